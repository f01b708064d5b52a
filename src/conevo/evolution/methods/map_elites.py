"""MAP-Elites: the fittest team that was found for each behaviour of a team.

Mouret and Clune 2015, "Illuminating search spaces by mapping elites". A map divides behaviours
into cells, and each cell keeps its fittest genotype, its elite. Children are varied copies of
random elites. A child takes an empty cell, or that of an elite that is less fit. The map shows
which teams a world allows at all, and how well each kind does.

Variation is "iso+line" of Vassiliades and Mouret 2018: x + iso * N(0, I) + line * N(0, 1) (y - x),
for random elites x and y. ``line`` = 0 leaves a plain normal mutation.

Choice: a generation of children is tried together. Choice: with ``rematch`` elites whose cells are
claimed play once more, in the scenarios of the claimants. Otherwise an elite from a generation with
easy scenarios keeps its cell forever, since every generation has other scenarios.
Choice: the archive is a map of conevo, not that of pyribs: its archives and emitters have random
generators inside, and no arrays from which they can be rebuilt bit for bit without pickle.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from conevo.evolution.assembly import rows
from conevo.evolution.behaviour import MapConfig, TeamMap, describe
from conevo.evolution.population import random_genes, ranking
from conevo.evolution.protocol import (
    BoolArray,
    FloatArray,
    IntArray,
    Layout,
    Progress,
    Scores,
    Trials,
)
from conevo.evolution.whole import credit_of_team, filled
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["MapElites", "MapElitesConfig", "MapElitesState", "iso_line"]


@parameters("method")
class MapElitesConfig(MapConfig):
    """Parameters of MAP-Elites."""

    genotypes: Annotated[int, Ge(2), Le(1_000_000)] = 10_000
    """M, children of a generation; each costs one team evaluation, and at most one more if its cell
    has an elite. Choice: 10000, as for HomCNE."""
    behaviour: Literal["division", "switching"] = "division"
    """axes of the map: "division" of labour (evenness of the team's actions, difference of its
    robots), or "switching" (mean S, its difference between robots)."""
    iso: Annotated[float, Ge(0), Le(1)] = 0.1
    """standard deviation of the normal noise on each gene of a child. Choice: 0.1, 1 in weights of
    [-10, 10]; with the source's 0.01 of a gene's range, 0.02 here, teams hardly learn the shipped
    example."""
    line: Annotated[float, Ge(0), Le(1)] = 0.2
    """standard deviation of a child's step along the line to another elite, in lengths of it
    (Vassiliades and Mouret 2018: 0.2); 0: mutation alone."""
    rematch: bool = True
    """whether an elite whose cell is claimed plays again, in the scenarios of the claimant; its
    fitness is then the mean of all that it has played."""


@dataclass(frozen=True)
class MapElitesState:
    """State of MAP-Elites. Genotypes are [P, U, G], P = 1 for clones, else R.

    Attributes:
        progress: the header.
        phase: "genotypes" (children), "elites" (those whose cells are claimed), "fittest".
        active: [P, U] the slots in use.
        genes: [P, U, C, G] float32 the elite of each cell, zero in a cell without one.
        map: their fitness.
        plays: [C] int64 times that each has been tried.
        claimants: [P, U, K, G] float32 the fittest new team of each claimed cell, until its elite
            has played.
        claimed: [K] int64 their cells.
        claims: [K] float64 their fitness.
        fittest: [P, U, 1, G] float32 the best genotype of this generation's trials.
        fitness: its fitness.
        start: [P, U, S, G] float32 the team that a run starts around; S = 0: random genotypes.
    """

    progress: Progress
    phase: str
    active: BoolArray
    genes: FloatArray
    map: TeamMap
    plays: IntArray
    claimants: FloatArray
    claimed: IntArray
    claims: FloatArray
    fittest: FloatArray
    fitness: float
    start: FloatArray

    def problem(self, first: MapElitesState) -> str:
        """Return the first field that is not valid in a state between generations, if any."""
        for name in ("active", "genes", "plays", "fittest"):
            if getattr(self, name).shape != getattr(first, name).shape:
                return name
        for name in ("genes", "fittest", "start"):
            if not (np.abs(getattr(self, name)) <= 1).all():
                return name
        if not self.active.any(axis=1).all():
            return "active"
        if self.map.problem(first.map):
            return "map"
        if not ((self.plays > 0) == np.isfinite(self.map.fitness)).all():
            return "plays"
        if self.start.shape[:2] != first.start.shape[:2]:
            return "start"
        for name in ("claimants", "claimed", "claims"):
            if getattr(self, name).size:
                return name
        return "" if self.phase == "genotypes" else "phase"


@dataclass(frozen=True)
class MapElites:
    """MAP-Elites; see the module."""

    config: MapElitesConfig = field(default_factory=MapElitesConfig)
    name: str = "map-elites"
    title: str = "MAP-Elites"

    def init(self, layout: Layout, root: int) -> MapElitesState:
        """Return generation 0, with an empty map; its children are random."""
        shape = self.config.n_networks(layout), layout.max_hidden
        active = np.zeros(shape, dtype=np.bool_)
        active[:, : layout.n_hidden] = True
        n_cells = self.config.bins**2

        def empty(n: int) -> FloatArray:
            return np.zeros((*active.shape, n, layout.n_genes), dtype=np.float32)

        return MapElitesState(
            progress=Progress.first(layout, root),
            phase="genotypes",
            active=active,
            genes=empty(n_cells),
            map=TeamMap.empty(self.config.bins),
            plays=np.zeros(n_cells, dtype=np.int64),
            claimants=empty(0),
            claimed=np.zeros(0, dtype=np.int64),
            claims=np.zeros(0),
            fittest=empty(1),
            fitness=float("nan"),
            start=empty(0),
        )

    def begin_with(
        self, layout: Layout, root: int, genes: FloatArray, active: BoolArray
    ) -> MapElitesState:
        """Return generation 0 around a team: children of generation 0 are varied copies of it.

        Choice: clones start from all its controllers in turn; whole teams from the team, whose
        robot r mod R' is the source of robot r.

        Args:
            layout: the size of the problem.
            root: the seed of every random decision.
            genes: [R', U, G] the team's genes.
            active: [R', U] its slots in use. Clones use those that any robot uses.
        """
        fresh = self.init(layout, root)
        team = (genes * active[..., None]).astype(np.float32)
        if self.config.team == "clones":
            used: BoolArray = active[:1] | active.any(axis=0)
            start = team.swapaxes(0, 1)[None]
        else:
            robot = np.arange(layout.n_robots) % len(genes)
            used, start = active[robot], team[robot][:, :, None]
        progress = replace(fresh.progress, n_hidden=np.asarray(used[0].sum())[None])
        return replace(fresh, progress=progress, active=used, start=start)

    def ask(self, state: MapElitesState) -> Trials:
        """Return the children; the elites whose cells are claimed; the fittest team."""
        if state.phase == "genotypes":
            return self._trials(state, self._children(state))
        if state.phase == "elites":
            return self._trials(state, state.genes[:, :, state.claimed])
        return self._trials(state, state.fittest)

    def tell(self, state: MapElitesState, trials: Trials, scores: Scores) -> MapElitesState:
        """Return the state after these scores."""
        is_first = state.phase == "genotypes"
        state = replace(state, progress=state.progress.counted(trials, scores, is_first=is_first))
        if state.phase == "fittest":
            progress = state.progress.crowned(trials, scores)
            progress = replace(progress, generation=progress.generation + 1)
            return replace(state, progress=progress, phase="genotypes")
        fitness = credit_of_team(scores.fitness)
        if state.phase == "elites":
            return self._settled(state, fitness)
        state = replace(state, progress=state.progress.graded(fitness))
        return self._claimed(state, self._children(state), fitness, scores)

    def _claimed(
        self, state: MapElitesState, children: FloatArray, fitness: FloatArray, scores: Scores
    ) -> MapElitesState:
        """Return the state with children in empty cells, and claims on those that have elites."""
        cell = state.map.cells(describe(scores, self.config.behaviour))
        best = state.map.candidates(cell, fitness)
        first = ranking(fitness)[:1]
        state = replace(
            state,
            claimants=children[:, :, best],
            claimed=cell[best],
            claims=fitness[best],
            fittest=children[:, :, first],
            fitness=float(fitness[first[0]]) if len(best) else float("nan"),
        )
        is_empty = np.isnan(state.map.fitness[state.claimed])
        if self.config.rematch:
            return self._moved_in(state, is_empty)
        return self._moved_in(state, is_empty | (state.claims > state.map.fitness[state.claimed]))

    def _settled(self, state: MapElitesState, fitness: FloatArray) -> MapElitesState:
        """Return the state after elites have played against claimants; fitness [K] of the elites.

        Choice: a score that is not finite does not change an elite's mean, and loses the match.
        """
        known, cell = np.isfinite(fitness), state.claimed
        wins = (state.claims > fitness) | ~known
        best = ranking(fitness)[0]
        if known[best] and not state.fitness >= fitness[best]:
            fittest = state.genes[:, :, cell[best : best + 1]]
            state = replace(state, fittest=fittest, fitness=float(fitness[best]))
        plays = state.plays.copy()
        plays[cell] += known
        mean, old = state.map.fitness.copy(), state.map.fitness[cell]
        mean[cell] = np.where(known, old + (fitness - old) / plays[cell], old)
        return self._moved_in(replace(state, plays=plays, map=TeamMap(mean)), wins)

    def _moved_in(self, state: MapElitesState, wins: BoolArray) -> MapElitesState:
        """Return the state with the claimants that win in their cells, and the next phase."""
        cell = state.claimed[wins]
        genes, fitness = state.genes.copy(), state.map.fitness.copy()
        plays = state.plays.copy()
        genes[:, :, cell] = state.claimants[:, :, wins]
        fitness[cell], plays[cell] = state.claims[wins], 1
        found = TeamMap(fitness)
        waits = ~wins & (state.phase == "genotypes") & self.config.rematch
        progress = state.progress.with_numbers(**found.numbers())
        return replace(
            state,
            progress=progress,
            phase="elites" if waits.any() else "fittest",
            genes=genes,
            map=found,
            plays=plays,
            claimants=state.claimants[:, :, waits],
            claimed=state.claimed[waits],
            claims=state.claims[waits],
        )

    def _children(self, state: MapElitesState) -> FloatArray:
        """Return the children [P, U, M, G] of this generation."""
        m, generation = self.config.genotypes, state.progress.generation
        generator = stream(state.progress.root, "children", generation)
        filled = np.flatnonzero(np.isfinite(state.map.fitness))
        parents = state.genes[:, :, filled] if len(filled) else state.start
        used = state.active[:, :, None, None]
        if not parents.shape[2]:
            shape = (*state.active.shape, m, state.genes.shape[3])
            return random_genes(generator, shape) * used
        x, y = generator.integers(parents.shape[2], size=(2, m))
        children = iso_line(
            parents[:, :, x], parents[:, :, y], self.config.iso, self.config.line, generator
        )
        if not len(filled):  # the team itself is among its varied copies
            n = min(m, parents.shape[2])
            children[:, :, :n] = parents[:, :, :n]
        return children * used

    def _trials(self, state: MapElitesState, genes: FloatArray) -> Trials:
        """Return genotypes [P, U, N, G] as trials."""
        n, n_robots = genes.shape[2], state.progress.fittest_fitness.size
        teams = rows(state.active, np.tile(np.arange(n)[:, None, None], (len(genes), 1)), n)
        is_last = state.phase == "fittest"
        return Trials(
            generation=state.progress.generation,
            genes=genes.reshape(-1, genes.shape[3]),
            teams=filled(teams, n_robots),
            scenarios="fixed" if is_last else "fresh",
            portrait=is_last,
            purpose=state.phase,
        )


def iso_line(
    x: FloatArray, y: FloatArray, iso: float, line: float, generator: np.random.Generator
) -> FloatArray:
    """Return x + iso * N(0, I) + line * N(0, 1) (y - x), limited to [-1, 1], [P, U, M, G] float32.

    Vassiliades and Mouret 2018, equation 1: each child has one number for its step on the line.

    Args:
        x, y: [P, U, M, G] both parents of each child.
        iso: standard deviation of the noise.
        line: standard deviation of the step along the line, in lengths of it.
        generator: the source of both.
    """
    noise = np.float32(iso) * generator.standard_normal(x.shape, dtype=np.float32)
    along = np.float32(line) * generator.standard_normal((x.shape[2], 1), dtype=np.float32)
    child: FloatArray = np.clip(x + noise + along * (y - x), -1.0, 1.0).astype(np.float32)
    return child
