"""Hyb-CCEA: CCGA with a number of populations that adapts, by merging and splitting.

Gomes, Mariano and Christensen 2015, "Cooperative coevolution of partially heterogeneous multiagent
systems", and 2018; asked for in Nitschke 2009, section 7.2. Robots form groups. The robots of a
group share one population, and in a team they are clones of the genotype that is drawn from it. Two
groups merge when their robots behave alike and their genotypes look alike. A group splits at random
when the fittest team stagnates. Each half keeps a copy of the population, and they drift apart.

We have only the abstract of the source, and descriptions of it by others. These are choices:

Choice: behaviour is what CONE's "shares" compares, how a robot divides its life among actions, as a
mean over the teams of a generation in which an elite genotype was on trial. The distance of two
groups is less than ``merge_below`` if they behave alike.
Choice: genotypes look alike if the mean GD (eq. 3.3) of their rank-paired elites is below ``gst``;
by default it is of no account, because independent populations find different networks that do the
same.
Choice: a merged population has M genotypes: the best of each group's elite, in turn, then bred.
Every team of a generation still tries a genotype, so a group of g robots has g times the evidence
for each of its genotypes, at the cost of CCGA. The source lets the cost fall instead.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Le

from conevo.errors import UsageError
from conevo.evolution.assembly import best_team, shared, systematic
from conevo.evolution.generation import (
    Populations,
    advance,
    begin,
    count,
    crown,
    grade,
    note,
    pool,
    push,
    trials,
)
from conevo.evolution.methods.ccga import CcgaConfig, CcgaState, type_a
from conevo.evolution.population import elite_count, genotype_distance, join, ranking, split
from conevo.evolution.protocol import BoolArray, FloatArray, IntArray, Layout, Scores, Trials
from conevo.evolution.regulation import trend
from conevo.evolution.selection import shares_distance
from conevo.evolution.variation import breed
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["HybCcea", "HybCceaConfig", "HybCceaState"]


@parameters("method")
class HybCceaConfig(CcgaConfig):
    """Parameters of Hyb-CCEA: those of CCGA and its own."""

    start: Literal["robots", "one"] = "robots"
    """groups at the start: one for each of the "robots", as in the source, or "one" for all, as in
    section 7.2."""
    merge_below: Annotated[float, Ge(0), Le(1)] = 0.1
    """difference between the behaviours of two groups below which they merge; 0: they never do.
    Choice: 0.1, a tenth of a robot's life."""
    gst: Annotated[float, Ge(0), Le(1)] = 1.0
    """genotype distance of two groups below which they merge; 1: genotypes do not matter."""
    stagnation_v: Annotated[int, Ge(1), Le(100_000)] = 15
    """generations without progress of the fittest team before a group splits, and generations
    between two changes of the groups (as CONE's V, table 5.5: 15)."""


@dataclass(frozen=True)
class HybCceaState(CcgaState):
    """State of Hyb-CCEA. The populations of a group's robots are copies of each other.

    Attributes:
        group: [R] int64 the first robot of each robot's group.
        behaviour: [R, A] float64 share of each action, of elite genotypes on trial; A = 0 before a
            generation is graded.
        past_fitness: [V + 1] float64 mean credit of the fittest team in the last generations, the
            newest last; NaN before the first.
        changed: the generation in which groups last changed, 0 at the start.
    """

    group: IntArray
    behaviour: FloatArray
    past_fitness: FloatArray
    changed: int

    def problem(self, first: Populations) -> str:
        """Return the first field that is not valid in a state between generations, if any."""
        robots = np.arange(len(self.group))
        if self.group.shape != robots.shape or not (self.group <= robots).all():
            return "group"
        if (self.group < 0).any() or (self.group[self.group] != self.group).any():
            return "group"
        if len(self.behaviour) != len(self.group) or not (self.behaviour >= 0).all():
            return "behaviour"
        if not 0 <= self.changed <= self.generation:
            return "changed"
        assert isinstance(first, HybCceaState)
        return Populations.problem(replace(self, behaviour=first.behaviour), first)


