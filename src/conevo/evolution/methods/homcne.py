"""HomCNE, homogeneous conventional neuro-evolution: one population, a team of clones.

Nitschke 2009, sections 2.3.1 and 5.3.3. Every genotype is a whole network; it is copied n times and
the clones are evaluated together. One team evaluation per genotype and generation.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from conevo.evolution import credit
from conevo.evolution.assembly import place_on_trial, rows
from conevo.evolution.generation import (
    Populations,
    advance,
    begin,
    breed_networks,
    count,
    crown,
    grade,
    trials,
)
from conevo.evolution.population import elite_count
from conevo.evolution.protocol import FloatArray, Layout, Scores, Trials
from conevo.evolution.variation import VariationConfig
from conevo.parameters import parameters

__all__ = ["HomCne", "HomCneConfig"]


@parameters("method")
class HomCneConfig(VariationConfig):
    """Parameters of HomCNE."""

    genotypes: Annotated[int, Ge(2), Le(1_000_000)] = 10_000
    """M, whole networks in the population; each costs one team evaluation. Choice: 10000, the 20 x
    500 of the methods with many populations (table 5.5's own number is lost), so that all methods
    spend the same team evaluations per generation."""
    clone_credit: Literal["mean", "one"] = "mean"
    """the credit that is a genotype's fitness: the "mean" of all its clones, or that of "one",
    drawn in each generation and the same robot for all its genotypes. Choice: the mean; 5.3.3
    states only that a genotype is replicated, and one clone is less evidence."""


@dataclass(frozen=True)
class HomCne:
    """Homogeneous conventional neuro-evolution; see the module."""

    config: HomCneConfig = field(default_factory=HomCneConfig)
    name: str = "homcne"
    title: str = "HomCNE"

    def init(self, layout: Layout, root: int) -> Populations:
        """Return generation 0 with random genotypes."""
        return begin(
            Populations,
            layout,
            root,
            n_populations=1,
            n_genotypes=self.config.genotypes,
            networks=True,
        )

    def ask(self, state: Populations) -> Trials:
        """Return a team of clones of every genotype, then of the fittest."""
        m = self.config.genotypes
        chosen = np.arange(m) if state.phase == "genotypes" else state.elite[0, :1]
        robots = state.progress.fittest_fitness.size
        clones = np.broadcast_to(chosen[:, None, None], (len(chosen), robots, 1))
        return trials(state, rows(state.active, clones, m))

    def tell(self, state: Populations, trials: Trials, scores: Scores) -> Populations:
        """Return the state after these scores; a genotype's fitness is its clones' credit."""
        state = count(state, trials, scores)
        config = self.config
        if state.phase == "genotypes":
            fitness = self._fitness(state, scores)[None]
            n_elite = elite_count(config.elite_portion, config.genotypes)
            return grade(state, fitness, n_elite, phase="fittest")
        state = crown(state, trials, scores)
        return advance(state, breed_networks(state, state.elite, config), state.active)

    def _fitness(self, state: Populations, scores: Scores) -> FloatArray:
        """Return type A fitness [M]."""
        if self.config.clone_credit == "mean":
            return credit.of_clones(scores.fitness)
        robot = place_on_trial(state.root, state.generation, scores.fitness.shape[1])
        return credit.of_robot(scores.fitness, robot)
