"""Statistics of runs: as the thesis does them, and as readers expect them today.

Nitschke 2009, sections 4.5, 5.4, 6.4 and appendices A, C, D: a Kolmogorov-Smirnov test of each data
set, then an independent t-test of two, significant below 0.05. In addition: the Lilliefors test,
Welch's test and interval, Mann-Whitney, Vargha-Delaney's A12, Holm's correction.

The unit of every sample is a run, never a scenario. Choice: a value that is not finite is left
out; the sizes returned count the values used. A result that a sample does not allow is None, never
a warning.

Choice: the error of a mean needs two runs, a test of normality three. Choice: samples without any
spread have no t-test and no interval, however equal or different they are, because they have no
error to compare with.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from conevo.report.ranks import above, mann_whitney, smallest_mann_whitney
from conevo.rng import stream
from conevo.typing import Floats

__all__ = [
    "ALPHA",
    "Comparison",
    "Estimate",
    "Normality",
    "compare",
    "finite",
    "holm",
    "is_alike",
    "mean_interval",
    "moments",
    "normality",
    "proportion_interval",
]

ALPHA = 0.05
"""The thesis' threshold of significance (appendix A)."""

LILLIEFORS_SAMPLES = 10_000  # a p-value near 0.05 is then known to about 0.004
LILLIEFORS_VALUES = 10**7  # of all these samples, at most: they are drawn at once


@dataclass(frozen=True)
class Normality:
    """Whether a sample may come from a normal distribution.

    Attributes:
        n: runs.
        p_ks: Kolmogorov-Smirnov against the normal with the sample's mean and deviation, as in
            the thesis. Too large, because the normal was fitted to the same sample.
        p_lilliefors: the same distance, judged by samples of normal numbers fitted in the same
            way (Lilliefors 1967).
    """

    n: int
    p_ks: float | None
    p_lilliefors: float | None


@dataclass(frozen=True)
class Comparison:
    """Two independent samples of runs, a and b. All tests are two-sided.

    Attributes:
        n_a, n_b: runs.
        mean_a, mean_b: None without runs.
        sd_a, sd_b: of the sample (n - 1); None below two runs.
        difference: mean_a - mean_b.
        low, high: Welch's 95 % interval of the difference.
        p_t: Student's independent t-test, as in the thesis.
        p_welch: Welch's t-test, which does not assume equal variances.
        p_mann_whitney: exact, ties included, up to 60 runs; then by the normal approximation.
        a12: the probability that a run of a is above one of b, ties half (Vargha & Delaney 2000).
        smallest_p: the smallest p that Mann-Whitney could give at these sizes.
    """

    n_a: int
    n_b: int
    mean_a: float | None
    mean_b: float | None
    sd_a: float | None
    sd_b: float | None
    difference: float | None
    low: float | None = None
    high: float | None = None
    p_t: float | None = None
    p_welch: float | None = None
    p_mann_whitney: float | None = None
    a12: float | None = None
    smallest_p: float | None = None


@dataclass(frozen=True)
class Estimate:
    """A value and its interval.

    Attributes:
        value: None without runs.
        low, high: None where the runs say nothing about the error.
        n: runs.
        method: of the interval, in words for a caption.
    """

    value: float | None
    low: float | None
    high: float | None
    n: int
    method: str

    def within(self, least: float, most: float) -> tuple[float | None, float | None]:
        """Return the interval, which ends where values do; a pair of None without one."""
        if self.low is None or self.high is None:
            return None, None
        return max(self.low, least), min(self.high, most)

    def ends(self, least: float, most: float) -> tuple[float, float, float] | None:
        """Return the value and its interval, as ``within``; None without one."""
        low, high = self.within(least, most)
        if self.value is None or low is None or high is None:
            return None
        return self.value, low, high


def normality(values: npt.ArrayLike) -> Normality:
    """Test a sample of runs against the normal distribution fitted to it.

    Both p-values are None below three runs, and if all are equal.
    """
    x = finite(values)
    mean, sd = moments(x)
    if len(x) < 3 or not sd:
        return Normality(len(x), None, None)
    from scipy.stats import kstest, norm

    thesis = kstest(x, norm(mean, sd).cdf, method="exact")
    by_chance = _lilliefors(len(x))
    at_least = int(np.sum(by_chance >= thesis.statistic - 1e-12))
    return Normality(len(x), float(thesis.pvalue), (1 + at_least) / (1 + len(by_chance)))


def compare(a: npt.ArrayLike, b: npt.ArrayLike) -> Comparison:
    """Compare two independent samples of runs.

    The t-tests and the interval need two runs in each and a spread in one of them; Mann-Whitney
    and A12 need one run in each (of two samples of equal values p is 1, and A12 a half).
    """
    x, y = finite(a), finite(b)
    n, m = len(x), len(y)
    (mean_a, sd_a), (mean_b, sd_b) = moments(x), moments(y)
    difference = None if mean_a is None or mean_b is None else mean_a - mean_b
    tests: dict[str, float] = {}
    if difference is not None and sd_a is not None and sd_b is not None and (sd_a or sd_b):
        tests |= _t_tests(x, y)
    if n and m:
        tests["p_mann_whitney"] = mann_whitney(x, y)
        tests["a12"] = float(above(x, y).mean())
        tests["smallest_p"] = smallest_mann_whitney(n, m)
    return Comparison(n, m, mean_a, mean_b, sd_a, sd_b, difference, **tests)


