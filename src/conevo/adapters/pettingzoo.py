"""A world as an environment of PettingZoo: robots of one team are the agents.

::

    import conevo

    env = conevo.adapters.pettingzoo.parallel_env("pursuit/team-3", prey="heuristic")
    observations, infos = env.reset(seed=1)
"""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from conevo.adapters.extras import lacking
from conevo.adapters.picture import Camera
from conevo.adapters.teams import SteppedTeams, fresh_seed, length_in, versioned
from conevo.errors import UsageError, unknown_name
from conevo.playback.look import SPEED
from conevo.rng import fold
from conevo.worlds.stepper import whole

try:
    from gymnasium import logger, spaces
    from gymnasium.utils import EzPickle
    from pettingzoo import ParallelEnv
    from pettingzoo.utils.conversions import parallel_to_aec
except ImportError as error:
    raise lacking("pettingzoo", error) from error

if TYPE_CHECKING:
    from conevo.worlds.spaces import Mode

__all__ = ["TeamEnv", "env", "parallel_env"]

Observations = dict[str, npt.NDArray[np.float32]]
Infos = dict[str, dict[str, Any]]

ARGUMENTS = ("actions", "max_cycles", "render_mode")
RENDER_MODES = ("rgb_array",)


class TeamEnv(ParallelEnv, EzPickle):
    """One team, all of whose robots act at once.

    - An observation is a robot's sensor values [S], and ``state()`` those of all robots [R * S].
    - A reward is the growth of the robot's fitness, so that its return is its fitness.
    - All robots are agents to the end: nobody terminates, and all are truncated after the last
      iteration. Then ``infos[agent]["performance"]`` has the measures of performance.
    - ``reset(seed=s)`` plays the first scenario of a run with this seed, and each ``reset()`` the
      next one. ``reset(options={"key": k})`` plays the scenario of a key. Without any seed it is
      drawn by the system.
    - A copy, also a pickled one, is a new environment with the same arguments.

    Args:
        task: "pursuit/team-3", "pursuit-v2/team-3", or "FILE.py:ENVIRONMENT".
        actions: "discrete", "continuous" or "outputs"; see ``conevo.worlds.spaces.ActionMode``.
        max_cycles: length of an epoch; the same as ``iterations``.
        render_mode: "rgb_array" if ``render()`` is to return pictures. Every step keeps a copy of
            the team's state for them.
        params: parameters of the world.

    Attributes:
        teams: the stepped team.
        action_names: of the discrete actions, else of the outputs.

    Raises:
        UsageError: a task, mode or parameter that is not allowed.
    """

    def __init__(
        self,
        task: str,
        *,
        actions: Mode = "discrete",
        max_cycles: int | None = None,
        render_mode: str | None = None,
        **params: Any,
    ) -> None:
        EzPickle.__init__(
            self, task, actions=actions, max_cycles=max_cycles, render_mode=render_mode, **params
        )
        if render_mode not in (None, *RENDER_MODES):
            raise unknown_name("render mode", str(render_mode), RENDER_MODES)
        whole = length_in(params, max_cycles)
        self.teams = teams = SteppedTeams(
            task, 1, actions, whole, scenarios=1, threads=1, arguments=ARGUMENTS
        )
        self.metadata = {
            "name": versioned(teams.world),
            "render_modes": [*RENDER_MODES],
            "render_fps": SPEED,
            "is_parallelizable": True,
        }
        self.render_mode = render_mode
        self._camera = Camera(teams) if render_mode else None
        self.possible_agents = teams.agents
        self._team = frozenset(teams.agents)
        self.agents: list[str] = []
        self._is_begun = False
        self.action_names = teams.actions.names
        self.observation_spaces = {
            agent: spaces.Box(teams.low, teams.high, dtype=np.float32) for agent in teams.agents
        }
        self.action_spaces = {agent: action_space(teams) for agent in teams.agents}
        n = len(teams.agents)
        self.state_space = spaces.Box(np.tile(teams.low, n), np.tile(teams.high, n))
        self._seed, self._epoch = fresh_seed(), 0

    def observation_space(self, agent: str) -> spaces.Box:
        """Return the space of an agent's observations, the same object each time."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's actions, the same object each time."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Start an epoch: robots are at their places and have sensed.

        Args:
            seed: of the scenarios from now on, from 0 and below 2**64.
            options: "key" is the key of a scenario to be played.

        Raises:
            UsageError: a seed, an option or a key that is not allowed.
        """
        given = options or {}
        for name in given.keys() - {"key"}:  # wrappers may pass options of their own
            if get_close_matches(str(name), ["key"]):
                raise unknown_name("option", str(name), ["key"], "of reset")
        if seed is not None:
            self._seed, self._epoch = whole(seed, "seed", 2**64 - 1, 0), 0
        if "key" in given:
            self.teams.play(given["key"])
        else:
            self.teams.play(fold(self._seed, "epoch", 0, self._epoch))
            self._epoch += 1
        self.agents, self._is_begun = list(self.possible_agents), True
        return self._seen(), {agent: {} for agent in self.agents}

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[Observations, dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """Let all robots act at once.

        Returns:
            Observations, rewards, terminations, truncations and infos of all agents; nothing once
            the epoch has ended.

        Raises:
            UsageError: before the first reset; an agent without an action, an action of an agent
                that is not in the team, or one that does not exist.
        """
        agents, teams = self.agents, self.teams
        if not agents:
            if not self._is_begun:
                raise UsageError("reset the environment before the first step")
            return {}, {}, {}, {}, {}
        if actions.keys() != self._team:
            raise self._refusal(actions)
        rewards = teams.step(np.array([[actions[agent] for agent in agents]]))[0].tolist()
        has_ended = bool(teams.clock[0] >= teams.iterations)
        seen = self._seen()
        infos: Infos = {agent: {} for agent in agents}
        if has_ended:
            reached = {name: float(values[0]) for name, values in teams.performance().items()}
            infos = {agent: {"performance": dict(reached)} for agent in agents}
            self.agents = []
        return (
            seen,
            dict(zip(agents, rewards, strict=True)),
            dict.fromkeys(agents, False),
            dict.fromkeys(agents, has_ended),
            infos,
        )

    def state(self) -> npt.NDArray[np.float32]:
        """Return the sensor values of all robots [R * S]."""
        return self.teams.observations.ravel()

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Return a picture [height, width, 3] of the world now; None without a render mode.

        Robots have the colours of their actions, as in a film.

        Raises:
            UsageError: before the first reset; a world that cannot be drawn.
        """
        if self._camera is None:
            logger.warn("nothing is drawn: make the environment with render_mode='rgb_array'")
            return None
        if not self._is_begun:
            raise UsageError("reset the environment before it is drawn")
        return self._camera.picture()

    def close(self) -> None:
        """Do nothing: no window is open."""

    def _seen(self) -> Observations:
        """Return the observations of now."""
        if self._camera is not None:
            self._camera.look()
        return dict(zip(self.agents, self.teams.observations[0], strict=True))

    def _refusal(self, actions: dict[str, Any]) -> UsageError:
        """Return the error for actions that are not those of all agents."""
        for agent in actions:
            if agent not in self.agents:
                return unknown_name("agent", str(agent), self.agents)
        lacking = next(agent for agent in self.agents if agent not in actions)
        return UsageError(f"agent {lacking!r} has no action: all robots act at once")


def action_space(teams: SteppedTeams) -> spaces.Space[Any]:
    """Return the space of one robot's actions."""
    mode = teams.actions
    if mode.mode == "discrete":
        return spaces.Discrete(len(mode.names))
    return spaces.Box(mode.low, mode.high, dtype=np.float32)


def parallel_env(task: str, **settings: Any) -> TeamEnv:
    """Return the environment in which all agents act at once; see ``TeamEnv``."""
    return TeamEnv(task, **settings)


def env(task: str, **settings: Any) -> Any:
    """Return the environment in which agents act in turn (``AECEnv``); see ``TeamEnv``."""
    return parallel_to_aec(TeamEnv(task, **settings))
