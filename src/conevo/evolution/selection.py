"""Elite selection: which populations, and which of their sub-populations, recombine.

Nitschke 2009, section 3.4.1 and 3.4.2. Similar behaviour makes two populations candidates. Similar
genotypes let their sub-populations recombine. All other sub-populations recombine within
themselves.

Choice: the thesis' loop over all pairs would overwrite a population n - 1 times. Here the most
similar pairs come first and each population, and each sub-population, is taken at most once; with
the pairing "all" a population may be in many pairs, but each of its sub-populations in one.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from conevo.evolution.behaviour import evenness
from conevo.evolution.population import genotype_distance
from conevo.evolution.protocol import BoolArray, FloatArray, IntArray

__all__ = [
    "elite_distance",
    "entropy_distance",
    "label_distance",
    "pair_populations",
    "pair_similar",
    "pair_slots",
    "shares_distance",
    "specialization_distance",
]


def specialization_distance(specialization: FloatArray) -> FloatArray:
    """Return SD [P, P] between all controllers: |S_i - S_j| (Nitschke 2009, eq. 3.5)."""
    return np.abs(specialization[:, None] - specialization[None, :])


def shares_distance(shares: FloatArray) -> FloatArray:
    """Return how differently controllers divide their lives among actions, [P, P] in [0, 1].

    It is the total variation of their shares. Doing nothing is one more action.

    Args:
        shares: [P, A] share of each action; the rest to 1 was spent on nothing.
    """
    spent = _with_nothing(shares)
    distance: FloatArray = np.abs(spent[:, None] - spent[None]).sum(axis=-1) / 2
    return distance


def entropy_distance(shares: FloatArray) -> FloatArray:
    """Return how much controllers differ in their degree of specialization, [P, P] in [0, 1].

    The degree is the entropy of a robot's shares, as a portion of that of equal ones: 0 for one
    action only, 1 for all equally often (O'Donnell and Jeanne 1990). It needs neither labels nor a
    threshold, nor switches between actions (Nitschke 2009, section 7.2).

    Args:
        shares: [P, A] share of each action.
    """
    return specialization_distance(evenness(shares))


def label_distance(
    specialization: FloatArray, shares: FloatArray, threshold: float = 0.5
) -> FloatArray:
    """Return 0 for controllers with the same label, else 1, [P, P].

    The label of a controller is the action that it executes most (ties go to the first), and
    whether its S is below 0.5 (Nitschke 2009, 3.2.3).

    Args:
        specialization: [P] S. A controller with NaN differs from all.
        shares: [P, A] share of each action; the rest to 1 was spent on nothing.
        threshold: a controller is not specialized if its S is this or more.
    """
    does = _with_nothing(shares).argmax(axis=1)
    is_specialized = specialization < threshold
    known = np.isfinite(specialization)
    same = (does[:, None] == does) & (is_specialized[:, None] == is_specialized)
    return np.where(same & known & known[:, None], 0.0, 1.0)


def _with_nothing(shares: FloatArray) -> FloatArray:
    """Return the shares with that of doing nothing added as the last action, [P, A + 1]."""
    return np.concatenate([shares, 1 - shares.sum(axis=1, keepdims=True)], axis=1)


def pair_populations(
    distance: FloatArray, sst: float, pairing: Literal["nearest", "all"] = "nearest"
) -> IntArray:
    """Return the pairs [Q, 2] of populations that may recombine: SD < SST, the most similar first.

    Args:
        distance: [P, P] SD between the populations' fittest controllers; NaN: never paired.
        sst: specialization similarity threshold. Higher pairs more.
        pairing: "nearest": each population once; "all": every pair below the threshold.
    """
    first, second = np.triu_indices(len(distance), k=1)
    of_pair = distance[first, second]
    similar = np.flatnonzero(of_pair < sst)
    order = similar[np.argsort(of_pair[similar], kind="stable")]
    if pairing == "all":
        return np.stack([first[order], second[order]], axis=1)
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
    slots: Literal["any", "same"] = "any",
) -> IntArray:
    """Return the pairs [Q, 2] of units ``p * U + u`` that recombine: distance < GST.

    Every pair of sub-populations of every candidate pair of populations is tested. The most similar
    are taken first, and each sub-population at most once.

    Args:
        elites: [P, U, L, G], the fittest first.
        active: [P, U] slots in use.
        candidates: [C, 2] pairs of populations.
        gst: genotype similarity threshold. Higher recombines more.
        aggregate: see ``elite_distance``.
        slots: whether sub-populations of "any" two slots may recombine, or of the "same" slot.
    """
    n_slots = active.shape[1]
    used_slots = [np.flatnonzero(used) for used in active]
    compact = [elites[p, used] for p, used in enumerate(used_slots)]
    found = []
    for i, j in candidates:
        distance = elite_distance(compact[i], compact[j], aggregate)
        a, b = used_slots[i], used_slots[j]
        similar = distance < gst
        if slots == "same":
            similar &= a[:, None] == b
        u, v = np.nonzero(similar)
        found.append((distance[u, v], i * n_slots + a[u], j * n_slots + b[v]))
    if not found:
        return np.empty((0, 2), dtype=np.int64)
    distances, first, second = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.argsort(distances, kind="stable")
    return _greedy(first[order], second[order])


def pair_slots(active: BoolArray, candidates: IntArray) -> IntArray:
    """Return the pairs [Q, 2] of units ``p * U + u`` of equal slot, for candidate populations.

    If two candidates share a population, the first one gets its slots.
    """
    n_slots = active.shape[1]
    i, j = candidates.reshape(-1, 2).T
    pair, slot = np.nonzero(active[i] & active[j])
    return _greedy(i[pair] * n_slots + slot, j[pair] * n_slots + slot)


def _greedy(first: IntArray, second: IntArray) -> IntArray:
    """Return the pairs whose members no earlier pair has taken, [Q, 2]."""
    taken: set[int] = set()
    pairs = []
    for a, b in zip(first.tolist(), second.tolist(), strict=True):
        if a not in taken and b not in taken:
            taken |= {a, b}
            pairs.append((a, b))
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)
