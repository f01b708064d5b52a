"""Tables of a campaign: which runs count, their values, and equal budgets."""

from __future__ import annotations

from pathlib import Path

import duckdb
import numpy as np
import pytest

from conevo.campaigns.schema import SCHEMA
from conevo.campaigns.tables import Tables
from conevo.errors import UsageError
from report.finished_runs import Cell, cells, write_campaign


def tables_of(folder: Path, of: list[Cell], **further: object) -> Tables:
    return Tables(write_campaign(folder / "campaign", of, **further) / "tables")  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def of_one_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the tables of one run."""
    folder = tmp_path_factory.mktemp("one-run") / "campaign"
    return write_campaign(folder, cells(["rover/complex-1"], ["cone"]), seeds=1) / "tables"


def edit(folder: Path, sql: str, table: str = "runs") -> None:
    """Replace a table by the result of a query over it (as ``old``)."""
    file = folder / "campaign" / "tables" / f"{table}.parquet"
    with duckdb.connect() as connection:
        connection.execute(f"CREATE TABLE old AS FROM read_parquet('{file}')")
        connection.execute(f"COPY ({sql}) TO '{file}' (FORMAT parquet)")


def test_a_value_is_the_mean_over_scenarios_of_one_run(tmp_path) -> None:
    with tables_of(tmp_path, cells(["rover/complex-2"], ["ccga", "cone"]), seeds=3) as tables:
        found = tables.values()
        assert [(one.method, one.seed) for one in found] == [
            (method, seed) for method in ("ccga", "cone") for seed in (1, 2, 3)
        ]
        first = found[0]
        scores = tables.query(
            f"SELECT value FROM scores WHERE run = '{first.run}' AND study = 'test' AND"
            " team = 'champion' AND measure = 'value'"
        )[1]
        assert len(scores) == 20
        assert first.value == pytest.approx(np.mean(scores), rel=1e-12)
        assert (first.measure.name, first.optimum) == ("value", 5000.0)


def test_other_measures_studies_and_teams_are_asked_for_by_name(tmp_path) -> None:
    with tables_of(tmp_path, cells(["rover/complex-2"], ["cone"]), seeds=2) as tables:
        area = tables.values("area")
        assert {one.measure.name for one in area} == {"area"}
        assert all(one.optimum is None and one.value < 1 for one in area)
        begun = tables.values(team="generation 0")
        assert all(a.value < b.value / 5 for a, b in zip(begun, tables.values(), strict=True))
        whole = tables.values(study="lesion", team="whole")
        assert len(whole) == 2
        assert tables.values("no such measure") == []


def test_a_run_without_a_finite_mean_has_no_value(tmp_path) -> None:
    write_campaign(tmp_path / "campaign", cells(["rover/complex-2"], ["cone"]), seeds=2)
    spoilt = "if(run LIKE '%s1' AND scenario = 3, 'nan'::DOUBLE, value)"
    edit(tmp_path, f"SELECT * REPLACE ({spoilt} AS value) FROM old", "scores")
    with Tables(tmp_path / "campaign" / "tables") as tables:
        assert [one.seed for one in tables.values()] == [2]


def test_budgets_join_near_numbers_of_evaluations_and_keep_others_apart(tmp_path) -> None:
    one = "rover/complex-1"
    of = [
        *cells([one], ["homcne"], budget=49848),
        *cells([one], ["cone"], budget=58000),  # within a fifth of the previous one
        *cells([one], ["mesp"], budget=70001),  # not within a fifth
        *cells([one], ["ccga"], budget=49848, preset="desk"),
    ]
    with tables_of(tmp_path, of, seeds=1) as tables:
        found = {value.method: value.budget for value in tables.values()}
    assert found == {
        "homcne": "smoke, about 50,000 team evaluations of 500 team-steps",
        "cone": "smoke, about 50,000 team evaluations of 500 team-steps",
        "mesp": "smoke, about 70,000 team evaluations of 500 team-steps",
        "ccga": "desk, about 50,000 team evaluations of 500 team-steps",
    }


def test_epochs_that_end_early_are_no_other_budget(tmp_path) -> None:
    of = [
        *cells(["rover/complex-1"], ["homcne"], budget=100),
        *cells(["rover/complex-1"], ["cone"], budget=102),
    ]
    with tables_of(tmp_path, of, seeds=1) as tables:
        assert len({one.budget for one in tables.values()}) == 1
    longer = "if(method = 'cone', team_steps * 2, team_steps) AS team_steps"
    edit(tmp_path, f"SELECT * REPLACE ({longer}) FROM old")
    with Tables(tmp_path / "campaign" / "tables") as tables:
        assert len({one.budget for one in tables.values()}) == 2
    edit(tmp_path, "SELECT * REPLACE ('vmas' AS world) FROM old")
    with Tables(tmp_path / "campaign" / "tables") as tables:
        assert {one.budget for one in tables.values()} == {"smoke, about 100 team evaluations"}


def test_runs_of_one_planned_budget_are_one_group(tmp_path) -> None:
    one = "rover/complex-1"
    of = [
        *cells([one], ["homcne"], budget=61, planned=100),
        *cells([one], ["cone"], budget=82, planned=100),
        *cells([one], ["mesp"], budget=82, planned=200),
    ]
    with tables_of(tmp_path, of, seeds=1) as tables:
        found = {value.method: value.budget for value in tables.values()}
    assert found == {
        "homcne": "smoke, about 100 team evaluations of 500 team-steps",
        "cone": "smoke, about 100 team evaluations of 500 team-steps",
        "mesp": "smoke, about 200 team evaluations of 500 team-steps",
    }
    edit(tmp_path, "SELECT * REPLACE ('generations' AS stopped_by) FROM old")
    with Tables(tmp_path / "campaign" / "tables") as tables:  # the budget did not end them
        assert len({one.budget for one in tables.values()}) == 2


def test_longer_evaluations_are_another_budget(tmp_path) -> None:
    write_campaign(tmp_path / "campaign", cells(["rover/complex-1"], ["ccga", "cone"]), seeds=1)
    edit(
        tmp_path,
        "SELECT * REPLACE (if(method = 'cone', 2, 1) * team_steps AS team_steps) FROM old",
    )
    with Tables(tmp_path / "campaign" / "tables") as tables:
        assert len({one.budget for one in tables.values()}) == 2


def test_a_run_that_ended_at_its_target_counts_with_its_planned_budget(tmp_path) -> None:
    of = [Cell("rover", "complex-1", "ccga"), Cell("rover", "complex-1", "cone", budget=300)]
    write_campaign(tmp_path / "campaign", of, seeds=1)
    with Tables(tmp_path / "campaign" / "tables") as tables:
        assert len({one.budget for one in tables.values()}) == 2
    edit(
        tmp_path,
        "SELECT * REPLACE (if(method = 'cone', 'target', 'budget') AS stopped_by) FROM old",
    )
    with Tables(tmp_path / "campaign" / "tables") as tables:
        assert len({one.budget for one in tables.values()}) == 1


def test_stages_of_shapings_are_separate_and_equal_ones_count_once(tmp_path) -> None:
    of = [Cell("gacc", "complex-1", "cone"), Cell("gacc", "complex-1", "cone", stage=1)]
    write_campaign(tmp_path / "campaign", of, seeds=2)
    with Tables(tmp_path / "campaign" / "tables") as tables:
        budgets = {"/stage-" in one.run: one.budget for one in tables.values()}
    assert "a stage" in budgets[True]
    assert "a stage" not in budgets[False]
    twin = "SELECT * REPLACE ('another' || run AS run) FROM old WHERE run LIKE '%/stage-1'"
    edit(tmp_path, f"FROM old UNION ALL ({twin})")
    with Tables(tmp_path / "campaign" / "tables") as tables:
        assert tables.query("SELECT count(*) FROM runs")[1] == [(4,)]


def test_a_table_without_a_file_is_empty(tmp_path) -> None:
    with tables_of(tmp_path, cells(["rover/complex-1"]), without=["behaviours"]) as tables:
        columns, rows = tables.query("FROM behaviours")
        assert columns == list(SCHEMA["behaviours"])
        assert rows == []


def test_a_folder_without_runs_and_a_foreign_file_are_refused(tmp_path) -> None:
    with pytest.raises(UsageError, match="no table of runs"):
        Tables(tmp_path)
    with duckdb.connect() as connection:
        connection.execute(f"COPY (SELECT 1 AS one) TO '{tmp_path}/runs.parquet'")
    with pytest.raises(UsageError, match=r"runs\.parquet is not a table of runs.*"):
        Tables(tmp_path)


@pytest.mark.parametrize(
    ("sql", "message"),
    [
        ("SELECT nothing FROM runs", "nothing"),
        ("SELECT * FROM read_text('/etc/hostname')", "disabled by configuration"),
        ("DROP TABLE runs", "DROP is not a query; ask as in"),
        ("SELECT 1; DROP TABLE runs", "DROP is not a query"),
        ("WITH one AS (SELECT 1) INSERT INTO budgets SELECT 1, 2", "INSERT is not a query"),
        ("COPY runs TO 'stolen.csv'", "COPY is not a query"),
        ("SET enable_external_access = true", "SET is not a query"),
        ("SELECT 1; SELECT 2", "2 SQL statements, must be one"),
        ("FROM runs; DESCRIBE runs; SHOW TABLES", "3 SQL statements, must be one"),
    ],
)
def test_anything_but_a_query_is_refused_in_one_line(
    of_one_run, tmp_path, monkeypatch, sql, message
) -> None:
    monkeypatch.chdir(tmp_path)
    with (
        Tables(of_one_run) as tables,
        pytest.raises(UsageError, match=message) as refused,
    ):
        tables.ask(sql)
    assert "\n" not in str(refused.value)
    assert not (tmp_path / "stolen.csv").exists()


@pytest.mark.parametrize(
    "sql",
    [
        "FROM runs",
        "WITH one AS (SELECT 1) FROM one",
        "VALUES (1)",
        "DESCRIBE runs",
        "SHOW TABLES",
        "SUMMARIZE runs",
        "EXPLAIN SELECT 1",
        "PIVOT runs ON method USING count(*)",
        "SELECT 1;  -- and a comment",
    ],
)
def test_all_read_only_statements_are_queries(of_one_run, sql) -> None:
    with Tables(of_one_run) as tables:
        columns, rows = tables.ask(sql)
    assert {len(row) for row in rows} == {len(columns)}


@pytest.mark.parametrize(
    ("sql", "message"),
    [
        ("COPY runs TO 'stolen.csv'", "disabled by configuration"),
        ("SET enable_external_access = true", "locked"),
    ],
)
def test_a_refused_statement_reaches_no_file(
    of_one_run, tmp_path, monkeypatch, sql, message
) -> None:
    monkeypatch.chdir(tmp_path)
    with (
        Tables(of_one_run) as tables,
        pytest.raises(UsageError, match=message) as refused,
    ):
        tables.query(sql)
    assert "\n" not in str(refused.value)
    assert not (tmp_path / "stolen.csv").exists()
