"""Many teams as a vector environment of Gymnasium, for learners of one policy.

::

    import conevo

    envs = conevo.adapters.gymnasium.TeamVectorEnv("pursuit/team-3", 64, prey="heuristic")
    observations, infos = envs.reset(seed=1)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from conevo.adapters.extras import lacking
from conevo.adapters.teams import SteppedTeams, versioned
from conevo.errors import UsageError, unknown_name
from conevo.worlds.stepper import MOST_WORLDS, whole

try:
    from gymnasium import spaces
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError as error:
    raise lacking("gymnasium", error) from error

if TYPE_CHECKING:
    from conevo.worlds.spaces import Mode

__all__ = ["TeamVectorEnv"]

ARGUMENTS = ("num_teams", "per", "actions", "autoreset_mode", "scenarios", "threads")
PER = ("robot", "team")


class TeamVectorEnv(VectorEnv):
    """Teams that are stepped together; a sub-environment is one robot, or one team.

    With ``per="robot"`` one policy controls each robot from its own sensors. Sub-environment
    ``k * R + i`` is robot i of team k; the robots of a team are reset together. With ``per="team"``
    one policy controls a whole team: observations and actions of its robots are joined, and the
    reward is their mean.

    Nobody terminates; all are truncated after the last iteration. Then the infos have the measures
    of ``performance``, each [num_envs] with a mask, in the form of Gymnasium's own vector
    environments: in the autoreset mode SAME_STEP they are in ``final_info``, next to ``final_obs``.

    Args:
        task: "pursuit/team-3", "pursuit-v2/team-3", or "FILE.py:ENVIRONMENT".
        num_teams: n.
        per: "robot" or "team".
        actions: "discrete", "continuous" or "outputs"; see ``conevo.worlds.spaces.ActionMode``.
        autoreset_mode: when a team starts again: SAME_STEP, NEXT_STEP, or DISABLED for
            ``reset(options={"reset_mask": mask})`` by the caller before the next step.
        scenarios: number of scenarios in the pool, or their keys; ``reset(seed=...)`` draws
            others.
        threads: CPU threads; by default the faster of one and all.
        params: parameters of the world.

    Attributes:
        teams: the stepped teams.
        action_names: of the discrete actions, else of the outputs.

    Raises:
        UsageError: a task, mode, number or parameter that is not allowed.
    """

    def __init__(
        self,
        task: str,
        num_teams: int,
        *,
        per: Literal["robot", "team"] = "robot",
        actions: Mode = "discrete",
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        scenarios: int | Sequence[int] = 256,
        threads: int | None = None,
        **params: Any,
    ) -> None:
        if per not in PER:
            raise unknown_name("sub-environment", str(per), PER)
        try:
            self._autoreset = AutoresetMode(autoreset_mode)
        except ValueError:
            known = [one.value for one in AutoresetMode]
            raise unknown_name("autoreset mode", str(autoreset_mode), known) from None
        self.teams = teams = SteppedTeams(
            task,
            whole(num_teams, "num_teams", MOST_WORLDS),
            actions,
            params,
            scenarios=scenarios,
            threads=threads,
            arguments=ARGUMENTS,
        )
        self._n, self._r = num_teams, len(teams.agents)
        self._robots = 1 if per == "robot" else self._r  # of a sub-environment
        self.num_envs = self._n * self._r // self._robots
        self.action_names = teams.actions.names
        self.metadata = {
            "name": versioned(teams.world),
            "autoreset_mode": self._autoreset,
            "render_modes": [],
        }
        low, high = (np.tile(end, self._robots) for end in (teams.low, teams.high))
        self.single_observation_space = spaces.Box(low, high, dtype=np.float32)
        self.single_action_space = self._actions_of_one()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._has_ended = np.zeros(self._n, bool)  # and not been reset
        self._is_begun = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[npt.NDArray[np.float32], dict[str, Any]]:
        """Start new epochs, of all teams or of some.

        Args:
            seed: of the scenarios from now on, one for all teams. Without one, the first reset
                takes it from the system.
            options: "reset_mask" [num_envs] selects the sub-environments; all robots of a team or
                none.

        Raises:
            UsageError: a seed, an option or a mask that does not fit.
        """
        given = options or {}
        for name in given.keys() - {"reset_mask"}:
            raise unknown_name("option", str(name), ["reset_mask"], "of reset")
        at = self._of_teams(given["reset_mask"]) if "reset_mask" in given else None
        if at is not None and (seed is not None or not self._is_begun):
            raise UsageError("a seed, and the first reset, are for all teams: leave out reset_mask")
        if seed is not None:
            seed = whole(seed, "seed", 2**64 - 1, 0)
        self.teams.reset(at, seed)
        super().reset(seed=seed)
        self._is_begun = True
        self._has_ended[slice(None) if at is None else at] = False
        return self._observed(), {}

    def step(
        self, actions: Any
    ) -> tuple[
        npt.NDArray[np.float32],
        npt.NDArray[np.float64],
        npt.NDArray[np.bool_],
        npt.NDArray[np.bool_],
        dict[str, Any],
    ]:
        """Let all robots act.

        Returns:
            Observations, rewards, terminations, truncations [num_envs, ...] and infos.

        Raises:
            UsageError: actions that do not exist or do not fit.
        """
        teams, before = self.teams, self._has_ended
        if self._autoreset == AutoresetMode.DISABLED and before.any():
            raise UsageError(
                f"{before.sum()} of {self._n} teams have ended: reset them before the next step, "
                f"with options={{'reset_mask': truncations}}"
            )
        rewards = teams.step(self._by_team(actions))
        if self._autoreset == AutoresetMode.NEXT_STEP and before.any():
            teams.reset(before)  # this step had no effect on them
        ended = self._has_ended = teams.has_ended
        infos: dict[str, Any] = {}
        if ended.any():
            infos = self._reached(ended)
            if self._autoreset == AutoresetMode.SAME_STEP:
                infos = self._final(ended, infos)
                teams.reset(ended)
                self._has_ended = np.zeros_like(ended)
        reward = rewards.reshape(self.num_envs, self._robots).mean(axis=1)
        terminated = np.zeros(self.num_envs, bool)
        return self._observed(), reward, terminated, self._of_all(ended), infos

    def _actions_of_one(self) -> spaces.Space[Any]:
        """Return the space of the actions of one sub-environment."""
        mode = self.teams.actions
        if mode.mode != "discrete":
            low, high = (np.tile(end, self._robots) for end in (mode.low, mode.high))
            return spaces.Box(low, high, dtype=np.float32)
        n = len(mode.names)
        return spaces.Discrete(n) if self._robots == 1 else spaces.MultiDiscrete([n] * self._robots)

    def _by_team(self, actions: Any) -> npt.NDArray[Any]:
        """Return actions [n, R, ...] of those [num_envs, ...]."""
        chosen, teams = np.asarray(actions), self.teams
        wanted = self.action_space.shape
        if chosen.shape != wanted:
            raise UsageError(f"actions must be {list(wanted)}, not {list(chosen.shape)}")
        size = () if teams.actions.mode == "discrete" else (len(teams.world.outputs),)
        return chosen.reshape(self._n, self._r, *size)

    def _observed(self) -> npt.NDArray[np.float32]:
        return self.teams.observations.reshape(self.num_envs, -1)

    def _of_all(self, of_teams: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return values of teams [n] as those of sub-environments [num_envs]."""
        return np.repeat(of_teams, self.num_envs // self._n)

    def _of_teams(self, mask: Any) -> npt.NDArray[np.bool_]:
        """Return a mask of sub-environments as one of teams."""
        given = np.asarray(mask)
        if given.shape != (self.num_envs,) or given.dtype != bool:
            raise UsageError(
                f"reset_mask must be {self.num_envs} truth values, not {list(given.shape)} of "
                f"{given.dtype}"
            )
        rows = given.reshape(self._n, -1)
        if (rows.any(axis=1) != rows.all(axis=1)).any():
            raise UsageError("reset_mask selects a part of a team: its robots are reset together")
        chosen: npt.NDArray[np.bool_] = rows[:, 0]
        return chosen

    def _reached(self, ended: npt.NDArray[np.bool_]) -> dict[str, Any]:
        """Return the performance of teams as an info of sub-environments."""
        mask, found = self._of_all(ended), {}
        for name, values in self.teams.performance(ended).items():
            found[name], found[f"_{name}"] = self._of_all(np.where(ended, values, 0.0)), mask
        return {"performance": found, "_performance": mask}

    def _final(self, ended: npt.NDArray[np.bool_], infos: dict[str, Any]) -> dict[str, Any]:
        """Return the infos of sub-environments that are reset in the same step."""
        mask, seen = self._of_all(ended), np.full(self.num_envs, None, dtype=object)
        observed = self._observed()
        for k in np.flatnonzero(mask).tolist():
            seen[k] = observed[k]
        return {"final_obs": seen, "_final_obs": mask, "final_info": infos, "_final_info": mask}