def holm(ps: Sequence[float | None]) -> list[float | None]:
    """Return the p-values of a family of tests, corrected for their number (Holm 1979).

    In the order given. None or NaN, a test that could not be made, is None and does not count.
    """
    made = [(p, k) for k, p in enumerate(ps) if p is not None and not math.isnan(p)]
    adjusted: list[float | None] = [None] * len(ps)
    least = 0.0
    for rank, (p, k) in enumerate(sorted(made)):
        least = max(least, min(1.0, (len(made) - rank) * p))
        adjusted[k] = least
    return adjusted


def is_alike(comparison: Comparison, margin: float = 0.15) -> bool:
    """Return whether two samples are shown to be alike (absence of evidence is not evidence).

    None of the three tests finds a difference, uncorrected, and the interval of the difference
    lies inside +-``margin`` of the larger mean. Choice: of the means' absolute values. Choice:
    samples without an interval are not alike.
    """
    low, high = comparison.low, comparison.high
    if low is None or high is None or comparison.mean_a is None or comparison.mean_b is None:
        return False
    tests = (comparison.p_t, comparison.p_welch, comparison.p_mann_whitney)
    if any(p is not None and p < ALPHA for p in tests):
        return False
    room = margin * max(abs(comparison.mean_a), abs(comparison.mean_b))
    return -room <= low and high <= room


def mean_interval(values: npt.ArrayLike, level: float = 0.95) -> Estimate:
    """Return the mean of a sample of runs with Student's t interval.

    The interval is None below two runs, and if all are equal.
    """
    x = finite(values)
    mean, sd = moments(x)
    method = "Student's t"
    if mean is None or not sd:
        return Estimate(mean, None, None, len(x), method)
    from scipy.stats import t

    low, high = t.interval(level, len(x) - 1, mean, sd / math.sqrt(len(x)))
    return Estimate(mean, float(low), float(high), len(x), method)


@lru_cache(maxsize=4096)  # its roots are searched for, and few pairs of numbers occur
def proportion_interval(successes: int, n: int, level: float = 0.95) -> Estimate:
    """Return the share of runs in which something was seen, with its exact interval.

    Clopper and Pearson 1934; None without runs.

    Raises:
        ValueError: successes outside 0 .. n.
    """
    if not 0 <= successes <= n:
        raise ValueError(f"{successes} of {n} runs is not a share")
    method = "Clopper-Pearson"
    if n == 0:
        return Estimate(None, None, None, 0, method)
    from scipy.stats import binomtest

    low, high = binomtest(successes, n).proportion_ci(level, "exact")
    return Estimate(successes / n, float(low), float(high), n, method)


def moments(values: npt.ArrayLike) -> tuple[float | None, float | None]:
    """Return the mean of a sample, None without runs, and its deviation (n - 1), None below two.

    The latter is exactly 0 if all values are equal.
    """
    x = finite(values)
    mean = float(x.mean()) if len(x) else None
    if len(x) < 2:
        return mean, None
    return (mean, float(x.std(ddof=1))) if np.ptp(x) > 0 else (float(x[0]), 0.0)


def finite(values: npt.ArrayLike) -> Floats:
    """Return the finite values of a sample, [runs].

    Raises:
        ValueError: more than one dimension.
    """
    x = np.asarray(values, dtype=np.float64)
    if x.ndim != 1:
        raise ValueError(f"a sample has one value per run, not the shape {x.shape}")
    return x[np.isfinite(x)]


def _t_tests(x: Floats, y: Floats) -> dict[str, float]:
    """Return the p-values of Student's and of Welch's test, and Welch's interval, by name.

    Of samples that are brought to one size, since the squares of tiny values vanish.
    """
    from scipy.stats import ttest_ind

    centre, size = y.mean(), max(np.ptp(x), np.ptp(y))
    x, y = (x - centre) / size, (y - centre) / size
    with warnings.catch_warnings(action="ignore"):  # of a sample without a spread
        student, welch = (ttest_ind(x, y, equal_var=are_equal) for are_equal in (True, False))
        low, high = welch.confidence_interval(1 - ALPHA)
    ends = {"low": float(low * size), "high": float(high * size)}
    return ends | {"p_t": float(student.pvalue), "p_welch": float(welch.pvalue)}


@lru_cache(maxsize=256)
def _lilliefors(n: int) -> Floats:
    """Return how far samples of n normal numbers are from the normals fitted to them."""
    from scipy.stats import goodness_of_fit, norm

    numbers = stream(0, "lilliefors", n)
    some = numbers.standard_normal(n)
    k = min(LILLIEFORS_SAMPLES, LILLIEFORS_VALUES // n)
    found = goodness_of_fit(norm, some, statistic="ks", n_mc_samples=k, rng=numbers)
    return np.asarray(found.null_distribution)
