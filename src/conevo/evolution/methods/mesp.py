"""MESP, Multi-Agent Enforced Sub-Populations: a population per robot, a sub-population per neuron.

Nitschke 2009, sections 2.3.3 and 5.3.3, after Yong and Miikkulainen. Recombination stays within
sub-populations, fitness is type A only, and controllers grow or shrink when they stagnate.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Generic, TypeVar, cast

import numpy as np
from annotated_types import Ge, Gt, Le

from conevo.errors import UsageError
from conevo.evolution import credit
from conevo.evolution.assembly import (
    SchemeConfig,
    best_team,
    lesion_teams,
    on_trial,
    shared,
    systematic,
)
from conevo.evolution.generation import (
    Populations,
    StartConfig,
    advance,
    begin,
    count,
    crown,
    grade,
    pool,
    push,
    trials,
)
from conevo.evolution.population import elite_count, random_genes
from conevo.evolution.protocol import (
    BoolArray,
    FloatArray,
    IntArray,
    Layout,
    Scores,
    Trials,
)
from conevo.evolution.regulation import resized, stagnating
from conevo.evolution.variation import VariationConfig, breed
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["Mesp", "MespConfig", "MespState"]


@parameters("method")
class MespConfig(VariationConfig, SchemeConfig, StartConfig):
    """Parameters of Multi-Agent ESP."""

    genotypes: Annotated[int, Ge(2), Le(1_000_000)] = 50
    """M, neurons per sub-population (table 5.5: 500 per population of 10)."""
    stagnation_y: Annotated[int, Ge(1), Le(100_000)] = 15
    """Y, generations without progress before a controller's size is questioned (table 5.5: 15; 20
    for pursuit)."""
    lesion_ratio: Annotated[float, Gt(0), Le(1)] = 0.9
    """share of its fitness that a controller must keep without its least needed neuron for that
    neuron to be removed. Lower removes more. Choice: 0.9, since the thesis gives none."""
    migration_every: Annotated[int, Ge(0), Le(1_000_000)] = 0
    """generations after which the population with the best mean type A fitness replaces the whole
    population with the worst; 0 means never. Choice: never, since the thesis does not do this."""


@dataclass(frozen=True)
class MespState(Populations):
    """State of Multi-Agent ESP.

    Attributes:
        past_fitness: [H, R] float64 credits of the fittest team in the last H generations, the
            newest last, NaN before the first. H is the length of the window.
        watched_since: [P] int64 generation at which the controller-size window started.
        partners: [P, U, L, G] float32 last generation's elite; L = 0 in the first generation, and
            always if partners do not come from the elite.
        population_fitness: [P] float64 mean of the finite type A fitness of this generation's
            genotypes; NaN without any, and before the first generation is graded.
    """

    past_fitness: FloatArray
    watched_since: IntArray
    partners: FloatArray
    population_fitness: FloatArray


Kind = TypeVar("Kind", bound=MespState)


@dataclass(frozen=True)
class Mesp(Generic[Kind]):
    """Multi-Agent ESP; see the module. CONE overrides the steps below ``tell``."""

    config: MespConfig = field(default_factory=MespConfig)
    name: str = "mesp"
    title: str = "Multi-Agent ESP"

    def init(self, layout: Layout, root: int) -> Kind:
        """Return generation 0 with random genotypes."""
        return cast("Kind", begin(MespState, layout, root, **self.beginning(layout)))

    def ask(self, state: Kind) -> Trials:
        """Return the teams of the state's phase."""
        m = self.config.genotypes
        if state.phase == "genotypes":
            generator = stream(state.root, "teams", state.generation)
            if self.config.evaluation == "shared":
                teams = shared(state.active, m, self.config.rounds, generator)
                return trials(state, teams, rounds=self.config.n_parts)
            teams = systematic(state.active, m, generator, state.partners.shape[2])
            return trials(state, teams, pool(state, state.partners))
        fittest = best_team(state.active, state.elite, m)
        if state.phase == "lesion":
            return trials(state, lesion_teams(fittest[0], self.suspects(state))[0])
        return trials(state, fittest)

    def tell(self, state: Kind, trials: Trials, scores: Scores) -> Kind:
        """Return the state after these scores."""
        state = count(state, trials, scores)
        if state.phase == "genotypes":
            n_elite = elite_count(self.config.elite_portion, self.config.genotypes)
            fitness = self.type_a(state, trials, scores)
            state = replace(state, population_fitness=_mean_of_finite(fitness))
            return grade(state, fitness, n_elite, phase="fittest")
        if state.phase == "fittest":
            state = self.crowned(state, trials, scores)
            if self.suspects(state).any():
                return replace(state, phase="lesion")
            return self.finish(state, state.active)
        return self.finish(state, self.resize(state, scores), self.suspects(state))

    def beginning(self, layout: Layout) -> dict[str, Any]:
        """Return the sizes of populations and their initial windows.

        Raises:
            UsageError: populations shall replace each other, and the team has only one.
        """
        if self.config.migration_every and layout.n_robots == 1:
            raise UsageError(
                f"method.migration_every = {self.config.migration_every} needs several "
                f"populations, one per robot, and this team has one robot"
            )
        return {
            "n_populations": layout.n_robots,
            "n_genotypes": self.config.genotypes,
            "common_start": self.config.common_start,
            "past_fitness": np.full((self.patience + 1, layout.n_robots), np.nan),
            "watched_since": np.zeros(layout.n_robots, dtype=np.int64),
            "population_fitness": np.full(layout.n_robots, np.nan),
            "partners": np.zeros(
                (layout.n_robots, layout.max_hidden, 0, layout.n_genes), dtype=np.float32
            ),
        }

    def crowned(self, state: Kind, trials: Trials, scores: Scores) -> Kind:
        """Return the state with its fittest team recorded."""
        past = push(state.past_fitness, scores.fitness[0])
        return crown(state, trials, scores, past_fitness=past)

    @property
    def patience(self) -> int:
        """Generations without progress before a controller's size is questioned."""
        return self.config.stagnation_y

    def suspects(self, state: Kind) -> BoolArray:
        """Return the populations [P] whose controllers' size is in question."""
        return stagnating(state.past_fitness, state.generation, state.watched_since, self.patience)

    def type_a(self, state: Kind, trials: Trials, scores: Scores) -> FloatArray:
        """Return type A fitness [P, U, M], NaN in empty slots."""
        shape = state.genes.shape[:3]
        if self.config.evaluation == "shared":
            n_rows = len(trials.genes)
            return credit.mean_of_trials(trials.teams, scores.fitness, n_rows).reshape(shape)
        fitness = np.full(shape, np.nan)
        place = on_trial(state.active, shape[2])
        fitness[place] = credit.of_robot(scores.fitness, place[0])
        return fitness

    def resize(self, state: Kind, scores: Scores) -> BoolArray:
        """Return the slots [P, U] in use after the lesions."""
        suspects = self.suspects(state)
        fittest = best_team(state.active, state.elite, self.config.genotypes)[0]
        _, robot, slot = lesion_teams(fittest, suspects)
        without = np.full(state.active.shape, np.nan)
        whole, lesioned = scores.fitness[0], scores.fitness[1:]
        without[robot, slot] = credit.of_robot(lesioned, robot)
        return resized(state.active, whole, without, suspects, self.config.lesion_ratio)

    def pairs(self, state: Kind) -> IntArray:
        """Return the sub-populations [Q, 2] that recombine between populations: none."""
        return np.empty((0, 2), dtype=np.int64)

    def finish(self, state: Kind, active: BoolArray, judged: BoolArray | None = None) -> Kind:
        """Return the next generation, whose controllers use the slots ``active`` [P, U].

        Args:
            state: the generation that ends.
            active: [P, U] slots in use from now on; a newly used slot starts at random.
            judged: [P] populations whose size was in question; their window restarts.
        """
        used = state.active
        unit = np.cumsum(used) - 1
        pairs = self.pairs(state)
        generator = stream(state.root, "breed", state.generation)
        children = np.zeros_like(state.genes)
        children[used] = breed(
            state.genes[used], state.elite[used], generator, self.config, unit[pairs]
        )
        for p, u in np.argwhere(active & ~used).tolist():
            fresh = stream(state.root, "sub-population", state.generation, p)
            children[p, u] = random_genes(fresh, children.shape[2:])
        since = state.watched_since
        if judged is not None:
            since = np.where(judged, state.generation + 1, since)
        numbers = {"recombinations": len(pairs)}
        partners = self.partners(state, children, active & ~used)
        if self.config.migration_every:
            source = self.sources(state)
            moved = source != np.arange(len(source))
            children, active, partners = children[source], active[source], partners[source]
            since = np.where(moved, state.generation + 1, since)
            numbers["migrations"] = int(moved.sum())
        return advance(state, children, active, numbers, watched_since=since, partners=partners)

    def sources(self, state: Kind) -> IntArray:
        """Return for each place [P] the population that continues there: its own, or the fittest.

        Choice: the children are copied, with the slots they use and the partners from their
        parents. The controller-size window of the replaced population restarts.
        """
        source = np.arange(len(state.active))
        fitness = np.where(np.isfinite(state.population_fitness), state.population_fitness, -np.inf)
        best, worst = fitness.argmax(), fitness.argmin()
        is_time = (state.generation + 1) % self.config.migration_every == 0
        if is_time and fitness[best] > fitness[worst]:
            source[worst] = best
        return source

    def partners(self, state: Kind, children: FloatArray, added: BoolArray) -> FloatArray:
        """Return the partners of the next generation, [P, U, L, G]: the elite of this one.

        Choice: an added sub-population has no elite yet, so its first L genotypes take its place;
        they are random, as all of its genotypes are.

        Args:
            state: the generation that ends.
            children: [P, U, M, G] the next generation.
            added: [P, U] slots that this generation did not use.
        """
        if not self.config.has_elite_partners:
            return state.partners
        elites = np.take_along_axis(state.genes, state.elite[..., None], axis=2)
        first = children[:, :, : elites.shape[2]]
        return np.where(added[:, :, None, None], first, elites)


def _mean_of_finite(fitness: FloatArray) -> FloatArray:
    """Return the mean of the finite values of [P, U, M] over slots and genotypes; NaN if none."""
    finite = np.isfinite(fitness)
    mean = np.full(len(fitness), np.nan)
    total, n = np.where(finite, fitness, 0.0).sum(axis=(1, 2)), finite.sum(axis=(1, 2))
    np.divide(total, n, out=mean, where=n > 0)
    return mean
