"""The closest robot in every octant, against plain Python."""

import math

import numpy as np
import pytest
import warp as wp

from conevo.kernels import engine
from conevo.kernels.sensing import closest_in_octants, is_marked, mark

engine.start()


@wp.kernel
def look(
    xs: wp.array[float],
    ys: wp.array[float],
    members: wp.array[int],
    x: float,
    y: float,
    reach: float,
    found: wp.array[int],
    marked: wp.array[int],
):
    robots = wp.uint64(0)
    for k in range(members.shape[0]):
        robots = mark(robots, members[k])
    for j in range(xs.shape[0]):
        marked[j] = int(is_marked(robots, j))
    closest = closest_in_octants(xs, ys, robots, x, y, reach * reach)
    for o in range(8):
        found[o] = closest[o]


def both(places, members, place, reach):
    """Return the closest robots as the kernel and as plain Python find them."""
    found, marked = wp.zeros(8, dtype=int), wp.zeros(len(places), dtype=int)
    arrays = [wp.array(places[:, k].astype(np.float32), dtype=float) for k in range(2)]
    chosen = wp.array(np.array(members, dtype=np.int32), dtype=int)
    wp.launch(look, 1, inputs=[*arrays, chosen, *place, reach, found, marked], device="cpu")
    assert [j for j, m in enumerate(marked.numpy()) if m] == sorted(set(members))
    expected = []
    for o in range(8):
        near = []
        for j in sorted(set(members)):
            dx, dy = places[j] - place
            angle = math.atan2(dy, dx) % (2 * math.pi)
            if math.hypot(dx, dy) < reach and int(angle // (math.pi / 4)) == o:
                near.append((math.hypot(dx, dy), j))
        expected.append(min(near)[1] if near else -1)
    return found.numpy().tolist(), expected


@pytest.mark.parametrize("seed", range(20))
def test_the_closest_of_a_set_in_every_octant(seed):
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, 1, (64, 2))
    members = rng.choice(64, size=int(rng.integers(1, 65)), replace=False).tolist()
    found, expected = both(places, members, rng.uniform(0, 1, 2), float(rng.uniform(0.05, 1)))
    assert found == expected


def test_nobody_is_found_out_of_reach_out_of_the_set_or_in_an_empty_octant():
    places = np.array([[0.6, 0.51], [0.55, 0.51], [0.9, 0.51], [0.5, 0.4]])
    found, expected = both(places, [0, 2, 3], np.array([0.5, 0.5]), 0.2)
    assert found == expected == [0, -1, -1, -1, -1, -1, 3, -1]
    assert both(places, [1], np.array([0.5, 0.5]), 0.2)[0] == [1] + [-1] * 7
    assert both(places, [2], np.array([0.5, 0.5]), 0.2)[0] == [-1] * 8
