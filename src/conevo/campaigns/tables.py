"""The tables of a campaign, opened for queries: DuckDB over sealed Parquet."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from conevo.campaigns.schema import SCHEMA
from conevo.errors import UsageError
from conevo.evolution.methods.registry import remember_title
from conevo.runs.frames import pandas
from conevo.typing import Floats, Record
from conevo.worlds.families import FAMILIES
from conevo.worlds.measures import Measure

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["Tables", "RunValue"]

QUERY = '"SELECT method, count(*) FROM runs GROUP BY ALL"'
QUERIES = ("SELECT", "EXPLAIN", "MULTI")  # as DuckDB names them: VALUES is a SELECT, PIVOT MULTI
NEAR = 0.2  # budgets that differ by no more are the same


class RunValue(NamedTuple):
    """The performance of one run: the unit of all statistics.

    budget: of the group of runs that may be compared with it, see ``Tables``.
    measure: the task performance measure of ``value``, with its unit and direction.
    optimum: its largest possible value, known for a world's main measure only.
    value: mean over the scenarios of a study.
    """

    run: str
    task: str
    world: str
    environment: str
    family: str
    number: int
    method: str
    preset: str
    variant: str
    seed: int
    budget: str
    measure: Measure
    optimum: float | None
    value: float


class Tables:
    """The tables of a campaign: one connection, the tables of ``SCHEMA``, and ``budgets``.

    All are read into memory once: no query writes or reads a file. A table without a file is empty.
    Identical runs (the first stages of two shapings that only differ later) count once: the first
    by name stays in ``runs``.

    ``budgets`` (run, budget) shows which runs may be compared: those of one world, one preset, and
    about equal numbers of team evaluations and, in conevo's worlds, of team-steps per evaluation;
    stages of shapings separately. Choice: "about equal" is within 20 %, as methods do not divide a
    budget evenly and CONE spends some on type C. A run that ended because the next generation would
    have exceeded its budget counts with that budget, whatever it spent of it. So does one that
    ended earlier at its target. Without a budget, the latter counts with those it saved evaluations
    to.

    Use it as a context, or ``close`` it.
    """

    def __init__(self, folder: Path, may_be_empty: bool = False) -> None:
        """Open the Parquet files of a folder.

        Args:
            folder: of the tables.
            may_be_empty: whether ``runs.parquet`` may be missing, as before any run is finished.

        Raises:
            UsageError: no runs.parquet, or a file without one of the columns.
        """
        import duckdb

        self.folder = Path(folder)
        if not (may_be_empty or (self.folder / "runs.parquet").is_file()):
            raise UsageError(f"no table of runs in {self.folder} (runs.parquet)")
        # One thread: sums of floats then have one order, so a report always has the same text.
        self._connection = duckdb.connect(":memory:", config={"threads": 1})
        for table, columns in SCHEMA.items():
            self._open(table, columns)
        for name, title in self.query("SELECT DISTINCT method, title FROM runs ORDER BY ALL")[1]:
            remember_title(name, title or name)
        self._connection.execute("CREATE TABLE budgets (run VARCHAR, budget VARCHAR)")
        rows = self.query(
            "SELECT run, world, preset, contains(run, '/stage-'), stopped_by, planned_evaluations,"
            " evaluations, team_steps FROM runs ORDER BY ALL"
        )[1]
        named = sorted(_budgets(rows).items())
        if named:
            both = [list(column) for column in zip(*named, strict=True)]
            self._connection.execute("INSERT INTO budgets SELECT unnest(?), unnest(?)", both)
        self._connection.execute("SET enable_external_access = false")
        self._connection.execute("SET lock_configuration = true")

    def ask(self, sql: str) -> tuple[list[str], list[tuple[Any, ...]]]:
        """Return the same as ``query``, but refuse other statements than queries.

        Raises:
            UsageError: a statement that is not a query, several, or as ``query``.
        """
        self._refuse_orders(sql)
        return self.query(sql)

    def frame(self, sql: str) -> DataFrame:
        """Return the same as a pandas DataFrame: NULL is NaN, and numbers with it are float64.

        Raises:
            UsageError: as ``ask``.
            EnvironmentFailure: pandas is not installed.
        """
        pandas()
        self._refuse_orders(sql)
        with _refusing():
            return self._connection.execute(sql).df()

    def _refuse_orders(self, sql: str) -> None:
        """Raise UsageError unless a text is one query: DuckDB returns the last result only."""
        with _refusing():
            statements = self._connection.extract_statements(sql)
        for one in statements:
            if one.type.name not in QUERIES:
                raise UsageError(f"{one.type.name} is not a query; ask as in {QUERY}")
        if not statements:
            raise UsageError(f"no SQL statement, as in {QUERY}")
        if len(statements) > 1:
            raise UsageError(f"{len(statements)} SQL statements, must be one, as in {QUERY}")

    def query(self, sql: str) -> tuple[list[str], list[tuple[Any, ...]]]:
        """Return the column names and the rows of an SQL statement's result.

        Raises:
            UsageError: no statement, or DuckDB's reason for refusing it.
        """
        with _refusing():
            result = self._connection.execute(sql)
            if result is None or not result.description:
                raise UsageError(f"no SQL statement, as in {QUERY}")
            return [str(column[0]) for column in result.description], result.fetchall()

    def records(self, sql: str) -> list[Record]:
        """Return the rows of an SQL statement's result, by the names of its columns.

        Raises:
            UsageError: as ``query``.
        """
        columns, rows = self.query(sql)
        return [dict(zip(columns, row, strict=True)) for row in rows]

    def arrays(self, sql: str) -> dict[str, Floats]:
        """Return the columns of an SQL statement's result, all numbers, as arrays: NULL is NaN.

        For many rows, where ``query`` would make a Python object of each number.

        Raises:
            UsageError: as ``query``.
        """
        with _refusing():
            columns = self._connection.execute(sql).fetchnumpy()
        return {
            name: np.ma.filled(np.ma.asarray(column).astype(np.float64), np.nan)
            for name, column in columns.items()
        }

    def values(
        self, measure: str | None = None, study: str = "test", team: str | None = "champion"
    ) -> list[RunValue]:
        """Return the mean over scenarios of a measure, a row per run that has it.

        Rows are ordered by task, budget, variant, method, seed and run. Runs whose mean is not
        finite are left out.

        Args:
            measure: one of the world's task performance measures; None: each world's main one.
            study: "test" (of the finished run), "lesion", "clones", "rotated" or "composed".
            team: test: "champion" or "generation 0"; lesion and clones: "whole" or a caste;
                rotated: "whole" or "moved"; composed: a collective behaviour.
        """
        rows = self._connection.execute(
            """
            SELECT r.run, r.task, r.world, r.environment, r.family, r.number, r.method, r.preset,
                   r.variant, r.seed, b.budget, s.measure, coalesce(m.unit, ''),
                   coalesce(m.larger_is_better, true), m.low, m.high,
                   if(s.measure = r.measure, r.optimum, NULL) AS optimum, avg(s.value) AS value
            FROM runs r JOIN budgets b USING (run) JOIN scores s USING (run)
                 LEFT JOIN measures m ON m.run = s.run AND m.measure = s.measure
            WHERE s.study = $study AND s.team = $team AND s.measure = coalesce($measure, r.measure)
            GROUP BY ALL
            HAVING isfinite(avg(s.value))
            ORDER BY r.world, r.family, r.number, r.task, b.budget, r.variant, r.method, r.seed,
                     r.run
            """,
            {"study": study, "team": team, "measure": measure},
        ).fetchall()
        return [
            RunValue._make((*about, Measure(name, unit, is_larger, low, high), optimum, value))
            for *about, name, unit, is_larger, low, high, optimum, value in rows
        ]

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def __enter__(self) -> Tables:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _open(self, table: str, columns: dict[str, str]) -> None:
        """Read one table."""
        file = self.folder / f"{table}.parquet"
        if file.is_file():
            listed = ", ".join(
                f'CAST("{name}" AS {kind}) AS "{name}"' for name, kind in columns.items()
            )
            quoted = str(file).replace("'", "''")
            source = f"SELECT {listed} FROM read_parquet('{quoted}')"
        else:
            listed = ", ".join(f'NULL::{kind} AS "{name}"' for name, kind in columns.items())
            source = f"SELECT {listed} WHERE false"
        if table == "runs":
            source += (
                " QUALIFY row_number() OVER (PARTITION BY run_id, task, method, preset, variant,"
                " seed ORDER BY run) = 1"
            )
        with _refusing(f"{file} is not a table of {table}", "\n"):
            self._connection.execute(f"CREATE TABLE {table} AS {source}")


@contextmanager
def _refusing(what: str = "query", end: str = "LINE 1:") -> Iterator[None]:
    """Raise UsageError, with ``what`` and DuckDB's message up to ``end``, if DuckDB fails."""
    import duckdb

    try:
        yield
    except duckdb.Error as error:
        line = " ".join(str(error).split(end)[0].split())
        raise UsageError(f"{what}: {line}") from error


