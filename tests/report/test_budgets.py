"""Budgets of runs in words: exact, and distinguished if headings would be the same."""

from __future__ import annotations

from conevo.report.comparison import Group
from conevo.report.sections.budgets import Spent, headings

DESK = Spent(20, False, (49920, 50000, 49980.0), (62_400_000, 62_500_000, 62_475_000.0),
             {"budget": 20}, ("desk",), ("0.1.0",))  # fmt: skip


def test_a_budget_is_exact() -> None:
    assert DESK.words == (
        "Each of the 20 runs spent 49,920 to 50,000 team evaluations (mean 49,980), 62,400,000 to "
        "62,500,000 team-steps (mean 62,475,000); preset desk; conevo 0.1.0."
    )


def test_a_single_run_or_stage_and_early_ends_are_named() -> None:
    one = DESK._replace(
        runs=1, is_stage=True, evaluations=(300, 300, 300.0), steps=(6000, 6000, 6000.0),
        ended={"target": 1}, presets=("",), versions=("0.1.0", "0.2.0"),
    )  # fmt: skip
    assert one.words == (
        "The stage spent 300 team evaluations, 6,000 team-steps; conevo 0.1.0 and 0.2.0. "
        "1 ended at the target, before the budget was spent."
    )


def test_headings_differ_if_only_the_budget_does() -> None:
    groups = [Group("rover-v2", "complex", "a"), Group("rover-v2", "complex", "b"),
              Group("rover-v2", "simple", "c")]  # fmt: skip
    small = DESK._replace(evaluations=(300, 320, 310.0), steps=(6000, 6400, 6200.0))
    assert headings(groups, [DESK, small, DESK]) == [
        "rover-v2, complex, desk, 49,920 to 50,000 team evaluations of 1,250 team-steps",
        "rover-v2, complex, desk, 300 to 320 team evaluations of 20 team-steps",
        "rover-v2, simple, desk",
    ]
