"""Tasks whose agents are not all robots of the team: who is a robot, and what the others do.

The others act at random, or by a function in a file::

    def flee(agent, observation, uniforms):
        return np.where(observation[:, 8] > 0, 1, 2)

It gets the name of an agent, its observations [K, S] in K epochs, and random numbers in [0, 1)
[K, A], and returns its actions: [K] by number, or [K, A] of A axes. Each of them must depend on its
own row alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError, unknown_name
from conevo.parameters import parameters
from conevo.rng import fold_all, uniforms
from conevo.simulators.actions import Actions, Continuous, Discrete
from conevo.simulators.functions import OwnFunction, function_in, keep
from conevo.simulators.tasks import TaskFacts, TaskParams

__all__ = ["Agent", "Others", "TeamFacts", "TeamParams", "actions_of", "team_of"]

Floats = npt.NDArray[np.float32]
RANDOM = "random"
MOVES = ("stay", "left", "right", "down", "up")  # of the particle worlds (MPE), in their order


@dataclass(frozen=True, eq=False)
class Agent:
    """An agent of a task.

    Attributes:
        name: its name.
        n_inputs: length of its observation.
        space: of its actions: how many there are, or the lower and upper ends of axes, each [A].
    """

    name: str
    n_inputs: int
    space: int | tuple[Floats, Floats]


@dataclass(frozen=True, eq=False)
class TeamFacts(TaskFacts):
    """The facts about a task with a team and others.

    Attributes:
        agents: all of them.
        team: places of the robots among the agents.
    """

    agents: tuple[Agent, ...] = ()
    team: tuple[int, ...] = ()

    @cached_property
    def width(self) -> int:
        """W, numbers of an action of the agent that has most."""
        spaces = (agent.space for agent in self.agents)
        return max(1 if isinstance(space, int) else len(space[0]) for space in spaces)

    def of_all(self, actions: npt.NDArray[Any], others: dict[int, npt.NDArray[Any]]) -> Floats:
        """Return the actions of all agents [B, agents, W].

        Args:
            actions: of robots [B, R] or [B, R, A].
            others: of the other agents by their place, each [B] or [B, A].
        """
        found = np.zeros((len(actions), len(self.agents), self.width), np.float32)
        own = actions if actions.ndim == 3 else actions[:, :, None]
        found[:, list(self.team), : own.shape[2]] = own
        for place, action in others.items():
            wide = action if action.ndim == 2 else action[:, None]
            found[:, place, : wide.shape[1]] = wide
        return found


@parameters("world")
class TeamParams(TaskParams):
    """Settings of tasks in which only some of the agents are robots of the team."""

    team: str = ""
    """first letters of the names of agents that are robots, "adversary", or several of them,
    "adversary, leadadversary"; all agents if empty."""
    others: str = RANDOM
    """what the other agents do: "random" actions, or FILE.py:FUNCTION."""
    others_digest: str = ""
    """digest of a file for the others; a run fills it in and checks it."""

    def __post_init__(self) -> None:
        TaskParams.__post_init__(self)
        keep(self, "others", RANDOM, policy_in)

    @cached_property
    def policy(self) -> OwnPolicy | None:
        """The user's function for the others, None if they act at random."""
        return None if self.others == RANDOM else policy_in(self.others, self.others_digest)


class OwnPolicy(OwnFunction):
    """A user's function that returns actions."""

    def of(self, agent: Agent, actions: Actions, seen: Floats, drawn: Floats) -> npt.NDArray[Any]:
        """Return the actions [K] or [K, A] of an agent.

        Raises:
            UsageError: the function returns something else.
        """
        k, found = len(seen), np.asarray(self.call(agent.name, seen, drawn))
        if isinstance(actions, Discrete):
            n = int(actions.sizes[0])
            if found.shape != (k,) or found.dtype.kind not in "iu":
                wanted = f"{k} whole numbers"
            elif found.size and not 0 <= found.min() <= found.max() < n:
                wanted = f"numbers of actions from 0 to {n - 1}"
            else:
                return found.astype(np.int64)
        elif found.shape != drawn.shape or not np.isfinite(found).all():
            wanted = f"numbers {list(drawn.shape)}"
        else:
            ends: Any = actions
            clipped: Floats = np.clip(found, ends.low[0], ends.high[0]).astype(np.float32)
            return clipped
        raise UsageError(
            f"{self.address} must return {wanted} for {agent.name}, not {found.dtype} "
            f"{list(found.shape)}"
        )


