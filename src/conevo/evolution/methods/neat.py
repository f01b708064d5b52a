"""NEAT, neuro-evolution of augmenting topologies: networks that start minimal and grow.

Stanley and Miikkulainen 2002, "Evolving neural networks through augmenting topologies". Networks
start with connections from all inputs to all outputs. Mutations add nodes and connections, whose
historical markings align genotypes for crossover. Species of similar genotypes compete among
themselves and share fitness, so that new structure has time to adjust its weights.

Each generation is one of four steps: every genotype plays as a team; the fittest plays once more in
the fixed scenarios; species get children in proportion to their shared fitness; the children are
divided into species by their distance from a random member of each species of their parents.

For teams a genotype is one network, of which all robots are clones, or a whole team: R networks
that are marked, crossed and compared as one genotype (Nitschke 2009, figure 2.5).

Choice: ``threshold`` adapts to keep a number of species, as in Stanley's later work; the article
has a fixed one for each task.
Choice: the species of a generation's fittest genotype always has children.
Choice: whether the whole population stagnates is judged by its fittest team in the fixed scenarios,
the only ones that are the same in all generations.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from conevo.errors import UsageError
from conevo.evolution.population import ranking
from conevo.evolution.protocol import (
    BoolArray,
    FloatArray,
    IntArray,
    Layout,
    Progress,
    Scores,
    Trials,
)
from conevo.evolution.species import Compatibility, aligned, offspring, speciate
from conevo.evolution.topology import (
    Graphs,
    Innovations,
    Sizes,
    add_connection,
    add_node,
    cross,
    marked,
    minimal,
)
from conevo.evolution.whole import TeamConfig, credit_of_team, filled
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["Neat", "NeatConfig", "NeatState"]

STEEPER, NARROWEST, WIDEST = 1.1, 1e-3, 1e3  # steps and limits of the threshold


@parameters("method")
class NeatConfig(TeamConfig):
    """Parameters of NEAT. Defaults are those of the article's appendix A, with weights as genes."""

    genotypes: Annotated[int, Ge(2), Le(1_000_000)] = 150
    """M, networks, or whole teams, in the population; each costs one team evaluation."""
    recurrent: bool = True
    """whether connections against the order of nodes may be added; without them networks are
    feed-forward."""
    elite_portion: Annotated[float, Gt(0), Le(1)] = 0.2
    """portion of each species that has children. Choice: 0.2; the article eliminates "the lowest
    performing members"."""
    crossover: Annotated[float, Ge(0), Le(1)] = 0.75
    """probability that a child has two parents."""
    between_species: Annotated[float, Ge(0), Le(1)] = 0.001
    """probability that the second of them is from any species."""
    stay_disabled: Annotated[float, Ge(0), Le(1)] = 0.75
    """probability that a connection is disabled in a child if it is in one of its parents."""
    weight_mutation: Annotated[float, Ge(0), Le(1)] = 0.8
    """probability that the weights of a child are mutated."""
    replacement: Annotated[float, Ge(0), Le(1)] = 0.1
    """probability that a weight is then drawn again; otherwise it is perturbed."""
    perturbation: Annotated[float, Gt(0), Le(2)] = 0.25
    """(genes) largest perturbation of a weight; it is uniform. Choice: an eighth of the range."""
    new_node: Annotated[float, Ge(0), Le(1)] = 0.03
    """probability that a child gets a new node."""
    new_connection: Annotated[float, Ge(0), Le(1)] = 0.05
    """probability that a child gets a new connection; 0.3 in the article's large population."""
    split_weight: Annotated[float, Ge(-1), Le(1)] = 0.5
    """gene of the connection into a new node. Choice: the article's weight of 1 with its sigmoid of
    slope 4.9 is that of a gene of 0.5 with ``controller.weight_scale`` 10."""
    excess: Annotated[float, Ge(0), Le(100)] = 1.0
    """c1, of the compatibility distance."""
    disjoint: Annotated[float, Ge(0), Le(100)] = 1.0
    """c2, of the compatibility distance."""
    weights: Annotated[float, Ge(0), Le(100)] = 0.4
    """c3, of the compatibility distance; weights count as genes."""
    small: Annotated[int, Ge(0), Le(1_000_000)] = 20
    """(connections) the number of differences is not divided by the size of the larger genotype
    below this size."""
    threshold: Annotated[float, Gt(0), Le(100)] = 3.0
    """largest distance within a species, in the first generation."""
    species: Annotated[int, Ge(0), Le(10_000)] = 10
    """species that the threshold aims at; it changes by a tenth in a generation with more or fewer.
    0: it stays as it is. Choice: 10."""
    stagnation_species: Annotated[int, Ge(1), Le(1_000_000)] = 15
    """(generations) a species whose best fitness has not risen for longer has no children."""
    stagnation_all: Annotated[int, Ge(1), Le(1_000_000)] = 20
    """(generations) if the fittest team has not improved for longer, only the two best species have
    children."""
    champion_of: Annotated[int, Ge(0), Le(1_000_000)] = 5
    """(genotypes) the fittest genotype of a larger species is copied unchanged."""