@dataclass(frozen=True)
class HybCcea:
    """CCGA whose populations merge and split; see the module."""

    config: HybCceaConfig = field(default_factory=HybCceaConfig)
    name: str = "hyb-ccea"
    title: str = "Hyb-CCEA"

    def init(self, layout: Layout, root: int) -> HybCceaState:
        """Return generation 0 with random genotypes."""
        config, n_robots = self.config, layout.n_robots
        nobody = (n_robots, layout.max_hidden, 0, layout.n_genes)
        is_one = config.start == "one"
        return begin(
            HybCceaState,
            layout,
            root,
            n_populations=n_robots,
            n_genotypes=config.genotypes,
            networks=True,
            common_start=config.common_start or is_one,
            partners=np.zeros(nobody, dtype=np.float32),
            group=np.arange(n_robots) * (not is_one),
            behaviour=np.zeros((n_robots, 0)),
            past_fitness=np.full(config.stagnation_v + 1, np.nan),
            changed=0,
        )

    def ask(self, state: HybCceaState) -> Trials:
        """Return the teams that try every genotype, then the fittest team."""
        config, m = self.config, self.config.genotypes
        if state.phase == "fittest":
            return trials(state, best_team(state.active, state.elite[:, None], m))
        generator = stream(state.root, "teams", state.generation)
        if config.evaluation == "shared":
            teams = shared(state.active, m, config.rounds, generator, networks=True)
            source = np.broadcast_to(state.group, teams.shape[:2])
            teams = _as_clones(teams, source, m, 0)
            return trials(state, teams, rounds=config.n_parts)
        n_partners = state.partners.shape[2]
        teams = systematic(state.active, m, generator, n_partners, networks=True)
        on_trial = np.arange(len(state.group)).repeat(m)[:, None]
        source = np.where(state.group[on_trial] == state.group, on_trial, state.group)
        teams = _as_clones(teams, source, m, n_partners)
        return trials(state, teams, pool(state, state.partners))

    def tell(self, state: HybCceaState, trials: Trials, scores: Scores) -> HybCceaState:
        """Return the state after these scores.

        Raises:
            UsageError: the scores have no shares of actions.
        """
        state = count(state, trials, scores)
        if state.phase == "genotypes":
            return self._graded(state, trials, scores)
        past = push(state.past_fitness, np.mean(scores.fitness[0]))
        state = crown(state, trials, scores, past_fitness=past)
        return self._next(state)

    def _graded(self, state: HybCceaState, trials: Trials, scores: Scores) -> HybCceaState:
        """Return the state with its elite and its robots' behaviour.

        The fitness that ranks a genotype of a group is the mean over the copies of it.
        """
        if scores.shares is None:
            raise UsageError("hyb-ccea needs scores.shares, the activity of each robot")
        config, m = self.config, self.config.genotypes
        n_elite = elite_count(config.elite_portion, m)
        fitness = type_a(config, state, trials, scores)
        state = grade(state, fitness, n_elite, phase="fittest")
        with np.errstate(invalid="ignore"):
            by_group = np.stack([fitness[state.group == one].mean(axis=0) for one in state.group])
        elite = ranking(by_group)[:, :n_elite]
        behaviour = _behaviour(trials.teams, scores.shares, elite, state.active, m)
        return replace(state, elite=elite, behaviour=behaviour)

    def _next(self, state: HybCceaState) -> HybCceaState:
        """Return the next generation: groups changed if it is time, then bred."""
        config = self.config
        group, pair = state.group, None
        if state.generation - state.changed >= config.stagnation_v:
            pair = self.pair(state)
            if pair is not None:
                group = np.where(group == pair[1], pair[0], group)
            elif state.generation >= config.stagnation_v and not trend(state.past_fitness) > 0:
                group = _parted(group, stream(state.root, "split", state.generation))
        state = note(state, populations=float(len(np.unique(group))))
        networks = join(state.genes, int(state.progress.n_hidden[0]))  # [R, M, L]
        if pair is not None:
            state, networks = self._pooled(state, networks, pair)
        first, of_robot = np.unique(group, return_inverse=True)
        generator = stream(state.root, "breed", state.generation)
        children = breed(networks[first], state.elite[first], generator, config)[of_robot]
        _, n_slots, _, n_genes = state.genes.shape
        changes: dict[str, Any] = (
            {} if (group == state.group).all() else {"changed": state.generation}
        )
        if config.has_elite_partners:
            elites = np.take_along_axis(networks, state.elite[:, :, None], axis=1)
            changes |= {"partners": split(elites, n_slots, n_genes)}
        genes = split(children, n_slots, n_genes)
        return advance(state, genes, state.active, group=group, **changes)

    def pair(self, state: HybCceaState) -> tuple[int, int] | None:
        """Return the first robots of the two groups that merge, the most alike; None if none do."""
        first = np.unique(state.group)
        i, j = np.triu_indices(len(first), k=1)
        if not len(i):
            return None
        mean = np.stack([state.behaviour[state.group == one].mean(axis=0) for one in first])
        apart = shares_distance(mean)[i, j]
        elites = np.take_along_axis(
            join(state.genes, int(state.progress.n_hidden[0]))[first],
            state.elite[first][:, :, None],
            axis=1,
        ).reshape(len(first), -1)
        looks_alike = genotype_distance(elites[i], elites[j]) < self.config.gst
        alike = (apart < self.config.merge_below) & (looks_alike | (self.config.gst == 1))
        if not alike.any():
            return None
        k = int(np.argmin(np.where(alike, apart, np.inf)))
        return int(first[i[k]]), int(first[j[k]])

    def _pooled(
        self, state: HybCceaState, networks: FloatArray, pair: tuple[int, int]
    ) -> tuple[HybCceaState, FloatArray]:
        """Return the state and networks [R, M, L] with one elite for both groups of a pair.

        Their elites take turns, the fittest of each first, and fill the first places.
        """
        networks, elite = networks.copy(), state.elite.copy()
        n_elite = elite.shape[1]
        both = np.stack([networks[one, state.elite[one]] for one in pair], axis=1)  # [L, 2, ...]
        members = np.isin(state.group, pair)
        networks[members, :n_elite] = both.reshape(2 * n_elite, -1)[:n_elite]
        elite[members] = np.arange(n_elite)
        return replace(state, elite=elite), networks


