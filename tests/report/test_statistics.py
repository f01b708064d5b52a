"""Tests of two samples against statsmodels, published numbers and brute force."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conevo.report.statistics import (
    Comparison,
    compare,
    holm,
    is_alike,
    mean_interval,
    normality,
    proportion_interval,
)

pytestmark = pytest.mark.filterwarnings("error")

# Student's sleep data, as printed with R's t.test.
SLEEP_1 = (0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0)
SLEEP_2 = (1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4)


# Results of statsmodels for samples and families with ties.
STATSMODELS = json.loads(Path(__file__).with_name("statsmodels.json").read_text())


def test_sleep_has_the_published_tests_and_interval():
    one = compare(SLEEP_1, SLEEP_2)
    assert (one.n_a, one.n_b) == (10, 10)
    assert one.p_t == pytest.approx(0.07919, abs=5e-6)
    assert one.p_welch == pytest.approx(0.07939, abs=5e-6)
    assert (one.low, one.high) == pytest.approx((-3.3654832, 0.2054832), abs=5e-8)
    assert (one.mean_a, one.mean_b, one.difference) == pytest.approx((0.75, 2.33, -1.58))
    assert (one.sd_a, one.sd_b) == pytest.approx((1.789010, 2.002249), abs=5e-7)


@pytest.mark.parametrize("row", STATSMODELS["t_tests"])
def test_t_tests_and_interval_equal_those_of_statsmodels(row):
    one = compare(row["a"], row["b"])
    for name in ("p_t", "p_welch", "low", "high"):
        assert getattr(one, name) == pytest.approx(row[name], rel=1e-9)


def test_swapped_samples_swap_everything():
    a, b = STATSMODELS["t_tests"][3]["a"], STATSMODELS["t_tests"][3]["b"]
    one, other = compare(a, b), compare(b, a)
    assert one == replace(
        other,
        n_a=other.n_b,
        n_b=other.n_a,
        mean_a=other.mean_b,
        mean_b=other.mean_a,
        sd_a=other.sd_b,
        sd_b=other.sd_a,
        difference=-other.difference,
        low=pytest.approx(-other.high),
        high=pytest.approx(-other.low),
        p_t=pytest.approx(other.p_t),
        p_welch=pytest.approx(other.p_welch),
        p_mann_whitney=pytest.approx(other.p_mann_whitney),
        a12=pytest.approx(1 - other.a12),
    )


NOTHING = dict.fromkeys(Comparison.__dataclass_fields__)


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        pytest.param([], [], {"n_a": 0, "n_b": 0}, id="no runs"),
        pytest.param(
            [], [1, 3], {"n_a": 0, "n_b": 2, "mean_b": 2.0, "sd_b": math.sqrt(2)}, id="one empty"
        ),
        pytest.param(
            [4.0],
            [1.0, 3.0],
            {"n_a": 1, "n_b": 2, "mean_a": 4.0, "mean_b": 2.0, "sd_b": math.sqrt(2)}
            | {"difference": 2.0, "p_mann_whitney": 2 / 3, "a12": 1.0, "smallest_p": 2 / 3},
            id="a single run",
        ),
        pytest.param(
            [0.1] * 3,
            [0.1] * 3,
            {"n_a": 3, "n_b": 3, "mean_a": 0.1, "mean_b": 0.1, "sd_a": 0.0, "sd_b": 0.0}
            | {"difference": 0.0, "p_mann_whitney": 1.0, "a12": 0.5, "smallest_p": 0.1},
            id="all equal",
        ),
        pytest.param(
            [0.3] * 4,
            [0.1] * 4,
            {"n_a": 4, "n_b": 4, "mean_a": 0.3, "mean_b": 0.1, "sd_a": 0.0, "sd_b": 0.0}
            | {"difference": 0.3 - 0.1, "p_mann_whitney": 2 / 70, "a12": 1.0}
            | {"smallest_p": 2 / 70},
            id="two constants",
        ),
    ],
)
def test_degenerate_samples_have_a_stated_result(a, b, expected):
    assert vars(compare(a, b)) == NOTHING | expected


def test_one_constant_sample_is_enough_for_the_t_tests():
    from scipy import stats

    one = compare([5, 5, 5, 5], [1, 2, 4, 6])
    student = stats.ttest_ind_from_stats(5, 0, 4, one.mean_b, one.sd_b, 4)
    assert one.p_t == pytest.approx(student.pvalue)
    against_five = stats.ttest_1samp([1, 2, 4, 6], 5)
    assert one.p_welch == pytest.approx(against_five.pvalue)


def test_tiny_deviations_do_not_vanish():
    small, large = (compare(scale * np.array([1, 2, 4]), [0, 0, 0]) for scale in (1e-150, 1.0))
    assert (small.p_t, small.p_welch) == pytest.approx((large.p_t, large.p_welch))


def test_values_that_are_not_finite_are_left_out():
    gaps = [0.7, math.nan, -1.6, math.inf, -0.2, -math.inf]
    assert compare(gaps, SLEEP_2) == compare(SLEEP_1[:3], SLEEP_2)
    assert normality(gaps) == normality(SLEEP_1[:3])
    assert mean_interval(gaps) == mean_interval(SLEEP_1[:3])


def test_a_sample_has_one_value_per_run():
    with pytest.raises(ValueError, match="one value per run"):
        compare([[1.0, 2.0]], [1.0])


# Normality


def kolmogorov(n, distance):
    """Return P(D < distance) by the matrix power of Marsaglia, Tsang & Wang (2003)."""
    k = int(n * distance) + 1
    size, h = 2 * k - 1, k - n * distance
    matrix = np.array([[float(i - j + 1 >= 0) for j in range(size)] for i in range(size)])
    for i in range(size):
        matrix[i, 0] -= h ** (i + 1)
        matrix[-1, i] -= h ** (size - i)
    matrix[-1, 0] += max(2 * h - 1, 0) ** size
    for i in range(size):
        for j in range(size):
            if i - j + 1 > 0:
                matrix[i, j] /= math.factorial(i - j + 1)
    return np.linalg.matrix_power(matrix, n)[k - 1, k - 1] * math.factorial(n) / n**n


def ks_distance(values):
    """Return the largest gap between a sample and its fitted normal, walked step by step."""
    ordered, n = sorted(values), len(values)
    mean = math.fsum(values) / n
    sd = math.sqrt(math.fsum((x - mean) ** 2 for x in values) / (n - 1))
    gaps = []
    for k, x in enumerate(ordered):
        below = (1 + math.erf((x - mean) / sd / math.sqrt(2))) / 2
        gaps += [below - k / n, (k + 1) / n - below]
    return max(gaps)


def test_the_oracle_of_kolmogorov_gives_its_published_number():
    assert kolmogorov(10, 0.274) == pytest.approx(0.6284796154565042753, abs=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_ks_equals_the_exact_distribution(seed):
    values = np.random.default_rng(seed).gamma(2, size=3 + seed)
    exact = 1 - kolmogorov(len(values), ks_distance(values))
    assert normality(values).p_ks == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize(
    ("n", "five", "one"),
    [(5, 0.337, 0.405), (10, 0.258, 0.294), (20, 0.190, 0.231), (30, 0.161, 0.187)],
)
def test_lilliefors_agrees_with_his_table(n, five, one):
    """Lilliefors 1967, table 1: distances exceeded by chance in 5 and 1 of 100 samples.

    He drew 1000 samples, so his quantiles are known to about 5 +- 0.7 and 1 +- 0.3 percent.
    """
    values = np.random.default_rng(n).normal(size=n)
    skewed = [np.expm1(strength * values) for strength in np.linspace(0.01, 4, 400)]
    found = sorted((ks_distance(x), normality(x).p_lilliefors) for x in skewed)
    distances, ps = np.array(found).T
    assert np.all(np.diff(ps) <= 0)
    assert distances[0] < five < one < distances[-1]
    assert np.interp(five, distances, ps) == pytest.approx(0.05, abs=0.014)
    assert np.interp(one, distances, ps) == pytest.approx(0.01, abs=0.006)


@pytest.mark.parametrize("row", STATSMODELS["lilliefors"])
def test_lilliefors_equals_the_table_of_statsmodels(row):
    p = normality(row["values"]).p_lilliefors
    assert p == pytest.approx(row["p"], abs=0.02) or row["p"] == 0.99


def test_normal_samples_are_rejected_at_the_promised_rate():
    """Of 1000 normal samples Lilliefors rejects about 50 (+- 21 at three deviations)."""
    random = np.random.default_rng(7)
    tests = [normality(random.normal(size=8)) for _ in range(1000)]
    assert 29 <= sum(one.p_lilliefors < 0.05 for one in tests) <= 71
    # The thesis' test hardly ever rejects: the distribution was fitted to the same sample.
    assert sum(one.p_ks < 0.05 for one in tests) <= 2


def test_a_simulated_p_is_never_zero():
    assert normality([0.0] * 19 + [1.0]).p_lilliefors == 1 / 10_001


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 2.0], [0.1] * 9])
def test_normality_needs_three_runs_that_are_not_equal(values):
    one = normality(values)
    assert (one.n, one.p_ks, one.p_lilliefors) == (len(values), None, None)


def test_normality_is_the_same_on_any_scale_and_every_time():
    values = np.random.default_rng(1).normal(size=20)
    one, other = normality(values), normality(1e6 * values - 3e7)
    assert other.p_ks == pytest.approx(one.p_ks, rel=1e-6)
    assert other.p_lilliefors == one.p_lilliefors


# Families of tests


def closed(ps, k):
    """Return Holm's p of test k as the closure of Bonferroni: the worst of all sub-families."""
    others = [p for j, p in enumerate(ps) if j != k]
    return max(
        min(1.0, (1 + size) * min(ps[k], *subset))
        for size in range(len(others) + 1)
        for subset in itertools.combinations(others, size)
        if subset or size == 0
        for subset in [(*subset, ps[k])]
    )


