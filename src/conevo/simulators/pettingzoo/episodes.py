"""Episodes of a PettingZoo task, in the worker process that plays them.

Environments are used again. So an episode must depend on its seed and actions alone, not on earlier
ones or on random numbers of the process; a task of which this is not true is refused.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError, in_a_line, shown, unknown_name
from conevo.reading import parse_toml
from conevo.simulators.particles import TaskLook
from conevo.simulators.pettingzoo.things import look_of, places_of

__all__ = ["Found", "Task", "begin", "find", "places", "step"]

Floats = npt.NDArray[np.float32]
Seen = tuple[Floats, Floats, npt.NDArray[np.bool_]]
Space = int | tuple[Floats, Floats]  # number of actions, or ends of axes
Task = tuple[str, str]  # the module with its environment, and keyword arguments as a TOML table
TRIED = 20  # steps
MOST_INPUTS = 10_000  # Choice: more are images, which a genotype cannot weigh one by one


@dataclass(frozen=True)
class Found:
    """The facts about a task.

    Attributes:
        agents: name, length of observation and space of actions of each.
        look: of its things, None if positions are unknown.
    """

    agents: tuple[tuple[str, int, Space], ...]
    look: TaskLook | None


class Episode:
    """One environment, and the agents that are left in it.

    Args:
        task: the task.
    """

    def __init__(self, task: Task) -> None:
        from gymnasium.spaces import flatdim

        self._task = f"pettingzoo:{task[0]}"
        self.env = made(*task)
        self.names: list[str] = list(self.env.possible_agents)
        self._spaces = [self.env.action_space(name) for name in self.names]
        self._observed = [self.env.observation_space(name) for name in self.names]
        self.sizes = [int(flatdim(space)) for space in self._observed]

    def begin(self, seed: int) -> Floats:
        """Start again, and return what agents observe [agents, S], filled up with 0.

        Raises:
            UsageError: an agent lacks its observation, or has another than its space has.
        """
        return self._seen(self.env.reset(seed=seed)[0], set(self.env.agents))

    def step(self, actions: Floats) -> Seen:
        """Execute the actions [agents, A] of the agents that are left.

        Returns:
            Observations [agents, S], rewards [agents], and which agents have gone [agents].

        Raises:
            UsageError: an agent that goes on lacks its observation or its reward, or observes other
                things than its space has.
        """
        alive = set(self.env.agents)
        given = {
            name: _action(space, action)
            for name, space, action in zip(self.names, self._spaces, actions, strict=True)
            if name in alive
        }
        observed, rewards, ended, cut, _ = self.env.step(given)
        alive = {name for name in self.env.agents if not (ended.get(name) or cut.get(name))}
        for name in alive & given.keys() - rewards.keys():
            raise UsageError(f"{self._task} gives no reward to {name}")
        found = np.array([rewards.get(name, 0.0) for name in self.names], np.float32)
        gone = np.array([name not in alive for name in self.names])
        return self._seen(observed, alive), found, gone

    def _seen(self, observed: dict[str, Any], alive: set[str]) -> Floats:
        whole = np.zeros((len(self.names), max(self.sizes)), np.float32)
        of_agents = zip(whole, self.names, self._observed, self.sizes, strict=True)
        for row, name, space, size in of_agents:
            if name in observed:
                flat = _flat(space, observed[name])
                if len(flat) != size or flat.dtype.kind not in "biuf":
                    is_given = f"{len(flat)} values of type {flat.dtype}"
                    raise UsageError(
                        f"{self._task} gives {name} an observation of {is_given}, where its "
                        f"observation_space has {size} numbers"
                    )
                row[:size] = flat
            elif name in alive:
                raise UsageError(f"{self._task} gives no observation to {name}")
        return whole


@functools.cache
def _factory(name: str) -> tuple[Callable[..., Any], tuple[str, ...]]:
    """Return the function that makes environments of a task, and the names of its options.

    Raises:
        UsageError: the module cannot be imported, or has no environment.
    """
    try:
        module = import_module(name)
    except Exception as error:
        raise UsageError(f"pettingzoo:{name} cannot be imported: {in_a_line(error)}") from error
    make = getattr(module, "parallel_env", None) or getattr(module, "env", None)
    if not callable(make):
        raise UsageError(f"pettingzoo:{name} has no function parallel_env, nor env")
    own = inspect.signature(getattr(module, "raw_env", make)).parameters.values()
    is_open = any(one.kind is inspect.Parameter.VAR_KEYWORD for one in own)
    return make, () if is_open else tuple(one.name for one in own)


def made(name: str, options: str) -> Any:
    """Return an environment of a task, as a parallel one.

    Raises:
        UsageError: an option that the task does not have, or refuses; agents that take turns.
    """
    make, known = _factory(name)
    given = parse_toml(f"options = {{{options}}}", "options")["options"]
    for key in given:
        if known and key not in known:
            raise unknown_name("option", key, known, f"of pettingzoo:{name}")
    try:
        env = make(**given)
    except Exception as error:
        raise UsageError(
            f"pettingzoo:{name} cannot be made with options {options!r}: {in_a_line(error)}"
        ) from error
    if hasattr(env, "agent_iter"):
        from pettingzoo.utils.conversions import aec_to_parallel

        if not env.metadata.get("is_parallelizable", False):
            raise UsageError(
                f"pettingzoo:{name} cannot be played: its agents must act at the same time, or "
                "each once in a cycle"
            )
        env = aec_to_parallel(env)
    agents = list(getattr(env, "possible_agents", ()))
    if not agents or not all(isinstance(one, str) for one in agents):
        raise UsageError(
            f"pettingzoo:{name} cannot be played: possible_agents must be names, "
            f"not {shown(agents)}"
        )
    if len(set(agents)) < len(agents):
        raise UsageError(f"pettingzoo:{name} cannot be played: two agents have the same name")
    return env


def find(name: str, options: str) -> Found:
    """Return the facts about a task, found by trying it.

    Raises:
        UsageError: it cannot be made or played, or gives other results when it is played again.
    """
    refuse = f"pettingzoo:{name} cannot be played: "
    first, second = Episode((name, options)), Episode((name, options))
    for agent, size in zip(first.names, first.sizes, strict=True):
        if size > MOST_INPUTS:
            many = f"{agent} observes {size} numbers, at most {MOST_INPUTS} are allowed"
            raise UsageError(refuse + many)
    spaces = [_space(refuse + agent, first.env.action_space(agent)) for agent in first.names]
    turns = [(first, 1), (second, 2), (second, 1), (first, 2)]
    try:
        one, two, one_again, two_again = (_tried(*turn, spaces) for turn in turns)
    except UsageError:
        raise
    except Exception as error:
        raise UsageError(refuse + in_a_line(error)) from error
    if (one, two) != (one_again, two_again):
        raise UsageError(f"{refuse}after reset(seed=1) it does not do the same again")
    return Found(tuple(zip(first.names, first.sizes, spaces, strict=True)), look_of(first.env))


def _tried(episode: Episode, seed: int, spaces: list[Space]) -> list[bytes]:
    """Return what some steps with mixed actions give."""
    wide = max(1 if isinstance(space, int) else len(space[0]) for space in spaces)
    found = [episode.begin(seed).tobytes()]
    for t in range(TRIED):
        if not episode.env.agents:
            break
        actions = np.zeros((len(spaces), wide), np.float32)
        for k, (row, space) in enumerate(zip(actions, spaces, strict=True)):
            mixed = seed + 5 * k + 3 * t
            if isinstance(space, int):
                row[0] = mixed % space
            else:
                low, high = space
                row[: len(low)] = low + (high - low) * np.float32(mixed % 7 / 7)
        found += [part.tobytes() for part in episode.step(actions)]
    return found


_slots: dict[Task, list[Episode]] = {}
_playing: list[Episode] = []


def begin(task: Task, seeds: list[int]) -> Floats:
    """Start an episode for each seed, and return what agents observe [B, agents, S]."""
    slots = _slots.setdefault(task, [])
    slots += [Episode(task) for _ in range(len(seeds) - len(slots))]
    _playing[:] = slots[: len(seeds)]
    return np.stack([one.begin(seed) for one, seed in zip(_playing, seeds, strict=True)])


def step(actions: Floats, playing: npt.NDArray[np.bool_]) -> Seen:
    """Execute actions in the episodes that have not ended.

    Args:
        actions: of all agents [B, agents, A]; an action by number is the first element.
        playing: which episodes go on [B].

    Returns:
        Observations [B, agents, S], rewards [B, agents], and which agents have gone [B, agents].
    """
    n = actions.shape[1]
    observed = np.zeros((len(actions), n, max(_playing[0].sizes)), np.float32)
    rewards, gone = np.zeros((len(actions), n), np.float32), np.ones((len(actions), n), np.bool_)
    for k in np.flatnonzero(playing):
        observed[k], rewards[k], gone[k] = _playing[k].step(actions[k])
    return observed, rewards, gone


def places() -> Floats:
    """Return the positions of agents and things in the first episode; nothing if unknown."""
    return places_of(_playing[0].env)


def _space(agent: str, space: Any) -> Space:
    """Return an agent's space of actions.

    Raises:
        UsageError: it is neither discrete nor a box with ends.
    """
    from gymnasium.spaces import Box, Discrete

    if isinstance(space, Discrete):
        return int(space.n)
    if isinstance(space, Box) and space.is_bounded():
        low, high = (np.asarray(end, np.float32).ravel() for end in (space.low, space.high))
        if low.size:
            return low, high
    words = " ".join(str(space).split())
    raise UsageError(f"{agent} acts in {words:.80}, not in a Discrete, or a Box with ends")


def _action(space: Any, action: Floats) -> Any:
    """Return an action of a space, given its number, or its axes."""
    if hasattr(space, "n"):
        return int(space.start) + int(action[0])
    axes = action[: int(np.prod(space.shape))].reshape(space.shape)
    return np.clip(axes, space.low, space.high).astype(space.dtype)


def _flat(space: Any, observed: Any) -> Floats:
    """Return an observation as numbers in a row."""
    if isinstance(observed, np.ndarray):
        return observed.ravel()
    from gymnasium.spaces import flatten

    return np.asarray(flatten(space, observed), np.float32).ravel()
