"""Worlds as tasks of BenchMARL.

::

    from conevo.adapters.benchmarl import ConevoTask

    task = ConevoTask.PURSUIT_TEAM_3.get_task(config={"prey": "heuristic"})

Each environment of a world of the package is a member; no YAML is needed. ``task_of`` makes a task
of a world in a file.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from conevo.adapters.extras import lacking
from conevo.errors import UsageError
from conevo.rng import fold
from conevo.worlds.registry import WORLDS, resolve, world
from conevo.worlds.spaces import discrete_actions_of

try:
    from benchmarl.environments.common import Task, TaskClass
except ImportError as error:
    raise lacking("benchmarl", error) from error

from conevo.adapters.torchrl import TeamBatchEnv

__all__ = ["ConevoTask", "ConevoTaskClass", "task_of"]

OF_BENCHMARL = ("actions", "device", "num_envs", "seed", "task")
OF_TEAMS = ("reward", "scale", "scenarios", "threads")


class ConevoTaskClass(TaskClass):
    """One environment of conevo, with discrete and continuous actions.

    The pool of scenarios depends on the experiment's seed and on the number of worlds. So an
    evaluation meets other scenarios than the training, unless ``evaluation_episodes`` equals the
    number of worlds of the training.

    Args:
        name: as in files of results, "PURSUIT_TEAM_3".
        config: parameters of the world, and ``scenarios``, ``reward``, ``scale`` and ``threads`` of
            ``TeamBatchEnv``.
        address: "pursuit/team-3".

    Raises:
        UsageError: a parameter that does not exist or is not allowed.
    """

    def __init__(self, name: str, config: Mapping[str, Any] | None, address: str) -> None:
        super().__init__(name, dict(config or {}))
        self.address = address
        for key in OF_BENCHMARL:
            if key in self.config:
                raise UsageError(f"{key!r} is chosen by BenchMARL's experiment, not in the config")
        params = {key: value for key, value in self.config.items() if key not in OF_TEAMS}
        self._is_discrete = bool(discrete_actions_of(world(address, **params)))

    def get_env_fun(
        self, num_envs: int, continuous_actions: bool, seed: int | None, device: Any
    ) -> Callable[[], TeamBatchEnv]:
        """Return a function that makes the environment."""
        return partial(
            TeamBatchEnv,
            self.address,
            num_envs,
            actions="continuous" if continuous_actions else "discrete",
            seed=None if seed is None else fold(seed, "benchmarl", num_envs),
            device=device,
            **copy.deepcopy(self.config),
        )

    def supports_continuous_actions(self) -> bool:
        """Return True: every world has them."""
        return True

    def supports_discrete_actions(self) -> bool:
        """Return whether the world has named actions."""
        return self._is_discrete

    def max_steps(self, env: Any) -> int:
        """Return the length of an epoch."""
        return int(env.teams.iterations)

    def has_render(self, env: Any) -> bool:
        """Return False: nothing is drawn."""
        return False

    def group_map(self, env: Any) -> dict[str, list[str]]:
        """Return the names of the robots in each group."""
        found: dict[str, list[str]] = env.group_map
        return found

    def observation_spec(self, env: Any) -> Any:
        """Return the spec of the observations of one team."""
        return env.full_observation_spec_unbatched.clone()

    def action_spec(self, env: Any) -> Any:
        """Return the spec of the actions of one team."""
        return env.full_action_spec_unbatched.clone()

    def state_spec(self, env: Any) -> None:
        """Return None: central critics take the observations of all robots."""

    def info_spec(self, env: Any) -> None:
        """Return None."""

    def action_mask_spec(self, env: Any) -> None:
        """Return None: all actions are possible at all times."""

    @staticmethod
    def env_name() -> str:
        """Return the name in files of results."""
        return "conevo"


class _Tasks(Task):
    """Tasks that need no YAML."""

    @staticmethod
    def associated_class() -> type[ConevoTaskClass]:
        """Return the class of the tasks."""
        return ConevoTaskClass

    def get_task(self, config: Mapping[str, Any] | None = None) -> ConevoTaskClass:
        """Return the task; see ``ConevoTaskClass`` for the config."""
        return ConevoTaskClass(self.name, config, ADDRESSES[self.name])


def _name_of(address: str) -> str:
    return re.sub(r"\W+", "_", address).upper()


ADDRESSES = {
    _name_of(address): address
    for entry in WORLDS.values()
    for address in (f"{entry.short_name}/{one}" for one in entry.environments)
}
ConevoTask: Any = _Tasks("ConevoTask", dict.fromkeys(ADDRESSES), module=__name__)
"""The environments of the package's worlds: ROVER_COMPLEX_5, PURSUIT_TEAM_3 and so on."""


def task_of(address: str, config: Mapping[str, Any] | None = None) -> ConevoTaskClass:
    """Return the task of any environment, such as one of a world in a file.

    Args:
        address: "FILE.py:ENVIRONMENT", or "pursuit/team-3".
        config: as for ``ConevoTaskClass``.

    Raises:
        UsageError: no such world, or a parameter that is not allowed.
    """
    entry, environment = resolve(address)
    return ConevoTaskClass(_name_of(f"{entry.short_name}/{environment}"), config, address)
