"""From outputs to actions, and from actions to labels, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from conevo.simulators.actions import Continuous, Discrete

FORCES = Continuous(  # a robot with two forces of 2 and a message, and one with a force of 1
    np.array([[-2, -2, 0], [-1, 0, 0]], np.float32),
    np.array([[2, 2, 1], [1, 0, 0]], np.float32),
    ("x", "y", "message"),
    (("right", "left"), ("up", "down")),
)


def test_outputs_are_squashed_to_the_ends_of_each_axis() -> None:
    outputs = np.array([[[0, 99, -99], [0, 99, 99]]], np.float32)
    assert FORCES.of(outputs) == pytest.approx(np.array([[[0, 2, 0], [0, 0, 0]]]), abs=1e-5)
    assert (FORCES.low <= FORCES.of(outputs)).all()
    assert (FORCES.of(outputs) <= FORCES.high).all()
    assert FORCES.nothing(1).tolist() == [[[0, 0, 0], [0, 0, 0]]]
    assert FORCES.drawn(np.full((1, 2, 3), 0.25, np.float32)).tolist() == [
        [[-1, -1, 0.25], [-0.5, 0, 0]]
    ]


def test_a_label_is_the_axis_with_the_largest_share_of_its_range() -> None:
    found = {
        FORCES.names[int(FORCES.label(np.array([[one, (0, 0, 0)]], np.float32))[0, 0])]: one
        for one in ((0.19, 0.1, 1), (0.21, 0, 0), (-0.5, 0.4, 0), (1, 1.5, 0), (0, -0.3, 0))
    }
    assert list(found) == ["rest", "right", "left", "up", "down"]
    of_small = FORCES.label(np.array([[(0, 0, 0), (-0.3, 0, 0)]], np.float32))
    assert FORCES.names[int(of_small[0, 1])] == "left"


def test_an_axis_without_a_negative_direction_has_one_label() -> None:
    ends = np.array([[0, -1, 0]], np.float32), np.array([[1, 1, 2]], np.float32)
    pushes = Continuous(*ends, ("a", "b", "c"), (("a",), ("b up", "b down"), ("c",)))
    actions = np.array([[(0, 0, 0)], [(1, 0.5, 0)], [(0, -1, 0)], [(0.5, 0, 2)]], np.float32)
    found = [pushes.names[label] for label in pushes.label(actions)[:, 0]]
    assert found == ["rest", "a", "b down", "c"]


def test_a_discrete_action_is_the_highest_output_that_the_robot_has() -> None:
    moves = Discrete(("stay", "left", "right"), np.array([3, 2]))
    outputs = np.array([[[0, 1, 2], [0, 0, 9]]], np.float32)
    assert moves.of(outputs).tolist() == [[2, 0]]
    assert moves.drawn(np.full((1, 2, 3), 0.999, np.float32)).tolist() == [[2, 1]]
    assert moves.names == ("stay", "left", "right")
    assert moves.label(moves.nothing(2)).tolist() == [[0, 0], [0, 0]]
