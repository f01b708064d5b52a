"""Novelty search: genotypes are selected because their teams behave as none has before.

Lehman and Stanley 2011, "Abandoning objectives". The novelty of a team is its sparseness: the mean
distance of its behaviour to the k nearest in the current population and in an archive of earlier
behaviours. Fitness has no part in selection. Each generation's fittest team is recorded all the
same, so the search can be compared with others.

Choice: behaviour is that of a whole team (``behaviour.describe``), as in Gomes, Mariano and
Christensen 2017. Distances are Euclidean.
Choice: the archive has a limit, and its oldest behaviour leaves first, so that checkpoints and the
cost of a generation do not grow. The threshold follows the source's rule once a generation: raised
by a fifth if more than 4 behaviours entered, lowered by a twentieth if none did.
Choice: ``weight`` < 1 adds fitness, scaled within the generation (Cuccu and Gomez 2011).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from conevo.evolution.assembly import rows
from conevo.evolution.behaviour import MapConfig, TeamMap, describe
from conevo.evolution.generation import (
    Populations,
    advance,
    begin,
    count,
    crown,
    grade,
    note,
    trials,
)
from conevo.evolution.population import elite_count, join, ranking, split
from conevo.evolution.protocol import FloatArray, Layout, Scores, Trials
from conevo.evolution.variation import VariationConfig, breed
from conevo.evolution.whole import credit_of_team, filled
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["Novelty", "NoveltyConfig", "NoveltyState", "sparseness"]

MANY, RAISED, LOWERED = 4, 1.2, 0.95  # entries that raise the threshold; its factors
BLOCK = 1_000_000  # distances computed at a time


@parameters("method")
class NoveltyConfig(VariationConfig, MapConfig):
    """Parameters of novelty search."""

    genotypes: Annotated[int, Ge(2), Le(1_000_000)] = 10_000
    """M, genotypes in the population; each costs one team evaluation. Choice: 10000, as for
    HomCNE."""
    behaviour: Literal["division", "switching", "shares"] = "division"
    """behaviour that is new or not: "division" of labour (evenness of the team's actions,
    difference of its robots); "switching" (mean S, its difference); "shares" (mean share of each
    action, difference of the robots)."""
    neighbours: Annotated[int, Ge(1), Le(1000)] = 15
    """k, nearest behaviours whose mean distance is the novelty (Lehman and Stanley 2011: 15)."""
    archive: Annotated[int, Ge(1), Le(100_000)] = 1000
    """behaviours that the archive holds at most."""
    threshold: Annotated[float, Gt(0), Le(1)] = 0.05
    """novelty above which a behaviour enters the archive, at the start; it is adapted. Choice:
    0.05, a twentieth of an axis."""
    weight: Annotated[float, Ge(0), Le(1)] = 1.0
    """weight of novelty in selection; the rest is that of fitness. 1: novelty alone."""


@dataclass(frozen=True)
class NoveltyState(Populations):
    """State of novelty search. With whole teams, genotype m of all populations is one team.

    Attributes:
        archive: [K, B] float64 behaviours, the oldest first; K = 0 at the start.
        threshold: novelty above which a behaviour enters it.
        map: the best team in each cell of "division", or of "switching" if that is the behaviour.
    """

    archive: FloatArray
    threshold: float
    map: TeamMap

    def problem(self, first: Populations) -> str:
        """Return the first field that is not valid in a state between generations, if any."""
        assert isinstance(first, NoveltyState)
        if not ((self.archive >= 0) & (self.archive <= 1)).all():
            return "archive"
        if not 0 <= self.threshold < np.inf:
            return "threshold"
        if self.map.problem(first.map):
            return "map"
        return Populations.problem(replace(self, archive=first.archive), first)


@dataclass(frozen=True)
class Novelty:
    """Novelty search; see the module."""

    config: NoveltyConfig = field(default_factory=NoveltyConfig)
    name: str = "novelty"
    title: str = "Novelty search"

    def init(self, layout: Layout, root: int) -> NoveltyState:
        """Return generation 0 with random genotypes."""
        config = self.config
        return begin(
            NoveltyState,
            layout,
            root,
            n_populations=config.n_networks(layout),
            n_genotypes=config.genotypes,
            networks=True,
            archive=np.zeros((0, 0)),
            threshold=float(config.threshold),
            map=TeamMap.empty(config.bins),
        )

    def ask(self, state: NoveltyState) -> Trials:
        """Return a team of every genotype, then the fittest."""
        m, n_robots = self.config.genotypes, state.progress.fittest_fitness.size
        chosen = np.arange(m) if state.phase == "genotypes" else ranking(state.fitness[0])[:1]
        teams = rows(state.active, np.tile(chosen[:, None, None], (len(state.genes), 1)), m)
        return trials(state, filled(teams, n_robots))

    def tell(self, state: NoveltyState, trials: Trials, scores: Scores) -> NoveltyState:
        """Return the state after these scores; the elite are the most novel."""
        state = count(state, trials, scores)
        if state.phase == "genotypes":
            return self._select(state, scores)
        state = crown(state, trials, scores)
        return advance(state, self._children(state), state.active)

    def _select(self, state: NoveltyState, scores: Scores) -> NoveltyState:
        """Return the state with its elite, its archive and its map, given scores of all teams."""
        config = self.config
        described = describe(scores, config.behaviour)
        fitness = credit_of_team(scores.fitness)
        novelty = sparseness(described, state.archive, config.neighbours)
        known = np.isfinite(fitness)
        worth = config.weight * _scaled(novelty, known)
        if config.weight < 1:
            worth = worth + (1 - config.weight) * _scaled(fitness, known)
        n_elite = elite_count(config.elite_portion, config.genotypes)
        elite = ranking(np.where(known, worth, np.nan))[:n_elite]
        n_populations = len(state.genes)
        state = grade(state, np.tile(fitness, (n_populations, 1)), n_elite, phase="fittest")
        state = replace(state, elite=np.tile(elite, (n_populations, 1)))
        plane = "switching" if config.behaviour == "switching" else "division"
        found = state.map.with_teams(state.map.cells(describe(scores, plane)), fitness)
        state = self._archived(replace(state, map=found), described[known], novelty[known])
        mean = float(novelty[known].mean()) if known.any() else float("nan")
        return note(state, novelty=mean, archive=float(len(state.archive)), **found.numbers())

    def _archived(
        self, state: NoveltyState, described: FloatArray, novelty: FloatArray
    ) -> NoveltyState:
        """Return the state with new behaviours [N, B] in its archive, and its threshold adapted.

        Choice: within a generation behaviours enter together, the most novel last, so that in a
        full archive they stay the longest.
        """
        enters = np.flatnonzero(novelty > state.threshold)
        enters = enters[np.argsort(novelty[enters], kind="stable")]
        old = state.archive.reshape(len(state.archive), described.shape[1])
        archive = np.concatenate([old, described[enters]])[-self.config.archive :]
        factor = RAISED if len(enters) > MANY else 1.0 if len(enters) else LOWERED
        return replace(state, archive=archive, threshold=state.threshold * factor)

    def _children(self, state: NoveltyState) -> FloatArray:
        """Return children [P, U, M, G]; a whole team is one genotype of all its networks."""
        n_populations, n_slots, m, n_genes = state.genes.shape
        networks = join(state.genes, int(state.progress.n_hidden[0]))  # [P, M, L]
        whole = networks.swapaxes(0, 1).reshape(1, m, -1)
        generator = stream(state.root, "breed", state.generation)
        children = breed(whole, state.elite[:1], generator, self.config)
        parts = children.reshape(m, n_populations, -1).swapaxes(0, 1)
        return split(parts, n_slots, n_genes)


def sparseness(described: FloatArray, archive: FloatArray, k: int) -> FloatArray:
    """Return the novelty [N] of behaviours [N, B]: the mean distance to the k nearest others.

    Lehman and Stanley 2011, their rho(x). Others are the rest of these and the archive; all of them
    if they are fewer than k; 0 if there are none.

    Args:
        described: [N, B] of the current population.
        archive: [K, B] of earlier ones; K may be 0, and B then is of no account.
        k: nearest neighbours.
    """
    n = len(described)
    others = np.concatenate([described, archive.reshape(len(archive), described.shape[1])])
    k = min(k, len(others) - 1)
    novelty = np.zeros(n)
    if k < 1:
        return novelty
    height = max(BLOCK // len(others), 1)
    for start in range(0, n, height):
        block = described[start : start + height]
        squares = np.zeros((len(block), len(others)))
        for axis in range(described.shape[1]):
            squares += (block[:, axis, None] - others[:, axis]) ** 2
        squares[np.arange(len(block)), start + np.arange(len(block))] = np.inf  # itself
        nearest = np.sort(np.partition(squares, k - 1, axis=1)[:, :k], axis=1)
        novelty[start : start + height] = np.sqrt(nearest).mean(axis=1)
    return novelty


def _scaled(values: FloatArray, known: FloatArray) -> FloatArray:
    """Return values moved to [0, 1], their least and greatest among the known ones; 0 if equal."""
    if not known.any():
        return np.zeros_like(values)
    low, high = values[known].min(), values[known].max()
    scaled: FloatArray = (np.where(known, values, low) - low) / max(high - low, 1e-300)
    return scaled
