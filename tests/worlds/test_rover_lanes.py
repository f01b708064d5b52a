"""The multi-rover world: lanes and cached values do not change a bit."""

import numpy as np
import pytest

from conevo.rng import fold
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from conevo.worlds.walk import Walk
from worlds.lanes import lanes_in
from worlds.test_rover import crowd, random_team

pytestmark = pytest.mark.slow  # the contract of worlds has one number of lanes for each
ONE_ROCK = {"rocks_per_activation": 1, "fitness": "activation"}


def meeting(n_robots, iterations, **options):
    """Return a world, and a team of networks and heuristic rovers that meet and detect rocks."""
    a_world = world("rover/complex-5", n_robots=n_robots, iterations=iterations, **options)
    genes, slots = random_team(a_world, 6)
    robots = np.arange(n_robots)
    heuristic = np.where(robots < 5, -1, robots % 4).astype(np.int32)
    scenarios = crowd(a_world.scenarios([fold(6, "meet")]), n_robots, 6, side=0.2)
    return a_world, (genes, slots, scenarios, heuristic)


@pytest.fixture(scope="module")
def epoch():
    return meeting(20, 40)


@pytest.fixture(scope="module")
def serial(epoch):
    a_world, played = epoch
    return Rollout(a_world, n_threads=1).record(*played)


@pytest.mark.parametrize("lanes", lanes_in(96, 256))
def test_any_number_of_lanes_agrees_bit_for_bit(epoch, serial, cpu_blocks, lanes):
    a_world, played = epoch
    with cpu_blocks():
        seen = Rollout(a_world, n_threads=1, lanes=lanes).record(*played)
    assert seen.keys() == serial.keys()
    for name, values in serial.items():
        assert seen[name].tobytes() == values.tobytes(), name
    assert (serial["fitness"][-1] > 0).sum() > 5


def test_lanes_agree_on_the_one_rock_of_an_activation(cpu_blocks):
    a_world, played = meeting(20, 40, **ONE_ROCK)
    serial = Rollout(a_world, n_threads=1).record(*played)
    with cpu_blocks():
        seen = Rollout(a_world, n_threads=1, lanes=32).record(*played)
    for name, values in serial.items():
        assert seen[name].tobytes() == values.tobytes(), name
    assert (serial["fitness"][-1] > 0).sum() > 5


@pytest.mark.parametrize("options", [{}, ONE_ROCK], ids=["all in range", "one rock"])
def test_cached_values_change_nothing(options):
    """Rovers that compute everything again in each iteration agree bit for bit."""
    a_world, (genes, slots, scenarios, heuristic) = meeting(12, 60, **options)
    kept, fresh = (Walk(a_world, genes, slots[None], scenarios, heuristic[None]) for _ in range(2))
    others = (2**12 - 1) ^ (1 << np.arange(12, dtype=np.uint64))
    for step, t in kept.epoch(a_world.params.iterations):
        arrays = fresh.arrays()
        if step == "sense":
            for name in ("looked", "barren", "covered_range"):
                arrays[name][:] = 0
            arrays["changed"][:] = 2**12 - 1
            arrays["sees_rovers"][:] = 1
        elif step == "act":
            arrays["crowd"][:] = arrays["company"][:] = others
        kept.step(step, kept.natural, t)
        fresh.step(step, fresh.natural, t)
        for name in ("inputs", "x", "y", "action", "energy", "covered", "value", "fitness"):
            assert arrays[name].tobytes() == kept.arrays()[name].tobytes(), (name, step, t)
    assert (kept.arrays()["detected"] < 60).sum() > 5
