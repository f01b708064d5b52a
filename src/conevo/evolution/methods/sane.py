"""SANE, symbiotic adaptive neuro-evolution: one population of neurons, one of blueprints.

Moriarty and Miikkulainen 1996, "Efficient reinforcement learning through symbiotic evolution";
1997, "Forming neural networks through efficient and adaptive coevolution", which added blueprints.
Nitschke 2009, section 2.3.3. A blueprint lists the neurons of a network. A generation:

- Every blueprint's network is evaluated. A neuron has the mean fitness of the five best networks in
  which it took part.
- The fittest quarter of the neurons mates with fitter ones. Each has two offspring: a child, which
  may be mutated, and a copy of the parent. They replace the least fit half.
- So do blueprints. In their offspring, few entries change to any neuron, and half of the entries
  that name a neuron which has just mated change to one of its offspring.

One blueprint is for a whole team: it lists the neurons of one network, of which all robots have a
clone, or those of a network for each robot.

Choice: a neuron has weights of all connections, where the source has a list of some connections.
Choice: at first an entry of a blueprint is drawn from a part of the population of its own, so that
populations handed on from other methods keep their order. Later it may name any neuron.
Choice: a neuron that no blueprint lists ranks last.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from conevo.evolution.generation import (
    Populations,
    advance,
    begin,
    count,
    crown,
    grade,
    trials,
)
from conevo.evolution.population import elite_count, ranking
from conevo.evolution.protocol import FloatArray, IntArray, Layout, Scores, Trials
from conevo.evolution.variation import VariationConfig, mutate, replaced, upward
from conevo.evolution.whole import TeamConfig, credit_of_team, filled
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["Sane", "SaneConfig", "SaneState", "mean_of_best"]


@parameters("method")
class SaneConfig(VariationConfig, TeamConfig):
    """Parameters of SANE."""

    genotypes: Annotated[int, Ge(2), Le(1_000_000)] = 25
    """M, neurons in the population for each hidden neuron of a genotype. Choice: 25, which is 200
    for 8 hidden neurons."""
    blueprints: Annotated[int, Ge(4), Le(1_000_000)] = 200
    """B, blueprints; each costs one team evaluation in a generation. Choice: 200."""
    best_networks: Annotated[int, Ge(1), Le(1_000_000)] = 5
    """number of best networks whose mean fitness a neuron has (Moriarty and Miikkulainen 1997)."""
    elite_portion: Annotated[float, Gt(0), Le(0.5)] = 0.25
    """fraction of neurons and of blueprints that mate. Each has two offspring."""
    n_elitist: Annotated[int, Ge(0), Le(0)] = 0
    """always 0: the fitter half of neurons and blueprints survives in any case."""
    entry_mutation: Annotated[float, Ge(0), Le(1)] = 0.01
    """chance of each entry of a new blueprint to change to any neuron."""
    renewal: Annotated[float, Ge(0), Le(1)] = 0.5
    """chance of an entry of a new blueprint that names a parent to change to its offspring."""


@dataclass(frozen=True)
class SaneState(Populations):
    """State of SANE. All neurons in use are one population; ``elite`` is by slot, and not used.

    Attributes:
        blueprints: [B, P, U] int32 rows of the neurons, of ``genes`` as one list [P * U * M, G].
        merits: [B] float64 fitness of the blueprints in this generation.
    """

    blueprints: IntArray
    merits: FloatArray

    def problem(self, first: Populations) -> str:
        """Return the first field that is not valid in a state between generations, if any."""
        n_rows = self.genes[..., 0].size
        if not ((self.blueprints >= 0) & (self.blueprints < n_rows)).all():
            return "blueprints"
        return super().problem(first)


@dataclass(frozen=True)
class Sane:
    """Symbiotic adaptive neuro-evolution; see the module."""

    config: SaneConfig = field(default_factory=SaneConfig)
    name: str = "sane"
    title: str = "SANE"

    def init(self, layout: Layout, root: int) -> SaneState:
        """Return generation 0 with random neurons and blueprints."""
        m, n_networks = self.config.genotypes, self.config.n_networks(layout)
        shape = (self.config.blueprints, n_networks, layout.max_hidden)
        part = np.arange(shape[1] * shape[2], dtype=np.int32).reshape(shape[1:])
        drawn = stream(root, "blueprints").integers(m, size=shape, dtype=np.int32)
        return begin(
            SaneState,
            layout,
            root,
            n_populations=n_networks,
            n_genotypes=m,
            blueprints=part * np.int32(m) + drawn,
            merits=np.full(shape[0], np.nan),
        )

    def ask(self, state: SaneState) -> Trials:
        """Return the team of every blueprint, then that of the fittest."""
        teams = np.where(state.active, state.blueprints, np.int32(-1))
        if state.phase == "fittest":
            teams = teams[ranking(state.merits)[:1]]
        return trials(state, filled(teams, state.progress.fittest_fitness.size))

    def tell(self, state: SaneState, trials: Trials, scores: Scores) -> SaneState:
        """Return the state after these scores."""
        state = count(state, trials, scores)
        if state.phase == "genotypes":
            merits = credit_of_team(scores.fitness)
            n_rows = state.genes[..., 0].size
            rows = state.blueprints[:, state.active]
            fitness = mean_of_best(rows, merits, n_rows, self.config.best_networks)
            n_elite = elite_count(self.config.elite_portion, self.config.genotypes)
            state = replace(state, merits=merits)
            return grade(state, fitness.reshape(state.genes.shape[:3]), n_elite, phase="fittest")
        return self._next(crown(state, trials, scores))

    def _next(self, state: SaneState) -> SaneState:
        """Return the next generation."""
        config, n_genes = self.config, state.genes.shape[3]
        generator = stream(state.root, "breed", state.generation)
        # All neurons in use, as one unit of N; "row" is their place in the whole pool.
        row = np.arange(state.genes[..., 0].size).reshape(state.genes.shape[:3])[state.active]
        row = row.ravel()
        neurons = state.genes.reshape(-1, n_genes)[row]
        fitness = state.fitness.ravel()[row]
        order = ranking(fitness)
        parents = order[: elite_count(config.elite_portion, len(row))]
        child = upward(neurons[None, parents], generator)[0]
        child = mutate(child, config.mutation_probability, config.mutation_scale, generator)
        # The fitter the parents, the worse the neurons that their offspring replace.
        offspring = np.concatenate([child[0], neurons[parents]])[: len(row)]
        places = order[::-1][: len(offspring)]
        neurons = replaced(neurons[None], fitness[None], offspring[None])[0]
        genes = state.genes.reshape(-1, n_genes).copy()
        genes[row] = neurons

        heirs = np.full((2, len(genes)), -1, dtype=np.int32)  # rows of each parent's offspring
        for k in range(2):
            own = places[k * len(parents) : (k + 1) * len(parents)]
            heirs[k, row[parents[: len(own)]]] = row[own]
        blueprints = self._blueprints(state, row, heirs, generator)
        return advance(state, genes.reshape(state.genes.shape), state.active, blueprints=blueprints)

    def _blueprints(
        self, state: SaneState, row: IntArray, heirs: IntArray, generator: np.random.Generator
    ) -> IntArray:
        """Return the next generation of blueprints [B, P, U].

        Args:
            state: the generation that ends.
            row: [N] rows of the neurons in use.
            heirs: [2, P * U * M] rows of each neuron's offspring, -1 without one.
            generator: the source of all random numbers.
        """
        config, entries = self.config, state.blueprints[:, state.active]
        order = ranking(state.merits)
        parents = order[: elite_count(config.elite_portion, len(order))]
        child = upward(entries[None, parents], generator)[0][0]
        new = np.concatenate([child, entries[parents]])[: len(order)]
        heir = heirs[generator.integers(2, size=new.shape), new]
        is_renewed = (generator.random(new.shape) < config.renewal) & (heir >= 0)
        new = np.where(is_renewed, heir, new)
        is_mutated = generator.random(new.shape) < config.entry_mutation
        new = np.where(is_mutated, row[generator.integers(len(row), size=new.shape)], new)
        blueprints = state.blueprints.copy()
        entries = replaced(entries[None], state.merits[None], new[None])[0]
        blueprints[:, state.active] = entries
        return blueprints


def mean_of_best(blueprints: IntArray, merits: FloatArray, n_rows: int, n_best: int) -> FloatArray:
    """Return the fitness [n_rows] of neurons: the mean of the best networks that list them.

    A network that lists a neuron twice counts once; one whose fitness is not finite does not count.

    Args:
        blueprints: [B, N] rows of neurons.
        merits: [B] fitness of the networks.
        n_rows: number of neurons; NaN for one that no network lists.
        n_best: number of networks that count; all, if a neuron has fewer.
    """
    order = [b for b in ranking(merits).tolist() if np.isfinite(merits[b])]
    total, used = np.zeros(n_rows), np.zeros(n_rows, dtype=np.int64)
    for b in order:  # from the best network on
        those = np.unique(blueprints[b])
        those = those[used[those] < n_best]
        total[those] += merits[b]
        used[those] += 1
    fitness = np.full(n_rows, np.nan)
    np.divide(total, used, out=fitness, where=used > 0)
    return fitness
