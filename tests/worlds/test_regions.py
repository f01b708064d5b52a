"""Types and starts with their own regions in gathering, and starts by robot in pursuit."""

import numpy as np
import pytest

import conevo
from conevo.errors import UsageError

KEYS = [7, 2**63 + 5, 19, 20, 21]


def third(x, y):
    """Return the third of the square, counted around its centre, in which a place lies."""
    dx, dy = x - 0.5, y - 0.5
    half = max(abs(dx), abs(dy))
    if dy == -half:
        way = dx + half
    elif dx == half:
        way = 2 * half + dy + half
    elif dy == half:
        way = 4 * half + half - dx
    else:
        way = 6 * half + half - dy
    return int(3 * way / (8 * half))


def objects(drawn):
    """Return type and region of every object, [E, K] each."""
    found = [
        [third(float(x), float(y)) for x, y in zip(xs, ys, strict=True)]
        for xs, ys in zip(drawn.object_x, drawn.object_y, strict=True)
    ]
    return drawn.object_type, np.array(found)


def test_a_share_of_each_type_lies_in_its_region():
    """Of n objects of a type the first round(s n) lie in its region; complex-9 has 15, 20 and 5."""
    counts = np.bincount(conevo.world("gacc/complex-9").plan.parts.ravel(), minlength=3)
    for segregation in (0.0, 0.4, 1.0):
        world = conevo.world("gacc/complex-9", segregation=segregation)
        types, found = objects(world.scenarios(KEYS))
        for kind, n in enumerate(counts):
            own = found[:, types[0] == kind] == kind
            bound = int(segregation * n + 0.5)
            assert own[:, :bound].all()
            if n - bound >= 4:
                assert 0.1 < own[:, bound:].mean() < 0.6  # the others: a third of them


def test_each_robot_starts_in_its_region_outside_the_home_area():
    world = conevo.world("gacc/complex-9", starts="by_robot", n_robots=11)
    drawn = world.scenarios(KEYS)
    for e in range(len(KEYS)):
        places = list(zip(map(float, drawn.start_x[e]), map(float, drawn.start_y[e]), strict=True))
        assert [third(x, y) for x, y in places] == [i % 3 for i in range(11)]
        assert all(max(abs(x - 0.5), abs(y - 0.5)) > 0.35 for x, y in places)
    alone = world.scenarios([KEYS[3]])
    assert alone.start_x[0].tolist() == drawn.start_x[3].tolist()  # whatever else is drawn


def test_other_draws_stay_the_same():
    plain = conevo.world("gacc/complex-4").scenarios(KEYS)
    apart = conevo.world("gacc/complex-4", segregation=1.0).scenarios(KEYS)
    by_robot = conevo.world("gacc/complex-4", starts="by_robot").scenarios(KEYS)
    assert np.array_equal(plain.start_x, apart.start_x)
    assert not np.array_equal(plain.object_x, apart.object_x)
    assert np.array_equal(plain.object_x, by_robot.object_x)
    assert not np.array_equal(plain.start_x, by_robot.start_x)
    assert np.array_equal(plain.left, apart.left)
    assert np.array_equal(plain.left, by_robot.left)


@pytest.mark.parametrize("team", ["team-1", "team-3", "team-10"])
def test_each_predator_starts_in_its_sector(team):
    """Of two predators one is below or on the right of the diagonal, the other on its left."""
    world = conevo.world(f"pursuit/{team}", starts="by_robot")
    drawn, n = world.scenarios(range(30)), world.n_robots
    for e in range(30):
        for i in range(n):
            x, y = (float(of[e, i]) / 100 for of in (drawn.x, drawn.y))
            dx, dy = x - 0.5, y - 0.5
            if n == 2:
                assert (dy < dx) == (i == 0)
            elif n == 4:  # below, right, above, left
                assert [-dy, dx, dy, -dx][i] == pytest.approx(max(abs(dx), abs(dy)))
    plain = conevo.world(f"pursuit/{team}").scenarios(range(30))
    assert not np.array_equal(plain.x, drawn.x)
    assert np.array_equal(plain.heading, drawn.heading)
    gaps = np.hypot(drawn.x[:, :1] - drawn.x[:, 1:], drawn.y[:, :1] - drawn.y[:, 1:])
    assert gaps.min() > 5.5  # bodies of 5.5 cm


def test_prey_start_anywhere_with_predators_in_their_sectors():
    drawn = conevo.world("pursuit/team-3", starts="by_robot").scenarios(range(200))
    below = drawn.y[:, 4] - 50 < -np.abs(drawn.x[:, 4] - 50)
    assert 0.15 < below.mean() < 0.35


def test_a_wrong_share_or_start_is_refused():
    with pytest.raises(UsageError, match=r"segregation = 1\.5"):
        conevo.world("gacc/complex-3", segregation=1.5)
    for world in ("gacc/complex-3", "pursuit/team-3"):
        with pytest.raises(UsageError, match="by_robot"):
            conevo.world(world, starts="by_robots")