def policy_in(address: str, digest: str = "") -> OwnPolicy:
    """Return the function at "FILE.py:FUNCTION".

    Args:
        address: of the function.
        digest: that it must have; any if empty.

    Raises:
        UsageError: the file cannot be run or has changed, or it has no such function.
    """
    found = function_in(address, "others", RANDOM, digest)
    return OwnPolicy(found.address, found.digest, found.function)


class Others:
    """The actions of the agents that are not robots, in B epochs.

    Args:
        facts: about the task.
        policy: the user's function, None for random actions.
        keys: of scenarios [B].
    """

    def __init__(
        self, facts: TeamFacts, policy: OwnPolicy | None, keys: npt.NDArray[np.uint64]
    ) -> None:
        self._policy = policy
        self._agents = [
            (k, agent, actions_of([agent]))
            for k, agent in enumerate(facts.agents)
            if k not in facts.team
        ]
        self._keys = fold_all(keys.copy(), "others")[:, None]

    def of(self, t: int, seen: Floats) -> dict[int, npt.NDArray[Any]]:
        """Return the actions of iteration t by the place of the agent, each [B] or [B, A].

        Args:
            t: iteration.
            seen: observations of all agents [B, agents, S].
        """
        found = {}
        for place, agent, actions in self._agents:
            width = np.arange(len(actions.outputs) if isinstance(actions, Continuous) else 1)
            drawn = uniforms(self._keys, t, place, width)
            if self._policy is None:
                found[place] = actions.drawn(drawn[:, None])[:, 0]
            else:
                own = np.ascontiguousarray(seen[:, place, : agent.n_inputs])
                found[place] = self._policy.of(agent, actions, own, drawn)
        return found


def team_of(agents: Sequence[str], prefixes: str) -> tuple[int, ...]:
    """Return the places of the agents whose names begin with one of some prefixes.

    Args:
        agents: names of all agents.
        prefixes: separated by commas; every agent if empty.

    Raises:
        UsageError: no agent's name begins with one of them.
    """
    starts = tuple(one.strip() for one in prefixes.split(",") if one.strip())
    for start in starts:
        if not any(name.startswith(start) for name in agents):
            raise unknown_name("agents", start, agents, "in world.team")
    return tuple(k for k, name in enumerate(agents) if not starts or name.startswith(starts))


def actions_of(agents: Sequence[Agent], moves: bool = False) -> Actions:
    """Return the actions of some agents.

    Args:
        agents: one or more.
        moves: whether the first five actions are the moves of the particle worlds.

    Raises:
        UsageError: some choose among actions, others have axes.
    """
    sizes = [agent.space for agent in agents if isinstance(agent.space, int)]
    if len(sizes) == len(agents):
        return Discrete(_names(max(sizes), "action", moves), np.array(sizes, np.int64))
    if sizes:
        raise UsageError(
            "the robots of a team must all choose among actions, or all have axes: "
            f"select agents by world.team ({', '.join(agent.name for agent in agents)})"
        )
    spaces: list[Any] = [agent.space for agent in agents]
    widest = max(len(lower) for lower, _ in spaces)
    low, high = np.zeros((2, len(spaces), widest), np.float32)
    for i, (lower, upper) in enumerate(spaces):
        low[i, : len(lower)], high[i, : len(lower)] = lower, upper
    outputs = _names(widest, "axis", moves)
    directions = tuple(
        (name,) if (low[:, axis] >= 0).all() else (f"{name} up", f"{name} down")
        for axis, name in enumerate(outputs)
    )
    return Continuous(low, high, outputs, directions)


def _names(n: int, kind: str, moves: bool) -> tuple[str, ...]:
    """Return the names of n actions or axes."""
    return MOVES if moves and n == len(MOVES) else tuple(f"{kind} {k}" for k in range(n))
