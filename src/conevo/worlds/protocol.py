"""Worlds: a task, its parameters, its controllers, and the functions that simulate it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from conevo.controllers.protocol import Controller
from conevo.errors import UsageError, unknown_name
from conevo.worlds.measures import Measure

__all__ = [
    "Outcome",
    "Scenarios",
    "Simulation",
    "Simulator",
    "World",
    "kernel_params",
    "names_of",
    "setting_columns",
]


def names_of(groups: Sequence[str], n: int) -> tuple[str, ...]:
    """Return names of sensors, ``n`` for each group: "light 0", "light 1", ..."""
    return tuple(f"{group} {k}" for group in groups for k in range(n))


@dataclass(frozen=True)
class Outcome:
    """Results of a batch of teams.

    fitness [N, E, R]: each robot's private fitness. counts [N, E, R, C]: how many actions each
    robot executed for each of the world's castes. switches [N, E, R]: how often it executed a
    different action than in the previous iteration. performance: task performance measures, each
    [N, E]. steps [N, E]: iterations that were played, where an epoch may end early; None: all of
    them.
    """

    fitness: npt.NDArray[np.float32]
    counts: npt.NDArray[np.int32]
    switches: npt.NDArray[np.int32]
    performance: dict[str, npt.NDArray[np.float32]]
    steps: npt.NDArray[np.int64] | None = None


@dataclass(frozen=True, kw_only=True)
class Scenarios:
    """E scenarios of a world, each drawn from a key.

    A world adds an array for each further field of its scene: [E, ...], or of any shape if all
    scenarios share it. seed [E] uint64: of random events while a scenario is played. unseen: arrays
    that only kernels need, which recordings leave out.
    """

    seed: npt.NDArray[np.uint64]
    unseen: ClassVar[tuple[str, ...]] = ("seed",)

    def __len__(self) -> int:
        """Return the number of scenarios."""
        return len(self.seed)


@dataclass(frozen=True)
class Simulation:
    """The Warp side of a world, all that ``worlds.rollout`` needs to run it.

    state: struct type of a team's state. The robots' controllers read ``inputs`` [R, S] and write
        ``outputs`` [R, O]. An array has one element for each robot unless it names its dimensions
        (``kernels.arrays``); in a kernel it is flat. sizes: of these dimensions. Those of "robots",
        "inputs", "outputs", "castes" and "measures" follow from the world's names, and "team" is 1.
    scene: struct type of a scenario; its arrays are those of the scenarios object, by name: flat
        over the scenarios, or of two and more dimensions if all scenarios share them.
    params_type, params: struct type of the parameters, and the parameters.
    functions: the phases of an epoch: reset, sense, act, commit, resolve, outcome. The last one
        writes ``performance``; all other results are right after each iteration. A world in which
        robots share something also has settle, once for the team between commit and resolve.
        Within a phase, robots visited in any order must give the same results bit for bit. In
        place of a function for one robot, a world may have phases over other items
        (``kernels.phases.Phase``).
    recorded: state arrays that ``Rollout.record`` keeps, iteration by iteration.
    recorded_at_end: state arrays that it keeps at the end.
    lanes: threads of a block on a CUDA device, a multiple of 32; results do not depend on it.
    scratch: state arrays whose content may depend on the order of items, such as lists that lanes
        fill; results must not depend on this content.
    """

    state: Any
    scene: Any
    params_type: Any
    params: Any
    functions: dict[str, Any]
    recorded: tuple[str, ...]
    sizes: dict[str, int] = field(default_factory=dict)
    recorded_at_end: tuple[str, ...] = ()
    lanes: int = 32
    scratch: tuple[str, ...] = ()


def kernel_params(struct: Any, *sources: Any, **given: Any) -> Any:
    """Return the parameters of a world as its kernels take them.

    Every field of the struct is filled by name, from the ``given`` values or else from a field or
    property of the first source that has it. If no source has ``NAME_2``, it is the square of
    ``NAME``. A truth value becomes 0 or 1, a tuple a vector.

    Args:
        struct: a wp.struct.
        sources: the parameters, and the world if it has some of the values.
        given: values by the names of their fields.

    Raises:
        UsageError: a field has no source, or its value is not a number; ``given`` has other names.
    """
    for name in given:
        if name not in struct.vars:
            raise unknown_name("field", name, struct.vars, f"of {struct.key}")
    filled = struct()
    for name in struct.vars:
        try:
            setattr(filled, name, _value_of(name, sources, given))
        except (AttributeError, TypeError) as error:
            raise UsageError(f"{struct.key}.{name}: {error}") from error
    return filled


def _value_of(name: str, sources: Sequence[Any], given: Mapping[str, Any]) -> Any:
    if name in given:
        return given[name]
    for source in sources:
        if hasattr(source, name):
            return getattr(source, name)
    if name.endswith("_2"):
        return _value_of(name.removesuffix("_2"), sources, given) ** 2
    kinds = " or ".join(type(source).__name__ for source in sources)
    raise AttributeError(f"{kinds} has no field or property of this name")


class Simulator(Protocol):
    """Plays teams in a world. ``worlds.rollout.Rollout`` is that of worlds written in Warp.

    Results depend on the arguments alone: not on threads, batches or earlier calls.
    """

    @property
    def world(self) -> World:
        """The world and environment."""

    @property
    def controller(self) -> Controller:
        """The controller of its robots."""

    @property
    def fingerprint(self) -> str:
        """A text that changes with anything that affects a result; a resume requires the same."""

    @property
    def n_threads(self) -> int:
        """CPU threads in use."""

    def evaluate(
        self,
        genes: npt.NDArray[np.float32],
        teams: npt.NDArray[np.int32],
        scenarios: Any,
        heuristic: npt.NDArray[np.int32] | None = None,
        rounds: int = 1,
    ) -> Outcome:
        """Play every team in every scenario of its round.

        Args:
            genes: pool of genotypes [K, G], float32, in [-1, 1].
            teams: pool rows of the parts [N, R, U] (team, robot, slot), -1 for an empty slot.
            scenarios: E scenarios of the world for each round, one round after another; they may be
                played again later, so nothing is written into them.
            heuristic: [N, R], index of a heuristic controller of the world, -1 for the robot's own.
            rounds: number of equal parts of the teams, each with its own scenarios.

        Raises:
            ValueError: shapes or rows that do not fit the world.
        """

    def record(
        self,
        genes: npt.NDArray[np.float32],
        team: npt.NDArray[np.int32],
        scenarios: Any,
        heuristic: npt.NDArray[np.int32] | None = None,
    ) -> dict[str, npt.NDArray[Any]]:
        """Play one team [R, U] in one scenario and return what happened in every iteration.

        Returns:
            The recorded arrays of the world, each [T, its dimensions], among them ``x``, ``y``,
            ``action`` and ``fitness``, all [T, R]; ``inputs`` [T, R, S], ``outputs`` [T, R, O],
            ``hidden`` [T, R, U]; ``performance`` [T, measures]. The last row equals the outcome of
            ``evaluate``. After an epoch that ends early, ``action`` is -1 and the rest stays.
        """

    def record_with_outcome(
        self,
        genes: npt.NDArray[np.float32],
        team: npt.NDArray[np.int32],
        scenarios: Any,
        heuristic: npt.NDArray[np.int32] | None = None,
    ) -> tuple[dict[str, npt.NDArray[Any]], Outcome]:
        """Return the results of ``record`` and of ``evaluate`` for one team in one scenario.

        A simulator that a world brings need not have it: ``worlds.own_simulator`` adds it.
        """

    def is_shared(self, name: str) -> bool:
        """Return whether all scenarios have a field of theirs in common."""


class World(Protocol):
    """One environment of a task, with its parameters.

    Attributes:
        name: with its version, "rover-v2".
        inputs: S names, of each robot's sensors.
        outputs: O names, of its controller's outputs, which are any real numbers.
        controller: settings of the controller that the source gives such robots. They also apply to
            other controllers that have them. Other settings have the controller's defaults.
        actions: A names; the state array ``action`` contains indices into them.
        castes: C names, one per column of ``Outcome.counts``: the caste of a robot that spends most
            of its life on it. Most worlds count actions, so castes are actions; a world that
            distinguishes the purposes of an action has more. Every executed action counts in
            exactly one column.
        performance: the task performance measures, the main one first. A measure is a ``Measure``,
            with its unit, whether larger is better and its range, or just a name: then larger is
            better.
        heuristics: names of the heuristic controllers, at least one.

    A world may have a property ``optimum``, the largest possible value of its main task performance
    measure. Reports then show the share of it. It has none if smaller is better.

    Its class may have ``settings``, the castes among which a robot chooses when it works, in the
    order of ``castes``, such as the settings with which a rover detects. The others, such as
    moving, come in between. Without it all castes are settings.

    Its class may have ``drawn``, the things that replay and film draw next to its robots
    (``playback.drawn``).

    Its class may have ``group``, ``input_bounds``, ``output_bounds`` and ``discrete_actions``, for
    programs that control its robots from outside (``worlds.spaces``).

    A world that is not written in Warp has, in place of ``simulation``, a method
    ``simulator(controller, n_threads)`` that returns its own ``Simulator``.
    """

    name: ClassVar[str]
    inputs: ClassVar[tuple[str, ...]]
    outputs: ClassVar[tuple[str, ...]]
    controller: ClassVar[dict[str, Any]]
    actions: ClassVar[tuple[str, ...]]
    castes: ClassVar[tuple[str, ...]]
    heuristics: ClassVar[tuple[str, ...]]

    @property
    def performance(self) -> tuple[str | Measure, ...]:
        """Task performance measures, the main one first."""

    @property
    def environment(self) -> str:
        """Name of the environment, as in "complex-1"."""

    @property
    def n_robots(self) -> int:
        """Number of robots in a team."""

    @property
    def params(self) -> Any:
        """Its parameters, a dataclass; one of them is ``iterations``, the length of an epoch."""

    def scenarios(self, keys: Sequence[int]) -> Scenarios:
        """Return one scenario per key: the same key always gives the same scenario."""

    def simulation(self) -> Simulation:
        """Return the Warp side of this world (imports Warp)."""


def setting_columns(world: World) -> tuple[int, ...]:
    """Return the columns of ``Outcome.counts`` among which a robot of a world chooses."""
    chosen = getattr(world, "settings", world.castes)
    return tuple(world.castes.index(name) for name in chosen)
