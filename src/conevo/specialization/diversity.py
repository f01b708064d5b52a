"""Diversity of a team: how much its robots differ, and whether that goes with performance.

Balch 1997 and 2000 (social and hierarchic social entropy), Bettini, Shankar and Prorok 2023 (system
neural diversity), Li, Martinoli and Abu-Mostafa 2004 (specialization is the diversity that pays).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.specialization.activity import shares
from conevo.specialization.entropy import entropy

__all__ = [
    "caste_entropy",
    "differences",
    "hierarchic_social_entropy",
    "system_neural_diversity",
    "task_specialization",
]

Floats = npt.NDArray[np.floating[Any]]


def caste_entropy(labels: Iterable[str]) -> float:
    """Return the entropy of a team's castes in bits; log2(R) if each robot has its own, 0 for one.

    Balch 1997: simple social entropy, of the castes of section 3.2.3 (Nitschke 2009).
    """
    return float(entropy(list(Counter(labels).values())))


def differences(counts: npt.ArrayLike) -> Floats:
    """Return how differently two robots divide their lives, [R, R] in [0, 1].

    The portion of its life that one would have to spend differently to be like the other: the total
    variation of their shares of actions, which is their Wasserstein distance if any two actions are
    one apart. Choice: robots are compared by the actions in their own lives. Balch and Bettini et
    al. compare the actions that their networks would choose with the same inputs. Doing nothing at
    all is one more action.

    Args:
        counts: [R, A] how often each robot executed each action.
    """
    share = shares(counts)
    share = np.concatenate([share, 1 - share.sum(axis=1, keepdims=True).round()], axis=1)
    apart: Floats = np.abs(share[:, None] - share[None]).sum(axis=-1) / 2
    return apart


def hierarchic_social_entropy(apart: npt.ArrayLike) -> float | None:
    """Return the entropy of a team's clusters, integrated over all levels of difference.

    0 if all robots are alike; at most log2(R) bits times the largest difference, reached if any two
    robots differ by it. Balch 2000. None for less than two robots. Choice: clusters at a level are
    robots that differences up to it link (single linkage). Balch's may overlap, and can be too many
    to list.

    Args:
        apart: [R, R] differences.
    """
    apart = np.asarray(apart, dtype=np.float64)
    n = len(apart)
    if n < 2:
        return None
    first, second = np.triu_indices(n, k=1)
    cluster = np.arange(n)
    total, level = 0.0, 0.0
    bits = float(np.log2(n))
    for pair in np.argsort(apart[first, second], kind="stable"):
        i, j = first[pair], second[pair]
        if cluster[i] == cluster[j]:
            continue
        total += (apart[i, j] - level) * bits
        level = apart[i, j]
        cluster[cluster == cluster[j]] = cluster[i]
        bits = float(entropy(np.bincount(cluster)))
    return float(total)


def system_neural_diversity(apart: npt.ArrayLike) -> float | None:
    """Return the mean difference between two robots of a team.

    0 if all are alike; the largest difference if any two differ by it, for any number of robots.
    Bettini et al. 2023, their aggregate of any matrix of differences. None for less than two
    robots.

    Args:
        apart: [R, R] differences.
    """
    apart = np.asarray(apart, dtype=np.float64)
    if len(apart) < 2:
        return None
    return float(apart[np.triu_indices(len(apart), k=1)].mean())


def task_specialization(diversity: npt.ArrayLike, performance: npt.ArrayLike) -> float | None:
    """Return the part of the diversity of several teams that goes with their performance.

    Their mean diversity times its correlation with their performance: at most the mean diversity, 0
    if the two are not related, negative if diversity costs performance. Li et al. 2004:
    specialization is the part of diversity that is required for performance. Choice: this product,
    with Pearson's correlation over teams. None for less than three teams, or if all teams are
    equally diverse or perform equally well.

    Args:
        diversity: [N] of each team, in any measure.
        performance: [N] of each team.
    """
    x, y = np.asarray(diversity, dtype=np.float64), np.asarray(performance, dtype=np.float64)
    if len(x) < 3 or not (np.ptp(x) > 0 and np.ptp(y) > 0):
        return None
    dx, dy = x - x.mean(), y - y.mean()
    return float(x.mean() * (dx @ dy) / np.sqrt((dx @ dx) * (dy @ dy)))
