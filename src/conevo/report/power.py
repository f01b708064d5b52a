"""The power of "alike": the probability of finding methods alike that are exactly alike.

Absence of evidence is not evidence, so "alike" needs an interval inside +-15 % of the larger mean
(``statistics.is_alike``). Few runs that scatter rarely meet it even where it is true. Here
campaigns in which it is true are drawn: normal samples of the same mean, with the number and
scatter of the runs. Only their means and variances are drawn, which are independent.

Choice: without the ranks. Mann-Whitney refuses a true "alike" less often than the t-test does, and
nearly always together with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from conevo.report.statistics import ALPHA, finite
from conevo.rng import stream
from conevo.typing import Floats

__all__ = ["CAMPAIGNS", "Redrawn", "draw", "found_alike", "power_of_pair"]

CAMPAIGNS = 2000
"""Campaigns that are drawn: a power of a half is then known to 2 %."""


class Redrawn(NamedTuple):
    """One sample in every campaign drawn: its runs, means and variances [campaigns]."""

    n: int
    mean: Floats
    variance: Floats


def draw(values: npt.ArrayLike, *place: int | str) -> Redrawn | None:
    """Return samples like a sample of runs, scaled to a mean of 1.

    None where the runs do not scatter, or are fewer than two, or their mean is 0.

    Args:
        values: the runs.
        place: names the random numbers.
    """
    x = finite(values)
    mean, sd = (float(x.mean()), float(x.std(ddof=1))) if len(x) > 1 else (0.0, 0.0)
    if not mean or not sd:
        return None
    numbers, n, scatter = stream(0, "power", *place), len(x), abs(sd / mean)
    return Redrawn(
        n,
        numbers.normal(1.0, scatter / np.sqrt(n), CAMPAIGNS),
        scatter**2 * numbers.chisquare(n - 1, CAMPAIGNS) / (n - 1),
    )


def found_alike(a: Redrawn, b: Redrawn, margin: float = 0.15) -> npt.NDArray[np.bool_]:
    """Return in which campaigns two samples are found alike [campaigns].

    That is: neither Student's nor Welch's test is below 0.05, and Welch's interval of the
    difference lies inside +-``margin`` of the larger mean.
    """
    from scipy.special import stdtrit

    errors = a.variance / a.n, b.variance / b.n
    error = np.sqrt(errors[0] + errors[1])
    freedom = error**4 / (errors[0] ** 2 / (a.n - 1) + errors[1] ** 2 / (b.n - 1))
    reach = stdtrit(freedom, 1 - ALPHA / 2) * error
    both = a.n + b.n - 2
    pooled = ((a.n - 1) * a.variance + (b.n - 1) * b.variance) / both
    student = stdtrit(both, 1 - ALPHA / 2) * np.sqrt(pooled * (1 / a.n + 1 / b.n))
    difference = np.abs(a.mean - b.mean)
    room = margin * np.maximum(np.abs(a.mean), np.abs(b.mean))
    found: npt.NDArray[np.bool_] = (difference < np.minimum(reach, student)) & (
        difference + reach <= room
    )
    return found


def power_of_pair(a: Sequence[float], b: Sequence[float]) -> float | None:
    """Return the probability of finding two equal methods alike, None if unknown."""
    one, other = draw(a, 0), draw(b, 1)
    return None if one is None or other is None else float(found_alike(one, other).mean())
