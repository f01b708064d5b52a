"""Mann-Whitney against full enumeration and scipy; A12 against its definition."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conevo.report.ranks import EXACT_RUNS, above, mann_whitney, smallest_mann_whitney
from conevo.report.statistics import compare

pytestmark = pytest.mark.filterwarnings("error")

few = st.lists(st.integers(0, 4).map(float), min_size=1, max_size=6)


def enumerated(a, b):
    """Return the share of all divisions of the pool whose A12 is as far from a half."""
    pool = [*a, *b]

    def apart(chosen):
        x = [pool[k] for k in chosen]
        y = [pool[k] for k in range(len(pool)) if k not in chosen]
        return abs(sum(2 * (v > w) + (v == w) for v in x for w in y) - len(x) * len(y))

    observed = apart(range(len(a)))
    divisions = list(itertools.combinations(range(len(pool)), len(a)))
    return sum(apart(chosen) >= observed for chosen in divisions) / len(divisions)


@given(few, few)
def test_exact_p_is_that_of_all_divisions_of_the_runs_including_ties(a, b):
    assert mann_whitney(np.array(a), np.array(b)) == pytest.approx(enumerated(a, b))


@pytest.mark.parametrize(("n", "m"), [(1, 1), (3, 8), (20, 20), (5, 55), (30, 30)])
def test_exact_p_equals_that_of_scipy_without_ties(n, m):
    from scipy import stats

    random = np.random.default_rng(n * m)
    x, y = random.normal(0.4, 1, n), random.normal(0, 1, m)
    assert n + m <= EXACT_RUNS
    other = stats.mannwhitneyu(x, y, method="exact").pvalue
    assert mann_whitney(x, y) == pytest.approx(other, rel=1e-9)


def test_the_approximation_agrees_with_the_exact_test_at_the_transition():
    random = np.random.default_rng(2)
    x, y = random.normal(0.5, 1, 31), random.normal(0, 1, 30)
    exact = mann_whitney(x[:30], y)
    from scipy import stats

    assert exact == pytest.approx(stats.mannwhitneyu(x[:30], y, method="asymptotic")[1], rel=0.05)
    assert mann_whitney(x, y) == pytest.approx(stats.mannwhitneyu(x, y, method="exact")[1], rel=0.1)


def test_many_equal_runs_have_no_effect():
    assert mann_whitney(np.full(40, 0.1), np.full(40, 0.1)) == 1.0


def test_published_tail_of_five_against_five():
    """Mann & Whitney 1947, table I: U <= 2 has probability .016 for n = m = 5."""
    x, y = np.array([1.0, 2, 3, 4, 7]), np.array([5.0, 6, 8, 9, 10])
    assert above(x, y).sum() == 2
    assert mann_whitney(x, y) == pytest.approx(2 * 4 / 252)


@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 6), (3, 3), (4, 4), (5, 3), (20, 20)])
def test_smallest_p_is_that_of_separate_samples(n, m):
    low, high = np.arange(n, dtype=float), 100 + np.arange(m, dtype=float)
    assert smallest_mann_whitney(n, m) == pytest.approx(mann_whitney(low, high))
    assert smallest_mann_whitney(n, m) == pytest.approx(min(1, 2 / math.comb(n + m, n)))


def test_three_runs_against_three_can_never_be_significant():
    assert compare([1, 2, 3], [4, 5, 6]).smallest_p == pytest.approx(0.1)
    assert compare([1, 2, 3, 4], [5, 6, 7, 8]).smallest_p < 0.05


@given(few, few)
def test_a12_counts_wins_and_half_the_ties(a, b):
    expected = np.mean([1.0 if x > y else 0.5 if x == y else 0.0 for x in a for y in b])
    assert compare(a, b).a12 == pytest.approx(expected)
