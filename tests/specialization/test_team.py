"""The table of team metrics, and the index that S comes from."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conevo.specialization.individual import degree, independent_degree, label
from conevo.specialization.switching import switching_index
from conevo.specialization.team import METRICS, Activity, measure

NAMES = ("a", "b", "c", "d", "e", "f")


def lived(lives: list[list[int]], n_actions: int) -> Activity:
    """Return the activity of robots with given sequences of actions, from the definitions."""
    counts = np.array([np.bincount(life, minlength=n_actions) for life in lives])
    switches = [sum(a != b for a, b in pairwise(life)) for life in lives]
    s = degree(switches, counts)
    labels = [label(float(one), own, NAMES) for one, own in zip(s, counts, strict=True)]
    return Activity(counts, s, labels, independent_degree(counts), range(n_actions))


def test_switching_index_with_two_tasks_is_that_of_gautrais() -> None:
    assert switching_index([0.0], 2) == 1.0  # never switches
    assert switching_index([0.5], 2) == 0.0  # as if tossing a coin
    assert switching_index([1.0], 2) == -1.0  # always
    assert switching_index([0.0, 1.0], 2) == 0.0
    assert switching_index([1.0], 4) == pytest.approx(-1 / 3)
    assert switching_index([0.3], 1) is None


@pytest.mark.parametrize("n_actions", [2, 4, 10])
def test_switching_index_of_random_actions_is_zero(n_actions: int) -> None:
    life = np.random.default_rng(1).integers(0, n_actions, 40_000).tolist()
    team = lived([life], n_actions)
    # Standard error: sqrt(p (1 - p) / n) A / (A - 1), p = 1 / A, at most 0.005.
    assert switching_index(team.specialization, n_actions) == pytest.approx(0, abs=0.02)


def test_a_team_of_perfect_specialists() -> None:
    """Four robots, each with its own action."""
    assert measure(lived([[k] * 20 for k in range(4)], 4)) == {
        "specialization": 0.0,
        "specialized": 1.0,
        "independent_specialization": 0.0,
        "relative_specialization": 0.0,
        "favourite_setting": 1.0,
        "affinity": 1.0,
        "devoted": 1.0,
        "favourite_action": 1.0,
        "switching_index": 1.0,
        "activity_entropy": 0.0,
        "caste_entropy": 2.0,
        "mutual_information": 2.0,
        "division_by_action": 1.0,
        "division_by_robot": 1.0,
        "hierarchic_social_entropy": 2.0,
        "system_neural_diversity": 1.0,
    }


def test_a_team_of_generalists() -> None:
    """All robots do everything in turn."""
    found = measure(lived([[0, 1, 2, 3] * 5] * 4, 4))
    assert found == pytest.approx(
        {
            "specialization": 1.0,
            "specialized": 0.0,
            "independent_specialization": 0.75,
            "relative_specialization": 4 / 3,
            "favourite_setting": 0.25,
            "affinity": 0.0,
            "devoted": 0.0,
            "favourite_action": 0.25,
            "switching_index": -1 / 3,
            "activity_entropy": 2.0,
            "caste_entropy": 0.0,
            "mutual_information": 0.0,
            "division_by_action": 0.0,
            "division_by_robot": 0.0,
            "hierarchic_social_entropy": 0.0,
            "system_neural_diversity": 0.0,
        },
        abs=1e-12,
    )


def test_a_team_of_one_caste_is_specialized_but_does_not_divide_labour() -> None:
    found = measure(lived([[2] * 9] * 5, 4))
    assert (found["specialization"], found["specialized"]) == (0.0, 1.0)
    assert found["division_by_action"] is None
    assert found["division_by_robot"] == found["system_neural_diversity"] == 0.0


def test_robots_that_did_nothing() -> None:
    found = measure(lived([[], []], 3))
    assert found["specialized"] == found["caste_entropy"] == 0.0
    assert found["independent_specialization"] == found["relative_specialization"] == 0.0
    assert found["favourite_setting"] is found["affinity"] is found["favourite_action"] is None
    assert found["devoted"] == 0.0
    assert found["activity_entropy"] is found["mutual_information"] is None
    assert found["hierarchic_social_entropy"] == found["system_neural_diversity"] == 0.0


def test_settings_are_counted_without_the_actions_in_between() -> None:
    """Two robots move (2) in turn with one setting each, a third with both; a fourth only moves."""
    counts = np.array([[5, 0, 5], [0, 5, 5], [3, 2, 5], [0, 0, 9]])
    s = np.array([1.0, 1.0, 1.0, 0.0])
    labels = ["non-specialized"] * 3 + ["c"]
    found = measure(Activity(counts, s, labels, independent_degree(counts), (0, 1)))
    assert found["favourite_setting"] == pytest.approx((1 + 1 + 0.6) / 3)
    assert found["affinity"] == pytest.approx((1 + 1 + 0.2) / 3)
    assert found["devoted"] == 0.75
    assert found["favourite_action"] == pytest.approx((0.5 + 0.5 + 0.5 + 1) / 4)
    assert found["independent_specialization"] == pytest.approx((0.5 + 0.5 + 0.62 + 0) / 4)
    assert found["relative_specialization"] == pytest.approx((2 + 2 + 1 / 0.62 + 0) / 4)


def limit(text: str, n_robots: int, n_actions: int) -> float:
    """Return the number at an end of a metric's stated range."""
    known = {"log2": math.log2, "min": min, "R": n_robots, "A": n_actions, "K": n_actions}
    text = text.removesuffix(" bits")
    if text.startswith("log2 "):
        text = f"log2({text[5:]})"
    return float(eval(text, {"__builtins__": {}}, known))


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32), st.integers(2, 7), st.integers(2, 6))
def test_every_metric_stays_in_its_stated_range(seed, n_robots, n_actions) -> None:
    rng = np.random.default_rng(seed)
    lives = [
        rng.choice(n_actions, rng.integers(0, 30), p=rng.dirichlet([0.3] * n_actions)).tolist()
        for _ in range(n_robots)
    ]
    found = measure(lived(lives, n_actions))
    assert list(found) == list(METRICS)
    for name, metric in METRICS.items():
        low, high = (limit(end, n_robots, n_actions) for end in metric.span.split(" to "))
        value = found[name]
        assert value is None or low - 1e-9 <= value <= high + 1e-9, name


def test_relabelling_robots_or_actions_changes_nothing() -> None:
    rng = np.random.default_rng(3)
    lives = [rng.integers(0, 4, 50).tolist() for _ in range(6)]
    found = measure(lived(lives, 4))
    assert measure(lived(lives[::-1], 4)) == pytest.approx(found)
    assert measure(lived([[3 - a for a in life] for life in lives], 4)) == pytest.approx(found)