@dataclass(frozen=True)
class NeatState:
    """State of NEAT.

    Attributes:
        progress: the header.
        phase: "genotypes", or "fittest".
        graphs: M genotypes.
        fitness: [M] float64 of this generation.
        species: [M] int32 the species of each genotype, 0 to Q - 1.
        record: [Q] float64 the best fitness that each species has had; -inf at first.
        since: [Q] int64 the generation of that record, or of the species' foundation.
        best: the best fitness of a fittest team in the fixed scenarios; -inf at first.
        best_since: the generation of that team.
        threshold: of the compatibility distance.
        next_mark: the next historical marking of a connection.
        next_node: the next historical marking of a node.
        n_outputs: O.
    """

    progress: Progress
    phase: str
    graphs: Graphs
    fitness: FloatArray
    species: IntArray
    record: FloatArray
    since: IntArray
    best: float
    best_since: int
    threshold: float
    next_mark: int
    next_node: int
    n_outputs: int

    def problem(self, first: NeatState) -> str:
        """Return the first field that is not valid in a state between generations, if any."""
        if name := self.graphs.problem(first.graphs, self.next_mark):
            return name
        n = len(self.record)
        for name in ("fitness", "species"):
            if getattr(self, name).shape != (len(self.graphs.nodes),):
                return name
        if self.species.min() < 0 or self.species.max() >= n or self.since.shape != (n,):
            return "species"
        if not NARROWEST <= self.threshold <= WIDEST:
            return "threshold"
        return "" if self.phase == first.phase else "phase"