@given(st.lists(st.floats(0, 1), min_size=1, max_size=7))
def test_holm_is_the_closure_of_bonferroni(ps):
    assert holm(ps) == pytest.approx([closed(ps, k) for k in range(len(ps))])


def test_holm_equals_that_of_statsmodels():
    for row in STATSMODELS["holm"]:
        assert holm(row["ps"]) == pytest.approx(row["adjusted"])


def test_holm_of_a_worked_family():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


def test_impossible_tests_do_not_count():
    assert holm([0.02, None, 0.01, math.nan]) == pytest.approx([0.02, None, 0.02, None])
    assert holm([]) == []
    assert holm([None]) == [None]


# Alike


def around(mean, sd, n=20):
    """Return n values with exactly this mean and deviation."""
    values = np.random.default_rng(n).normal(size=n)
    return mean + sd * (values - values.mean()) / values.std(ddof=1)


@pytest.mark.parametrize(
    ("a", "b", "alike"),
    [
        pytest.param(around(100, 5), around(101, 5), True, id="close together"),
        pytest.param(around(-100, 5), around(-101, 5), True, id="below zero"),
        pytest.param(around(100, 60), around(101, 60), False, id="no evidence"),
        pytest.param(around(100, 5), around(105, 5), False, id="small but significant"),
        pytest.param(around(100, 5, 3), around(101, 5, 3), True, id="three runs, close together"),
        pytest.param(around(100, 9, 3), around(101, 9, 3), False, id="three runs, wide"),
        pytest.param([1.0] * 20, [1.0] * 20, False, id="no spread, no error to judge by"),
        pytest.param([0.0] * 20, [0.0] * 20, False, id="nothing happened"),
        pytest.param([1.0], [1.0], False, id="a run of each"),
        pytest.param([], [], False, id="no runs"),
    ],
)
def test_alike_needs_evidence(a, b, alike):
    assert is_alike(compare(a, b)) is alike
    assert is_alike(compare(b, a)) is alike


