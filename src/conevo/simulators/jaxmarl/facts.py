"""The facts about a JaxMARL task, found by making it."""

from __future__ import annotations

import functools
import inspect
import math
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError, in_a_line, unknown_name
from conevo.reading import parse_toml
from conevo.simulators.jaxmarl.arithmetic import started
from conevo.simulators.jaxmarl.things import PARTICLES, look_of
from conevo.simulators.particles import drawn_of
from conevo.simulators.teams import Agent, TeamFacts, actions_of, team_of

__all__ = ["JaxMarlFacts", "facts_of", "made"]

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class JaxMarlFacts(TeamFacts):
    """The facts about a task.

    Attributes:
        has_places: whether its state has the positions of agents and landmarks.
    """

    has_places: bool = False


@functools.lru_cache(maxsize=32)
def facts_of(task: str, options: str, prefixes: str) -> JaxMarlFacts:
    """Return the facts about a task with options, and a team of agents with some prefixes.

    Raises:
        UsageError: the task cannot be made with these options, or cannot be played.
    """
    env = made(task, options)
    if not env.agents:
        raise UsageError(f"jaxmarl:{task} has no agents with options {options!r}")
    try:
        observed, state = jax.eval_shape(env.reset, np.zeros(2, np.uint32))
        agents = tuple(
            Agent(name, math.prod(observed[name].shape), _space(task, env, name))
            for name in env.agents
        )
    except UsageError:
        raise
    except Exception as error:
        raise UsageError(f"jaxmarl:{task} cannot be played: {in_a_line(error)}") from error
    team = team_of([agent.name for agent in agents], prefixes)
    robots = [agents[k] for k in team]
    if not max(robot.n_inputs for robot in robots):
        raise UsageError(f"the robots of jaxmarl:{task} observe nothing")
    look = look_of(env, state)
    return JaxMarlFacts(
        versions=started(),
        n_robots=len(robots),
        n_inputs=max(robot.n_inputs for robot in robots),
        actions=actions_of(robots, moves=task.startswith(PARTICLES)),
        drawn=None if look is None else drawn_of(look, team),
        agents=agents,
        team=team,
        has_places=look is not None,
    )


@functools.lru_cache(maxsize=32)
def made(task: str, options: str) -> Any:
    """Return a task's environment.

    Raises:
        UsageError: an option that the task does not have, or refuses.
    """
    started()
    import jaxmarl  # not before: it makes arrays, which starts jax

    given = parse_toml(f"options = {{{options}}}", "options")["options"]
    try:
        with jax.default_device(jax.devices("cpu")[0]):
            env = jaxmarl.make(task, **given)
    except Exception as error:
        raise UsageError(
            f"jaxmarl:{task} cannot be made with options {options!r}: {in_a_line(error)}"
        ) from error
    for key in given:
        if key not in (known := _keywords(type(env))):
            raise unknown_name("option", key, known, f"of jaxmarl:{task}")
    return env


def _keywords(kind: type) -> set[str]:
    """Return the keyword arguments of a class of environments, and of those it is built upon."""
    of_all = (inspect.signature(one).parameters for one in kind.__mro__[:-1])
    names = {name for parameters in of_all for name in parameters}
    return names - {"self", "args", "kwargs", "env_kwargs"}


def _space(task: str, env: Any, name: str) -> int | tuple[Floats, Floats]:
    """Return how many actions an agent has, or the ends of its axes.

    Raises:
        UsageError: its actions are something else.
    """
    try:
        space = env.action_space(name)
    except TypeError:  # some tasks have one space for all agents
        space = env.action_space()
    if hasattr(space, "n"):
        return int(space.n)
    if hasattr(space, "low") and len(space.shape) == 1:
        low, high = (np.broadcast_to(end, space.shape) for end in (space.low, space.high))
        if np.isfinite(low).all() and np.isfinite(high).all():
            return np.array(low, np.float32), np.array(high, np.float32)
    raise UsageError(
        f"{name} of jaxmarl:{task} has actions {type(space).__name__}, which a controller cannot "
        "choose: they must have numbers, or be axes with ends"
    )
