"""The gathering world in blocks of any number of lanes: equal bit for bit in every iteration."""

import numpy as np
import pytest

from conevo.rng import fold
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from worlds.gathering import SMALL, crowded, random_team
from worlds.lanes import lanes_in

pytestmark = pytest.mark.slow  # the contract of worlds has one number of lanes for each
PARAMS = SMALL | {"wait": 4, "energy": 1.503, "robot_range": 0.1}


@pytest.fixture(scope="module")
def epoch():
    """A crowd of networks and heuristic robots that grip, build, let go and run out of energy."""
    a_world = world("gacc/complex-9", iterations=60, **PARAMS)
    heuristic = (np.arange(a_world.n_robots) % 11 - 1).astype(np.int32)
    scenarios = crowded(a_world.scenarios([fold(3, "lanes")]), 3)
    return a_world, (*random_team(a_world, 3), scenarios, heuristic)


@pytest.fixture(scope="module")
def serial(epoch):
    a_world, played = epoch
    return Rollout(a_world, n_threads=1).record(*played)


def test_the_epoch_has_the_events_that_lanes_share(serial):
    assert set(np.unique(serial["life"])) == set(range(7))
    assert (serial["energy"][-1] <= 0).any()
    assert (serial["situation"] == 4).any()
    assert (np.abs(serial["inputs"]).max(axis=(0, 1)) > 0).all()


@pytest.mark.parametrize("lanes", lanes_in(32, 96))
def test_any_number_of_lanes_agrees_bit_for_bit(epoch, serial, cpu_blocks, lanes):
    a_world, played = epoch
    with cpu_blocks():
        seen = Rollout(a_world, n_threads=1, lanes=lanes).record(*played)
    for name, values in serial.items():
        assert values.tobytes() == seen[name].tobytes(), name
