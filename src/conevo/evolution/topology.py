"""Genotypes that are networks of any topology, with historical markings, and their variation.

Stanley and Miikkulainen 2002, sections 3.1, 3.2 and 3.4, appendix A. A new connection or node gets
the next number, its historical marking, which its copies in other genotypes keep. Equal markings
have an equal origin, so genotypes of different topology can be aligned without analysis. The same
change in several genotypes of one generation gets the same marking.

The genes are those of ``controllers.graph``: for each node the weights of its connections from S
inputs, from a bias and from U nodes, further genes of the node, and last its place in the order of
evaluation. A genotype contains T networks that share only the genotype.

Choice: of two equally fit parents the one with fewer connections counts as the fitter one, as in
Stanley's own program; the article inherits disjoint and excess genes of both at random. A child
then never has more nodes than there are slots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from conevo.evolution.population import random_genes
from conevo.evolution.protocol import BoolArray, FloatArray, IntArray

__all__ = [
    "Graphs",
    "Innovations",
    "Sizes",
    "add_connection",
    "add_node",
    "cross",
    "marked",
    "minimal",
]

FIRST_PLACE, LAST_PLACE = np.float32(-1), np.float32(1)  # of inputs, of outputs


@dataclass(frozen=True)
class Sizes:
    """The room of a genotype.

    Attributes:
        n_networks: T, networks in a genotype.
        n_inputs: S.
        n_outputs: O, the first slots of a network.
        n_slots: U, slots for nodes of a network.
        n_further: further genes of a node, between its weights and its place.
    """

    n_networks: int
    n_inputs: int
    n_outputs: int
    n_slots: int
    n_further: int = 0

    @property
    def n_feeds(self) -> int:
        """F, possible sources of a node's connections: inputs, the bias, nodes of its network."""
        return self.n_inputs + 1 + self.n_slots

    @property
    def n_genes(self) -> int:
        """G, genes of a node."""
        return self.n_feeds + self.n_further + 1


