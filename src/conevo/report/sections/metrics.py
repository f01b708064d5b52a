"""How specialized the champions of a group are, by the measures of ``specialization.team``."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import product, starmap
from typing import NamedTuple

from conevo.report.comparison import Cell
from conevo.report.exhibits import Column, Section, Table, number, plain, rows_of
from conevo.report.sections.scope import KEYS, Scope, span
from conevo.specialization.diversity import task_specialization
from conevo.specialization.team import METRICS, Metric
from conevo.terms import S_SCALE, SHARE_SCALE

__all__ = ["definitions", "metrics"]

MOST_COLUMNS = 5  # of treatments next to each other; more are below each other
DIVERSITY = "hierarchic_social_entropy"
PAYS = "diversity that pays"
PAYING = Metric(
    lambda _: None,  # of several runs, see ``_paying``
    "plus or minus the hierarchic social entropy",
    "the runs' mean hierarchic social entropy times its correlation with their task performance; "
    "below 0: diversity costs",
    "Li et al. 2004",
)
DIRECTIONS = {
    "specialization": S_SCALE,
    "independent_specialization": "S of independent draws; 0 = always the same action",
    "relative_specialization": "0 = always the same action, 1 = as if drawn",
    "favourite_setting": SHARE_SCALE,
    "affinity": SHARE_SCALE,
    "devoted": "1 = every robot has more than half of its work in one setting",
    "favourite_action": SHARE_SCALE,
}


MEASURED = """
    SELECT cell, metric, count(*), avg(value), stddev_samp(value)
    FROM own JOIN metrics USING (run) WHERE isfinite(value) GROUP BY cell, metric
"""


class _Number(NamedTuple):
    """A measure of the champions of a cell: mean and standard deviation of the runs."""

    cell: Cell
    metric: str
    n: int
    mean: float | None
    sd: float | None

    @property
    def about(self) -> dict[str, str]:
        """Where it is, and its name with its direction."""
        direction = f" ({DIRECTIONS[self.metric]})" if self.metric in DIRECTIONS else ""
        return {"environment": self.cell.environment, "metric": _title(self.metric) + direction}

    @property
    def text(self) -> str:
        """Mean and deviation."""
        return number(self.mean) + (f" ± {number(self.sd)}" if self.sd else "")


NUMBERS: Sequence[Column[_Number]] = (*KEYS, *(Column(name) for name in _Number._fields[1:]))


def metrics(scope: Scope) -> Section:
    """Return every measure of the champions, a column per treatment."""
    title = "Measures of specialization"
    found = [_Number(*row) for row in scope.per_cell(MEASURED)]
    if not found:
        return Section(title, ["No team of these runs was studied."])
    names = [*METRICS, *sorted({one.metric for one in found} - METRICS.keys()), PAYS]
    by_place = {
        (one.cell.environment, one.metric, one.cell.treatment): one
        for one in [*found, *_paying(scope)]
    }
    places = product(scope.environments, names, scope.treatments)
    numbers = [by_place[place] for place in places if place in by_place]
    runs: dict[str, list[int]] = defaultdict(list)
    for cell, of in scope.cells.items():
        runs[cell.treatment.title].append(len(of))
    treatments = {one.title: f"{one.title} ({span(runs[one.title])})" for one in scope.treatments}
    columns = [Column("environment", "environment", plain), Column("metric", "measure", plain)]
    rows: list[dict[str, str]]
    if len(treatments) > MOST_COLUMNS:
        columns += [Column("treatment", "method", plain), Column("value", "value", plain)]
        rows = [
            one.about | {"treatment": treatments[one.cell.treatment.title], "value": one.text}
            for one in numbers
        ]
    else:
        columns += [Column(title, name, plain) for title, name in treatments.items()]
        by_metric: dict[tuple[str, str], dict[str, str]] = {}
        for one in numbers:
            row = by_metric.setdefault((one.cell.environment, one.metric), one.about)
            row[one.cell.treatment.title] = one.text
        rows = list(by_metric.values())
    table = Table(
        f"{scope.stem}-specialization-measures",
        "Measures of specialization of the champions",
        "Mean over runs ± standard deviation of the runs, champions in fresh scenarios; the end "
        "of the report explains each measure and its range. "
        f"{PAYS.capitalize()} is one number for all runs of a cell, from three on.",
        columns,
        rows,
        numbers=rows_of(NUMBERS, numbers),
    )
    return Section(title, (), [table])


def _paying(scope: Scope) -> Iterator[_Number]:
    """Yield the diversity that pays of each cell; nothing if no run has a diversity."""
    sql = "SELECT cell, run, value FROM own JOIN metrics USING (run) WHERE isfinite(value)"
    found = scope.per_cell(f"{sql} AND metric = '{DIVERSITY}'")
    diversity = {run: value for _, run, value in found}
    if not diversity:
        return
    sign = 1 if scope.main.larger_is_better else -1
    for cell in starmap(Cell, product(scope.environments, scope.treatments)):
        runs = [one for one in scope.cells.get(cell, ()) if one.run in diversity]
        reached = [sign * one.value for one in runs]
        part = task_specialization([diversity[one.run] for one in runs], reached)
        yield _Number(cell, PAYS, len(runs), part, None)


def _title(metric: str) -> str:
    return "S" if metric == "specialization" else metric.replace("_", " ")


def definitions() -> Section:
    """Return what each measure is, its range, and where it is from."""
    every = METRICS | {PAYS: PAYING}
    columns: list[Column[str]] = [
        Column("name", "measure", plain, of=_title),
        Column("span", "range", plain, of=lambda name: every[name].span),
        Column("what", "meaning", plain, of=lambda name: every[name].what),
        Column("source", "source", plain, of=lambda name: every[name].source),
    ]
    note = "R: robots of the team, A: actions of the world, K: its settings."
    title = "Measures of specialization: definitions"
    table = Table.of("measures", title, note, columns, every, is_folded=False)
    return Section("Definitions of the measures of specialization", (), [table])
