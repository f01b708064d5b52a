"""How specialized the champions of a group are, by the measures of ``specialization.team``."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from conevo.report.comparison import Cell
from conevo.report.exhibits import Column, Section, Table, number, plain
from conevo.report.sections.scope import Scope, span
from conevo.specialization.diversity import task_specialization
from conevo.specialization.team import METRICS, Metric
from conevo.terms import S_SCALE, SHARE_SCALE
from conevo.typing import Record

__all__ = ["definitions", "metrics"]

MOST_COLUMNS = 5  # of treatments next to each other; more are below each other
DIVERSITY = "hierarchic_social_entropy"
PAYS = "diversity that pays"
PAYING = Metric(
    lambda _: None,  # of several runs, see ``_numbers``
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


def metrics(scope: Scope) -> Section:
    """Return every measure of the champions, a column per treatment."""
    title = "Measures of specialization"
    found: dict[str, dict[Cell, list[float]]] = defaultdict(lambda: defaultdict(list))
    diversity: dict[str, float] = {}
    for cell, run, metric, value in scope.rows(
        "SELECT run, metric, value FROM metrics WHERE isfinite(value) ORDER BY run, metric"
    ):
        found[metric][cell].append(value)
        if metric == DIVERSITY:
            diversity[run] = value
    if not found:
        return Section(title, ["No team of these runs was studied."])
    names = [*(m for m in METRICS if m in found), *sorted(found.keys() - METRICS.keys())]
    numbers = [
        scope.key(environment, treatment) | about
        for environment in scope.environments
        for metric in [*names, *([PAYS] if diversity else [])]
        for treatment in scope.treatments
        for about in _numbers(scope, Cell(environment, treatment), metric, found, diversity)
    ]
    runs: dict[str, list[int]] = defaultdict(list)
    for cell, of in scope.cells.items():
        runs[cell.treatment.title].append(len(of))
    treatments = {one.title: f"{one.title} ({span(runs[one.title])})" for one in scope.treatments}
    columns = [Column("environment", "environment", plain), Column("metric", "measure", plain)]
    if len(treatments) > MOST_COLUMNS:
        columns += [Column("treatment", "method", plain), Column("value", "value", plain)]
        rows = [
            _named(one) | {"treatment": treatments[one["treatment"]], "value": _shown(one)}
            for one in numbers
        ]
    else:
        columns += [Column(key, name, plain) for key, name in treatments.items()]
        by_metric: dict[tuple[str, str], Record] = {}
        for one in numbers:
            row = by_metric.setdefault((one["environment"], one["metric"]), _named(one))
            row[one["treatment"]] = _shown(one)
        rows = list(by_metric.values())
    table = Table(
        f"{scope.stem}-specialization-measures",
        "Measures of specialization of the champions",
        "Mean over runs ± standard deviation of the runs, champions in fresh scenarios; the end "
        "of the report explains each measure and its range. "
        f"{PAYS.capitalize()} is one number for all runs of a cell, from three on.",
        columns,
        rows,
        numbers=numbers,
    )
    return Section(title, (), [table])


def _numbers(
    scope: Scope,
    cell: Cell,
    metric: str,
    found: Mapping[str, Mapping[Cell, Sequence[float]]],
    diversity: Mapping[str, float],
) -> Iterator[Record]:
    """Yield what a measure is in a cell; nothing if the cell has none."""
    if metric == PAYS:
        of = [run for run in scope.cells.get(cell, ()) if run.run in diversity]
        sign = 1 if scope.main.larger_is_better else -1
        reached = [sign * run.value for run in of]
        part = task_specialization([diversity[run.run] for run in of], reached)
        yield {"metric": metric, "n": len(of), "mean": part, "sd": None}
    elif values := found[metric].get(cell):
        sd = float(np.std(values, ddof=1)) if len(values) > 1 else None
        yield {"metric": metric, "n": len(values), "mean": float(np.mean(values)), "sd": sd}


def _named(one: Record) -> Record:
    """Return where and what a number is."""
    metric = one["metric"]
    direction = f" ({DIRECTIONS[metric]})" if metric in DIRECTIONS else ""
    return {"environment": one["environment"], "metric": _title(metric) + direction}


def _shown(one: Record) -> str:
    return number(one["mean"]) + (f" ± {number(one['sd'])}" if one["sd"] else "")


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
