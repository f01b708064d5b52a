"""Aggregates over several environments, with stratified bootstrap intervals.

Agarwal et al. 2021, "Deep reinforcement learning at the edge of the statistical precipice". A
stratum is the sample of runs of one environment. Runs are resampled within each stratum, and the
interval is that of the percentiles. Choice: if all resamples agree, the result has no interval,
because a width of zero would be a certainty that few runs do not have.

With few runs such intervals are too narrow. The caller brings values of several environments to one
scale (a share of the optimum) before they are pooled.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from conevo.report.ranks import above
from conevo.report.statistics import Estimate, finite
from conevo.rng import stream
from conevo.typing import Floats

__all__ = ["iqm", "iqm_interval", "probability_of_improvement"]

METHOD = "stratified bootstrap"


def iqm(values: npt.ArrayLike) -> float | None:
    """Return the interquartile mean of the finite values, None without any.

    Choice: whole runs are cut, a quarter of them rounded down at each end, as by Agarwal et al.
    """
    from scipy.stats import trim_mean

    x = finite(values)
    return float(trim_mean(x, 0.25)) if len(x) else None


def iqm_interval(
    strata: Sequence[npt.ArrayLike], level: float = 0.95, resamples: int = 2000, seed: int = 0
) -> Estimate:
    """Return the interquartile mean of all runs, with its interval.

    Args:
        strata: of each environment, the values of its runs, [runs]; empty ones do not count.
        level: of the interval.
        resamples: number of resamples.
        seed: of the resampling.
    """
    from scipy.stats import trim_mean

    samples = [x for x in map(finite, strata) if len(x)]
    n = sum(map(len, samples))
    if not samples:
        return Estimate(None, None, None, 0, METHOD)
    numbers = stream(seed, "iqm")
    drawn = [x[numbers.integers(len(x), size=(resamples, len(x)))] for x in samples]
    middles = trim_mean(np.concatenate(drawn, axis=1), 0.25, axis=1)
    return _estimate(iqm(np.concatenate(samples)), middles, level, n)


def probability_of_improvement(
    x_strata: Sequence[npt.ArrayLike],
    y_strata: Sequence[npt.ArrayLike],
    level: float = 0.95,
    resamples: int = 2000,
    seed: int = 0,
) -> Estimate:
    """Return the probability that a run of x is above one of y, ties half, with its interval.

    The mean of A12 over the environments, each counting the same.

    Args:
        x_strata: of each environment, the values of x's runs, [runs].
        y_strata: of the same environments, those of y. An environment without runs of both does
            not count.
        level: of the interval.
        resamples: number of resamples.
        seed: of the resampling.

    Raises:
        ValueError: not as many strata of y as of x.
    """
    pairs = [
        (x, y)
        for x, y in zip(map(finite, x_strata), map(finite, y_strata), strict=True)
        if len(x) and len(y)
    ]
    n = sum(len(x) + len(y) for x, y in pairs)
    wins = [above(x, y) for x, y in pairs]
    if not wins:
        return Estimate(None, None, None, 0, METHOD)
    numbers = stream(seed, "probability of improvement")
    total = np.zeros(resamples)
    for won in wins:
        # The counts of each run represent the runs drawn.
        x_drawn, y_drawn = (
            numbers.multinomial(size, np.full(size, 1 / size), size=resamples) for size in won.shape
        )
        total += ((x_drawn @ won) * y_drawn).sum(axis=1) / won.size
    return _estimate(float(np.mean([w.mean() for w in wins])), total / len(wins), level, n)


def _estimate(value: float | None, drawn: Floats, level: float, n: int) -> Estimate:
    if np.ptp(drawn) == 0:
        return Estimate(value, None, None, n, METHOD)
    low, high = np.quantile(drawn, [(1 - level) / 2, (1 + level) / 2])
    return Estimate(value, float(low), float(high), n, METHOD)
