"""Aggregates over environments against scipy, and against all possible resamples."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from conevo.report.bootstrap import iqm, iqm_interval, probability_of_improvement
from conevo.report.statistics import compare

pytestmark = pytest.mark.filterwarnings("error")


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([1, 2, 3, 100], 2.5),
        ([9, 1, 2, 3, 100], 14 / 3),
        ([1, 2, 99], 34.0),
        ([4, math.nan], 4.0),
        ([math.nan], None),
        ([], None),
    ],
)
def test_iqm_of_few_runs(values, expected):
    assert iqm(values) == (None if expected is None else pytest.approx(expected))


def resamples(values):
    """Return all equally likely ways to draw a sample again."""
    return list(itertools.product(values, repeat=len(values)))


def middle(values):
    """Return the interquartile mean, cut by hand."""
    ordered = sorted(values)
    cut = len(ordered) // 4
    kept = ordered[cut : len(ordered) - cut]
    return math.fsum(kept) / len(kept)


def chance(x, y):
    return sum((v > w) + (v == w) / 2 for v in x for w in y) / (len(x) * len(y))


def assert_percentiles(one, outcomes, level):
    """Assert that an interval excludes the promised share of all outcomes at either end.

    Outcomes are few and discrete, so an end must be an outcome at which the tail passes its share,
    within the accuracy of 20,000 resamples.
    """
    outcomes, tail, slack = np.array(outcomes), (1 - level) / 2, 0.006
    assert np.mean(outcomes < one.low - 1e-9) <= tail + slack
    assert np.mean(outcomes <= one.low + 1e-9) >= tail - slack
    assert np.mean(outcomes > one.high + 1e-9) <= tail + slack
    assert np.mean(outcomes >= one.high - 1e-9) >= tail - slack


@pytest.mark.parametrize("level", [0.95, 0.8])
def test_iqm_interval_is_that_of_all_stratified_resamples(level):
    strata = [[1.0, 2.0, 4.5, 9.0], [20.0, 31.0, 33.0], [5.0]]
    one = iqm_interval(strata, level, resamples=20_000)
    outcomes = [
        middle([*a, *b, *c]) for a, b, c in itertools.product(*(resamples(s) for s in strata))
    ]
    assert one.value == pytest.approx(middle([x for s in strata for x in s]))
    assert (one.n, one.method) == (8, "stratified bootstrap")
    assert_percentiles(one, outcomes, level)


@pytest.mark.parametrize("level", [0.95, 0.8])
def test_probability_interval_is_that_of_all_stratified_resamples(level):
    x, y = [[1.0, 3.0, 5.0], [2.0, 2.5]], [[2.0, 3.0], [2.0, 7.0]]
    one = probability_of_improvement(x, y, level, resamples=20_000)
    outcomes = [
        (chance(a, b) + chance(c, d)) / 2
        for a, b, c, d in itertools.product(*map(resamples, (x[0], y[0], x[1], y[1])))
    ]
    assert one.value == pytest.approx((chance(x[0], y[0]) + chance(x[1], y[1])) / 2)
    assert (one.n, one.method) == (9, "stratified bootstrap")
    assert_percentiles(one, outcomes, level)


def test_intervals_of_one_environment_equal_those_of_scipy():
    from scipy import stats

    random = np.random.default_rng(4)
    x, y = random.normal(1, 1, 20), random.normal(0, 2, 15)
    options = {"method": "percentile", "vectorized": False, "n_resamples": 1500, "rng": random}
    other = stats.bootstrap((x,), middle, **options).confidence_interval
    one = iqm_interval([x], resamples=4000)
    assert (one.low, one.high) == pytest.approx(tuple(other), abs=0.1)
    other = stats.bootstrap((x, y), chance, **options).confidence_interval
    one = probability_of_improvement([x], [y], resamples=4000)
    assert (one.low, one.high) == pytest.approx(tuple(other), abs=0.02)


def test_strata_are_kept_separate():
    """Environments that differ greatly do not widen the interval; only their runs' spread does."""
    near, far = [1.0, 1.1, 0.9, 1.0], [1001.0, 1001.1, 1000.9, 1001.0]
    apart, pooled = iqm_interval([near, far]), iqm_interval([[*near, *far]])
    assert apart.value == pooled.value
    assert apart.high - apart.low < 1 < 100 < pooled.high - pooled.low


def test_each_environment_counts_the_same_for_improvement():
    one = probability_of_improvement([[2.0] * 9, [0.0]], [[1.0] * 9, [1.0]])
    assert one.value == 0.5


def test_improvement_in_one_environment_is_a12():
    x, y = [1.0, 4.0, 4.0, 6.0], [4.0, 2.0, 3.0]
    assert probability_of_improvement([x], [y]).value == pytest.approx(compare(x, y).a12)


def test_the_seed_decides_the_draws():
    strata = [np.random.default_rng(k).normal(size=9) for k in range(3)]
    assert iqm_interval(strata, seed=1) == iqm_interval(strata, seed=1)
    assert iqm_interval(strata, seed=1) != iqm_interval(strata, seed=2)


@pytest.mark.parametrize(
    ("strata", "value", "n"),
    [
        ([], None, 0),
        ([[], [math.nan]], None, 0),
        ([[1.0], [2.0]], 1.5, 2),
        ([[0.1] * 3, []], pytest.approx(0.1), 3),
        ([[1.0, 1.0], [5.0, 5.0]], 3.0, 4),
    ],
)
def test_iqm_without_draws_that_differ_has_no_interval(strata, value, n):
    one = iqm_interval(strata)
    assert (one.value, one.low, one.high, one.n) == (value, None, None, n)


@pytest.mark.parametrize(
    ("x", "y", "value", "n"),
    [
        ([], [], None, 0),
        ([[1.0]], [[]], None, 0),
        ([[1.0], [3.0]], [[1.0], [2.0]], 0.75, 4),
        ([[1.0, 1.0], []], [[0.0, math.nan], [5.0]], 1.0, 3),
    ],
)
def test_improvement_without_draws_that_differ_has_no_interval(x, y, value, n):
    one = probability_of_improvement(x, y)
    assert (one.value, one.low, one.high, one.n) == (value, None, None, n)


def test_samples_without_overlap_are_not_certain():
    one = probability_of_improvement([[5.0, 6.0, 7.0], [3.0]], [[1.0, 2.0, 4.0], [2.0, 2.5]])
    assert (one.value, one.low, one.high) == (1.0, None, None)


def test_both_methods_need_the_same_environments():
    with pytest.raises(ValueError, match="shorter"):
        probability_of_improvement([[1.0], [2.0]], [[1.0]])
