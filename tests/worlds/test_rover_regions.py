"""Types with their own regions and starts by robot, against one rock after another in Python."""

import numpy as np
import pytest

import conevo
from conevo.errors import UsageError
from conevo.rng import fold_all
from conevo.worlds.rover import canals, rocks
from oracles import splitmix

KEYS = [7, 2**63 + 5, 19]


def regions(layout):
    """Return the sites of a layout, and a function that returns the region of a place."""
    xy = canals.sites(canals.load(layout))
    middle = np.median(xy[:, 0])
    left, right = (np.median(xy[side, 1]) for side in (xy[:, 0] <= middle, xy[:, 0] > middle))

    def region(x, y):
        if x <= middle:
            return 2 if y > left else 0
        return 3 if y > right else 1

    return xy, region


def in_turn(key, environment, segregation):
    """Return the type of the rock at each occupied place: rocks anywhere, then in regions."""
    xy, region = regions(rocks.layout(environment))
    cell = (xy * np.float32(40)).astype(int)
    sites = [tuple(xy[k]) for k in np.lexsort((cell[:, 0], cell[:, 1]))]  # the order of grid cells
    counts = rocks.mix(environment)
    own = [int(segregation * n + 0.5) for n in counts[:4]] + [0]
    found = {}

    def place(kind, n, draw, allowed):
        free = [s for s in range(len(sites)) if sites[s] not in found and allowed(sites[s])]
        free.sort(key=lambda s: splitmix.bits(key, draw, s, 0))
        found.update((sites[s], kind) for s in free[:n])

    for kind in range(5):
        place(kind, counts[kind] - own[kind], 0, lambda xy: True)
    for kind in range(4):
        place(kind, own[kind], 1, lambda xy, kind=kind: region(*xy) == kind)
    return found


@pytest.mark.parametrize(
    ("environment", "segregation"),
    [("complex-5", 0.0), ("complex-5", 0.3), ("complex-1", 1.0), ("extended-2", 0.777),
     ("extended-5", 1.0), ("extended-10", 0.5), ("simple-2", 1.0)],
)  # fmt: skip
def test_rocks_lie_as_if_placed_one_after_another(environment, segregation):
    drawn = conevo.world(f"rover/{environment}", segregation=segregation).scenarios(KEYS)
    keys = fold_all(np.array(KEYS, np.uint64), "rover", "rocks")
    for e in (0, 2):
        places = zip(drawn.rock_x[e], drawn.rock_y[e], strict=True)
        seen = dict(zip(places, map(int, drawn.rock_type[e]), strict=True))
        assert seen == in_turn(int(keys[e]), environment, segregation)
        row, column = (drawn.rock_y[e] * 40).astype(int), (drawn.rock_x[e] * 40).astype(int)
        first = np.searchsorted(row * 40 + column, np.arange(1601))
        assert drawn.cell[e].tolist() == first.tolist()


def test_a_share_of_each_type_lies_in_its_region():
    """All at segregation 1; at s the share s, and a quarter of the others, which lie anywhere."""
    _, region = regions(5)
    for segregation in (0.0, 0.5, 1.0):
        drawn = conevo.world("rover/complex-5", segregation=segregation).scenarios(range(20))
        own = [
            region(x, y) == kind
            for x, y, kind in zip(
                drawn.rock_x.flat, drawn.rock_y.flat, drawn.rock_type.flat, strict=True
            )
        ]
        share = segregation + (1 - segregation) / 4
        assert np.mean(own) == pytest.approx(share, abs=0.01)
        counts = np.stack([np.bincount(row, minlength=5) for row in drawn.rock_type])
        assert (counts == rocks.mix("complex-5")).all()


@pytest.mark.parametrize("layout", range(1, 11))
def test_regions_have_equal_numbers_of_sites(layout):
    xy, region = regions(layout)
    counts = np.bincount([region(x, y) for x, y in xy], minlength=4)
    assert counts.min() > 1200  # of about 5500: enough for the 1000 of the largest type
    assert counts.max() < 1.1 * counts.min()  # a line of the raster goes to one side


def test_each_rover_starts_in_its_region():
    a_world = conevo.world("rover/complex-3", starts="by_robot", n_robots=11)
    drawn = a_world.scenarios(range(10))
    _, region = regions(3)
    mask = canals.load(3)
    for e in range(10):
        places = np.stack([drawn.start_x[e], drawn.start_y[e]], axis=1)
        assert [region(x, y) for x, y in places] == [i % 4 for i in range(11)]
        assert not mask[(places[:, 1] * 200).astype(int), (places[:, 0] * 200).astype(int)].any()
    alone = a_world.scenarios([4])
    assert alone.start_x[0].tolist() == drawn.start_x[4].tolist()  # whatever else is drawn


def test_other_draws_stay_the_same():
    plain = conevo.world("rover/complex-3").scenarios(KEYS)
    own = conevo.world("rover/complex-3", segregation=1.0).scenarios(KEYS)
    by_robot = conevo.world("rover/complex-3", starts="by_robot").scenarios(KEYS)
    assert np.array_equal(plain.start_x, own.start_x)
    assert np.array_equal(plain.rock_x, by_robot.rock_x)
    assert np.array_equal(plain.lander, own.lander)
    assert not np.array_equal(plain.rock_x, own.rock_x)
    assert not np.array_equal(plain.start_x, by_robot.start_x)


def test_a_wrong_share_or_start_is_refused():
    with pytest.raises(UsageError, match=r"segregation = 1\.5"):
        conevo.world("rover/complex-3", segregation=1.5)
    with pytest.raises(UsageError, match="by_robot"):
        conevo.world("rover/complex-3", starts="by_robots")
