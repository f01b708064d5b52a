"""Declarations of worlds for programs outside are true; actions of three modes become outputs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.controllers.registry import controller
from conevo.errors import UsageError
from conevo.worlds.checks import random_teams
from conevo.worlds.contract import faults_of_names
from conevo.worlds.spaces import (
    MODES,
    ActionMode,
    discrete_actions_of,
    group_of,
    input_bounds_of,
    n_signed,
    output_bounds_of,
)
from conevo.worlds.stepper import Stepper

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
LIGHT = f"{EXAMPLES}/light.py:dark-1"
WORLDS = ("rover/complex-5", "pursuit/team-3", "prey/shaping-6", "gacc/complex-9")
PREY = WORLDS[2:3]  # a kernel with noise that no other test needs


def begun(world: Any, n: int = 1) -> Stepper:
    stepper = Stepper(world, n, 4)
    stepper.reset()
    return stepper


@pytest.mark.parametrize(
    ("path", "noise"),
    [
        *((path, 0.0) for path in WORLDS),
        *((path, 0.5) for path in WORLDS if path not in PREY),
        *(pytest.param(path, 0.5, marks=pytest.mark.exhaustive) for path in PREY),
    ],
)
def test_inputs_lie_within_their_bounds_and_reach_far(path: str, noise: float) -> None:
    others = {"action_noise": 1e-12, "failure": 1e-12} if noise else {}  # kernels of other tests
    world = conevo.world(path, iterations=120, sensor_noise=noise, **others)
    low, high = np.array(input_bounds_of(world)).T
    genes, teams = random_teams(world, 4)
    seen = np.concatenate(
        [
            conevo.Rollout(world).record(genes, team, world.scenarios([k]))["inputs"]
            for k, team in enumerate(teams)
        ]
    )
    assert (seen >= low).all()
    assert (seen <= high).all()
    if noise:  # of half a reading, in both directions
        assert (seen.min(axis=(0, 1)) < np.minimum(low + 0.55, 0.1)).all()
        assert (seen.max(axis=(0, 1)) > high - 0.55).all()
    assert n_signed(world) == (low < 0).sum()
    assert (low[: n_signed(world)] < 0).all()


@pytest.mark.parametrize("path", WORLDS)
def test_each_discrete_action_is_the_one_that_it_names(path: str) -> None:
    world = conevo.world(path)
    actions = ActionMode(world)
    for k, name in enumerate(actions.names):
        stepper = begun(world)
        x, y = stepper.read("x"), stepper.read("y")
        chosen = np.full((1, world.n_robots), k)
        stepper.outputs.assign(actions.outputs(chosen))
        stepper.step()
        done = {world.actions[a] for a in stepper.read("action").ravel()}
        assert done == {"move" if name.startswith("move ") else name}, name
        if name.startswith("move "):
            to_x, to_y = stepper.read("x") - x, stepper.read("y") - y
            has_moved = (to_x != 0) | (to_y != 0)
            assert has_moved.mean() > 0.5, name
            full = world.params.move_range / np.sqrt(2)
            for axis, step in (("x", to_x), ("y", to_y)):
                sign = ("+" + axis in name) - ("-" + axis in name)
                assert np.allclose(step[has_moved], sign * full, atol=1e-6), (name, axis)


def test_discrete_actions_are_those_of_the_worlds() -> None:
    steps = ["+x", "+x +y", "+y", "-x +y", "-x", "-x -y", "-y", "+x -y"]
    moves = [f"move {one}" for one in steps]
    names = {path: list(discrete_actions_of(conevo.world(path))) for path in WORLDS}
    assert names["pursuit/team-3"] == ["stop", "forward", "left", "right", "reverse"]
    assert names["rover/complex-5"] == ["low", "med", "hi", *moves]
    detect, grip = ([f"{what} {kind}" for kind in "ABC"] for what in ("detect", "grip"))
    assert names["gacc/complex-9"] == [*detect, *moves, *grip]
    assert [group_of(conevo.world(path)) for path in (*WORLDS, LIGHT)] == [
        "rover", "predator", "prey", "robot", "robot",
    ]  # fmt: skip


@pytest.mark.parametrize("path", ["pursuit/team-3", "prey/shaping-6"])
def test_a_continuous_action_is_the_command_of_the_wheels(path: str) -> None:
    world = conevo.world(path)
    actions, stepper = ActionMode(world, "continuous"), begun(world)
    assert (actions.low.tolist(), actions.high.tolist()) == ([-1, -1], [1, 1])
    for values in ([0.3, -0.7], [1.0, -1.0], [0.0, 0.999], [3.0, -3.0]):
        wheels = np.broadcast_to(np.array(values), (1, world.n_robots, 2))
        stepper.outputs.assign(actions.outputs(wheels))
        stepper.step()
        team = slice(0, world.n_robots)
        for k, name in enumerate(("left", "right")):
            seen = stepper.read(name)[0, team]
            free = stepper.read("collided")[0, team] == 0  # a prey that has collided stops
            assert np.allclose(seen[free], np.clip(values[k], -1, 1), atol=2e-6), (values, name)


@pytest.mark.parametrize("path", ["rover/complex-5", "gacc/complex-9"])
def test_a_continuous_action_is_a_step(path: str) -> None:
    world = conevo.world(path)
    actions, stepper = ActionMode(world, "continuous"), begun(world)
    at = [k for k, name in enumerate(world.outputs) if name.startswith("move")]
    assert np.allclose(actions.high[at], world.params.move_range / np.sqrt(2))
    given = np.where(np.isin(np.arange(len(world.outputs)), at), [0.0], actions.low)
    given[at] = 0.5 * actions.high[at[0]], -0.25 * actions.high[at[1]]
    x, y = stepper.read("x"), stepper.read("y")
    stepper.outputs.assign(actions.outputs(np.tile(given, (1, world.n_robots, 1))))
    stepper.step()
    to_x, to_y = stepper.read("x") - x, stepper.read("y") - y
    has_moved = to_x != 0
    assert has_moved.mean() > 0.5
    assert np.allclose(to_x[has_moved], given[at[0]], atol=1e-6)
    assert np.allclose(to_y[has_moved], given[at[1]], atol=1e-6)


@pytest.mark.parametrize("path", [*WORLDS, LIGHT])
def test_a_team_replayed_from_outside_gets_its_fitness_as_the_sum_of_rewards(path: str) -> None:
    """Its controllers are numpy's; growth of fitness is the reward, and all sums are exact."""
    world = conevo.world(path, iterations=200)
    mind = controller(world=world)
    genes, (team,) = random_teams(world, 1)
    outcome = conevo.Rollout(world).evaluate(genes, team[None], world.scenarios([8]))
    stepper, actions = Stepper(world, 1, [8]), ActionMode(world, "outputs")
    stepper.reset()
    memory = np.zeros((*team.shape, mind.n_memory), np.float32)
    before = stepper.fitness.numpy().astype(np.float64)
    rewards = np.zeros((1, world.n_robots))
    for _ in range(200):
        inputs = stepper.inputs.numpy()[0]
        outputs, memory = mind.forward(genes[team], team >= 0, memory, inputs, len(world.outputs))
        stepper.outputs.assign(actions.outputs(outputs[None]))
        stepper.step()
        now = stepper.fitness.numpy().astype(np.float64)
        rewards += now - before
        before = now
    assert rewards.astype(np.float32).tobytes() == outcome.fitness.tobytes()
    stepper.finish()
    ended = [values[0, 0] for values in outcome.performance.values()]
    assert stepper.performance.numpy()[0].tolist() == ended


