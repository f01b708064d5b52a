"""Species: genotypes of similar topology, which compete among themselves and share fitness.

Stanley and Miikkulainen 2002, section 3.3. The compatibility distance of two genotypes with
historical markings is ``c1 E / N + c2 D / N + c3 W``: E excess and D disjoint connections, W the
mean difference of the weights of matching ones, N the connections of the larger genotype.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from conevo.evolution.protocol import BoolArray, FloatArray, IntArray
from conevo.evolution.topology import Graphs

__all__ = ["Aligned", "Compatibility", "aligned", "distance", "offspring", "speciate"]

NONE = np.int32(2**31 - 1)  # a marking that no connection has


@dataclass(frozen=True)
class Compatibility:
    """Coefficients of the compatibility distance.

    Attributes:
        excess: c1.
        disjoint: c2.
        weights: c3.
        small: N is 1 if both genotypes have fewer connections.
    """

    excess: float
    disjoint: float
    weights: float
    small: int


@dataclass(frozen=True)
class Aligned:
    """The connections of M genotypes by historical marking; C, the most that one has.

    Attributes:
        marks: [M, C] int32, rising, then ``NONE``.
        weights: [M, C] float32 genes.
        count: [M] connections of each.
    """

    marks: IntArray
    weights: FloatArray
    count: IntArray

    def __getitem__(self, some: slice | IntArray) -> Aligned:
        """Return some of the genotypes."""
        return Aligned(self.marks[some], self.weights[some], self.count[some])


def aligned(graphs: Graphs) -> Aligned:
    """Return the connections of genotypes by historical marking, disabled ones too."""
    n, n_slots, n_feeds = graphs.marks.shape
    flat = graphs.marks.reshape(n, n_slots * n_feeds)
    marks = np.where(flat < 0, NONE, flat)
    most = int(graphs.n_connections.max(initial=1))
    order = np.argsort(marks, axis=1, kind="stable")[:, :most]
    weights = graphs.genes[:, :, :n_feeds].reshape(flat.shape)
    marks = np.take_along_axis(marks, order, axis=1)
    return Aligned(marks, np.take_along_axis(weights, order, axis=1), (marks < NONE).sum(axis=1))


def distance(some: Aligned, one: Aligned, coefficients: Compatibility) -> FloatArray:
    """Return the compatibility distance [M] of genotypes from another one.

    Args:
        some: M genotypes.
        one: a single genotype.
        coefficients: c1, c2, c3 and the limit for N.
    """
    n = int(one.count[0])
    marks, weights = one.marks[0, :n], one.weights[0, :n]
    exists = some.marks < NONE
    at = np.minimum(np.searchsorted(marks, some.marks), n - 1)
    matches = exists & (marks[at] == some.marks)
    n_matching = matches.sum(axis=1)
    newest = some.marks[np.arange(len(some.count)), some.count - 1]
    excess = (exists & (some.marks > marks[-1])).sum(axis=1)
    excess = excess + n - np.searchsorted(marks, newest, side="right")
    disjoint = some.count + n - 2 * n_matching - excess
    apart = np.where(matches, np.abs(some.weights - weights[at]), np.float32(0)).sum(axis=1)
    larger = np.maximum(some.count, n)
    larger = np.where(larger < coefficients.small, 1, larger)
    found: FloatArray = (
        coefficients.excess * excess / larger
        + coefficients.disjoint * disjoint / larger
        + coefficients.weights * apart / np.maximum(n_matching, 1)
    )
    return found


def speciate(
    some: Aligned,
    representatives: Aligned,
    coefficients: Compatibility,
    threshold: float,
) -> IntArray:
    """Return the species [M] of genotypes.

    A genotype belongs to the first species whose representative is nearer than the threshold. The
    first genotype without one founds the next species, and represents it.

    Args:
        some: M genotypes.
        representatives: of species 0 to Q - 1, one each.
        coefficients: of the distance.
        threshold: of the distance.
    """
    species = np.full(len(some.count), -1, dtype=np.int32)
    k = 0
    while (alone := np.flatnonzero(species < 0)).size:
        is_new = k >= len(representatives.count)
        one = some[alone[:1]] if is_new else representatives[k : k + 1]
        near = distance(some[alone], one, coefficients) < threshold
        near[0] |= is_new
        species[alone[near]] = k
        k += 1
    return species


def offspring(fitness: FloatArray, species: IntArray, allowed: BoolArray, n: int) -> IntArray:
    """Return the number of children [Q] of each species, in proportion to its shared fitness.

    A genotype shares its fitness with its species: it counts divided by their number, and the sum
    over the species is their mean (section 3.3).

    Choice: fitness counts from the lowest of the generation, since that of a team may be negative.
    Remainders go to the species with the largest ones.

    Args:
        fitness: [M], not below 0.
        species: [M] the species of each, 0 to Q - 1.
        allowed: [Q] whether a species may have children, at least one.
        n: children of all.
    """
    size = np.bincount(species, minlength=len(allowed))
    total = np.bincount(species, weights=fitness, minlength=len(allowed))
    shared = np.where(allowed, total / np.maximum(size, 1), 0.0)
    if not shared.sum() > 0:
        shared = np.where(allowed & (size > 0), 1.0, 0.0)
    exact = n * shared / shared.sum()
    count = np.floor(exact).astype(np.int64)
    most = np.argsort(count - exact, kind="stable")[: n - count.sum()]
    count[most] += 1
    found: IntArray = count
    return found
