"""What a world is: a task, its parameters, its controllers, and the functions that simulate it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from conevo.controllers import ControllerSpec

__all__ = ["Outcome", "Simulation", "World"]


@dataclass(frozen=True)
class Outcome:
    """What happened to a batch of teams.

    fitness [N, E, R]: each robot's private fitness. counts [N, E, R, A]: how often each robot
    executed each action. switches [N, E, R]: how often it executed another action than just before.
    performance: task performance measures, each [N, E].
    """

    fitness: npt.NDArray[np.float32]
    counts: npt.NDArray[np.int32]
    switches: npt.NDArray[np.int32]
    performance: dict[str, npt.NDArray[np.float32]]


@dataclass(frozen=True)
class Simulation:
    """The Warp side of a world: what ``worlds.rollout`` needs to run it.

    state: struct type of a team's state, with a field ``nets`` of networks; its other arrays are
        flat over a batch of teams. sizes: elements that one team needs of each of them.
    scene: struct type of a scenario; its arrays are those of the scenarios object, by name: flat
        over the scenarios, or of two and more dimensions if all scenarios share them.
    params_type, params: struct type of the parameters, and the parameters.
    functions: the phases of an epoch: reset, sense, act, commit, resolve, outcome.
    recorded: state arrays that ``Rollout.record`` keeps, iteration by iteration.
    recorded_at_end: state arrays that it keeps at the end.
    """

    state: Any
    sizes: dict[str, int]
    scene: Any
    params_type: Any
    params: Any
    functions: dict[str, Any]
    recorded: tuple[str, ...]
    recorded_at_end: tuple[str, ...] = ()


class World(Protocol):
    """One environment of a task, with its parameters.

    The dataclass of its parameters has a field ``iterations``; ``heuristics`` names at least one.
    """

    name: ClassVar[str]
    actions: ClassVar[tuple[str, ...]]
    performance: ClassVar[tuple[str, ...]]
    heuristics: ClassVar[tuple[str, ...]]

    @property
    def environment(self) -> str:
        """Name of the environment, as in "complex-1"."""

    @property
    def n_robots(self) -> int:
        """Number of robots in a team."""

    @property
    def iterations(self) -> int:
        """Iterations of one epoch, T."""

    @property
    def controller(self) -> ControllerSpec:
        """Shape of the robots' controllers."""

    def scenarios(self, keys: Sequence[int]) -> Any:
        """Return one scenario per key: the same key always gives the same scenario."""

    def simulation(self) -> Simulation:
        """Return the Warp side of this world (imports Warp)."""
