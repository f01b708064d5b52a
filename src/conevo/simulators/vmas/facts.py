"""The facts about a VMAS scenario, found by making it and trying a few steps."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from vmas.simulator.environment import Environment

from conevo.errors import ConevoError, UsageError, in_a_line
from conevo.rng import stream
from conevo.simulators.actions import Continuous
from conevo.simulators.tasks import TaskFacts, versions
from conevo.simulators.vmas.draws import SharedDraw
from conevo.simulators.vmas.epochs import WIDTH, Batch, flattened, made, policy_of
from conevo.simulators.vmas.things import drawn_of
from conevo.worlds.measures import Measure

__all__ = ["VmasFacts", "facts_of"]

TRIED = 20  # steps
# Directions of the axes of robots, by the name of VMAS' class of their motion.
DIRECTIONS = {
    "Holonomic": (("right", "left"), ("up", "down")),
    "HolonomicWithRotation": (("right", "left"), ("up", "down"), ("turn left", "turn right")),
    "Forward": (("forward", "backward"),),
    "Rotation": (("turn left", "turn right"),),
    "DiffDrive": (("forward", "backward"), ("turn left", "turn right")),
    "KinematicBicycle": (("forward", "backward"), ("turn left", "turn right")),
}


@dataclass(frozen=True, eq=False)
class VmasFacts(TaskFacts):
    """The facts about a scenario.

    Attributes:
        is_shared: whether it draws numbers for all environments of a batch together, so that those
            of a batch must play the same scenario.
    """

    is_shared: bool = False


@functools.lru_cache(maxsize=32)
def facts_of(task: str, options: str) -> VmasFacts:
    """Return the facts about a scenario with options.

    Raises:
        UsageError: VMAS cannot make it with these options, or it cannot be played.
    """
    env = made(task, options, WIDTH)
    if not env.agents:
        raise UsageError(f"vmas:{task} has no robots to control with options {options!r}")
    sizes = [flattened(one, WIDTH).shape[1] for one in _first(env)]
    if not max(sizes):
        raise UsageError(f"the robots of vmas:{task} observe nothing")
    try:
        infos, is_shared = _tried(env, [1, 2], max(sizes)), False
    except SharedDraw:
        infos, is_shared = _tried(env, [1], max(sizes)), True
    names = dict.fromkeys(name for info in infos for name in info)
    return VmasFacts(
        versions=versions("vmas", "torch"),
        n_robots=len(env.agents),
        n_inputs=max(sizes),
        actions=_actions(env),
        measures=tuple(Measure(name) for name in names),
        heuristics=("scenario",) if _has_policy(env, max(sizes)) else (),
        drawn=drawn_of(env),
        is_shared=is_shared,
    )


def _first(env: Environment) -> list[Any]:
    """Return what robots observe first."""
    found: list[Any] = env.get_from_scenario(
        get_observations=True, get_rewards=False, get_infos=False, get_dones=False
    )[0]
    return found


def _tried(env: Environment, keys: list[int], n_inputs: int) -> list[dict[str, torch.Tensor]]:
    """Play some steps with random actions and return what VMAS reports of each robot.

    Raises:
        SharedDraw: the scenario draws numbers for all environments, and keys differ.
        UsageError: it cannot be played.
    """
    batch = Batch(env, np.resize(np.array(keys, np.uint64), env.num_envs), n_inputs)
    actions, rng = _actions(env), stream(0, "tries of a scenario")
    try:
        env.seed(batch.seed)
        before = list(Environment.vmas_random_state)
        batch.begin()
        for _ in range(TRIED):
            shape = (env.num_envs, *actions.low.shape)
            batch.step(actions.drawn(rng.random(shape, np.float32)))
    except ConevoError:
        raise
    except Exception as error:
        raise UsageError(f"a scenario of VMAS cannot be played: {in_a_line(error)}") from error
    if len(keys) > 1 and not _are_same(before, batch.used):
        raise SharedDraw("the task draws numbers that have no address")
    return [
        {name: one for name, one in info.items() if _is_measure(one, env.num_envs)}
        for info in batch.infos
    ]


def _has_policy(env: Environment, n_inputs: int) -> bool:
    """Return whether VMAS has a controller of the scenario that works here."""
    if policy_of(env) is None:
        return False
    batch = Batch(env, np.zeros(env.num_envs, np.uint64), n_inputs)
    try:
        return bool(np.isfinite(batch.heuristic(batch.begin())).all())
    except Exception:  # it needs a package that VMAS does not install
        return False


def _are_same(before: list[Any], after: list[Any]) -> bool:
    """Return whether two states of random numbers, of torch, numpy and Python, are the same."""
    (torch_before, numpy_before, other_before), (torch_after, numpy_after, other_after) = (
        before,
        after,
    )
    return (
        torch.equal(torch_before, torch_after)
        and np.array_equal(numpy_before[1], numpy_after[1])
        and numpy_before[2:] == numpy_after[2:]
        and other_before == other_after
    )


def _is_measure(value: Any, n: int) -> bool:
    """Return whether a report has one number for each environment."""
    return isinstance(value, torch.Tensor) and value.numel() == n and not value.is_complex()


def _actions(env: Environment) -> Continuous:
    """Return the actions of robots: forces, wheels or messages, as the scenario has it."""
    spaces = [env.get_agent_action_space(agent) for agent in env.agents]
    widest = max(space.shape[0] for space in spaces)
    low, high = np.zeros((2, len(spaces), widest), np.float32)
    for i, space in enumerate(spaces):
        low[i, : space.shape[0]], high[i, : space.shape[0]] = space.low, space.high
    moved = min(int(agent.action_size) for agent in env.agents)
    kinds = {type(agent.dynamics).__name__ for agent in env.agents}
    named = DIRECTIONS.get(kinds.pop(), ()) if len(kinds) == 1 else ()
    others = tuple((f"axis {k} up", f"axis {k} down") for k in range(len(named), moved))
    directions = (*named, *others)[:moved]
    outputs = (
        *(f"{positive} or {negative}" for positive, negative in directions),
        *(f"action {k}" for k in range(moved, widest)),
    )
    return Continuous(low, high, outputs, directions)
