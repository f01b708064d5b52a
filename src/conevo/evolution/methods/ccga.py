"""CCGA, cooperative co-evolutionary genetic algorithm: one population of whole networks per robot.

Nitschke 2009, sections 2.3.3 and 5.3.3, after Potter and De Jong. Populations are genetically
isolated. A genotype's fitness is that of its own robot in a team with partners from the others.

Choice: "elite" partners are those of the previous generation, which the state keeps, since children
have no fitness before they are tried. The first generation takes any genotypes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from conevo.evolution import credit
from conevo.evolution.assembly import SchemeConfig, best_team, shared, systematic
from conevo.evolution.generation import (
    Populations,
    StartConfig,
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
from conevo.evolution.protocol import FloatArray, Layout, Scores, Trials
from conevo.evolution.variation import VariationConfig
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["Ccga", "CcgaConfig", "CcgaState", "type_a"]


@parameters("method")
class CcgaConfig(VariationConfig, SchemeConfig, StartConfig):
    """Parameters of CCGA."""

    genotypes: Annotated[int, Ge(2), Le(1_000_000)] = 500
    """M, whole networks per population (table 5.5: 500; 600 in all for pursuit)."""


@dataclass(frozen=True)
class CcgaState(Populations):
    """State of CCGA.

    Attributes:
        partners: [P, U, L, G] float32 last generation's elite; L = 0 in the first generation, and
            always if partners do not come from the elite.
    """

    partners: FloatArray


@dataclass(frozen=True)
class Ccga:
    """Cooperative co-evolutionary genetic algorithm; see the module."""

    config: CcgaConfig = field(default_factory=CcgaConfig)
    name: str = "ccga"
    title: str = "CCGA"

    def init(self, layout: Layout, root: int) -> CcgaState:
        """Return generation 0 with random genotypes."""
        nobody = (layout.n_robots, layout.max_hidden, 0, layout.n_genes)
        return begin(
            CcgaState,
            layout,
            root,
            n_populations=layout.n_robots,
            n_genotypes=self.config.genotypes,
            networks=True,
            common_start=self.config.common_start,
            partners=np.zeros(nobody, dtype=np.float32),
        )

    def ask(self, state: CcgaState) -> Trials:
        """Return the teams that try every genotype, then the fittest team."""
        config, m = self.config, self.config.genotypes
        if state.phase == "fittest":
            return trials(state, best_team(state.active, state.elite[:, None], m))
        generator = stream(state.root, "teams", state.generation)
        if config.evaluation == "shared":
            teams = shared(state.active, m, config.rounds, generator, networks=True)
            return trials(state, teams, rounds=config.n_parts)
        n_partners = state.partners.shape[2]
        teams = systematic(state.active, m, generator, n_partners, networks=True)
        return trials(state, teams, pool(state, state.partners))

    def tell(self, state: CcgaState, trials: Trials, scores: Scores) -> CcgaState:
        """Return the state after these scores."""
        state = count(state, trials, scores)
        config = self.config
        n_elite = elite_count(config.elite_portion, config.genotypes)
        if state.phase == "genotypes":
            fitness = type_a(config, state, trials, scores)
            return grade(state, fitness, n_elite, phase="fittest")
        state = crown(state, trials, scores)
        children = breed_networks(state, state.elite, config)
        if not config.has_elite_partners:
            return advance(state, children, state.active)
        population = np.arange(len(state.elite))[:, None]
        partners = state.genes[population, :, state.elite].swapaxes(1, 2)
        return advance(state, children, state.active, partners=partners)


def type_a(config: CcgaConfig, state: CcgaState, trials: Trials, scores: Scores) -> FloatArray:
    """Return type A fitness [P, M] of the genotypes on trial in phase "genotypes"."""
    if config.evaluation == "shared":
        by_row = credit.mean_of_trials(trials.teams, scores.fitness, len(trials.genes))
        return by_row.reshape(state.genes.shape[:3])[:, 0]
    robot = np.arange(len(state.active)).repeat(config.genotypes)
    return credit.of_robot(scores.fitness, robot).reshape(-1, config.genotypes)
