"""Entropies of cases with known values, and against their definitions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as some_numpy

from conevo.specialization.entropy import (
    activity_entropy,
    division_of_labour,
    entropy,
    mutual_information,
)

COUNTS = some_numpy.arrays(
    np.int64,
    some_numpy.array_shapes(min_dims=2, max_dims=2, max_side=6),
    elements=st.integers(0, 9),
)


@pytest.mark.parametrize(
    ("weights", "bits"),
    [
        ([1, 1], 1.0),
        ([5, 5, 5, 5], 2.0),
        ([7, 0, 0], 0.0),
        ([0, 0], 0.0),
        ([3, 1], 0.8112781244591328),  # 2 - 0.75 log2 3
        ([0.5, 0.25, 0.125, 0.125], 1.75),  # a fair code's mean length
        ([], 0.0),
    ],
)
def test_entropy_in_bits(weights, bits) -> None:
    assert entropy(weights) == pytest.approx(bits, abs=1e-15)
    assert str(float(entropy(weights)))[0] != "-"


def test_entropy_of_many_rows_at_once() -> None:
    assert entropy([[1, 1, 0], [2, 0, 0]]).tolist() == [1.0, 0.0]


def test_activity_entropy_is_the_mean_over_active_robots() -> None:
    assert activity_entropy([[9, 0, 0, 0], [0, 4, 0, 0]]) == 0.0
    assert activity_entropy([[5, 5, 5, 5], [1, 1, 1, 1]]) == 2.0
    assert activity_entropy([[8, 8, 0, 0], [3, 0, 0, 0], [0, 0, 0, 0]]) == 0.5
    assert activity_entropy([[0, 0], [0, 0]]) is None


def test_entropy_does_not_depend_on_how_often_a_robot_switches() -> None:
    """The purpose of S: entropy is blind to the order (Nitschke 2009, section 2.3)."""
    assert activity_entropy([[50, 50]]) == activity_entropy([[2, 2]]) == 1.0


def test_division_of_labour_at_its_extremes() -> None:
    assert mutual_information(np.eye(4)) == 2.0
    assert division_of_labour(np.eye(4)) == (1.0, 1.0)
    alike = [[3, 1], [6, 2], [9, 3]]
    assert mutual_information(alike) == pytest.approx(0, abs=1e-12)
    assert division_of_labour(alike) == pytest.approx((0, 0), abs=1e-12)


def test_the_two_normalizations_distinguish_shared_actions_from_shared_robots() -> None:
    # Four robots, two actions: each robot does one, two robots do the same.
    assert division_of_labour([[5, 0], [5, 0], [0, 5], [0, 5]]) == (1.0, 0.5)
    # Two robots, four actions: each action has one robot, a robot has two.
    assert division_of_labour([[5, 5, 0, 0], [0, 0, 5, 5]]) == (0.5, 1.0)


def test_division_of_labour_of_a_worked_case() -> None:
    # H(action) = H(robot) = 1, H(both) = 1.8112781: a robot does its own action 3 times of 4.
    mutual = 2 - (2 * 0.375 * math.log2(1 / 0.375) + 2 * 0.125 * math.log2(8))
    assert mutual_information([[3, 1], [1, 3]]) == pytest.approx(mutual)
    assert division_of_labour([[3, 1], [1, 3]]) == pytest.approx((mutual, mutual))


def test_division_of_labour_where_there_is_nothing_to_divide() -> None:
    assert division_of_labour([[4, 0], [2, 0]]) == (None, 0.0)  # one action
    assert division_of_labour([[4, 2]]) == (0.0, None)  # one robot
    assert division_of_labour([[0, 0], [0, 0]]) == (None, None)
    assert mutual_information([[0, 0], [0, 0]]) is None


@settings(max_examples=60, deadline=None)
@given(COUNTS)
def test_mutual_information_is_the_divergence_from_independence(counts) -> None:
    total = counts.sum()
    if total == 0:
        assert mutual_information(counts) is None
        return
    p = counts / total
    rows, columns = p.sum(axis=1), p.sum(axis=0)
    expected = sum(
        p[i, j] * math.log2(p[i, j] / (rows[i] * columns[j])) for i, j in np.argwhere(p > 0)
    )
    assert mutual_information(counts) == pytest.approx(expected, abs=1e-9)
    by_action, by_robot = division_of_labour(counts)
    if by_action is not None:
        assert by_action == pytest.approx(expected / entropy(columns), abs=1e-9)
        assert 0 <= by_action <= 1
    if by_robot is not None:
        assert by_robot == pytest.approx(expected / entropy(rows), abs=1e-9)
        assert 0 <= by_robot <= 1
