"""Which arrays lie in shared memory, and which parts a launch fetches and stores there."""

from pathlib import Path

import numpy as np
import pytest
import warp as wp

from conevo.kernels.views import near_arrays
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout

LIGHT = f"{Path(__file__).resolve().parents[2] / 'examples' / 'light.py'}:dark-1"


@wp.struct
class Small:
    """Arrays of a team."""

    x: wp.array[float]
    kind: wp.array[wp.uint8]
    grid: wp.array[wp.uint64]


@wp.struct
class Other:
    """Arrays of its controllers."""

    hidden: wp.array2d[float]


SHAPES = {Small: {"x": (4,), "kind": (3,), "grid": (10, 2)}, Other: {"hidden": (4, 8)}}


@pytest.mark.parametrize(
    ("limit", "small", "other"),
    [
        (0, (), ()),
        (31, (("kind", 3),), ()),  # 16 bytes, since every array starts at a multiple of 16
        (32, (("kind", 3), ("x", 4)), ()),
        (159, (("kind", 3), ("x", 4)), ()),
        (160, (("kind", 3), ("x", 4)), (("hidden", 32),)),
        (320, (("grid", 20), ("kind", 3), ("x", 4)), (("hidden", 32),)),
    ],
)
def test_the_smallest_arrays_lie_near_as_many_as_fit(limit, small, other):
    assert near_arrays(SHAPES, limit) == {Small: small, Other: other}


@pytest.mark.slow
@pytest.mark.parametrize(("path", "limit"), [(LIGHT, 600), ("rover/complex-1", 24 * 1024)])
def test_near_arrays_compile_for_cuda_and_change_no_result(path, limit, tmp_path):
    from contracts.test_worlds import assert_same_bits, random_teams

    task = world(path, n_robots=3, iterations=12)
    genes, teams = random_teams(task, 2)
    scenarios = task.scenarios([5])
    plain, near = Rollout(task, n_threads=1), Rollout(task, n_threads=1)
    state, memory = near._simulation.state, near._mind.memory
    chosen = near_arrays({state: near._shapes, memory: near._mind_shapes[memory]}, limit)
    assert all(chosen.values())
    n_arrays = len(near._shapes) + len(near._mind_shapes[memory])
    assert (sum(map(len, chosen.values())) == n_arrays) == (path != LIGHT)  # one lies far there
    kernel = near.cuda_form(64, shared_bytes=limit)
    near._kernel = kernel
    assert_same_bits(*(one.evaluate(genes, teams, scenarios) for one in (plain, near)))
    seen = [one.record(genes, teams[0], scenarios) for one in (plain, near)]
    for name, values in seen[0].items():
        assert np.array_equal(values, seen[1][name]), name
    (file,) = wp.compile_aot_module(kernel.module, arch=90, module_dir=tmp_path, use_ptx=True)
    text = file.read_text()
    assert text.count(".shared .align 16") == sum(map(len, chosen.values()))
    assert ".maxntid 64" in text
