"""Favourites and the null of S, for lives with values worked out by hand."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest

from conevo.specialization.favourite import (
    affinity,
    favourite,
    favourite_share,
    mean_where_defined,
    portion_devoted,
)
from conevo.specialization.individual import degree, independent_degree, relative_degree

NAN = float("nan")
SETTINGS = ("low", "med", "hi")


def switches(life: tuple[int, ...]) -> int:
    return sum(a != b for a, b in pairwise(life))


def test_a_robot_that_moves_and_detects_in_turn_has_a_caste_unseen_by_s() -> None:
    """Fifty times move, then low: S = 1, but all detections are with one setting."""
    life = (3, 0) * 50
    counts = np.bincount(life, minlength=4)
    assert degree(switches(life), counts) == 1
    assert independent_degree(counts) == 0.5
    assert relative_degree(1.0, 0.5) == 2
    assert favourite(counts[:3], SETTINGS) == "low"
    assert favourite_share(counts[:3]) == affinity(counts[:3]) == 1
    assert favourite_share(counts) == 0.5  # of its time


@pytest.mark.parametrize(
    ("counts", "name", "share", "liking"),
    [
        ([6, 3, 1], "low", 0.6, 0.3),
        ([2, 2, 2], "low", 1 / 3, 0),  # a tie goes to the first
        ([0, 0, 7], "hi", 1, 1),
        ([1, 5, 4], "med", 0.5, 0.1),
        ([0, 0, 0], None, NAN, NAN),
    ],
)
def test_favourites(counts, name, share, liking) -> None:
    assert favourite(counts, SETTINGS) == name
    assert favourite_share(counts) == pytest.approx(share, nan_ok=True)
    assert affinity(counts) == pytest.approx(liking, nan_ok=True)


def test_with_a_single_setting_its_share_is_one() -> None:
    assert favourite_share([[4], [0]]) == pytest.approx([1, NAN], nan_ok=True)
    assert affinity([[4], [0]]) == pytest.approx([1, NAN], nan_ok=True)


def test_devoted_robots_do_more_than_half_of_their_work_with_one_setting() -> None:
    """Of 100 actions 51 are enough, 50 are not, and an idle robot is not devoted."""
    assert portion_devoted([[51, 49], [50, 50], [0, 0], [1, 9]]) == 0.5
    assert portion_devoted([[0, 0]]) == 0


def test_a_mean_leaves_out_robots_without_a_value() -> None:
    assert mean_where_defined([0.5, NAN, 1.0]) == 0.75
    assert mean_where_defined([NAN, NAN]) is None


@pytest.mark.parametrize(
    ("counts", "expected"),
    [
        ([9, 0, 0, 0], 0),
        ([5, 5, 5, 5], 0.75),
        ([3, 1, 0, 0], 1 - 9 / 16 - 1 / 16),
        ([0, 0, 0, 0], 0),
    ],
)
def test_s_of_independent_draws(counts, expected) -> None:
    assert independent_degree(counts) == pytest.approx(expected, abs=1e-12)


def test_s_of_independent_draws_is_the_mean_over_all_possible_draws() -> None:
    """Every life of four draws, each with its probability: shares 1/2, 1/4, 1/4."""
    shares = (0.5, 0.25, 0.25)
    expected = sum(
        np.prod([shares[a] for a in life]) * degree(switches(life), np.bincount(life, minlength=3))
        for life in product(range(3), repeat=4)
    )
    assert independent_degree([2, 1, 1]) == pytest.approx(expected)


def test_relative_s_goes_from_zero_to_nine_quarters() -> None:
    found = {
        life: float(relative_degree(degree(switches(life), counts), independent_degree(counts)))
        for n in range(1, 7)
        for life in product(range(3), repeat=n)
        for counts in [np.bincount(life, minlength=3)]
    }
    assert found[0, 0, 0, 0] == found[(0,)] == 0
    assert found[0, 1, 0] == max(found.values()) == pytest.approx(9 / 4)
    assert found[0, 0, 0, 1, 1, 1] == pytest.approx((1 / 5) / 0.5)  # in blocks: below 1
    assert found[0, 1, 0, 1, 0, 1] == 2  # in turn: above
