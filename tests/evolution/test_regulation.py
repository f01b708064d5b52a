"""Thresholds and controller sizes adapt as in sections 3.5 and 3.6."""

import numpy as np
import pytest

from conevo.evolution.regulation import regulate_gst, regulate_sst, resized, stagnating, trend

RISING, FALLING, FLAT = np.arange(5.0), -np.arange(5.0), np.ones(5)
NAN = float("nan")


def test_trend_compares_the_means_of_the_halves():
    assert trend(np.array([1.0, 4.0])) == 3
    assert trend(np.array([1.0, 3.0, 100.0, 4.0, 5.0])) == 2.5  # 4.5 - 2, the middle is left out
    assert trend(FLAT) == 0
    assert trend(np.array([1.0, NAN, 2.0, np.inf])) == 1
    assert np.isnan(trend(np.array([NAN, NAN, 2.0, 3.0])))
    assert trend(np.array([[1.0, 5.0], [2.0, 3.0]])).tolist() == [1, -2]


@pytest.mark.parametrize(
    ("fitness", "specialization", "expected"),
    [
        (FLAT, RISING, 0.49),  # stagnates, S has increased: decrement
        (FALLING, RISING, 0.49),
        (FLAT, FALLING, 0.51),  # S has decreased: increment
        (FLAT, FLAT, 0.5),
        (RISING, RISING, 0.5),  # progress: leave alone
        (RISING, FALLING, 0.5),
        (np.full(5, NAN), RISING, 0.49),
        (FLAT, np.full(5, NAN), 0.5),
    ],
)
def test_sst_follows_specialization_while_fitness_stagnates(fitness, specialization, expected):
    assert regulate_sst(0.5, fitness, specialization) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("fitness", "recombinations", "expected"),
    [
        (FLAT, RISING, 0.19),  # more recombinations: decrement
        (FLAT, FALLING, 0.21),  # fewer: increment
        (FALLING, FLAT, 0.21),  # the same number: increment
        (RISING, RISING, 0.2),
        (RISING, FLAT, 0.2),
    ],
)
def test_gst_follows_recombinations_while_fitness_stagnates(fitness, recombinations, expected):
    assert regulate_gst(0.2, fitness, recombinations) == pytest.approx(expected, abs=1e-12)


def test_thresholds_stay_in_range_and_absent_ones_absent():
    assert regulate_sst(0.005, FLAT, RISING) == 0
    assert regulate_sst(0.995, FLAT, FALLING) == 1
    assert regulate_gst(1.0, FLAT, FLAT) == 1
    assert np.isnan(regulate_sst(NAN, FLAT, RISING))
    assert np.isnan(regulate_gst(NAN, FLAT, RISING))


def test_controllers_stagnate_when_their_window_is_full_and_shows_no_progress():
    # Patience 3: windows of four values, one column per population.
    past = np.array(
        [[9.0, 9.0, 9.0], [0.0, 1.0, 1.0], [0.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]
    )
    since = np.array([0, 0, 5])
    # Population 0 progressed (0, 0 -> 1, 1), 1 did not, 2's window restarted at 5.
    assert stagnating(past, 7, since, 3).tolist() == [False, True, False]
    assert stagnating(past, 8, since, 3).tolist() == [False, True, True]
    assert stagnating(past, 2, np.zeros(3, dtype=int), 3).tolist() == [False, False, False]


@pytest.mark.parametrize(
    ("active", "without", "expected"),
    [
        # Slot 1 is least needed, 9.0 >= 0.9 * 10: removed.
        ([1, 1, 1, 0], [8.0, 9.0, 2.0, NAN], [1, 0, 1, 0]),
        # Better without it: removed.
        ([1, 1, 0, 1], [12.0, 9.0, NAN, 14.0], [1, 1, 0, 0]),
        # All are needed: the lowest empty slot is filled.
        ([1, 0, 1, 0], [8.9, NAN, 2.0, NAN], [1, 1, 1, 0]),
        # All are needed and no slot is empty.
        ([1, 1, 1, 1], [1.0, 2.0, 3.0, 4.0], [1, 1, 1, 1]),
        # Never below two.
        ([1, 1, 0, 0], [9.9, 1.0, NAN, NAN], [1, 1, 0, 0]),
        # Not finite without it: needed.
        ([1, 1, 1, 0], [NAN, 8.0, -np.inf, NAN], [1, 1, 1, 1]),
    ],
)
def test_controller_size_after_lesions(active, without, expected):
    before = np.array([active, active], dtype=bool)
    without = np.array([without, without])
    after = resized(before, np.array([10.0, 10.0]), without, np.array([True, False]), 0.9)
    assert after.astype(int).tolist() == [expected, active]
    assert before.astype(int).tolist() == [active, active]


def test_controller_size_with_fitness_below_zero_unknown_or_zero():
    before = np.array([[1, 1, 1, 0]] * 4, dtype=bool)
    nine = [9.0] * 3 + [NAN]
    without = np.array([[-11.0, -20.0, -30.0, NAN], [-11.1, -20.0, -30.0, NAN], nine, nine])
    fitness = np.array([-10.0, -10.0, NAN, 0.0])
    after = resized(before, fitness, without, np.ones(4, dtype=bool), 0.9)
    kept = [1, 1, 1, 0]
    assert after.astype(int).tolist() == [[0, 1, 1, 0], [1, 1, 1, 1], kept, kept]
