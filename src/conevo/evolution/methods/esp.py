"""ESP, Enforced Sub-Populations: a sub-population for each hidden neuron of one network.

Gomez and Miikkulainen 1997, "Incremental evolution of complex general behavior"; 1999, "Solving
non-Markovian control tasks with neuroevolution"; Gomez 2003, "Robust non-linear control through
neuroevolution". Nitschke 2009, section 2.3.3 and figure 2.6. A generation:

- Networks are made of one neuron from each sub-population until every neuron has had ``rounds``
  trials. A neuron's fitness is the mean of its networks.
- Each neuron of the elite portion mates with a fitter one of its sub-population. The children
  replace the least fit half.
- If the best network has not improved for ``stagnation`` generations, there is a burst: every
  sub-population starts again around the best network's neuron, with Cauchy noise (delta coding).
- If two bursts have not helped, the network's size is questioned, neuron by neuron.

Multi-Agent ESP (``mesp``) has this for every robot, each with its own credit. Here one genotype is
for a whole team, with the credit of the team.

Choice: the best network of a generation is the one that is most above the mean of its round, since
each round has scenarios of its own. It plays once more in the scenarios of all fittest teams. This
fitness decides whether the best network so far has improved.
Choice: the lesions are those of section 3.6, of the best network so far (``regulation.resized``): a
neuron without which enough fitness is left is removed, otherwise a sub-population is added. A
sub-population that was added and has not entered the best network since is replaced first.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from conevo.evolution import credit
from conevo.evolution.assembly import lesion_teams, rows, shared
from conevo.evolution.generation import (
    Populations,
    advance,
    begin,
    count,
    crown,
    grade,
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
from conevo.evolution.regulation import resized
from conevo.evolution.variation import VariationConfig, mutate, replaced, upward
from conevo.evolution.whole import TeamConfig, credit_of_team, filled
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["Esp", "EspConfig", "EspState"]

BURSTS = 2  # without success, before the size is questioned (Gomez 2003)


@parameters("method")
class EspConfig(VariationConfig, TeamConfig):
    """Parameters of ESP."""

    genotypes: Annotated[int, Ge(2), Le(1_000_000)] = 40
    """M, neurons per sub-population. Choice: 40."""
    rounds: Annotated[int, Ge(1), Le(10_000)] = 10
    """K, trials of each neuron; a generation has K x M teams (Gomez and Miikkulainen 1997: 10)."""
    fresh_rounds: bool = True
    """whether each round has its own scenarios, as for other methods with shared evaluation."""
    elite_portion: Annotated[float, Gt(0), Le(0.5)] = 0.25
    """fraction of a sub-population that mates (Gomez and Miikkulainen 1997: a quarter). Each has
    two children."""
    n_elitist: Annotated[int, Ge(0), Le(0)] = 0
    """always 0: the fitter half of a sub-population survives in any case."""
    stagnation: Annotated[int, Ge(1), Le(100_000)] = 20
    """generations without a better network before a burst, and between bursts. Choice: 20."""
    burst_scale: Annotated[float, Gt(0), Le(1000)] = 0.03
    """scale of a burst's Cauchy noise in gene units. Choice: 0.03, which is 0.3 in weight units
    (Gomez 2003)."""
    lesion_ratio: Annotated[float, Gt(0), Le(1)] = 0.9
    """share of its fitness that the best network must keep without a neuron for that neuron to be
    removed. Choice: 0.9, as for Multi-Agent ESP."""


@dataclass(frozen=True)
class EspState(Populations):
    """State of ESP.

    Attributes:
        candidate: [P, U] int32 genotypes of the best network of this generation.
        best: [P, U, G] float32 the best network so far, zero in empty slots.
        best_active: [P, U] its slots in use.
        record: its fitness in the scenarios of the fittest teams; NaN before the first.
        since: generation of the record, of the last burst or of the last lesions.
        bursts: since the record or the last lesions.
    """

    candidate: IntArray
    best: FloatArray
    best_active: BoolArray
    record: float
    since: int
    bursts: int

    def problem(self, first: Populations) -> str:
        """Return the first field that is not valid in a state between generations, if any."""
        if found := super().problem(first):
            return found
        if not (np.abs(self.best) <= 1).all() or self.best[~self.best_active].any():
            return "best"
        if not ((self.candidate >= 0) & (self.candidate < self.genes.shape[2])).all():
            return "candidate"
        if not 0 <= self.bursts <= BURSTS:
            return "bursts"
        return "" if 0 <= self.since <= self.generation else "since"


@dataclass(frozen=True)
class Esp:
    """Enforced Sub-Populations; see the module."""

    config: EspConfig = field(default_factory=EspConfig)
    name: str = "esp"
    title: str = "ESP"

    def init(self, layout: Layout, root: int) -> EspState:
        """Return generation 0 with random neurons."""
        shape = (self.config.n_networks(layout), layout.max_hidden)
        return begin(
            EspState,
            layout,
            root,
            n_populations=shape[0],
            n_genotypes=self.config.genotypes,
            candidate=np.zeros(shape, dtype=np.int32),
            best=np.zeros((*shape, layout.n_genes), dtype=np.float32),
            best_active=np.zeros(shape, dtype=np.bool_),
            record=float("nan"),
            since=0,
            bursts=0,
        )

    def ask(self, state: EspState) -> Trials:
        """Return teams in which every neuron takes part, the best of them again, or lesions."""
        n_robots = state.progress.fittest_fitness.size
        if state.phase == "lesion":
            teams = filled(_lesions(state)[0], n_robots)
            return trials(state, teams, state.best.reshape(-1, state.best.shape[2]))
        if state.phase == "fittest":
            team = rows(state.active, state.candidate[None], self.config.genotypes)
            return trials(state, filled(team, n_robots))
        config, generator = self.config, stream(state.root, "teams", state.generation)
        teams = shared(state.active, config.genotypes, config.rounds, generator)
        return trials(state, filled(teams, n_robots), rounds=self._parts)

    def tell(self, state: EspState, trials: Trials, scores: Scores) -> EspState:
        """Return the state after these scores."""
        state = count(state, trials, scores)
        fitness = credit_of_team(scores.fitness)
        if state.phase == "genotypes":
            everyone = np.broadcast_to(fitness[:, None], scores.fitness.shape)
            of_neuron = credit.mean_of_trials(trials.teams, everyone, len(trials.genes))
            n_elite = elite_count(self.config.elite_portion, self.config.genotypes)
            state = replace(state, candidate=self._candidate(state, trials, fitness))
            of_neuron = of_neuron.reshape(state.genes.shape[:3])
            return grade(state, of_neuron, n_elite, phase="fittest")
        if state.phase == "fittest":
            return self._compare(crown(state, trials, scores), float(fitness[0]))
        return self._resize(state, fitness)

    @property
    def _parts(self) -> int:
        return self.config.rounds if self.config.fresh_rounds else 1

    def _candidate(self, state: EspState, asked: Trials, fitness: FloatArray) -> IntArray:
        """Return the genotypes [P, U] of the team that is most above the mean of its round."""
        by_round = np.where(np.isfinite(fitness), fitness, np.nan).reshape(self._parts, -1)
        known = np.isfinite(by_round)
        mean = np.where(known, by_round, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
        above = np.where(known, by_round - mean[:, None], -np.inf)
        team = asked.teams[int(above.argmax()), : len(state.active)]
        genotypes: IntArray = np.where(team >= 0, team % self.config.genotypes, 0).astype(np.int32)
        return genotypes

    def _compare(self, state: EspState, fitness: float) -> EspState:
        """Return the state after the candidate's fitness: the next generation, or lesions."""
        if np.isfinite(fitness) and not fitness <= state.record:
            slots = np.indices(state.active.shape)
            best = state.genes[slots[0], slots[1], state.candidate]
            state = replace(
                state,
                best=best,
                best_active=state.active,
                record=fitness,
                since=state.generation,
                bursts=0,
            )
        if state.generation - state.since < self.config.stagnation or np.isnan(state.record):
            return advance(state, self._children(state), state.active, {"burst": 0})
        if state.bursts == BURSTS:
            return replace(state, phase="lesion")
        changes = {"since": state.generation, "bursts": state.bursts + 1}
        return advance(state, self._burst(state), state.active, {"burst": 1}, **changes)

    def _children(self, state: EspState) -> FloatArray:
        """Return the next generation [P, U, M, G]: the fitter part, then children of the elite."""
        used = state.active
        generator = stream(state.root, "breed", state.generation)
        genes = state.genes[used]
        elites = np.take_along_axis(genes, state.elite[used][..., None], axis=1)
        children = np.concatenate(upward(elites, generator), axis=1)[:, : genes.shape[1]]
        probability, scale = self.config.mutation_probability, self.config.mutation_scale
        children = mutate(children, probability, scale, generator)
        found = state.genes.copy()
        found[used] = replaced(genes, state.fitness[used], children)
        return found

    def _burst(self, state: EspState) -> FloatArray:
        """Return sub-populations around the best network's neurons, which are the first of each.

        Choice: one that the best network does not use yet starts at random.
        """
        generator = stream(state.root, "burst", state.generation)
        around = np.broadcast_to(state.best[:, :, None], state.genes.shape)
        genes = mutate(around, 1.0, self.config.burst_scale, generator)
        genes[:, :, 0] = state.best
        anew = random_genes(generator, state.genes.shape)
        return np.where(state.best_active[:, :, None, None], genes, anew)

    def _resize(self, state: EspState, fitness: FloatArray) -> EspState:
        """Return the next generation, given the fitness [1 + N] of the best network's lesions."""
        shape = state.best_active.shape
        _, population, slot = _lesions(state)
        without = np.full(shape, np.nan)
        without[population, slot] = fitness[1:]
        active = resized(
            state.best_active,
            np.repeat(fitness[:1], shape[0]),
            without,
            np.ones(shape[0], dtype=np.bool_),
            self.config.lesion_ratio,
        )
        children = self._children(state)
        generator = stream(state.root, "sub-population", state.generation)
        anew = random_genes(generator, children.shape)
        is_new = active & ~(state.active & state.best_active)
        children = np.where(is_new[:, :, None, None], anew, children)
        kept = state.best_active & active
        return advance(
            state,
            children,
            active,
            {"burst": 0},
            best=state.best * kept[..., None],
            best_active=kept,
            since=state.generation,
            bursts=0,
        )


def _lesions(state: EspState) -> tuple[IntArray, IntArray, IntArray]:
    """Return the best network, then each without one neuron; population and slot of that neuron."""
    size = state.best_active.size
    every = np.arange(size, dtype=np.int32).reshape(state.best_active.shape)
    team = np.where(state.best_active, every, np.int32(-1))
    return lesion_teams(team, np.ones(len(team), dtype=np.bool_))
