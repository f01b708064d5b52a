"""Lanes that share the items of the pursuit worlds' phases agree with one lane bit for bit."""

import numpy as np
import pytest

from conevo.rng import fold
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from worlds.lanes import lanes_in
from worlds.situations import NAN, random_team

pytestmark = pytest.mark.slow  # the contract of worlds has one number of lanes for each
FULL = {"iterations": 25, "arena_cm": 60.0}  # so that all bodies meet others


def recorded(a_world, lanes, heuristic):
    """The record of an epoch in which some sensors are clamped."""
    genes, slots = random_team(a_world, 6)
    scenarios = a_world.scenarios([fold(6, "lanes")])
    scenarios.clamp[:] = np.where(np.arange(scenarios.clamp.size) % 7, NAN, 0.5).reshape(
        scenarios.clamp.shape
    )
    rollout = Rollout(a_world, n_threads=1, lanes=lanes)
    return rollout.record(genes, slots, scenarios, np.array(heuristic, np.int32))


@pytest.mark.parametrize("lanes", lanes_in(32, 128))
def test_lanes_share_predators(lanes, cpu_blocks):
    a_world = world("pursuit/team-10", n_obstacles=6, capture_window=3, **FULL)
    heuristic = [-1, -1, 0, -1, -1, -1]
    one = recorded(a_world, 1, heuristic)
    assert one["collided"].any()
    with cpu_blocks():
        many = recorded(a_world, lanes, heuristic)
    assert {name: values.tobytes() for name, values in one.items()} == {
        name: values.tobytes() for name, values in many.items()
    }


def test_lanes_share_prey(cpu_blocks):
    a_world = world("prey/shaping-6", least=6, **FULL)
    one = recorded(a_world, 1, [-1, 0])
    with cpu_blocks():
        many = recorded(a_world, 64, [-1, 0])
    for name, values in one.items():
        assert values.tobytes() == many[name].tobytes(), name