def _as_clones(teams: IntArray, source: IntArray, m: int, n_partners: int) -> IntArray:
    """Return teams [N, R, U] in which each robot has the genotype of its source, of its own copies.

    Args:
        teams: pool rows; those of the partners come after those of the populations.
        source: [N, R] robot whose genotype each robot gets.
        m: M, genotypes in a population.
        n_partners: L, partners of each population in the pool.
    """
    _, n_robots, n_slots = teams.shape
    found = np.take_along_axis(teams, source[:, :, None], axis=1)
    is_partner = found >= n_robots * n_slots * m
    shift = (np.arange(n_robots) - source)[:, :, None] * n_slots
    moved = found + shift * np.where(is_partner, n_partners, m)
    clones: IntArray = np.where(found < 0, np.int32(-1), moved).astype(np.int32)
    return clones


def _behaviour(
    teams: IntArray, shares: FloatArray, elite: IntArray, active: BoolArray, m: int
) -> FloatArray:
    """Return the mean shares [R, A] of each robot over the teams in which its genotype is elite.

    Args:
        teams: [N, R, U] pool rows.
        shares: [N, R, A] of these teams.
        elite: [R, L] elite genotypes.
        active: [R, U] slots in use; the first is always used.
        m: M.
    """
    n_robots, n_slots = active.shape
    genotype = teams[:, :, 0] - np.arange(n_robots) * n_slots * m
    is_elite = np.zeros((n_robots, m), dtype=np.bool_)
    np.put_along_axis(is_elite, elite.astype(np.intp), True, axis=1)
    inside = (genotype >= 0) & (genotype < m)
    counts = inside & is_elite[np.arange(n_robots), np.where(inside, genotype, 0)]
    total = np.einsum("nr,nra->ra", counts, shares)
    mean: FloatArray = total / counts.sum(axis=0)[:, None]
    return mean


def _parted(group: IntArray, generator: np.random.Generator) -> IntArray:
    """Return groups [R] of which one with several robots, if any, has split at random.

    Choice: all such groups are equally likely, and so are all sizes of the part that leaves.
    """
    first, size = np.unique(group, return_counts=True)
    large = first[size > 1]
    if not len(large):
        return group
    robots = np.flatnonzero(group == generator.choice(large))
    leaving = generator.permutation(robots)[: generator.integers(1, len(robots))]
    parted = group.copy()
    for part in (leaving, np.setdiff1d(robots, leaving)):
        parted[part] = part.min()
    return parted
