"""Intra-class correlation: by hand, against tables added up cell by cell, and for known truth."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from conevo.studies.repeatability import (
    LEAST_RELIABILITY,
    has_signal,
    repeatability,
    spearman_brown,
    trials_for,
)


def drawn(seed: int, shape: tuple[int, ...], icc: float, *, hardness: float = 2.0) -> np.ndarray:
    """Return fitness [K, P, S, M] whose genotypes have a share ``icc`` of variance 1."""
    rng = np.random.default_rng(seed)
    n_trials, *groups, _ = shape
    return (
        np.sqrt(icc) * rng.normal(size=shape[1:])
        + np.sqrt(1 - icc) * rng.normal(size=shape)
        + hardness * rng.normal(size=(n_trials, *groups, 1))
    )


def slow_icc(groups: list[np.ndarray]) -> float:
    """Return ICC(C,1) of tables [K, M], from their sums of squares, added up cell by cell."""
    between = within = freedom = 0.0
    n_trials = len(groups[0])
    for x in groups:
        n_units, grand = x.shape[1], x.mean()
        between += sum(n_trials * (x[:, m].mean() - grand) ** 2 for m in range(n_units))
        within += sum(
            (x[k, m] - x[k].mean() - x[:, m].mean() + grand) ** 2
            for k in range(n_trials)
            for m in range(n_units)
        )
        freedom += n_units - 1
    square, error = between / freedom, within / (freedom * (n_trials - 1))
    return (square - error) / (square + (n_trials - 1) * error)


def test_an_example_by_hand() -> None:
    # Two trials of three genotypes. Less the mean of the trial: -2, -1, 3 and -2, 0, 2.
    # Between genotypes: 2 (4 + 1/4 + 25/4) = 21 with 2 degrees of freedom, mean square 10.5; of
    # the sum of squares 22 is left 1, with 2 degrees of freedom, mean square 0.5.
    found = repeatability(np.array([[1.0, 2, 6], [3, 5, 7]])[:, None, None])
    assert found.icc == pytest.approx((10.5 - 0.5) / (10.5 + 0.5))
    assert found.n_units == 3
    # Without each of the three, a pair is left: -1/2, 1/2 and -1, 1; 3/2 = 9/4 and 1/4; ...
    pairs = [slow_icc([np.array(x)]) for x in ([[2.0, 6], [5, 7]], [[1.0, 6], [3, 7]],
                                               [[1.0, 2], [3, 5]])]  # fmt: skip
    mean = sum(pairs) / 3
    error = np.sqrt(2 / 3 * sum((one - mean) ** 2 for one in pairs))
    assert found.standard_error == pytest.approx(error)
    assert found.high == pytest.approx(found.icc + stats.t.ppf(0.975, 2) * error)


@pytest.mark.parametrize("shape", [(4, 12, 3, 5), (3, 2, 2, 6), (7, 1, 1, 8)])
def test_it_equals_tables_added_up_cell_by_cell(shape) -> None:
    x = drawn(1, shape, 0.3)
    n_populations, n_genotypes = shape[1], shape[3]
    found = repeatability(x)
    groups = [x[:, p, s] for p in range(shape[1]) for s in range(shape[2])]
    assert found.icc == pytest.approx(slow_icc(groups), rel=1e-12)
    if n_populations >= 10:
        without = [np.delete(x, p, axis=1) for p in range(n_populations)]
    else:
        without = [np.delete(x, m, axis=3) for m in range(n_genotypes)]
    one_less = np.array(
        [slow_icc([y[:, p, s] for p in range(y.shape[1]) for s in range(shape[2])])
         for y in without]
    )  # fmt: skip
    n = len(one_less)
    assert found.standard_error == pytest.approx(one_less.std() * np.sqrt(n - 1), rel=1e-9)


def test_neither_scale_nor_order_nor_how_hard_a_trial_is_matters() -> None:
    x, rng = drawn(2, (6, 3, 2, 7), 0.2), np.random.default_rng(0)
    first = repeatability(x)
    harder = x * 5 + rng.normal(size=(6, 3, 2, 1)) * 100
    for other in (harder, x[::-1], x[:, ::-1], rng.permutation(x, axis=3)):
        again = repeatability(other)
        assert again.icc == pytest.approx(first.icc, rel=1e-9)
        assert again.standard_error == pytest.approx(first.standard_error, rel=1e-9)


@pytest.mark.parametrize("icc", [0.0, 0.05, 0.6])
@pytest.mark.parametrize("shape", [(20, 12, 2, 10), (20, 1, 1, 60)])
def test_the_truth_is_found_and_the_interval_covers_it_at_the_right_rate(icc, shape) -> None:
    found = [repeatability(drawn(seed, shape, icc)) for seed in range(150)]
    values = np.array([one.icc for one in found])
    assert abs(values.mean() - icc) < 4 * values.std() / np.sqrt(len(values)) + 0.003
    errors = np.array([one.standard_error for one in found])
    assert errors.mean() == pytest.approx(values.std(), rel=0.25)
    held = sum(one.low <= icc <= one.high for one in found)
    assert stats.binomtest(held, len(found), 0.95).pvalue > 0.001


def test_a_genotype_without_a_finite_fitness_is_left_out() -> None:
    x = drawn(3, (5, 2, 1, 6), 0.4)
    x[2, 0, 0, 1], x[4, 1, 0, 5], x[0, 1, 0, 5] = np.inf, np.nan, -np.inf
    rest = [np.delete(x[:, 0, 0], 1, axis=1), np.delete(x[:, 1, 0], 5, axis=1)]
    found = repeatability(x)
    assert (found.icc, found.n_units) == (pytest.approx(slow_icc(rest)), 10)


def test_slots_that_are_not_in_use_change_nothing() -> None:
    x = drawn(4, (5, 12, 3, 6), 0.4)
    x[:, :, 2] = np.nan
    found, fewer = repeatability(x), repeatability(x[:, :, :2])
    assert (found.icc, found.standard_error) == pytest.approx((fewer.icc, fewer.standard_error))


@pytest.mark.parametrize("value", [0.0, 0.1, 1e6 / 3])
def test_equal_fitness_has_no_correlation(value) -> None:
    rng = np.random.default_rng(0)
    same = np.full((4, 2, 1, 5), value) + rng.normal(size=(4, 2, 1, 1)) * (value > 1)
    found = repeatability(same)
    assert (found.icc, found.standard_error, found.low) == (None, None, None)
    assert not has_signal(found.icc)


def test_too_few_genotypes_have_no_error() -> None:
    found = repeatability(np.array([[1.0, 2], [2, 4]])[:, None, None])
    assert found.icc == pytest.approx((2.25 - 0.25) / (2.25 + 0.25))
    assert found.standard_error is None
    assert repeatability(np.array([[1.0], [2]])[:, None, None]).icc is None


def test_spearman_brown_is_the_reliability_of_a_mean() -> None:
    assert spearman_brown(0.5, 2) == pytest.approx(2 / 3)
    assert spearman_brown(0.2, 1) == 0.2
    assert spearman_brown(-0.1, 50) == 0  # an estimate below 0 has no meaning
    x = drawn(5, (60, 400, 1, 20), 0.1, hardness=0)
    means = x.reshape(2, 30, 400, 1, 20).mean(axis=1)
    assert repeatability(means).icc == pytest.approx(spearman_brown(0.1, 30), abs=0.02)


def test_the_trials_for_half_give_half() -> None:
    assert trials_for(0.055) == pytest.approx(17.18, abs=0.01)
    assert spearman_brown(0.055, trials_for(0.055)) == pytest.approx(0.5)
    assert spearman_brown(0.055, trials_for(0.055, 0.8)) == pytest.approx(0.8)
    assert trials_for(0.0) is trials_for(-0.2) is trials_for(None) is None


def test_signal_starts_at_the_bound() -> None:
    assert has_signal(LEAST_RELIABILITY)
    assert has_signal(0.9)
    assert not has_signal(LEAST_RELIABILITY - 1e-9)
    assert not has_signal(None)
