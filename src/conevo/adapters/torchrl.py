"""Many teams as one batched environment of TorchRL.

::

    import conevo

    env = conevo.adapters.torchrl.TeamBatchEnv("pursuit/team-3", num_envs=512, prey="heuristic")
    played = env.rollout(100)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from conevo.adapters.extras import lacking
from conevo.adapters.teams import SteppedTeams, fresh_seed
from conevo.errors import UsageError, unknown_name
from conevo.worlds.measures import measures_of
from conevo.worlds.spaces import group_of
from conevo.worlds.stepper import MOST_WORLDS, whole

try:
    import torch
    from tensordict import TensorDict, TensorDictBase
    from torchrl.data import Bounded, Categorical, Composite, Unbounded
    from torchrl.envs import EnvBase
except ImportError as error:
    raise lacking("torchrl", error) from error

if TYPE_CHECKING:
    from conevo.worlds.spaces import Mode

__all__ = ["TeamBatchEnv"]

REWARDS = ("fitness", "performance")
ARGUMENTS = (
    "num_envs", "actions", "seed", "scenarios", "reward", "scale", "threads", "device",
)  # fmt: skip


class TeamBatchEnv(EnvBase):
    """``num_envs`` teams that are stepped together, all robots of a team in one group.

    - Keys are ``(group, "observation")`` [n, R, S], ``(group, "action")`` [n, R] or [n, R, O] and
      ``(group, "reward")`` [n, R, 1], with the group "predators", "rovers" or "robots". ``done``,
      ``terminated`` and ``truncated`` [n, 1] are those of the team.
    - Nobody terminates. A team is truncated after its last iteration, so that a learner bootstraps
      its values there.
    - A reset honours ``_reset`` [n, 1]: the other teams go on.
    - Observations are copies, which the next step does not change.

    Args:
        task: "pursuit/team-3", "pursuit-v2/team-3", or "FILE.py:ENVIRONMENT".
        num_envs: n.
        actions: "discrete", "continuous" or "outputs"; see ``conevo.worlds.spaces.ActionMode``.
        seed: of the scenarios, as ``set_seed`` sets it; by default one from the system.
        scenarios: number of scenarios in the pool, or their keys. Each team meets one of them at
            random in each epoch. A learner can adapt to a small pool.
        reward: "fitness" is the growth of a robot's own fitness, so that its return is its fitness.
            "performance" is the growth of the team's first measure of performance (its decrease, if
            less of it is better), the same for all robots, so that a return is the performance. A
            step of the rover world takes three times as long with it.
        scale: factor of all rewards.
        threads: CPU threads; by default the faster of one and all.
        device: of the worlds and all tensors, "cpu" or a CUDA device. CUDA has not been tested.
            Actions and rewards take the path through the host there.
        params: parameters of the world.

    Attributes:
        teams: the stepped teams; ``teams.performance()`` has the measures of performance [n].
        group: name of the group.
        group_map: names of the robots in the group.
        action_names: of the discrete actions, else of the outputs.

    Raises:
        UsageError: a task, mode, reward, number or parameter that is not allowed.
        EnvironmentFailure: the device does not exist or has too little memory.
    """

    batch_locked = True

    def __init__(
        self,
        task: str,
        num_envs: int,
        *,
        actions: Mode = "discrete",
        seed: int | None = None,
        scenarios: int | Sequence[int] = 256,
        reward: Literal["fitness", "performance"] = "fitness",
        scale: float = 1.0,
        threads: int | None = None,
        device: str | torch.device = "cpu",
        **params: Any,
    ) -> None:
        if reward not in REWARDS:
            raise unknown_name("reward", str(reward), REWARDS)
        factor: Any = scale
        if type(factor) not in (int, float) or not math.isfinite(factor):
            raise UsageError(f"scale = {scale!r}: must be a finite number")
        teams = SteppedTeams(
            task,
            whole(num_envs, "num_envs", MOST_WORLDS),
            actions,
            params,
            scenarios=scenarios,
            threads=threads,
            device=str(device),
            arguments=ARGUMENTS,
        )
        super().__init__(device=torch.device(teams.stepper.device), batch_size=[num_envs])
        self.teams = teams
        self.group = f"{group_of(teams.world)}s"
        self.group_map = {self.group: list(teams.agents)}
        self.action_names = teams.actions.names
        self._reward, self._scale = reward, float(scale)
        self._inputs = torch.from_dlpack(teams.stepper.inputs)  # a view
        self._before = np.zeros(num_envs)  # performance before a step, if it is the reward
        self._seed: int | None = None  # of the next reset of all teams
        if seed is not None:
            self._set_seed(seed)
        self._declare()

    def _declare(self) -> None:
        """Declare keys, shapes and bounds."""
        teams, shape = self.teams, (*self.batch_size, len(self.teams.agents))

        def grouped(name: str, spec: Any) -> Any:
            inside = Composite({name: spec}, shape=shape, device=self.device)
            return Composite({self.group: inside}, shape=self.batch_size, device=self.device)

        mode = teams.actions
        if mode.mode == "discrete":
            action = Categorical(len(mode.names), shape=shape, device=self.device)
        else:
            action = self._real(mode.low, mode.high, shape)
        self.action_spec = grouped("action", action)
        self.observation_spec = grouped("observation", self._real(teams.low, teams.high, shape))
        self.reward_spec = grouped("reward", Unbounded((*shape, 1), device=self.device))
        names = ("done", "terminated", "truncated")
        self.done_spec = Composite(
            {name: Categorical(2, (*shape[:1], 1), self.device, torch.bool) for name in names},
            shape=self.batch_size,
            device=self.device,
        )

    def _real(self, low: Any, high: Any, shape: tuple[int, ...]) -> Any:
        """Return the spec of real numbers [*shape, K] between bounds [K], if all are finite."""
        whole = (*shape, len(low))
        if not (np.isfinite(low).all() and np.isfinite(high).all()):
            return Unbounded(whole, device=self.device)
        ends = (torch.from_numpy(end).expand(whole) for end in (low, high))
        return Bounded(*ends, whole, self.device, torch.float32)

    def to(self, device: Any) -> TeamBatchEnv:
        """Return the environment itself.

        Raises:
            UsageError: another device; worlds stay where they have been made.
        """
        if torch.device(device).type != self.device.type:
            raise UsageError(f"make the environment with device={str(device)!r}: it cannot move")
        return self

    def _set_seed(self, seed: int | None) -> None:
        """Let the next reset of all teams draw another pool of scenarios."""
        self._seed = fresh_seed() if seed is None else whole(seed, "seed", 2**64 - 1, 0)

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDictBase:
        mask = None if tensordict is None else tensordict.get("_reset", None)
        at = None if mask is None else mask.reshape(self.batch_size).cpu().numpy()
        if at is None or at.all():
            self.teams.reset(seed=self._seed)
            self._seed = None
        else:
            self.teams.reset(at)
        self._before[slice(None) if at is None else at] = 0.0
        return self._seen()

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        rewards = self.teams.step(tensordict.get((self.group, "action")).cpu().numpy())
        if self._reward == "performance":
            now = self._performance()
            rewards[:] = (now - self._before)[:, None]
            self._before = now
        scaled = torch.from_numpy(self._scale * rewards).to(self.device, torch.float32)
        return self._seen(reward=scaled.unsqueeze(-1))

    def _performance(self) -> npt.NDArray[np.float64]:
        """Return the first measure of performance [n] now, more of which is better."""
        main = measures_of(self.teams.world)[0]
        return self.teams.performance()[main.name] * (1.0 if main.larger_is_better else -1.0)

    def _seen(self, **more: torch.Tensor) -> TensorDict:
        """Return observations and more of the robots, and which epochs have ended."""
        n = self.batch_size
        # On the CPU naming it takes a quarter of a step's time, for checks of every tensor.
        device = None if self.device.type == "cpu" else self.device
        ended = torch.from_numpy(self.teams.has_ended).to(self.device).unsqueeze(-1)
        found = {
            self.group: TensorDict(
                {"observation": self._inputs.clone(), **more}, (*n, len(self.teams.agents))
            ),
            "done": ended,
            "terminated": torch.zeros_like(ended),
            "truncated": ended.clone(),
        }
        return TensorDict(found, n, device=device)
