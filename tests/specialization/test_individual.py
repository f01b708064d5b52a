"""Degree of specialization, labels and castes, for the cases of the thesis (section 3.2)."""

from itertools import pairwise

import numpy as np
import pytest

from conevo.specialization import castes, degree, label

ACTIONS = ("low", "med", "hi", "move")


def life(actions):
    """Return switches and counts of a life of actions, from their definition."""
    switches = sum(a != b for a, b in pairwise(actions))
    return switches, [actions.count(a) for a in ACTIONS]


def test_a_perfect_specialist_never_switches():
    assert degree(*life(["med"] * 100)) == 0.0


def test_a_controller_that_always_switches():
    assert degree(*life(["low", "hi"] * 50)) == 1.0


def test_a_non_specialist_spends_half_its_life_switching():
    # Eq. 3.4's example, S = 0.5: 101 actions are 100 possible switches, every second one is used.
    assert degree(*life((["low"] * 2 + ["move"] * 2) * 25 + ["low"])) == 0.5


def test_degree_of_many_robots_at_once_and_of_the_idle():
    switches = np.array([[3, 0], [0, 0]])
    counts = np.array([[[2, 2, 0, 0], [0, 1, 0, 0]], [[0, 0, 0, 0], [4, 0, 0, 0]]])
    s = degree(switches, counts)
    assert s.tolist() == [[1.0, 0.0], [0.0, 0.0]]


@pytest.mark.parametrize(
    ("s", "counts", "expected"),
    [
        (0.0, [0, 9, 0, 0], "med"),
        (0.49, [3, 2, 4, 1], "hi"),
        (0.5, [3, 2, 4, 1], "non-specialized"),
        (0.9, [9, 0, 0, 0], "non-specialized"),
        (0.2, [4, 1, 4, 0], "low"),  # a tie goes to the first
        (0.0, [0, 0, 0, 0], "non-specialized"),  # executed nothing
        (float("nan"), [1, 0, 0, 0], "non-specialized"),
    ],
)
def test_label(s, counts, expected):
    assert label(s, counts, ACTIONS) == expected


def test_castes_count_robots_the_largest_first():
    labels = ["move", "low", "non-specialized", "low", "move", "low"]
    found = castes(labels)
    assert list(found.items()) == [("low", 3), ("move", 2), ("non-specialized", 1)]
    assert castes([]) == {}