def test_a_world_without_declarations_has_defaults() -> None:
    world = conevo.world(LIGHT)
    assert input_bounds_of(world) == ((-np.inf, np.inf),) * 2
    assert output_bounds_of(world) == ((0.0, 1.0),) * 4
    assert ActionMode(world, "outputs").names == world.outputs
    assert np.isinf(ActionMode(world, "outputs").high).all()
    with pytest.raises(UsageError, match="light-v1 declares no discrete actions: use the mode"):
        ActionMode(world)


def test_actions_that_do_not_fit_are_one_line() -> None:
    world = conevo.world("pursuit/team-3")
    with pytest.raises(UsageError, match=r"unknown mode of actions 'discreet'.*'discrete'"):
        ActionMode(world, "discreet")  # type: ignore[arg-type]
    for mode, given, words in (
        ("discrete", [[5]], "action 5: must be from 0 to 4 \\(stop, forward, left"),
        ("discrete", [-1], "action -1"),
        ("discrete", [0.5], "an action must be an integer from 0 to 4, not float64"),
        ("continuous", [[0.0]], "has 2 values, one for each output; got shape \\[1, 1\\]"),
        ("outputs", 3.0, "got shape \\[\\]"),
    ):
        with pytest.raises(UsageError, match=words):
            ActionMode(world, mode).outputs(given)  # type: ignore[arg-type]
    for mode in MODES:  # a bound of no side effect: any leading shape
        shape = (3, 4) if mode == "discrete" else (3, 4, 2)
        assert ActionMode(world, mode).outputs(np.ones(shape, int)).shape == (3, 4, 2)


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        ({"group": ""}, "group must be a word for a robot"),
        ({"input_bounds": ((0, 1),)}, "input_bounds must have (low, high) for each of 2 inputs"),
        ({"input_bounds": ((1, 0), (0, 1))}, "low below high"),
        ({"output_bounds": 3}, "output_bounds must have (low, high) for each of 4 outputs"),
        ({"discrete_actions": ["rest"]}, "discrete_actions must be a dict of names and outputs"),
        ({"discrete_actions": {"rest": (1,)}}, "discrete_actions['rest'] must be 4 finite numbers"),
        ({"discrete_actions": {"rest": (1, 0, 0, np.nan)}}, "must be 4 finite numbers"),
        ({"discrete_actions": {"rest": "wxyz"}}, "must be 4 finite numbers, not 'wxyz'"),
    ],
)
def test_a_wrong_declaration_is_one_line(declared: dict[str, Any], words: str) -> None:
    world = conevo.world(LIGHT)
    kind = type("Wrong", (type(world),), declared)
    assert list(faults_of_names(world)) == []
    (found,) = faults_of_names(kind(world.environment, replace(world.params)))
    assert words in found
