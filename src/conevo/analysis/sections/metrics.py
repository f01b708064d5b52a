"""How specialized the champions of a group are, by the measures of ``specialization.team``."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from conevo.analysis.comparison import Cell
from conevo.analysis.exhibits import Column, Section, Table, number, plain
from conevo.analysis.sections.scope import Scope, named
from conevo.specialization.team import METRICS

__all__ = ["definitions", "metrics"]


def metrics(scope: Scope) -> Section:
    """Return every measure of the champions, a column per treatment."""
    title = "Measures of specialization"
    cells = {one.run: cell for cell, values in scope.cells.items() for one in values}
    found: dict[tuple[str, Cell], list[float]] = defaultdict(list)
    listed = scope.tables.query(
        "SELECT run, metric, value FROM metrics WHERE isfinite(value) ORDER BY run, metric"
    )[1]
    for run, metric, value in listed:
        if run in cells:
            found[metric, cells[run]].append(value)
    if not found:
        return Section(title, ["No team of these runs was studied."])
    seen = {metric for metric, _ in found}
    names = [*(m for m in METRICS if m in seen), *sorted(seen - set(METRICS))]
    treatments = named(scope.treatments, scope.cells)
    rows = []
    numbers: list[dict[str, object]] = []
    for environment in scope.environments:
        for metric in names:
            row: dict[str, str] = {"environment": environment, "metric": metric.replace("_", " ")}
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
    columns = [
        Column("environment", "environment", plain),
        Column("metric", "measure", plain),
        *(Column(t.title, name, plain) for t, name in treatments.items()),
    ]
    table = Table(
        f"{scope.stem}-specialization-measures",
        "Measures of specialization of the champions",
        "Mean over runs ± standard deviation of the runs, champions in fresh scenarios; what the "
        "measures are and between which values they lie stands at the end of the report.",
        columns,
        rows,
        is_open=len(rows) <= 12,
        numbers=numbers,
    )
    return Section(title, (), [table])


def definitions() -> Section:
    """Return what each measure is, its range, and where it is from."""
    rows = [
        {
            "name": name.replace("_", " "),
            "span": metric.span,
            "what": metric.what,
            "source": metric.source,
        }
        for name, metric in METRICS.items()
    ]
    columns = [
        Column("name", "measure", plain),
        Column("span", "range", plain),
        Column("what", "what it says", plain),
        Column("source", "source", plain),
    ]
    note = "R: robots of the team, A: actions of the world."
    table = Table("measures", "Measures of specialization: definitions", note, columns, rows)
    return Section("What the measures of specialization say", (), [table])
