"""How specialized the champions of a group are, by the measures of ``specialization.team``."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

import numpy as np

from conevo.report.comparison import Cell, Treatment
from conevo.report.exhibits import Column, Section, Table, number, plain
from conevo.report.sections.scope import Scope, span
from conevo.specialization.diversity import task_specialization
from conevo.specialization.team import METRICS
from conevo.terms import S_SCALE, SHARE_SCALE

__all__ = ["definitions", "metrics"]

MOST_COLUMNS = 5  # of treatments next to each other; more are below each other
DIVERSITY = "hierarchic_social_entropy"
PAYS = "diversity that pays"
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
    found: dict[tuple[str, Cell], list[float]] = defaultdict(list)
    diversity: dict[str, float] = {}
    for cell, run, metric, value in scope.rows(
        "SELECT run, metric, value FROM metrics WHERE isfinite(value) ORDER BY run, metric"
    ):
        found[metric, cell].append(value)
        if metric == DIVERSITY:
            diversity[run] = value
    if not found:
        return Section(title, ["No team of these runs was studied."])
    seen = {metric for metric, _ in found}
    names = [*(m for m in METRICS if m in seen), *sorted(seen - set(METRICS))]
    treatments = {
        treatment: f"{treatment.title} ({span(counts)})"
        for treatment in scope.treatments
        if (counts := [len(of) for cell, of in scope.cells.items() if cell.treatment == treatment])
    }
    rows = []
    numbers: list[dict[str, object]] = []
    for environment in scope.environments:
        for metric in names:
            row: dict[str, str] = {
                "environment": environment,
                "metric": _title(metric)
                + (f" ({DIRECTIONS[metric]})" if metric in DIRECTIONS else ""),
            }
            for treatment in treatments:
                values = found.get((metric, Cell(environment, treatment)))
                if values:
                    mean = float(np.mean(values))
                    sd = float(np.std(values, ddof=1)) if len(values) > 1 else None
                    row[treatment.title] = number(mean) + (f" ± {number(sd)}" if sd else "")
                    numbers.append(
                        scope.key(environment, treatment)
                        | {"metric": metric, "n": len(values), "mean": mean, "sd": sd}
                    )
            rows.append(row)
        if diversity:
            rows.append(_what_pays(scope, environment, treatments, diversity, numbers))
    columns = [
        Column("environment", "environment", plain),
        Column("metric", "measure", plain),
        *(Column(t.title, name, plain) for t, name in treatments.items()),
    ]
    if len(treatments) > MOST_COLUMNS:
        columns = [
            *columns[:2],
            Column("treatment", "method", plain),
            Column("value", "value", plain),
        ]
        rows = [
            {"environment": row["environment"], "metric": row["metric"]}
            | {"treatment": name, "value": row[treatment.title]}
            for row in rows
            for treatment, name in treatments.items()
            if treatment.title in row
        ]
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


def _title(metric: str) -> str:
    return "S" if metric == "specialization" else metric.replace("_", " ")


def _what_pays(
    scope: Scope,
    environment: str,
    treatments: Mapping[Treatment, str],
    diversity: Mapping[str, float],
    numbers: list[dict[str, object]],
) -> dict[str, str]:
    """Return the part of diversity that pays, of each treatment, and add it to the numbers."""
    row = {"environment": environment, "metric": PAYS}
    for treatment in treatments:
        ran = scope.cells.get(Cell(environment, treatment), ())
        of = [one for one in ran if one.run in diversity]
        sign = 1 if scope.main.larger_is_better else -1
        reached = [sign * one.value for one in of]
        part = task_specialization([diversity[one.run] for one in of], reached)
        row[treatment.title] = number(part)
        about = {"metric": PAYS, "n": len(of), "mean": part, "sd": None}
        numbers.append(scope.key(environment, treatment) | about)
    return row


def definitions() -> Section:
    """Return what each measure is, its range, and where it is from."""
    rows = [
        {
            "name": _title(name),
            "span": metric.span,
            "what": metric.what,
            "source": metric.source,
        }
        for name, metric in METRICS.items()
    ]
    rows.append(
        {
            "name": PAYS,
            "span": "plus or minus the hierarchic social entropy",
            "what": "the runs' mean hierarchic social entropy times its correlation with their "
            "task performance; below 0: diversity costs",
            "source": "Li et al. 2004",
        }
    )
    columns = [
        Column("name", "measure", plain),
        Column("span", "range", plain),
        Column("what", "meaning", plain),
        Column("source", "source", plain),
    ]
    note = "R: robots of the team, A: actions of the world, K: its settings."
    name = "Measures of specialization: definitions"
    table = Table("measures", name, note, columns, rows, is_folded=False)
    return Section("Definitions of the measures of specialization", (), [table])
