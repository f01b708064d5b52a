"""Teams that are stepped with actions: the part that environments of all packages share."""

from __future__ import annotations

import re
import secrets
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError, shown, unknown_name
from conevo.worlds.families import is_task
from conevo.worlds.measures import measures_of
from conevo.worlds.registry import WORLDS, resolve, world
from conevo.worlds.spaces import ActionMode, Mode, group_of, input_bounds_of
from conevo.worlds.stepper import Stepper

if TYPE_CHECKING:
    from collections.abc import Sequence

    from conevo.worlds.protocol import World

__all__ = ["SteppedTeams", "fresh_seed", "length_in", "versioned"]

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


class SteppedTeams:
    """``n`` teams of one environment: actions in, observations and rewards out.

    A robot's reward is the growth of its fitness, so that rewards of an epoch add up to it. No
    epoch ends before its last iteration.

    Args:
        task: "pursuit/team-3", or another address of a world that is written in Warp.
        n: number of teams.
        actions: the mode of actions (``ActionMode``).
        params: parameters of the world that differ from their defaults.
        scenarios: number of scenarios in the pool, or their keys.
        threads: CPU threads; by default the faster of one and all.
        device: as for ``Stepper``.
        arguments: names that the caller takes in addition to parameters, for the error that names
            the nearest right one.

    Attributes:
        world: the world.
        stepper: plays it.
        actions: turns actions into outputs.
        agents: R names of the robots, "predator_0".
        low, high: [S] float32, bounds of an observation.
        measures: names of the world's measures of performance.
        iterations: length of an epoch.

    Raises:
        UsageError: a task, parameter, mode or number that is not allowed.
        EnvironmentFailure: the device does not exist or has too little memory.
    """

    def __init__(
        self,
        task: str,
        n: int,
        actions: Mode,
        params: dict[str, Any],
        *,
        scenarios: int | Sequence[int],
        threads: int | None = None,
        device: str = "cpu",
        arguments: Sequence[str] = (),
    ) -> None:
        self.world = _world(task, params, arguments)
        self.actions = ActionMode(self.world, actions)
        self.stepper = Stepper(self.world, n, scenarios, n_threads=threads, device=device)
        group, r = group_of(self.world), self.world.n_robots
        self.agents = [f"{group}_{i}" for i in range(r)]
        bounds = np.array(input_bounds_of(self.world), np.float32)
        self.low, self.high = bounds[:, 0], bounds[:, 1]
        self.measures = tuple(one.name for one in measures_of(self.world))
        self.iterations: int = self.world.params.iterations
        self._is_on_cpu = self.stepper.device == "cpu"  # where these are views
        self._inputs: Floats = self.stepper.inputs.numpy()
        self._outputs: Floats = self.stepper.outputs.numpy()
        self._fitness: Floats = self.stepper.fitness.numpy()
        self._clock: npt.NDArray[np.int32] = self.stepper.clock.numpy()
        self._before = np.zeros((n, r))
        self._is_seeded = False

    def reset(self, at: Mask | None = None, seed: int | None = None) -> None:
        """Start a new epoch in some teams, all by default.

        Args:
            at: [n] mask of the teams.
            seed: draws another pool of scenarios. The first reset without a seed takes one from the
                system.

        Raises:
            UsageError: a mask or a seed that does not fit.
        """
        if seed is None and at is None and not self._is_seeded:
            seed = fresh_seed()
        self.stepper.reset(at, seed=seed)
        self._is_seeded = True
        self._before[slice(None) if at is None else at] = 0.0

    def play(self, key: int) -> None:
        """Start a new epoch of all teams in the scenario of a key.

        Raises:
            UsageError: it is not a key.
        """
        self.stepper.draw([key])
        self.stepper.reset()
        self._before[:] = 0.0

    def step(self, actions: Any) -> Doubles:
        """Let all robots act.

        Args:
            actions: [n, R], or [n, R, O] unless they are discrete.

        Returns:
            Rewards [n, R]; 0 for a team whose epoch has ended before.

        Raises:
            UsageError: actions that do not exist or do not fit.
        """
        self._outputs[:] = self.actions.outputs(actions)
        if not self._is_on_cpu:
            self.stepper.outputs.assign(self._outputs)
        self.stepper.step()
        fitness = self._fitness if self._is_on_cpu else self.stepper.fitness.numpy()
        now = fitness.astype(np.float64)
        rewards = now - self._before
        self._before = now
        return rewards

    @property
    def observations(self) -> Floats:
        """Sensor values [n, R, S] now, a copy."""
        return self._inputs.copy() if self._is_on_cpu else self.stepper.inputs.numpy()

    @property
    def clock(self) -> npt.NDArray[np.int32]:
        """Iterations played [n], not to be changed."""
        return self._clock if self._is_on_cpu else self.stepper.clock.numpy()

    @property
    def has_ended(self) -> Mask:
        """Whether the epoch has ended, [n]."""
        return self.clock >= self.iterations

    def performance(self, at: Mask | None = None) -> dict[str, Doubles]:
        """Return each measure of performance [n] as if the epochs of some teams ended now."""
        self.stepper.finish(at)
        values = self.stepper.performance.numpy().astype(np.float64)
        return dict(zip(self.measures, values.T, strict=True))


def _world(task: str, params: dict[str, Any], arguments: Sequence[str]) -> World:
    """Return the world of a task.

    Raises:
        UsageError: as for ``SteppedTeams``.
    """
    if not isinstance(task, str):
        raise UsageError(f"task = {shown(task)}: must be a name, 'WORLD/ENVIRONMENT'")
    if is_task(task):
        raise UsageError(
            f"{task} is a task of another package: use its environment there. Worlds of conevo "
            f"are {', '.join(entry.short_name for entry in WORLDS.values())}, or FILE.py"
        )
    entry, _ = resolve(task)
    known = [field.name for field in fields(entry.params_class)]
    for name in params:
        if name not in known:
            raise unknown_name("argument", name, [*arguments, *known], f"for {task}")
    made = world(task, **params)
    if not hasattr(made, "simulation"):
        raise UsageError(f"{task} has a simulator of its own, which cannot be stepped from outside")
    return made


def fresh_seed() -> int:
    """Return a seed from the system, another one each time."""
    return secrets.randbits(63)


def versioned(made: World) -> str:
    """Return a world's name as PettingZoo writes names, "pursuit_team_3_v2"."""
    name, _, version = made.name.rpartition("-v")
    whole = f"{name}_{made.environment}_v{version}" if name else f"{made.name}_{made.environment}"
    return re.sub(r"\W+", "_", whole)


def length_in(params: dict[str, Any], max_cycles: int | None) -> dict[str, Any]:
    """Return parameters with the length of an epoch, if it is given as ``max_cycles``.

    Raises:
        UsageError: the parameters have another length.
    """
    if max_cycles is None:
        return params
    if params.get("iterations", max_cycles) != max_cycles:
        raise UsageError(
            f"max_cycles = {max_cycles!r} and iterations = {params['iterations']!r}: give one of "
            f"them, both are the length of an epoch"
        )
    return {**params, "iterations": max_cycles}
