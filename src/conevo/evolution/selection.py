"""Elite selection: which populations, and which of their sub-populations, recombine.

Nitschke 2009, section 3.4.1 and 3.4.2. Similar behaviour makes two populations candidates, similar
genotypes let their sub-populations recombine; everything else recombines within itself.

Choice: the thesis' loop over all pairs would overwrite a population n - 1 times. Here the most
similar pairs come first and each population, and each sub-population, is taken at most once.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from conevo.evolution.population import genotype_distance
from conevo.evolution.protocol import BoolArray, FloatArray, IntArray

__all__ = [
    "elite_distance",
    "pair_populations",
    "pair_similar",
    "pair_slots",
    "specialization_distance",
]


def specialization_distance(specialization: FloatArray) -> FloatArray:
    """Return SD [P, P] between all controllers: |S_i - S_j| (Nitschke 2009, eq. 3.5)."""
    return np.abs(specialization[:, None] - specialization[None, :])


def pair_populations(specialization: FloatArray, sst: float) -> IntArray:
    """Return the pairs [Q, 2] of populations that may recombine: SD < SST, the most similar first.

    Args:
        specialization: [P] S of each population's fittest controller. Not a number: never paired.
        sst: specialization similarity threshold. Higher pairs more.
    """
    first, second = np.triu_indices(len(specialization), k=1)
    distance = specialization_distance(specialization)[first, second]
    similar = np.flatnonzero(distance < sst)
    order = similar[np.argsort(distance[similar], kind="stable")]
    return _greedy(first[order], second[order])


def elite_distance(
    a: FloatArray, b: FloatArray, aggregate: Literal["mean", "sum"] = "mean"
) -> FloatArray:
    """Return the distances [U, V] between sub-populations: GD over their rank-paired elites.

    Choice: the mean; the thesis sums (3.4.3), but a sum over L >= 6 elites never passes a threshold
    in [0, 1].

    Args:
        a: [U, L, G] elites of one population's sub-populations, the fittest first.
        b: [V, L, G] elites of another's.
        aggregate: "mean" or "sum" over the L pairs.
    """
    flat_a, flat_b = (x.reshape(len(x), -1) for x in (a, b))
    distance = genotype_distance(flat_a[:, None], flat_b[None])
    return distance * a.shape[1] if aggregate == "sum" else distance


def pair_similar(
    elites: FloatArray,
    active: BoolArray,
    candidates: IntArray,
    gst: float,
    aggregate: Literal["mean", "sum"] = "mean",
) -> IntArray:
    """Return the pairs [Q, 2] of units ``p * U + u`` that recombine: distance < GST.

    Every pair of sub-populations of every candidate pair of populations is tested, the most similar
    are taken first, each sub-population at most once.

    Args:
        elites: [P, U, L, G], the fittest first.
        active: [P, U] slots in use.
        candidates: [C, 2] pairs of populations.
        gst: genotype similarity threshold. Higher recombines more.
        aggregate: see ``elite_distance``.
    """
    n_slots = active.shape[1]
    slots = [np.flatnonzero(used) for used in active]
    compact = [elites[p, used] for p, used in enumerate(slots)]
    found = []
    for i, j in candidates:
        distance = elite_distance(compact[i], compact[j], aggregate)
        u, v = np.nonzero(distance < gst)
        found.append((distance[u, v], i * n_slots + slots[i][u], j * n_slots + slots[j][v]))
    if not found:
        return np.empty((0, 2), dtype=np.int64)
    distances, first, second = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.argsort(distances, kind="stable")
    return _greedy(first[order], second[order])


def pair_slots(active: BoolArray, candidates: IntArray) -> IntArray:
    """Return the pairs [Q, 2] of units ``p * U + u`` of equal slot, for candidate populations."""
    n_slots = active.shape[1]
    i, j = candidates.reshape(-1, 2).T
    pair, slot = np.nonzero(active[i] & active[j])
    return np.stack([i[pair] * n_slots + slot, j[pair] * n_slots + slot], axis=1)


def _greedy(first: IntArray, second: IntArray) -> IntArray:
    """Return the pairs whose members no earlier pair has taken, [Q, 2]."""
    taken: set[int] = set()
    pairs = []
    for a, b in zip(first.tolist(), second.tolist(), strict=True):
        if a not in taken and b not in taken:
            taken |= {a, b}
            pairs.append((a, b))
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)
