"""Curves of runs whose generations have different sizes, worked out by hand."""

from __future__ import annotations

from pathlib import Path

import duckdb
import numpy as np
import pytest
from scipy import stats

from conevo.campaigns.schema import SCHEMA
from conevo.campaigns.tables import Tables
from conevo.report.comparison import Cell, Treatment, group_values
from conevo.report.learning_curves import caste_courses, courses, read_histories
from conevo.report.sections.castes import castes
from conevo.report.sections.scope import scopes
from report.finished_runs import cells, write_campaign

CONE = Cell("complex-1", Treatment("cone", ""))


@pytest.fixture
def tables(tmp_path: Path) -> Tables:
    """Two runs: generations end after 10, 20, 30, 40 evaluations, and after 25 and 40."""
    folder = write_campaign(tmp_path / "c", cells(["rover/complex-1"], ["cone"], budget=40), 2)
    rows = {
        "generations": [
            *((1, g, 10 * (g + 1), 1.0 * g, 0.9, None) for g in range(4)),
            *((2, g, e, v, 0.5, 0.25) for g, e, v in ((0, 25, 10.0), (1, 40, 20.0))),
        ],
        "castes": [(1, 0, "low", 20), (1, 1, "low", 5), (1, 1, "hi", 15), (1, 2, "hi", 20),
                   (1, 3, "hi", 20), (2, 0, "low", 20), (2, 1, "low", 20)],
    }  # fmt: skip
    with duckdb.connect() as connection:
        for name, of in rows.items():
            connection.execute(f"CREATE TABLE {name} ({_columns(name)})")
            for seed, *row in of:
                if name == "generations":
                    generation, evaluations, value, s, sst = row
                    row = [generation, evaluations, 0, value, 0, s, sst, None, 0, 0, 10]
                run = f"rover-complex-1-cone--smoke-40-s{seed}"
                marks = ", ".join("?" * (1 + len(row)))
                connection.execute(f"INSERT INTO {name} VALUES ({marks})", [run, *row])
            file = folder / "tables" / f"{name}.parquet"
            connection.execute(f"COPY {name} TO '{file}' (FORMAT parquet)")
    return Tables(folder / "tables")


def _columns(name: str) -> str:
    return ", ".join(f"{column} {kind}" for column, kind in SCHEMA[name].items())


def histories_of(tables: Tables):
    (group,) = group_values(tables.values())
    return read_histories(tables, group)


def test_a_run_counts_with_the_last_generation_it_had_finished(tables) -> None:
    course = courses(histories_of(tables), "value", n=4)[CONE]
    assert course.x.tolist() == [10, 20, 30, 40]
    assert course.mean.tolist() == [0.0, 1.0, (2.0 + 10.0) / 2, (3.0 + 20.0) / 2]
    assert course.n == 2
    assert np.isnan(course.low[:2]).all()  # one run has finished a generation by then
    low, high = stats.t.interval(0.95, 1, 11.5, stats.sem([3.0, 20.0]))
    assert (course.low[3], course.high[3]) == pytest.approx((low, high))


def test_runs_without_a_threshold_do_not_count(tables) -> None:
    found = courses(histories_of(tables), "sst", n=4)[CONE]
    assert (found.x.tolist(), found.mean.tolist(), found.n) == ([30, 40], [0.25, 0.25], 1)
    assert courses(histories_of(tables), "gst", n=4) == {}


def test_shares_of_castes_add_up_over_runs(tables) -> None:
    x, found = caste_courses(histories_of(tables), n=4)
    assert x.tolist() == [10, 20, 30, 40]
    shares = found[CONE]
    assert shares["low"].tolist() == [1.0, 0.25, (0.0 + 1.0) / 2, 0.5]
    assert (shares["low"] + shares["hi"]).tolist() == [1.0] * 4


def test_castes_are_unknown_before_the_first_generation_has_ended(tables) -> None:
    x, found = caste_courses(histories_of(tables), n=8)
    assert x.tolist() == [5, 10, 15, 20, 25, 30, 35, 40]
    assert np.isnan([found[CONE]["low"][0], found[CONE]["hi"][0]]).all()
    assert found[CONE]["low"][1] == 1.0


def test_castes_are_drawn_on_an_axis_that_starts_at_zero(tables, tmp_path) -> None:
    (scope,) = scopes(tables)
    figure, *_ = castes(scope, read_histories(tables, scope.group)).exhibits
    assert min(row["evaluations"] for row in figure.rows) >= 10  # the end of the first generation
    assert all(np.isfinite(row["share"]) for row in figure.rows)
