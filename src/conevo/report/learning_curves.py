"""How runs went, averaged over the runs of a cell: learning, specialization, castes.

Runs have generations of different sizes, so they are read at equal numbers of team evaluations.
Choice: a run counts there with the last generation it had finished, to the end of the budget; it
does not count before its first.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from conevo.campaigns.tables import Tables
from conevo.report.comparison import Cell, Group, Treatment
from conevo.report.statistics import ALPHA
from conevo.typing import Floats

__all__ = ["COURSES", "Course", "Histories", "caste_courses", "courses", "read_histories"]

COURSES = ("value", "specialization", "sst", "gst", "hidden", "recombinations")
"""Columns of ``generations`` that have a course."""


class Course(NamedTuple):
    """Mean over runs with its 95 % t interval, at numbers of team evaluations.

    x, mean, low, high: [X]; low and high NaN below two runs. n: runs at the last point.
    """

    x: Floats
    mean: Floats
    low: Floats
    high: Floats
    n: int


@dataclass(frozen=True)
class Histories:
    """All generations of the runs of a group, G in all, one run after the other.

    Attributes:
        cells: of each run, [N].
        starts: first generation of each run, and G, [N + 1].
        evaluations: [G] team evaluations (or team-steps) spent, ascending within a run.
        columns: name of one of ``COURSES`` -> [G], NaN for no value.
        castes: C names.
        shares: [G, C] share of the fittest team's robots in each caste.
    """

    cells: list[Cell]
    starts: npt.NDArray[np.int64]
    evaluations: Floats
    columns: dict[str, Floats]
    castes: list[str]
    shares: Floats

    def at(self, x: Floats) -> Iterator[tuple[Cell, npt.NDArray[np.int64], npt.NDArray[np.bool_]]]:
        """Yield each cell with the generations [runs, X] that count at x, and whether there are."""
        rows: dict[Cell, list[npt.NDArray[np.int64]]] = {}
        for cell, start, end in zip(self.cells, self.starts[:-1], self.starts[1:], strict=True):
            before = np.searchsorted(self.evaluations[start:end], x, side="right")
            rows.setdefault(cell, []).append(start + before - 1)
            rows[cell][-1][before == 0] = -1
        for cell, found in rows.items():
            stacked = np.stack(found)
            yield cell, np.maximum(stacked, 0), stacked >= 0

    def grid(self, n: int) -> Floats:
        """Return n numbers of team evaluations, the last the most that a run spent."""
        most = float(self.evaluations.max(initial=0))
        return np.array([round(most * k / n) for k in range(1, n + 1)], dtype=np.float64)


def read_histories(tables: Tables, group: Group, over: str = "evaluations") -> Histories:
    """Return the generations of a group's runs, by environment, method, variant and seed.

    Args:
        tables, group: the runs.
        over: the column that counts what is spent, or "team_steps".
    """
    tables.query(
        "CREATE OR REPLACE TEMP TABLE chosen AS SELECT row_number() OVER (ORDER BY number,"
        " environment, method, variant, seed, run) - 1 AS place, runs.* FROM runs JOIN budgets"
        f" USING (run) WHERE {group.condition}"
    )
    tables.query(
        "CREATE OR REPLACE TEMP TABLE history AS SELECT row_number() OVER (ORDER BY place,"
        " g.evaluations, generation) - 1 AS row, place, generation, g.* EXCLUDE (generation)"
        " FROM chosen JOIN generations g USING (run)"
    )
    runs = tables.query(
        "SELECT environment, method, variant, count(history.row) FROM chosen LEFT JOIN history"
        " USING (place) GROUP BY place, environment, method, variant ORDER BY place"
    )[1]
    listed = ", ".join(f"{name}::DOUBLE AS {name}" for name in COURSES)
    read = tables.arrays(f"SELECT {over}::DOUBLE AS spent, {listed} FROM history ORDER BY row")
    names = [
        name
        for (name,) in tables.query(
            "SELECT DISTINCT caste FROM castes JOIN chosen USING (run) ORDER BY caste"
        )[1]
    ]
    parts = tables.arrays(
        "SELECT row, dense_rank() OVER (ORDER BY caste) - 1 AS caste, robots::DOUBLE AS robots"
        " FROM castes JOIN history USING (run, generation)"
    )
    robots = np.zeros((len(read["spent"]), len(names)))
    np.add.at(robots, (parts["row"].astype(int), parts["caste"].astype(int)), parts["robots"])
    return Histories(
        cells=[Cell(row[0], Treatment(row[1], row[2])) for row in runs],
        starts=np.cumsum([0, *(row[3] for row in runs)]),
        evaluations=read.pop("spent"),
        columns=read,
        castes=names,
        shares=robots / np.maximum(robots.sum(axis=1, keepdims=True), 1),
    )


def courses(histories: Histories, column: str, n: int = 50) -> dict[Cell, Course]:
    """Return the course of one of ``COURSES`` for each cell that has it, at n points."""
    from scipy.special import stdtrit

    x = histories.grid(n)
    made = {}
    for cell, rows, has in histories.at(x):
        values = histories.columns[column][rows]
        values = np.where(has & np.isfinite(values), values, math.nan)
        shown = ~np.isnan(values).all(axis=0)
        if not shown.any():
            continue
        values = values[:, shown]
        counts = np.sum(~np.isnan(values), axis=0)
        mean = np.nanmean(values, axis=0)
        with warnings.catch_warnings(action="ignore"):  # of a single run
            error = np.sqrt(np.nanvar(values, axis=0, ddof=1) / counts)
        reach = stdtrit(counts - 1, 1 - ALPHA / 2) * error
        made[cell] = Course(x[shown], mean, mean - reach, mean + reach, int(counts[-1]))
    return made


def caste_courses(
    histories: Histories, n: int = 30
) -> tuple[Floats, dict[Cell, dict[str, Floats]]]:
    """Return n points [X] and each cell's share of the robots [X] in each caste.

    Of the fittest team of each generation, mean over runs; NaN before the first generation of a
    cell's first run.
    """
    x = histories.grid(n)
    made = {}
    for cell, rows, has in histories.at(x):
        shares = np.where(has[..., None], histories.shares[rows], 0).sum(axis=0)
        counts = has.sum(axis=0)
        if not counts.any() or not shares.any():
            continue
        present = shares.any(axis=0)
        shares[counts > 0] /= counts[counts > 0, None]
        shares[counts == 0] = math.nan
        made[cell] = {name: shares[:, k] for k, name in enumerate(histories.castes) if present[k]}
    return x, made