def test_the_margin_is_of_the_larger_mean():
    fields = {"mean_a": 80.0, "mean_b": 100.0, "p_t": 0.5, "p_welch": 0.5, "p_mann_whitney": 0.5}
    at = Comparison(**(NOTHING | fields | {"low": -15.0, "high": 15.0}))
    assert is_alike(at)
    assert not is_alike(replace(at, low=-15.1))
    assert not is_alike(replace(at, high=15.1))
    assert not is_alike(at, margin=0.1)
    for test in ("p_t", "p_welch", "p_mann_whitney"):
        assert not is_alike(replace(at, **{test: 0.049}))
        assert is_alike(replace(at, **{test: 0.05}))


# Intervals of one sample


@pytest.mark.parametrize(("level", "reach"), [(0.9, 1.8331129), (0.95, 2.2621572)])
def test_the_mean_interval_has_the_half_width_of_students_table(level, reach):
    one = mean_interval(SLEEP_1, level)
    error = 1.789010 / math.sqrt(10)
    assert one.value == pytest.approx(0.75)
    assert (one.low, one.high) == pytest.approx((0.75 - reach * error, 0.75 + reach * error))
    assert (one.n, one.method) == (10, "Student's t")


@pytest.mark.parametrize(("values", "mean"), [([], None), ([3.0], 3.0), ([0.1] * 3, 0.1)])
def test_mean_interval_needs_two_runs_that_differ(values, mean):
    one = mean_interval(values)
    assert (one.value, one.low, one.high, one.n) == (mean, None, None, len(values))


@pytest.mark.parametrize("n", [1, 5, 20])
def test_proportion_interval_of_none_and_of_all(n):
    none, all_of_them = proportion_interval(0, n), proportion_interval(n, n)
    assert (none.value, none.low, none.n) == (0, 0, n)
    assert none.high == pytest.approx(1 - 0.025 ** (1 / n))
    assert (all_of_them.value, all_of_them.high) == (1, 1)
    assert all_of_them.low == pytest.approx(0.025 ** (1 / n))


def test_the_proportion_interval_ends_where_chance_has_one_fortieth():
    def share(p, counts):
        return sum(math.comb(20, c) * p**c * (1 - p) ** (20 - c) for c in counts)

    one = proportion_interval(13, 20)
    assert share(one.low, range(13, 21)) == pytest.approx(0.025)
    assert share(one.high, range(14)) == pytest.approx(0.025)


def test_a_share_of_no_runs_is_unknown_and_of_more_than_all_is_refused():
    assert proportion_interval(0, 0).value is None
    with pytest.raises(ValueError, match="3 of 2 runs"):
        proportion_interval(3, 2)
