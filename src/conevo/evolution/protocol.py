"""Methods: the functions init, ask and tell, and the state between them.

A state is a frozen dataclass of arrays, plain values and further dataclasses of these, so that a
checkpoint can keep it. Its field ``progress`` is the header, the only part that the loop and the
store read. A generation takes any number of requests. Each names the scenarios of its teams, and
may ask for a portrait of the first one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Protocol, get_args

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError

__all__ = [
    "BoolArray",
    "FloatArray",
    "IntArray",
    "Layout",
    "Method",
    "Progress",
    "Scores",
    "State",
    "Trials",
]

FloatArray = npt.NDArray[np.floating[Any]]
IntArray = npt.NDArray[np.integer[Any]]
BoolArray = npt.NDArray[np.bool_]
SCENARIOS = Literal["fresh", "fixed"]


@dataclass(frozen=True)
class Layout:
    """The size of the problem, all that a method knows about a world.

    Attributes:
        n_robots: R, robots in a team, one population each where a method has several.
        n_hidden: hidden neurons of every controller at the start.
        max_hidden: U, numbered slots for hidden neurons; the most that a controller can have.
        n_genes: G, genes of one neuron.
        n_inputs: S, inputs of a robot; 0 if they are not known. Methods that evolve the topology of
            networks need it.
        n_outputs: O, outputs of a robot, likewise.
    """

    n_robots: int
    n_hidden: int
    max_hidden: int
    n_genes: int
    n_inputs: int = 0
    n_outputs: int = 0

    def __post_init__(self) -> None:
        """Refuse sizes of which a team cannot be made."""
        if min(self.n_robots, self.n_hidden, self.n_genes) < 1 or self.max_hidden < self.n_hidden:
            raise UsageError(
                f"a layout needs n_robots, n_hidden, n_genes >= 1, max_hidden >= n_hidden: {self}"
            )
        if min(self.n_inputs, self.n_outputs) < 0:
            raise UsageError(f"a layout needs n_inputs, n_outputs >= 0: {self}")


@dataclass(frozen=True)
class Trials:
    """Teams to evaluate.

    Attributes:
        generation: the generation they belong to.
        genes: [K, G] float32 pool of genotypes of neurons, in [-1, 1].
        teams: [N, R, U] int32 rows of ``genes``: the neuron in robot r's slot k, -1 = empty slot.
        scenarios: "fresh" ones of the generation, or those that are "fixed" for the whole run.
        portrait: whether the first team's behaviour is recorded as the generation's portrait.
        rounds: number of equal parts of the teams; each part is played in its own scenarios.
        purpose: of the trials, in the method's own words; only the method reads it.
    """

    generation: int
    genes: FloatArray
    teams: IntArray
    scenarios: SCENARIOS = "fresh"
    portrait: bool = False
    rounds: int = 1
    purpose: str = ""

    def networks(self) -> FloatArray:
        """Return the genes of every neuron of every robot, [N, R, U, G]; empty slots are zero."""
        found: FloatArray = self.genes[self.teams]
        found[self.teams < 0] = 0.0
        return found

    def problem(self, progress: Progress) -> str:
        """Return the reason why a run cannot evaluate these trials, nothing if it can.

        Args:
            progress: the header of the state that asks for them.
        """
        genes, teams, sizes = self.genes, self.teams, progress.fittest_genes.shape
        if not (genes.ndim == 2 and genes.shape[1] == sizes[2] and genes.dtype == np.float32):
            return f"genes must be [K, {sizes[2]}] float32, not {_kind(genes)}"
        if not (teams.ndim == 3 and teams.shape[1:] == sizes[:2] and teams.dtype == np.int32):
            return f"teams must be [N, {sizes[0]}, {sizes[1]}] int32, not {_kind(teams)}"
        if not len(teams) or len(teams) % self.rounds:
            return f"{len(teams)} teams cannot be played in {self.rounds} equal rounds"
        if teams.min() < -1 or teams.max() >= len(genes):
            return f"teams must hold rows of its {len(genes)} genotypes, or -1 for an empty slot"
        if not (np.abs(genes) <= 1).all():
            return "genes must be in [-1, 1]"
        if self.scenarios not in get_args(SCENARIOS):
            return f"scenarios must be one of {get_args(SCENARIOS)}, not {self.scenarios!r}"
        if self.generation != progress.generation:
            return f"its generation must be {progress.generation}, not {self.generation}"
        return ""


def _kind(array: Any) -> str:
    return f"{list(array.shape)} {array.dtype}"


@dataclass(frozen=True)
class Scores:
    """Results of the evaluation of teams.

    Attributes:
        fitness: [N, R] float64 credit of each robot, mean over epochs; may be non-finite.
        specialization: [N, R] float64 degree of specialization S of each robot (Nitschke 2009,
            eq. 3.4), mean over epochs. Zeros if it is not defined.
        shares: [N, R, A] float64 share of each of A actions in all that a robot executed, mean over
            epochs. The rest to 1 is the share of epochs in which it did nothing. None if it is not
            defined.
        plays: team evaluations that each team took.
    """

    fitness: FloatArray
    specialization: FloatArray
    shares: FloatArray | None = None
    plays: int = 1


@dataclass(frozen=True)
class Progress:
    """The header of a state: the part that the loop and the store read, for any method.

    Attributes:
        root: the seed of every random decision.
        generation: the generation being evaluated, from 0.
        team_evaluations: teams evaluated so far.
        n_hidden: [P] int64 hidden neurons of each population's controllers.
        fittest_genes: [R, U, G] float32 fittest team of the last finished generation; G genes of a
            neuron in each of U slots, zero in empty ones.
        fittest_active: [R, U] its slots in use.
        fittest_fitness: [R] float64 its credits.
        fittest_specialization: [R] float64 its degrees of specialization.
        best_fitness: the best fitness of the generation.
        mean_fitness: the mean fitness of the generation (of the finite ones).
        n_nonfinite: scores of the generation that were not finite; they rank last.
        numbers: further numbers of the generation by name, which become columns of the log.
    """

    root: int
    generation: int
    team_evaluations: int
    n_hidden: IntArray
    fittest_genes: FloatArray
    fittest_active: BoolArray
    fittest_fitness: FloatArray
    fittest_specialization: FloatArray
    best_fitness: float = float("nan")
    mean_fitness: float = float("nan")
    n_nonfinite: int = 0
    numbers: Mapping[str, float] = field(default_factory=dict)

    @staticmethod
    def first(layout: Layout, root: int, n_populations: int = 1) -> Progress:
        """Return the header of generation 0, in which nothing has been evaluated."""
        robots, slots = layout.n_robots, layout.max_hidden
        return Progress(
            root=root,
            generation=0,
            team_evaluations=0,
            n_hidden=np.full(n_populations, layout.n_hidden, dtype=np.int64),
            fittest_genes=np.zeros((robots, slots, layout.n_genes), dtype=np.float32),
            fittest_active=np.zeros((robots, slots), dtype=np.bool_),
            fittest_fitness=np.full(robots, np.nan),
            fittest_specialization=np.full(robots, np.nan),
        )

    def counted(self, asked: Trials, scores: Scores, *, is_first: bool) -> Progress:
        """Return the header with an evaluation counted.

        Args:
            asked: the trials that were evaluated.
            scores: their results.
            is_first: whether it is the generation's first; this drops the last generation's data.

        Raises:
            UsageError: the scores belong to other trials.
        """
        if asked.generation != self.generation:
            raise UsageError(
                f"these scores are for generation {asked.generation}, the state waits for those "
                f"of {self.generation}"
            )
        expected = asked.teams.shape[:2]
        for name in ("fitness", "specialization"):
            shape = np.shape(getattr(scores, name))
            if shape != expected:
                raise UsageError(f"scores.{name} has shape {shape}, teams x robots is {expected}")
        if scores.shares is not None:
            shape = np.shape(scores.shares)
            if len(shape) != 3 or shape[:2] != expected:
                wanted = f"({expected[0]}, {expected[1]}, A)"
                raise UsageError(
                    f"scores.shares has shape {shape}, teams x robots x actions is {wanted}"
                )
        return replace(
            self,
            team_evaluations=self.team_evaluations + expected[0] * scores.plays,
            n_nonfinite=int(np.count_nonzero(~np.isfinite(scores.fitness)))
            + (0 if is_first else self.n_nonfinite),
            numbers={} if is_first else self.numbers,
        )

    def graded(self, fitness: FloatArray) -> Progress:
        """Return the header with the best and the mean of a generation's fitness, of any shape."""
        finite = fitness[np.isfinite(fitness)]
        return replace(
            self,
            best_fitness=float(finite.max()) if finite.size else float("nan"),
            mean_fitness=float(finite.mean()) if finite.size else float("nan"),
        )

    def crowned(self, asked: Trials, scores: Scores) -> Progress:
        """Return the header with the first team of some trials as the generation's fittest."""
        team: IntArray = asked.teams[0]
        return replace(
            self,
            fittest_genes=np.where((team >= 0)[..., None], asked.genes[team], np.float32(0)).astype(
                np.float32
            ),
            fittest_active=team >= 0,
            fittest_fitness=np.array(scores.fitness[0], dtype=np.float64),
            fittest_specialization=np.array(scores.specialization[0], dtype=np.float64),
        )

    def with_numbers(self, **numbers: float) -> Progress:
        """Return the header with further numbers of the generation."""
        return replace(self, numbers={**self.numbers, **numbers})

    def problem(self, first: Progress) -> str:
        """Return the first field that is not valid in a state of a run, nothing if all are.

        Args:
            first: the header of generation 0 of that run.
        """
        for name in ("generation", "team_evaluations", "n_nonfinite"):
            if getattr(self, name) < 0:
                return name
        for name in (
            "fittest_genes",
            "fittest_active",
            "fittest_fitness",
            "fittest_specialization",
        ):
            if np.shape(getattr(self, name)) != np.shape(getattr(first, name)):
                return name
        if not (np.abs(self.fittest_genes) <= 1).all():
            return "fittest_genes"
        return "root" if self.root != first.root else ""


class State(Protocol):
    """The state of a method: a frozen dataclass with all that a bit-exact resume needs.

    Its arrays must not be written to. It may have a function ``problem(first)`` that returns the
    name of a field that is not valid in a state between two generations, given generation 0 of the
    same run. It is called when a checkpoint is read, after the types and dimensions of all fields
    have been compared.
    """

    @property
    def progress(self) -> Progress:
        """The header."""


class Method(Protocol):
    """A controller design method. Its functions are pure: they do not change their arguments."""

    @property
    def name(self) -> str:
        """The registry name ("cone")."""

    @property
    def title(self) -> str:
        """The name as published ("CONE")."""

    @property
    def config(self) -> Any:
        """The frozen dataclass of its parameters."""

    def init(self, layout: Layout, root: int) -> State:
        """Return generation 0 with random genotypes."""

    def ask(self, state: Any) -> Trials:
        """Return the teams to evaluate next, given one of the method's states."""

    def tell(self, state: Any, trials: Trials, scores: Scores) -> State:
        """Return the state after these scores, of the next generation if this one is finished."""
