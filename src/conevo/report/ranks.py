"""Which of two samples of runs is above the other, by ranks only."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from conevo.typing import Floats

__all__ = ["EXACT_RUNS", "above", "mann_whitney", "smallest_mann_whitney"]

EXACT_RUNS = 60
"""Of both samples together: above that Mann-Whitney takes the normal approximation."""


def above(x: Floats, y: Floats) -> Floats:
    """Return 1 where a run of x is above one of y, a half where they tie, else 0, [n, m]."""
    wins: Floats = (x[:, None] > y) + 0.5 * (x[:, None] == y)
    return wins


def mann_whitney(x: Floats, y: Floats) -> float:
    """Return the two-sided p-value of the Mann-Whitney test of two samples, neither empty.

    Exact up to ``EXACT_RUNS`` runs. Choice: the exact test uses the permutation
    distribution of the ranks, including ties, and counts every sum of ranks at least as far from
    its expectation (with ties the tails may differ). Above, the normal approximation, corrected for
    ties and continuity.
    """
    n, m = len(x), len(y)
    _, index, counts = np.unique(np.concatenate([x, y]), return_inverse=True, return_counts=True)
    doubled = (2 * np.cumsum(counts) - counts + 1)[index]  # twice the mid-rank: integers
    apart = abs(int(doubled[:n].sum()) - n * (n + m + 1))
    if n + m <= EXACT_RUNS:
        ways = _ways(doubled, n)
        sums = np.arange(len(ways))
        return float(ways[np.abs(sums - n * (n + m + 1)) >= apart].sum() / ways.sum())
    from scipy.stats import mannwhitneyu

    if len(counts) == 1:
        return 1.0  # scipy makes 1 or NaN of it, depending on its version
    return float(mannwhitneyu(x, y, method="asymptotic").pvalue)


def smallest_mann_whitney(n: int, m: int) -> float:
    """Return the smallest two-sided p-value that samples of n and m runs can give, without ties."""
    return min(1.0, 2 / math.comb(n + m, n))


def _ways(ranks: npt.NDArray[np.int64], n: int) -> npt.NDArray[np.int64]:
    """Return how many sets of n of the ranks have each sum, [largest sum + 1]."""
    largest = int(np.sort(ranks)[-n:].sum())
    ways = np.zeros((n + 1, largest + 1), dtype=np.int64)
    ways[0, 0] = 1
    for rank in ranks.tolist():
        ways[1:, rank:] += ways[:-1, : largest + 1 - rank].copy()
    sums: npt.NDArray[np.int64] = ways[n]
    return sums