@dataclass(frozen=True)
class Neat:
    """Neuro-evolution of augmenting topologies; see the module."""

    config: NeatConfig = field(default_factory=NeatConfig)
    name: str = "neat"
    title: str = "NEAT"
    n_further: int = 0  # genes of a node that only another method reads

    def init(self, layout: Layout, root: int) -> NeatState:
        """Return generation 0: networks without hidden nodes, with random weights.

        Raises:
            UsageError: the layout is not that of the controller "graph".
        """
        sizes = self.sizes(layout)
        graphs, marks = minimal(sizes, self.config.genotypes, stream(root, "genotypes"))
        return self._first(layout, root, sizes, graphs, marks)

    def begin_with(
        self, layout: Layout, root: int, genes: FloatArray, active: BoolArray
    ) -> NeatState:
        """Return generation 0 around a team: all genotypes are it, all but the first mutated.

        Choice: clones are those of its first robot. In a larger team its robots take turns.

        Args:
            layout: the size of the problem.
            root: the seed of every random decision.
            genes: [R', U, G] the team's genes.
            active: [R', U] its slots in use.

        Raises:
            UsageError: as ``init``.
        """
        sizes = self.sizes(layout)
        source = np.arange(sizes.n_networks) % len(genes)
        one, marks = marked(genes[source], active[source], sizes)
        graphs = one[np.zeros(self.config.genotypes, dtype=np.int64)]
        self._mutate_weights(graphs, 1, stream(root, "champion"))
        return self._first(layout, root, sizes, graphs, marks)

    def continued(
        self, layout: Layout, root: int, graphs: Graphs, next_mark: int, next_node: int
    ) -> NeatState:
        """Return generation 0 with the genotypes of another run.

        Args:
            layout: the size of the problem.
            root: the seed of every random decision.
            graphs: M genotypes.
            next_mark: the next historical marking of a connection.
            next_node: the next historical marking of a node.

        Raises:
            UsageError: as ``init``.
        """
        marks = Innovations(next_mark, next_node)
        return self._first(layout, root, self.sizes(layout), graphs, marks)

    def _first(
        self, layout: Layout, root: int, sizes: Sizes, graphs: Graphs, marks: Innovations
    ) -> NeatState:
        """Return generation 0 with some genotypes."""
        first = Progress.first(layout, root)
        state = NeatState(
            progress=replace(first, n_hidden=_mean_nodes(graphs, sizes)),
            phase="genotypes",
            graphs=graphs,
            fitness=np.full(self.config.genotypes, np.nan),
            species=np.zeros(self.config.genotypes, dtype=np.int32),
            record=np.full(0, -np.inf),
            since=np.zeros(0, dtype=np.int64),
            best=-np.inf,
            best_since=0,
            threshold=self.config.threshold,
            next_mark=marks.next_mark,
            next_node=marks.next_node,
            n_outputs=layout.n_outputs,
        )
        return self._divided(state, graphs, graphs[:0])

    def sizes(self, layout: Layout) -> Sizes:
        """Return the room of a genotype.

        Raises:
            UsageError: as ``init``.
        """
        sizes = Sizes(
            n_networks=self.config.n_networks(layout),
            n_inputs=layout.n_inputs,
            n_outputs=layout.n_outputs,
            n_slots=layout.max_hidden,
            n_further=self.n_further,
        )
        if not 1 <= sizes.n_outputs <= sizes.n_slots or sizes.n_genes != layout.n_genes:
            raise UsageError(f"{self.title} needs the layout of controller 'graph', not {layout}")
        return sizes

    def _sizes_in(self, state: NeatState) -> Sizes:
        """Return the room of a state's genotypes."""
        _, n_slots, n_genes = state.progress.fittest_genes.shape
        n_networks = state.graphs.nodes.shape[1] // n_slots
        n_inputs = n_genes - n_slots - 2 - self.n_further
        return Sizes(n_networks, n_inputs, state.n_outputs, n_slots, self.n_further)

    def ask(self, state: NeatState) -> Trials:
        """Return a team of every genotype, then of the fittest."""
        graphs = state.graphs
        if state.phase == "fittest":
            graphs = graphs[ranking(state.fitness)[:1]]
        n_robots, n_slots, n_genes = state.progress.fittest_genes.shape
        every = np.arange(graphs.nodes.size, dtype=np.int32).reshape(graphs.nodes.shape)
        used = np.where(graphs.nodes >= 0, every, np.int32(-1))
        rows = used.reshape(len(used), -1, n_slots)
        is_last = state.phase == "fittest"
        return Trials(
            generation=state.progress.generation,
            genes=graphs.expressed().reshape(-1, n_genes),
            teams=filled(rows, n_robots),
            scenarios="fixed" if is_last else "fresh",
            portrait=is_last,
            purpose=state.phase,
        )

    def tell(self, state: NeatState, trials: Trials, scores: Scores) -> NeatState:
        """Return the state after these scores."""
        is_first = state.phase == "genotypes"
        progress = state.progress.counted(trials, scores, is_first=is_first)
        fitness = credit_of_team(scores.fitness)
        if is_first:
            fitness = np.where(np.isfinite(fitness), fitness, np.nan)
            progress = progress.graded(fitness)
            return replace(state, progress=progress, phase="fittest", fitness=fitness)
        progress = progress.crowned(trials, scores).with_numbers(
            species=len(state.record),
            threshold=state.threshold,
            connections=float(state.graphs.n_connections.mean()),
        )
        state = replace(state, progress=progress)
        if np.isfinite(fitness[0]) and fitness[0] > state.best:
            generation = progress.generation
            state = replace(state, best=float(fitness[0]), best_since=generation)
        return self._next(state)

    def _next(self, state: NeatState) -> NeatState:
        """Return the first state of the next generation."""
        config, generation = self.config, state.progress.generation
        generator = stream(state.progress.root, "breed", generation)
        fitness, species, n_species = state.fitness, state.species, len(state.record)
        lowest = np.nanmin(fitness) if np.isfinite(fitness).any() else 0.0
        shifted = np.where(np.isfinite(fitness), fitness - lowest, 0.0)
        record = state.record.copy()
        np.maximum.at(record, species, np.where(np.isfinite(fitness), fitness, -np.inf))
        since = np.where(record > state.record, generation, state.since)
        state = replace(state, record=record, since=since)
        allowed = self._allowed(state, shifted)
        count = offspring(shifted, species, allowed, config.genotypes)
        order = ranking(fitness)
        members = [order[species[order] == k] for k in range(n_species)]
        parents = [some[: max(1, int(config.elite_portion * len(some) + 0.5))] for some in members]
        kept = [
            int(some[0])
            for some, n in zip(members, count, strict=True)
            if n and len(some) > config.champion_of
        ]
        count = count - np.bincount(species[kept], minlength=n_species)
        pairs = self._pairs(state, parents, np.repeat(np.arange(n_species), count), generator)
        innovations = Innovations(state.next_mark, state.next_node)
        children = cross(state.graphs, *pairs, config.stay_disabled, generator)
        sizes = self._sizes_in(state)
        self._grow(children, sizes, innovations, generator)
        self._mutate_weights(children, 0, generator)
        graphs = Graphs.joined([state.graphs[np.array(kept, dtype=np.int64)], children])
        drawn = [int(some[generator.integers(len(some))]) for some in members]
        chosen = state.graphs[np.array(drawn)]
        progress = replace(
            state.progress,
            generation=generation + 1,
            n_hidden=_mean_nodes(graphs, sizes),
        )
        state = replace(
            state,
            progress=progress,
            phase="genotypes",
            next_mark=innovations.next_mark,
            next_node=innovations.next_node,
            fitness=np.full(config.genotypes, np.nan),
        )
        return self._divided(state, graphs, chosen)

    def _allowed(self, state: NeatState, shifted: FloatArray) -> BoolArray:
        """Return the species [Q] that may have children."""
        config, generation = self.config, state.progress.generation
        best = np.zeros(len(state.record))
        np.maximum.at(best, state.species, shifted)
        order = ranking(best)
        if generation - state.best_since > config.stagnation_all:
            allowed: BoolArray = np.isin(np.arange(len(order)), order[:2])
            return allowed
        allowed = generation - state.since <= config.stagnation_species
        allowed[order[0]] = True
        return allowed

    def _pairs(
        self,
        state: NeatState,
        parents: list[IntArray],
        species: IntArray,
        generator: np.random.Generator,
    ) -> tuple[IntArray, IntArray]:
        """Return the fitter and the other parent of each child, [N] each.

        Args:
            state: the generation that ends.
            parents: the genotypes of each species that have children.
            species: [N] of each child.
            generator: the source of all random numbers.
        """
        everyone = np.concatenate(parents)
        size = np.array([len(some) for some in parents])
        start = np.cumsum(size) - size
        first, second, wide, mates, strays = generator.random((5, len(species)))
        one, two = (
            everyone[start[species] + (share * size[species]).astype(np.int64)]
            for share in (first, second)
        )
        anyone = everyone[(wide * len(everyone)).astype(np.int64)]
        two = np.where(strays < self.config.between_species, anyone, two)
        two = np.where(mates < self.config.crossover, two, one)
        fitness = np.where(np.isfinite(state.fitness), state.fitness, -np.inf)
        n_connections = state.graphs.n_connections
        is_smaller = (fitness[two] == fitness[one]) & (n_connections[two] < n_connections[one])
        is_fitter = (fitness[two] > fitness[one]) | is_smaller
        return np.where(is_fitter, two, one), np.where(is_fitter, one, two)

    def _grow(
        self,
        children: Graphs,
        sizes: Sizes,
        innovations: Innovations,
        generator: np.random.Generator,
    ) -> None:
        """Add nodes and connections to some of the children, in place."""
        config = self.config
        in_order = not config.recurrent
        grows, links = generator.random((2, len(children.nodes)))
        for k in np.flatnonzero(grows < config.new_node).tolist():
            weight = config.split_weight
            add_node(children, k, sizes, weight, innovations, generator, in_order=in_order)
        for k in np.flatnonzero(links < config.new_connection).tolist():
            add_connection(children, k, sizes, innovations, generator, in_order=in_order)

    def _mutate_weights(self, graphs: Graphs, n_kept: int, generator: np.random.Generator) -> None:
        """Mutate the weights of all genotypes but the first ``n_kept``, in place."""
        config, n_feeds = self.config, graphs.marks.shape[2]
        changed = generator.random(len(graphs.nodes)) < config.weight_mutation
        changed[:n_kept] = False
        at = np.nonzero((graphs.marks >= 0) & changed[:, None, None])
        old = graphs.genes[..., :n_feeds][at]
        drawn = generator.uniform(-1, 1, len(old))
        is_new = generator.random(len(old)) < config.replacement
        moved = np.clip(old + config.perturbation * drawn, -1, 1)
        graphs.genes[..., :n_feeds][at] = np.where(is_new, drawn, moved).astype(np.float32)

    def _divided(self, state: NeatState, graphs: Graphs, chosen: Graphs) -> NeatState:
        """Return the state with new genotypes, divided into species.

        Args:
            state: with the parents' species.
            graphs: the new genotypes.
            chosen: [Q] a representative of each species of the parents.
        """
        config = self.config
        coefficients = Compatibility(config.excess, config.disjoint, config.weights, config.small)
        found = speciate(aligned(graphs), aligned(chosen), coefficients, state.threshold)
        alive, species = np.unique(found, return_inverse=True)
        n_new = max(int(alive[-1]) + 1 - len(state.record), 0)
        record = np.concatenate([state.record, np.full(n_new, -np.inf)])
        founded = np.full(n_new, state.progress.generation, dtype=np.int64)
        since = np.concatenate([state.since, founded])
        threshold = state.threshold
        if config.species and len(alive) != config.species:
            threshold *= STEEPER if len(alive) > config.species else 1 / STEEPER
            threshold = float(np.clip(threshold, NARROWEST, WIDEST))
        return replace(
            state,
            graphs=graphs,
            species=species.astype(np.int32),
            record=record[alive],
            since=since[alive],
            threshold=threshold,
        )


def _mean_nodes(graphs: Graphs, sizes: Sizes) -> IntArray:
    """Return the mean number of nodes of a network, rounded, [1]."""
    mean = (graphs.nodes >= 0).sum() / (len(graphs.nodes) * sizes.n_networks)
    return np.array([int(mean + 0.5)], dtype=np.int64)
