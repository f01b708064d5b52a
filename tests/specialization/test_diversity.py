"""Diversity of teams with values known in closed form, and against scipy's clusters."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conevo.specialization.diversity import (
    caste_entropy,
    differences,
    hierarchic_social_entropy,
    system_neural_diversity,
    task_specialization,
)


def apart(n: int, distance: float) -> np.ndarray:
    """Return the differences of n robots, any two equally far apart."""
    return distance * (1 - np.eye(n))


def test_social_entropy_of_castes() -> None:
    """Balch's own example: one mother and three alike, 0.81 bits."""
    assert caste_entropy(["mother", "rover", "rover", "rover"]) == pytest.approx(0.8112781244591328)
    assert caste_entropy(["a"] * 9) == 0.0
    assert caste_entropy("abcdefgh") == 3.0


def test_differences_are_the_share_of_life_spent_differently() -> None:
    counts = [[10, 0, 0], [0, 3, 0], [5, 5, 0], [1, 0, 3], [0, 0, 0]]
    expected = [
        [0, 1, 0.5, 0.75, 1],
        [1, 0, 0.5, 1, 1],
        [0.5, 0.5, 0, 0.75, 1],
        [0.75, 1, 0.75, 0, 1],
        [1, 1, 1, 1, 0],  # a robot that does nothing shares this with no other
    ]
    assert differences(counts) == pytest.approx(np.array(expected))
    assert differences([[0, 0], [0, 0]]).tolist() == [[0, 0], [0, 0]]


def test_differences_of_robots_that_live_alike_are_exactly_zero() -> None:
    assert (differences([[1, 2, 4], [3, 6, 12], [7, 14, 28]]) == 0).all()


def test_hierarchic_social_entropy_in_closed_form() -> None:
    assert hierarchic_social_entropy(apart(5, 0.0)) == 0.0
    assert hierarchic_social_entropy(apart(8, 1.0)) == 3.0
    assert hierarchic_social_entropy(apart(8, 0.25)) == pytest.approx(0.75)
    # Two castes of two and six, one apart: their entropy, up to the level at which they merge.
    castes = differences([[9, 0]] * 2 + [[0, 9]] * 6)
    assert hierarchic_social_entropy(castes) == pytest.approx(caste_entropy("aabbbbbb"))
    assert hierarchic_social_entropy(apart(1, 0.0)) is None


def test_hierarchic_social_entropy_counts_levels_within_castes() -> None:
    # Pairs 0.2 apart, the pairs 0.6 apart: log2 4 bits up to 0.2, then 1 bit up to 0.6.
    d = np.full((4, 4), 0.6)
    d[:2, :2] = d[2:, 2:] = 0.2
    np.fill_diagonal(d, 0)
    assert hierarchic_social_entropy(d) == pytest.approx(0.2 * 2 + 0.4 * 1)
    # Stretched differences stretch it.
    assert hierarchic_social_entropy(d / 2) == pytest.approx(0.4)


def by_scipy(d: np.ndarray) -> float:
    """Integrate the entropy of scipy's single-linkage clusters over all levels."""
    hierarchy = pytest.importorskip("scipy.cluster.hierarchy")
    squareform = pytest.importorskip("scipy.spatial.distance").squareform
    tree = hierarchy.linkage(squareform(d, checks=False), method="single")
    levels = np.unique(np.concatenate([[0.0], tree[:, 2]]))
    total = 0.0
    for low, high in pairwise(levels):
        clusters = hierarchy.fcluster(tree, (low + high) / 2, criterion="distance")
        p = np.bincount(clusters)[1:] / len(clusters)
        total += (high - low) * -sum(share * math.log2(share) for share in p)
    return total


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32), st.integers(2, 12), st.integers(2, 5))
def test_hierarchic_social_entropy_against_scipy(seed, n_robots, n_actions) -> None:
    rng = np.random.default_rng(seed)
    d = differences(rng.integers(0, 8, (n_robots, n_actions)))
    expected = by_scipy(d)
    assert hierarchic_social_entropy(d) == pytest.approx(expected, abs=1e-9)
    order = rng.permutation(n_robots)
    assert hierarchic_social_entropy(d[np.ix_(order, order)]) == pytest.approx(expected, abs=1e-9)


def test_system_neural_diversity_in_closed_form() -> None:
    assert system_neural_diversity(apart(6, 0.0)) == 0.0
    # Bettini et al.: equally distant robots are equally diverse in any number.
    assert [system_neural_diversity(apart(n, 0.4)) for n in (2, 5, 30)] == pytest.approx([0.4] * 3)
    assert system_neural_diversity([[0.0]]) is None
    # Two castes of k: k * k of the k (2 k - 1) pairs are apart.
    for k in (1, 3, 10):
        castes = differences([[9, 0]] * k + [[0, 9]] * k)
        assert system_neural_diversity(castes) == pytest.approx(k / (2 * k - 1))


def test_a_robot_like_another_makes_a_team_less_diverse_to_one_and_not_to_the_other() -> None:
    """The criticism of entropy by Bettini et al.: it is blind to how redundant a team is."""
    lone, double = [[9, 0], [0, 9]], [[9, 0], [0, 9], [9, 0], [0, 9]]
    assert hierarchic_social_entropy(differences(double)) == 1.0
    assert hierarchic_social_entropy(differences(lone)) == 1.0
    assert system_neural_diversity(differences(double)) == pytest.approx(2 / 3)
    assert system_neural_diversity(differences(lone)) == 1.0


def test_specialization_is_the_diversity_that_pays() -> None:
    diversity = [0.2, 0.4, 0.6, 0.8]
    assert task_specialization(diversity, [1, 2, 3, 4]) == pytest.approx(0.5)
    assert task_specialization(diversity, [40, 30, 20, 10]) == pytest.approx(-0.5)
    assert task_specialization(diversity, [1, 2, 2, 1]) == pytest.approx(0)
    assert task_specialization([0, 1, 2], [0, 1, 0.5]) == pytest.approx(0.5)  # r is a half
    for x, y in (([1, 2], [3, 4]), ([1, 1, 1], [1, 2, 3]), ([1, 2, 3], [5, 5, 5])):
        assert task_specialization(x, y) is None


def test_task_specialization_against_numpy() -> None:
    x, y = np.random.default_rng(5).random((2, 30))
    assert task_specialization(x, y) == pytest.approx(x.mean() * np.corrcoef(x, y)[0, 1])
