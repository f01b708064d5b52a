"""The exact cost of a group's runs in words, and headings that distinguish two budgets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from conevo.campaigns.tables import Tables
from conevo.report.comparison import Group

__all__ = ["Spent", "headings", "spent_by"]


class Spent(NamedTuple):
    """The cost of the runs of a group.

    runs: finished ones. is_stage: whether they are stages of shapings. evaluations, steps: team
    evaluations and team-steps of a run, lowest, highest and mean. ended: why runs ended, with how
    many did. presets, versions: named ones, of runs and of conevo.
    """

    runs: int
    is_stage: bool
    evaluations: tuple[int, int, float]
    steps: tuple[int, int, float]
    ended: dict[str, int]
    presets: tuple[str, ...]
    versions: tuple[str, ...]

    @property
    def words(self) -> str:
        """All of it in a sentence or two."""
        kind = "stage" if self.is_stage else "run"
        who = f"Each of the {self.runs:,} {kind}s" if self.runs > 1 else f"The {kind}"
        named = [name for name in self.presets if name]
        about = [f"preset {' and '.join(named)}"] if named else []
        about.append(f"conevo {' and '.join(self.versions)}")
        text = (
            f"{who} spent {_between(self.evaluations, 'team evaluations')}, "
            f"{_between(self.steps, 'team-steps')}; {'; '.join(about)}."
        )
        for reason, why in (("target", "at the target"), ("time", "at the time limit")):
            if self.ended.get(reason):
                text += f" {self.ended[reason]:,} ended {why}, before the budget was spent."
        return text

    @property
    def short(self) -> str:
        """The words that distinguish this budget from another one of the same preset."""
        low, high, _ = self.evaluations
        of = round(self.steps[2] / max(self.evaluations[2], 1))
        span = f"{low:,}" if low == high else f"{low:,} to {high:,}"
        return f"{span} team evaluations {'a stage ' if self.is_stage else ''}of {of:,} team-steps"


def spent_by(tables: Tables, group: Group) -> Spent:
    """Return the cost of the finished runs of a group."""
    rows = tables.query(
        "SELECT evaluations, team_steps, stopped_by, preset, conevo, contains(run, '/stage-')"
        f" FROM runs JOIN budgets USING (run) WHERE {group.condition} ORDER BY run"
    )[1]
    evaluations, steps, reasons, presets, versions, stages = zip(*rows, strict=True)
    return Spent(
        runs=len(rows),
        is_stage=any(stages),
        evaluations=_range(evaluations),
        steps=_range(steps),
        ended=dict(Counter(reasons)),
        presets=tuple(sorted(set(presets))),
        versions=tuple(sorted(set(versions))),
    )


def headings(groups: Sequence[Group], spent: Sequence[Spent]) -> list[str]:
    """Return a heading for each group: with its budget where another has the same one without."""
    plain = [
        ", ".join(part for part in (one.world, one.family, *of.presets) if part)
        for one, of in zip(groups, spent, strict=True)
    ]
    return [
        f"{title}, {of.short}" if plain.count(title) > 1 else title
        for title, of in zip(plain, spent, strict=True)
    ]


def _range(numbers: Sequence[int]) -> tuple[int, int, float]:
    return min(numbers), max(numbers), sum(numbers) / len(numbers)


def _between(of: tuple[int, int, float], unit: str) -> str:
    """Return lowest, highest and mean in words."""
    low, high, mean = of
    return f"{low:,} {unit}" if low == high else f"{low:,} to {high:,} {unit} (mean {mean:,.0f})"