def _budgets(rows: list[tuple[Any, ...]]) -> dict[str, str]:
    """Return the budget of each run in words.

    Choice: the team-steps of an evaluation distinguish budgets in conevo's worlds only. Epochs of
    another package's task may end early, so that good teams need more or fewer steps than bad ones.

    Args:
        rows: run, world, preset, whether a stage of a shaping, stopped_by, planned evaluations,
            evaluations, team_steps.
    """
    scales = defaultdict(list)
    for run, world, preset, is_stage, stopped_by, planned, evaluations, steps in rows:
        counted = (stopped_by in ("budget", "target") and planned) or evaluations
        is_saver = stopped_by == "target" and not planned
        one = (is_saver, counted, steps / max(evaluations, 1), run)
        scales[world, preset, is_stage].append(one)
    budgets = {}
    for (world, preset, is_stage), runs in scales.items():
        for alike in [runs] if world in FAMILIES else _apart(runs, 2):
            steps = _rounded(min(one[2] for one in alike))
            of_steps = "" if world in FAMILIES else f" of {steps:,} team-steps"
            groups = _apart([one for one in alike if not one[0]] or alike, 1)
            for one in alike:
                group = next((g for g in groups if one[1] <= g[-1][1]), groups[-1])
                budgets[one[3]] = (
                    f"{preset}, about {_rounded(group[0][1]):,} team evaluations"
                    f"{' a stage' if is_stage else ''}{of_steps}"
                )
    return budgets


def _apart(runs: list[tuple[Any, ...]], column: int) -> list[list[tuple[Any, ...]]]:
    """Return runs in groups, ascending in a column; neighbours in a group are within 20 %."""
    ordered = sorted(runs, key=lambda one: (one[column], one))
    groups = [ordered[:1]]
    for one in ordered[1:]:
        if one[column] > (1 + NEAR) * groups[-1][-1][column]:
            groups.append([])
        groups[-1].append(one)
    return groups


def _rounded(number: float) -> int:
    """Return a number with two significant digits."""
    return int(float(f"{number:.2g}"))