@dataclass(frozen=True)
class Graphs:
    """Genotypes; the slots of all T networks follow one another, L = T U.

    Attributes:
        genes: [M, L, G] float32 in [-1, 1]; weights of disabled connections are kept.
        marks: [M, L, F] int32 historical markings of connections, -1 where there is none.
        enabled: [M, L, F] whether a connection is expressed.
        nodes: [M, L] int32 historical markings of nodes, -1 in an empty slot.
    """

    genes: FloatArray
    marks: IntArray
    enabled: BoolArray
    nodes: IntArray

    def __getitem__(self, some: Any) -> Graphs:
        """Return some of the genotypes."""
        return Graphs(*(getattr(self, one.name)[some] for one in fields(self)))

    def expressed(self) -> FloatArray:
        """Return the genes [M, L, G] of the networks: those of disabled connections are zero."""
        found = self.genes.copy()
        found[..., : self.marks.shape[2]] *= self.enabled
        return found

    @property
    def n_connections(self) -> IntArray:
        """Connections [M] of each genotype, disabled ones too."""
        counted: IntArray = (self.marks >= 0).sum(axis=(1, 2))
        return counted

    @staticmethod
    def joined(parts: Sequence[Graphs]) -> Graphs:
        """Return the genotypes of all parts in one."""
        names = [one.name for one in fields(Graphs)]
        return Graphs(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    def problem(self, first: Graphs, next_mark: int) -> str:
        """Return the first array that is not valid, given those of generation 0, if any."""
        for one in fields(self):
            if getattr(self, one.name).shape != getattr(first, one.name).shape:
                return one.name
        if not (np.abs(self.genes) <= 1).all():
            return "genes"
        if self.marks.min() < -1 or self.marks.max() >= next_mark:
            return "marks"
        return "enabled" if (self.enabled & (self.marks < 0)).any() else ""


@dataclass
class Innovations:
    """The markings that a generation hands out; the same change gets the same marking.

    Attributes:
        next_mark: of connections.
        next_node: of nodes.
    """

    next_mark: int
    next_node: int
    _connections: dict[tuple[int, int], int] = field(default_factory=dict)
    _nodes: dict[int, int] = field(default_factory=dict)

    def connection(self, source: int, target: int) -> int:
        """Return the marking of a connection between two nodes; inputs count from -1 downward."""
        if (source, target) not in self._connections:
            self._connections[source, target] = self.next_mark
            self.next_mark += 1
        return self._connections[source, target]

    def node(self, split: int) -> int:
        """Return the marking of the node that splits the connection with the given marking."""
        if split not in self._nodes:
            self._nodes[split] = self.next_node
            self.next_node += 1
        return self._nodes[split]


def minimal(sizes: Sizes, n: int, generator: np.random.Generator) -> tuple[Graphs, Innovations]:
    """Return genotypes without hidden nodes, and the markings in use.

    All inputs and the bias are connected to all outputs, with random weights (section 3.4).

    Args:
        sizes: the room of a genotype.
        n: M, their number.
        generator: the source of the weights.
    """
    t, s, o = sizes.n_networks, sizes.n_inputs, sizes.n_outputs
    shape = (n, t, sizes.n_slots)
    genes = np.zeros((*shape, sizes.n_genes), dtype=np.float32)
    marks = np.full((*shape, sizes.n_feeds), -1, dtype=np.int32)
    nodes = np.full(shape, -1, dtype=np.int32)
    genes[:, :, :o, : s + 1] = random_genes(generator, (n, t, o, s + 1))
    genes[:, :, :o, -1] = LAST_PLACE
    marks[:, :, :o, : s + 1] = np.arange(t * o * (s + 1)).reshape(t, o, s + 1)
    nodes[:, :, :o] = np.arange(t * o).reshape(t, o)
    flat = (n, t * sizes.n_slots)
    graphs = Graphs(
        genes.reshape(*flat, -1),
        marks.reshape(*flat, -1),
        (marks >= 0).reshape(*flat, -1),
        nodes.reshape(flat),
    )
    return graphs, Innovations(t * o * (s + 1), t * o)


def marked(genes: FloatArray, active: BoolArray, sizes: Sizes) -> tuple[Graphs, Innovations]:
    """Return a team as one genotype, [1], whose nodes and connections get new markings.

    Args:
        genes: [T, U, G] of its networks; a weight of 0 is not a connection.
        active: [T, U] its slots in use; output nodes exist in any case.
        sizes: the room of a genotype.
    """
    t, o, u = sizes.n_networks, sizes.n_outputs, sizes.n_slots
    is_output = np.arange(u) < o
    is_node = active | is_output
    is_hidden = is_node & ~is_output
    nodes = np.full(active.shape, -1, dtype=np.int32)
    nodes[:, :o] = np.arange(t * o).reshape(t, o)
    nodes[is_hidden] = t * o + np.arange(is_hidden.sum())
    genes = np.where(active[..., None], genes, np.float32(0)).astype(np.float32)
    genes[:, :o, -1] = LAST_PLACE
    exists = genes[..., : sizes.n_feeds] != 0
    exists[:, :, sizes.n_inputs + 1 :] &= is_node[:, None]
    genes[..., : sizes.n_feeds] *= exists
    marks = np.full(exists.shape, -1, dtype=np.int32)
    marks[exists] = np.arange(exists.sum())
    flat = (1, t * u)
    graphs = Graphs(
        genes.reshape(*flat, -1),
        marks.reshape(*flat, -1),
        exists.reshape(*flat, -1),
        nodes.reshape(flat),
    )
    return graphs, Innovations(int(exists.sum()), int(t * o + is_hidden.sum()))


def cross(
    graphs: Graphs,
    fitter: IntArray,
    other: IntArray,
    disabled: float,
    generator: np.random.Generator,
) -> Graphs:
    """Return one child of each pair of parents, [N]; one that is both parents is copied.

    Matching connections have the weight of either parent, at random. Disjoint and excess ones are
    those of the fitter parent (section 3.2, figure 4).

    Args:
        graphs: the parents' generation.
        fitter: [N] the fitter parent of each child.
        other: [N] the other parent.
        disabled: probability that a connection that is disabled in a parent is so in the child.
        generator: the source of all random numbers.
    """
    children = graphs[fitter]
    child, slot, feed = np.nonzero((children.marks >= 0) & (fitter != other)[:, None, None])
    marks = children.marks[child, slot, feed].astype(np.int64)
    n_marks = int(graphs.marks.max()) + 1
    owner, *place = np.nonzero(graphs.marks >= 0)
    keys = owner * n_marks + graphs.marks[owner, *place]  # genotype and marking in one number
    order = np.argsort(keys)
    wanted = other[child] * n_marks + marks
    at = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(order) - 1)]
    matches = keys[at] == wanted
    partner = owner[at], place[0][at], place[1][at]
    weights = children.genes[child, slot, feed]
    is_taken = matches & (generator.random(len(marks)) < 0.5)
    children.genes[child, slot, feed] = np.where(is_taken, graphs.genes[partner], weights)
    is_on = children.enabled[child, slot, feed] & (~matches | graphs.enabled[partner])
    is_on |= generator.random(len(marks)) >= disabled
    children.enabled[child, slot, feed] = is_on
    return children


