"""The power of "alike" is the rate at which the rule recognizes equal methods."""

from __future__ import annotations

import numpy as np
import pytest

from conevo.report.power import CAMPAIGNS, draw, found_alike, power_of_pair
from conevo.report.statistics import compare, is_alike


@pytest.mark.parametrize(("n", "m", "scatter"), [(20, 20, 0.2), (5, 8, 0.1), (20, 20, 0.05)])
def test_power_is_the_rate_of_the_rule_itself(n: int, m: int, scatter: float) -> None:
    def runs(size: int) -> list[float]:
        """Return runs with exactly this scatter, so that drawn samples are similar."""
        x = np.linspace(-1, 1, size)
        return (50 * (1 + scatter * x / x.std(ddof=1))).tolist()

    stated = power_of_pair(runs(n), runs(m))
    rng = np.random.default_rng(1)
    pairs = [(rng.normal(9, 9 * scatter, n), rng.normal(9, 9 * scatter, m)) for _ in range(400)]
    rate = np.mean([is_alike(compare(a, b)) for a, b in pairs])
    assert stated == pytest.approx(rate, abs=0.06)  # three standard errors, and the ranks


def test_an_unknown_power_is_not_stated() -> None:
    assert power_of_pair([1.0], [1.0, 2.0]) is None
    assert power_of_pair([2.0, 2.0], [1.0, 2.0]) is None
    assert power_of_pair([-1.0, 1.0], [1.0, 2.0]) is None


def test_samples_that_several_pairs_share_are_drawn_once() -> None:
    one, same = draw([1.0, 1.1, 0.9], 7), draw([1.0, 1.1, 0.9], 7)
    other = draw([1.0, 1.1, 0.9], 8)
    assert one is not None
    assert same is not None
    assert other is not None
    assert len(one.mean) == CAMPAIGNS
    assert np.array_equal(one.mean, same.mean)
    assert not np.array_equal(one.mean, other.mean)
    assert found_alike(one, same).mean() > found_alike(one, other).mean()
