"""CoSyNE, cooperative synapse neuro-evolution: a sub-population for each connection weight.

Gomez, Schmidhuber and Miikkulainen 2008, "Accelerated neural evolution through cooperatively
coevolved synapses", section 3. M networks of n weights are a matrix: a column is a network, a row
is the sub-population of one weight. A generation:

- Every network is evaluated. All of its weights have its fitness.
- The fittest quarter recombines; the children replace the least fit networks.
- In each row some of the weights are marked, and the marked ones are permuted among their networks.
  A weight is marked with probability 1 - q^(1/n), where q in [0, 1] is the relative fitness of its
  network. So q is also the chance that a network stays together, and the fittest one always does.

One genotype is for a whole team, and n is the number of its weights.

Choice: a child has the q of the network that it replaces, since it has no fitness yet.
Choice: parents mate as in ESP, by the same authors: each of the quarter with a random fitter one,
with two children. The paper leaves the number of children open.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from conevo.evolution.assembly import rows
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
from conevo.evolution.protocol import BoolArray, FloatArray, Layout, Scores, Trials
from conevo.evolution.variation import VariationConfig, mutate, replaced, upward
from conevo.evolution.whole import TeamConfig, credit_of_team, filled
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["Cosyne", "CosyneConfig", "marked", "permuted", "relative"]


@parameters("method")
class CosyneConfig(VariationConfig, TeamConfig):
    """Parameters of CoSyNE."""

    genotypes: Annotated[int, Ge(4), Le(1_000_000)] = 40
    """M, networks; each costs one team evaluation in a generation. Choice: 40."""
    elite_portion: Annotated[float, Gt(0), Le(0.5)] = 0.25
    """fraction of the networks that mate. Each has two children."""
    n_elitist: Annotated[int, Ge(0), Le(0)] = 0
    """always 0: the fitter half of the networks survives in any case."""
    permutation: Literal["fitness", "rank", "all"] = "fitness"
    """what the relative fitness q of a network is: its place between the least and the largest
    "fitness" (equation of section 3), its "rank" likewise, which does not depend on the scale of
    fitness, or 0, so that "all" weights are permuted."""


@dataclass(frozen=True)
class Cosyne:
    """Cooperative synapse neuro-evolution; see the module."""

    config: CosyneConfig = field(default_factory=CosyneConfig)
    name: str = "cosyne"
    title: str = "CoSyNE"

    def init(self, layout: Layout, root: int) -> Populations:
        """Return generation 0 with random weights."""
        return begin(
            Populations,
            layout,
            root,
            n_populations=self.config.n_networks(layout),
            n_genotypes=self.config.genotypes,
            networks=True,
        )

    def ask(self, state: Populations) -> Trials:
        """Return the team of every genotype, then that of the fittest."""
        m, n_robots = self.config.genotypes, state.progress.fittest_fitness.size
        chosen = np.arange(m) if state.phase == "genotypes" else state.elite[0, :1]
        teams = rows(state.active, chosen[:, None, None], m)
        return trials(state, filled(teams, n_robots))

    def tell(self, state: Populations, trials: Trials, scores: Scores) -> Populations:
        """Return the state after these scores; a genotype's fitness is that of its team."""
        state = count(state, trials, scores)
        if state.phase == "genotypes":
            fitness = np.repeat(credit_of_team(scores.fitness)[None], len(state.active), axis=0)
            n_elite = elite_count(self.config.elite_portion, self.config.genotypes)
            return grade(state, fitness, n_elite, phase="fittest")
        state = crown(state, trials, scores)
        return advance(state, self._offspring(state), state.active)

    def _offspring(self, state: Populations) -> FloatArray:
        """Return the next generation [P, U, M, G]."""
        used, m = state.active, self.config.genotypes
        generator = stream(state.root, "breed", state.generation)
        genes = state.genes[used].swapaxes(0, 1)  # [M, neurons, G], the weights in use
        networks = genes.reshape(1, m, -1)
        elites = networks[:, state.elite[0]]
        children = np.concatenate(upward(elites, generator), axis=1)[:, :m]
        probability, scale = self.config.mutation_probability, self.config.mutation_scale
        children = mutate(children, probability, scale, generator)
        matrix = replaced(networks, state.fitness[:1], children)[0].T  # [weights, M]
        q = relative(state.fitness[0], self.config.permutation)
        matrix = permuted(matrix, marked(q, len(matrix), generator), generator)
        found = np.zeros_like(state.genes)
        found[used] = matrix.T.reshape(genes.shape).swapaxes(0, 1)
        return found


def relative(fitness: FloatArray, by: str) -> FloatArray:
    """Return the relative fitness q [M] in [0, 1] of networks, 1 for the fittest.

    Ties in fitness count by their order, if it is by rank. One that is not finite has q = 0.
    Choice: with equal fitness all networks but the first count as the least fit.

    Args:
        fitness: [M].
        by: "fitness", "rank" or "all", as ``CosyneConfig.permutation``.
    """
    order = ranking(fitness)
    known = np.isfinite(fitness)
    q = np.zeros(len(fitness))
    if by == "rank":
        q[order] = np.linspace(1.0, 0.0, len(order))
    elif by == "fitness" and known.any():
        least, largest = fitness[known].min(), fitness[known].max()
        if largest > least:
            q[known] = (fitness[known] - least) / (largest - least)
        q[order[0]] = 1.0
    return q * known


def marked(q: FloatArray, n_weights: int, generator: np.random.Generator) -> BoolArray:
    """Return whether each weight [weights, M] is marked, given the relative fitness q [M]."""
    chance = 1 - q ** (1 / n_weights)
    mark: BoolArray = generator.random((n_weights, len(q))) < chance
    return mark


def permuted(matrix: FloatArray, mark: BoolArray, generator: np.random.Generator) -> FloatArray:
    """Return a matrix [weights, M] whose marked values are permuted at random within each row.

    Args:
        matrix: of the weights.
        mark: [weights, M] whether a value is marked.
        generator: the source of the permutations.
    """
    to = np.argsort(~mark, axis=1, kind="stable")
    at = np.argsort(np.where(mark, generator.random(mark.shape), 2.0), axis=1, kind="stable")
    found = np.empty_like(matrix)
    np.put_along_axis(found, to, np.take_along_axis(matrix, at, axis=1), axis=1)
    return found
