"""A device must agree with the CPU bit for bit before it is used; here a device is simulated."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from conevo.controllers.registry import controller
from conevo.errors import EnvironmentFailure
from conevo.worlds import agreement
from conevo.worlds.agreement import difference, refuse_other_bits
from conevo.worlds.protocol import Outcome
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from conevo.worlds.simulators import simulator

LIGHT = f"{Path(__file__).resolve().parents[2] / 'examples' / 'light.py'}:dark-1"
TASK = world("rover/complex-1", n_robots=4, iterations=50)


@pytest.fixture(autouse=True)
def asked(monkeypatch):
    """Clear previous comparisons, and return the iterations of every evaluation."""
    monkeypatch.setattr(agreement, "_agreed", set())
    seen, evaluate = [], Rollout.evaluate

    def noted(self, *arguments, **named):
        seen.append(named.get("iterations"))
        return evaluate(self, *arguments, **named)

    monkeypatch.setattr(Rollout, "evaluate", noted)
    return seen


def test_blocks_of_lanes_agree_with_the_cpu_and_are_compared_once(cpu_blocks, asked):
    task = world(LIGHT, iterations=50)
    with cpu_blocks():
        block = Rollout(task, n_threads=1, lanes=32)
        refuse_other_bits(block, "cuda:0")
        assert asked == [20, 20]
        other = world(LIGHT, n_robots=4)
        refuse_other_bits(Rollout(other, n_threads=1, lanes=32), "cuda:0")
        assert asked == [20, 20]
        refuse_other_bits(block, "cuda:1")
        refuse_other_bits(Rollout(task, controller("gru", world=task), 1), "cuda:1")
    assert asked == [20] * 6


def wrong(task):
    """Return a rollout that claims to play a task, but plays by other rules."""
    played = Rollout(world("rover/complex-1", n_robots=4, iterations=50, move_range=0.005), None, 1)
    played.world = task
    return played


def test_a_kernel_with_other_results_is_refused_each_time(asked):
    for _ in range(2):
        with pytest.raises(
            EnvironmentFailure,
            match=r"^device 'cuda:0' gives other results than the CPU in rover-v2: \w+ of team \d "
            r"is \S+, on the CPU \S+; play on the CPU \(--device cpu\), and install the newest",
        ):
            refuse_other_bits(wrong(TASK), "cuda:0")
    assert asked == [20] * 4


def test_every_rollout_on_a_device_has_been_compared(two_cards, asked, monkeypatch):
    simulator(TASK, controller(world=TASK), 1)
    assert asked == []
    simulator(TASK, controller(world=TASK), 1, "cuda:1")
    assert asked == [20, 20]
    monkeypatch.setattr("conevo.worlds.rollout.Rollout", lambda *_: wrong(TASK))
    with pytest.raises(EnvironmentFailure, match="device 'cuda' gives other results than the CPU"):
        simulator(TASK, controller(world=TASK), 1, "cuda")


def test_short_epochs_are_played_to_their_end():
    genes, teams = agreement.random_teams_of(Rollout(TASK).genome, 4, 2)
    short = world("rover/complex-1", n_robots=4, iterations=20)
    scenarios = TASK.scenarios([1])
    part = Rollout(TASK, n_threads=1).evaluate(genes, teams, scenarios, iterations=20)
    whole = Rollout(short, n_threads=1).evaluate(genes, teams, short.scenarios([1]), iterations=99)
    assert difference(part, whole) == ""
    assert difference(Rollout(TASK).evaluate(genes, teams, scenarios), part) != ""


def test_a_difference_in_any_bit_is_named():
    one = Outcome(
        fitness=np.array([[[0.0, 1.5]], [[2.5, np.nan]]]),
        counts=np.zeros((2, 1, 2, 3), np.int32),
        switches=np.zeros((2, 1, 2), np.int32),
        performance={"value": np.array([[1.0], [np.nan]], np.float32)},
    )
    assert difference(one, one) == ""
    other = one.fitness.copy()
    other[1, 0, 1] = -np.nan
    assert difference(one, replace(one, fitness=other)) == ""
    other[0, 0, 0] = -0.0
    message = "fitness of team 0 is -0.0, on the CPU 0.0"
    assert difference(one, replace(one, fitness=other)) == message
    near = {"value": np.array([[1.0], [3.0]], np.float32)}
    assert difference(one, replace(one, performance=near)) == (
        "value of team 1 is 3.0, on the CPU nan"
    )
    counts = one.counts.copy()
    counts[1, 0, 1, 2] = 7
    assert difference(one, replace(one, counts=counts)) == "counts of team 1 is 7, on the CPU 0"
