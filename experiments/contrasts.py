"""A weighted sum of the differences of several comparisons, with an interval."""

from __future__ import annotations

import math
from collections.abc import Sequence

from scipy.stats import t as student

from conevo.report.statistics import Comparison, Estimate

__all__ = ["contrast"]


def contrast(weighted: Sequence[tuple[float, Comparison]]) -> Estimate:
    """Return a weighted sum of differences, with Welch's interval (Satterthwaite).

    Args:
        weighted: weights and comparisons, each with at least two runs on both sides.
    """
    value, parts = 0.0, []
    for weight, of in weighted:
        value += weight * (of.difference or 0.0)
        for sd, n in ((of.sd_a, of.n_a), (of.sd_b, of.n_b)):
            parts.append((weight**2 * (sd or 0.0) ** 2 / n, n))
    variance = sum(part for part, _ in parts)
    freedom = variance**2 / sum(part**2 / (n - 1) for part, n in parts)
    reach = float(student.ppf(0.975, freedom)) * math.sqrt(variance)
    n = sum(n for _, n in parts)
    return Estimate(value, value - reach, value + reach, n, "Welch's t")