def add_node(
    graphs: Graphs,
    child: int,
    sizes: Sizes,
    weight: float,
    innovations: Innovations,
    generator: np.random.Generator,
    *,
    in_order: bool,
) -> None:
    """Split a connection of a genotype, in place: a new node, two connections; the old is disabled.

    Section 3.1: the connection into the node gets a fixed weight, that out of it the weight of the
    old one, so that the network does at first almost what it did. Nothing happens without an
    expressed connection, or without a free slot in its network.

    Choice: the node's place is drawn from the middle half between the two nodes, so that two nodes
    that split the same connection have an order and can be connected.

    Args:
        graphs: genotypes, of which one is changed.
        child: its number.
        sizes: the room of a genotype.
        weight: gene of the connection into the new node.
        innovations: of this generation.
        generator: the source of all random numbers.
        in_order: whether the new node must have a place of its own, for feed-forward networks.
    """
    genes, marks, enabled, nodes = (getattr(graphs, one.name)[child] for one in fields(graphs))
    slots, feeds = np.nonzero(enabled)
    if not len(slots):
        return
    chosen = generator.integers(len(slots))
    target, feed = int(slots[chosen]), int(feeds[chosen])
    network = target // sizes.n_slots * sizes.n_slots  # its first slot
    free = np.flatnonzero(nodes[network : network + sizes.n_slots] < 0)
    start, end = _places(genes, sizes, network)[feed], genes[target, -1]
    share = np.float32(0.25 + 0.5 * generator.random())
    place = np.float32(start + share * (end - start))
    if not len(free) or (in_order and not start < place < end):
        return
    new = network + int(free[0])
    nodes[new] = innovations.node(int(marks[target, feed]))
    genes[new] = 0
    genes[new, sizes.n_feeds : -1] = random_genes(generator, (sizes.n_further,))
    genes[new, -1] = place
    enabled[target, feed] = False
    out = sizes.n_inputs + 1 + new - network
    for slot, source, gene in ((new, feed, np.float32(weight)), (target, out, genes[target, feed])):
        _connect(graphs, child, sizes, slot, source, gene, innovations)


def add_connection(
    graphs: Graphs,
    child: int,
    sizes: Sizes,
    innovations: Innovations,
    generator: np.random.Generator,
    *,
    in_order: bool,
) -> None:
    """Connect two nodes of a genotype that are not connected, in place, with a random weight.

    Nothing happens if no connection is possible.

    Args:
        graphs: genotypes, of which one is changed.
        child: its number.
        sizes: the room of a genotype.
        innovations: of this generation.
        generator: the source of all random numbers.
        in_order: whether only connections in the order of evaluation are possible, which keeps the
            network feed-forward.
    """
    u, s = sizes.n_slots, sizes.n_inputs
    is_node = (graphs.nodes[child] >= 0).reshape(-1, u)  # [T, U]
    possible = np.ones((*is_node.shape, sizes.n_feeds), dtype=np.bool_)
    possible[:, :, s + 1 :] = is_node[:, None]
    if in_order:
        place = graphs.genes[child, :, -1].reshape(-1, u)
        possible[:, :, s + 1 :] &= place[:, None] < place[:, :, None]
    possible &= is_node[:, :, None]
    possible &= graphs.marks[child].reshape(possible.shape) < 0
    free = np.flatnonzero(possible)
    if len(free):
        slot, feed = divmod(int(free[generator.integers(len(free))]), sizes.n_feeds)
        gene = random_genes(generator, (1,))[0]
        _connect(graphs, child, sizes, slot, feed, gene, innovations)


def _connect(
    graphs: Graphs,
    child: int,
    sizes: Sizes,
    slot: int,
    feed: int,
    gene: Any,
    innovations: Innovations,
) -> None:
    """Add a connection to a genotype, in place."""
    nodes = graphs.nodes[child]
    network = slot // sizes.n_slots * sizes.n_slots
    at = feed - sizes.n_inputs - 1
    source = int(nodes[network + at]) if at >= 0 else -1 - feed
    graphs.genes[child, slot, feed] = gene
    graphs.marks[child, slot, feed] = innovations.connection(source, int(nodes[slot]))
    graphs.enabled[child, slot, feed] = True


def _places(genes: FloatArray, sizes: Sizes, network: int) -> FloatArray:
    """Return the places [F] of the sources of a network's connections."""
    places = np.full(sizes.n_feeds, FIRST_PLACE)
    places[sizes.n_inputs + 1 :] = genes[network : network + sizes.n_slots, -1]
    return places
