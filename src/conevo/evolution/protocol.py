"""What a method is: init / ask / tell on one flat state, the same for all methods.

Nitschke 2009, chapter 3. A generation is several rounds of ask and tell, told apart by the state's
``phase``: "genotypes" (type A fitness), for CONE "elites" (type C), "fittest" (each population's
fittest controller, together once more) and, when a controller's size is in question, "lesion".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError

__all__ = ["BoolArray", "FloatArray", "IntArray", "Layout", "Method", "Scores", "State", "Trials"]

FloatArray = npt.NDArray[np.floating[Any]]
IntArray = npt.NDArray[np.integer[Any]]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Layout:
    """The size of the problem: what a method must know of a world.

    Attributes:
        n_robots: R, robots in a team, one population each where a method has several.
        n_hidden: hidden neurons of every controller at the start.
        max_hidden: U, numbered slots for hidden neurons; the most a controller can grow to.
        n_genes: G, genes of one neuron.
    """

    n_robots: int
    n_hidden: int
    max_hidden: int
    n_genes: int

    def __post_init__(self) -> None:
        """Refuse sizes that make no team."""
        if min(self.n_robots, self.n_hidden, self.n_genes) < 1 or self.max_hidden < self.n_hidden:
            raise UsageError(
                f"a layout needs n_robots, n_hidden, n_genes >= 1, max_hidden >= n_hidden: {self}"
            )


@dataclass(frozen=True)
class Trials:
    """What to evaluate.

    Attributes:
        phase: the state's phase they belong to.
        generation: the generation they belong to.
        genes: [K, G] float32 pool of neuron genotypes.
        teams: [N, R, U] int32 rows of ``genes``: the neuron in robot r's slot k, -1 = empty slot.
        rounds: the teams come in so many parts of equal length, each of which tries every genotype
            once; each part is to be played in scenarios of its own.
    """

    phase: str
    generation: int
    genes: FloatArray
    teams: IntArray
    rounds: int = 1

    def networks(self) -> FloatArray:
        """Return the genes of every neuron of every robot, [N, R, U, G]; empty slots are zero."""
        found: FloatArray = self.genes[self.teams]
        found[self.teams < 0] = 0.0
        return found


@dataclass(frozen=True)
class Scores:
    """What came back.

    Attributes:
        fitness: [N, R] float64 credit of each robot, mean over epochs; may be non-finite.
        specialization: [N, R] float64 degree of specialization S of each robot (Nitschke 2009,
            eq. 3.4), mean over epochs. Zeros where there is no such thing.
    """

    fitness: FloatArray
    specialization: FloatArray


@dataclass(frozen=True)
class State:
    """Everything a method remembers, as arrays and plain values: enough to resume bit for bit.

    Arrays must not be written to. Arrays with a U axis have all ``max_hidden`` slots; empty slots
    hold zeros. Whole-network methods (HomCNE, HetCNE, CCGA) have one fitness per network: there
    ``fitness`` and ``elite`` lack the U axis.

    Attributes:
        root: the seed of every random decision.
        generation: the generation being evaluated, from 0.
        phase: what ``ask`` will ask for.
        team_evaluations: teams evaluated so far, in all phases.
        genes: [P, U, M, G] float32 genotypes in [-1, 1].
        active: [P, U] the slots (sub-populations) in use.
        fitness: [P, U, M] or [P, M] float64 fitness of this generation (type A; C overwrites it).
        elite: [P, U, L] or [P, L] int32 genotypes of the elite portion, the fittest first.
        partners: [P, U, L, G] float32 last generation's elite, for methods that take partners from
            it; L = 0 otherwise.
        past_fitness: [H, R] float64 ``fittest_fitness`` of the last H generations, the newest last,
            NaN before the first. H is what the method's windows need.
        past_specialization: [H] float64 mean S of the fittest team.
        past_recombinations: [H] float64 recombinations between populations.
        watched_since: [P] int64 generation at which the controller-size window started.
        sst: specialization similarity threshold, NaN for methods without.
        gst: genotype similarity threshold, NaN for methods without.
        fittest_genes: [R, U, G] float32 fittest team of the last finished generation.
        fittest_active: [R, U] its slots in use.
        fittest_fitness: [R] float64 its credits when evaluated together once more.
        fittest_specialization: [R] float64 its degrees of specialization.
        best_fitness: the best type A fitness of the generation.
        mean_fitness: the mean type A fitness of the generation (of the finite ones).
        n_nonfinite: scores of the generation that were not finite; they rank last.
        recombinations: sub-population pairs recombined between populations.
        n_hidden: [P] int64 hidden neurons of each population's controllers.
    """

    root: int
    generation: int
    phase: str
    team_evaluations: int
    genes: FloatArray
    active: BoolArray
    fitness: FloatArray
    elite: IntArray
    partners: FloatArray
    past_fitness: FloatArray
    past_specialization: FloatArray
    past_recombinations: FloatArray
    watched_since: IntArray
    sst: float
    gst: float
    fittest_genes: FloatArray
    fittest_active: BoolArray
    fittest_fitness: FloatArray
    fittest_specialization: FloatArray
    best_fitness: float
    mean_fitness: float
    n_nonfinite: int
    recombinations: int
    n_hidden: IntArray


class Method(Protocol):
    """A controller design method. All three are pure: they change nothing they are given."""

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

    def ask(self, state: State) -> Trials:
        """Return the teams to evaluate next."""

    def tell(self, state: State, trials: Trials, scores: Scores) -> State:
        """Return the state after these scores; ``generation`` has grown if one was finished."""
