"""HetCNE, heterogeneous conventional neuro-evolution: one population, teams of different networks.

Nitschke 2009, sections 2.3.1 and 5.3.3. Every genotype is a whole network; it is tried once with
n - 1 different genotypes and credited with its own robot's fitness. One team evaluation per
genotype and generation.

Choice: children replace all genotypes and have no fitness before they are tried, so "elite" means
the elite portion of the previous generation, which the state keeps. The first generation takes any
other genotypes. An elite portion of fewer than n - 1 is filled up with the next in rank. With
``n_elitist`` a survivor may meet its own copy.
Choice: the fittest team consists of the n fittest genotypes, rank r in robot r (section 2.3.1: "M
of the fittest genotypes ... decoded into a group of M different ANNs").
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from conevo.errors import UsageError
from conevo.evolution import credit
from conevo.evolution.assembly import distinct, place_on_trial, rows
from conevo.evolution.generation import (
    Populations,
    advance,
    begin,
    breed_networks,
    count,
    crown,
    grade,
    pool,
    trials,
)
from conevo.evolution.population import elite_count
from conevo.evolution.protocol import FloatArray, IntArray, Layout, Scores, Trials
from conevo.evolution.variation import VariationConfig
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["HetCne", "HetCneConfig", "HetCneState"]


@parameters("method")
class HetCneConfig(VariationConfig):
    """Parameters of HetCNE."""

    genotypes: Annotated[int, Ge(2), Le(1_000_000)] = 10_000
    """M, whole networks in the population, at least as many as robots; each costs one team
    evaluation. Choice: 10000, as for HomCNE."""
    partners: Literal["elite", "any"] = "elite"
    """partners of a genotype on trial: different genotypes of the previous generation's elite
    portion ("elite", 5.3.3), or "any" others of its own generation."""


@dataclass(frozen=True)
class HetCneState(Populations):
    """State of HetCNE.

    Attributes:
        partners: [1, U, L, G] float32 last generation's elite; L = 0 in the first generation, and
            always if partners do not come from the elite.
    """

    partners: FloatArray


@dataclass(frozen=True)
class HetCne:
    """Heterogeneous conventional neuro-evolution; see the module."""

    config: HetCneConfig = field(default_factory=HetCneConfig)
    name: str = "hetcne"
    title: str = "HetCNE"

    def init(self, layout: Layout, root: int) -> HetCneState:
        """Return generation 0 with random genotypes."""
        if self.config.genotypes < layout.n_robots:
            raise UsageError(
                f"HetCNE fills a team with different genotypes: genotypes "
                f"({self.config.genotypes}) must be at least the robots ({layout.n_robots})"
            )
        return begin(
            HetCneState,
            layout,
            root,
            n_populations=1,
            n_genotypes=self.config.genotypes,
            networks=True,
            partners=np.zeros((1, layout.max_hidden, 0, layout.n_genes), dtype=np.float32),
        )

    def ask(self, state: HetCneState) -> Trials:
        """Return a team for every genotype, with different partners, then the fittest team."""
        m, n_robots = self.config.genotypes, state.progress.fittest_fitness.size
        if state.phase == "fittest":
            fittest = state.elite[:, :n_robots, None]
            return trials(state, rows(state.active, fittest, m))
        generator = stream(state.root, "teams", state.generation)
        own = np.arange(m, dtype=np.int32)[:, None]
        n_kept = state.partners.shape[2]
        if n_kept == 0:
            chosen = distinct(m, n_robots - 1, m - 1, generator)
            chosen = chosen + (chosen >= own)
            partners = rows(state.active, chosen[:, :, None], m)
        else:
            chosen = distinct(m, n_robots - 1, n_kept, generator)
            partners = rows(state.active, chosen[:, :, None], n_kept, offset=len(pool(state)))
        robot = place_on_trial(state.root, state.generation, n_robots)
        teams = np.insert(partners, robot, rows(state.active, own, m), axis=1)
        return trials(state, teams, pool(state, state.partners))

    def tell(self, state: HetCneState, trials: Trials, scores: Scores) -> HetCneState:
        """Return the state after these scores; a genotype's fitness is its own robot's credit."""
        state = count(state, trials, scores)
        config = self.config
        n_elite = elite_count(config.elite_portion, config.genotypes)
        if state.phase == "genotypes":
            n_robots = scores.fitness.shape[1]
            robot = place_on_trial(state.root, state.generation, n_robots)
            fitness = credit.of_robot(scores.fitness, robot)[None]
            n_named = max(n_elite, n_robots)
            return grade(state, fitness, n_named, phase="fittest")
        state = crown(state, trials, scores)
        children = breed_networks(state, state.elite[:, :n_elite], config)
        if config.partners == "any":
            return advance(state, children, state.active)
        kept: IntArray = state.elite[0, : max(n_elite, scores.fitness.shape[1] - 1)]
        return advance(state, children, state.active, partners=state.genes[:, :, kept])
