import csv
import html
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from campaigns.plans import tiny_campaign
from conevo.campaigns.campaign import Campaign
from conevo.campaigns.executors.local import Serial
from conevo.campaigns.paths import Paths
from conevo.campaigns.schema import SCHEMA
from conevo.campaigns.sealing import is_sealed, seal_tables
from conevo.campaigns.tables import Tables
from conevo.report.files import write_report
from conevo.report.sections.overview import overview
from conevo.runs.directory import read_json
from conevo.runs.run import Run
from conevo.runs.shrinkage import shrinkage
from conevo.runs.store import Store

pytest_plugins = ["report.quick_figures"]
pytestmark = pytest.mark.usefixtures("without_ink")


def unread_of(page: Path) -> dict[str, str]:
    """The lines of a report about files that could not be read."""
    with (page.parent / "numbers" / "left-out.csv").open() as file:
        return {row["file"]: row["why"] for row in csv.DictReader(file)}


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """A finished campaign of four tiny runs with studies."""
    made = tiny_campaign(tmp_path_factory.mktemp("tables"), 'studies = ["teams"]')
    made.carry_on(Serial(1))
    return made


@pytest.fixture
def tables(campaign):
    with Tables(campaign.paths.tables) as opened:
        yield opened


def test_every_run_has_a_row_with_its_own_data(campaign, tables):
    _, rows = tables.query(
        "SELECT run, method, seed, generations, evaluations, team_steps, measure, run_id, "
        "kernel_hash, optimum, n_robots FROM runs ORDER BY run"
    )
    assert [row[0] for row in rows] == sorted(campaign.planned)
    for row in rows:
        run = Run(campaign.paths.run(row[0]))
        last = run.generations()[-1]
        assert row[1:] == (
            run.config.method,
            run.config.run.seed,
            2,
            last["team_evaluations"],
            last["team_steps"],
            "value",
            run.config.run_id,
            run.provenance["kernel_hash"],
            5000.0,
            20,
        )


def test_costs_of_all_attempts_count(campaign, tables):
    spent = {entry.label: entry.core_seconds for entry in campaign.ledger.entries()}
    _, rows = tables.query("SELECT run, core_seconds FROM runs")
    assert dict(rows) == pytest.approx(spent)
    assert min(spent.values()) > 0


def test_scores_are_those_of_the_testing_phase(campaign, tables):
    for label in campaign.planned:
        tested = Run(campaign.paths.run(label)).test_result
        for team, title in (("champion", "champion"), ("generation_0", "generation 0")):
            for measure, values in tested[team]["performance"].items():
                _, rows = tables.query(
                    f"SELECT value FROM scores WHERE run = '{label}' AND study = 'test' "
                    f"AND team = '{title}' AND measure = '{measure}' ORDER BY scenario"
                )
                assert [value for (value,) in rows] == values["values"]


def test_champions_are_those_of_the_validation(campaign, tables):
    for label in campaign.planned:
        run = Run(campaign.paths.run(label))
        columns, rows = tables.query(f"SELECT * FROM champions WHERE run = '{label}'")
        about = run.test_result["validation"]
        expected = [
            {
                "run": label,
                "generation": run.champion.generation,
                "finalists": len(about["finalists"]),
                "measure": row["measure"],
                "selection": row["selection"],
                "validation": row["validation"]["mean"],
                "test": row["test"]["mean"],
                "ratio": row["ratio"],
            }
            for row in shrinkage(run.test_result)
        ]
        assert [dict(zip(columns, row, strict=True)) for row in rows] == expected
        assert [row["measure"] for row in expected] == ["fitness", "value", "area"]


def test_a_value_that_is_not_finite_keeps_its_scenario(campaign, tmp_path):
    paths = Paths(shutil.copytree(campaign.path, tmp_path / "copy"))
    label = min(campaign.planned)
    path = paths.run(label) / "test.json"
    test = read_json(path)
    test["champion"]["performance"]["value"]["values"][1] = None
    path.write_text(json.dumps(test))
    Store(paths.run(label)).seal()
    shutil.rmtree(paths.tables)
    seal_tables(paths, list(campaign.planned.values()), {})
    with Tables(paths.tables) as opened:
        _, rows = opened.query(
            f"SELECT scenario, value FROM scores WHERE run = '{label}' AND study = 'test' "
            "AND team = 'champion' AND measure = 'value' ORDER BY scenario"
        )
    assert rows == list(enumerate(test["champion"]["performance"]["value"]["values"]))


def test_generations_and_castes_are_those_of_the_log(campaign, tables):
    for label in campaign.planned:
        for record in Run(campaign.paths.run(label)).generations():
            where = f"WHERE run = '{label}' AND generation = {record['generation']}"
            _, rows = tables.query(
                f"SELECT evaluations, value, fitness, specialization, sst, gst, recombinations, "
                f"hidden FROM generations {where}"
            )
            assert rows == [
                (
                    record["team_evaluations"],
                    record["performance"]["value"],
                    record["team_fitness"],
                    record["specialization"],
                    record["sst"],
                    record["gst"],
                    record["recombinations"],
                    np.mean(record["n_hidden"]),
                )
            ]
            _, rows = tables.query(f"SELECT caste, robots FROM castes {where}")
            assert dict(rows) == record["castes"]


def test_studies_are_stored_completely(campaign, tables):
    for label in campaign.planned:
        study = read_json(campaign.paths.study(label))
        for table in ("robots", "actions", "behaviours"):
            columns = [name for name in SCHEMA[table] if name != "run"]
            _, rows = tables.query(f"SELECT {', '.join(columns)} FROM {table} WHERE run='{label}'")
            assert rows == [tuple(row[name] for name in columns) for row in study[table]]
        _, rows = tables.query(f"SELECT metric, value FROM metrics WHERE run = '{label}'")
        assert dict(rows) == study["metrics"]
        _, rows = tables.query(
            f"SELECT count(*) FROM scores WHERE run = '{label}' AND study <> 'test'"
        )
        assert rows == [(len(study["scores"]),)]


def test_studies_of_earlier_versions_have_no_favourites_and_are_reported(campaign, tmp_path):
    copy = Campaign(shutil.copytree(campaign.path, tmp_path / "copy"))
    old, *new = copy.planned
    study = read_json(copy.paths.study(old))
    first = ("robot", "caste", "specialization", "fitness", "hidden")
    study["robots"] = [{name: row[name] for name in first} for row in study["robots"]]
    copy.paths.study(old).write_text(json.dumps(study))
    shutil.rmtree(copy.paths.tables)
    copy.seal()
    with Tables(copy.paths.tables) as tables:
        sql = "SELECT DISTINCT run FROM robots WHERE relative IS {} ORDER BY ALL"
        assert tables.query(sql.format("NULL"))[1] == [(old,)]
        assert tables.query(sql.format("NOT NULL"))[1] == [(label,) for label in sorted(new)]
    assert (
        "and the settings that robots prefer" in write_report(copy, tmp_path / "report").read_text()
    )


def test_tables_are_made_again_only_after_more_runs_are_finished(campaign):
    made = (campaign.paths.tables / "runs.parquet").stat().st_mtime_ns
    campaign.seal()
    assert (campaign.paths.tables / "runs.parquet").stat().st_mtime_ns == made
    manifest = campaign.paths.tables / "tables.json"
    found = json.loads(manifest.read_text())
    assert sorted(found["runs"]) == sorted(campaign.planned)
    found["runs"].popitem()
    manifest.write_text(json.dumps(found))
    campaign.seal()
    assert (campaign.paths.tables / "runs.parquet").stat().st_mtime_ns != made
    assert not list(campaign.path.glob(".tables*"))


@pytest.mark.parametrize("table", ["runs", "generations", "scores"])
def test_a_table_that_is_lost_is_made_again(campaign, table):
    path = campaign.paths.tables / f"{table}.parquet"
    with Tables(campaign.paths.tables) as opened:
        before = opened.query(f"SELECT count(*) FROM {table}")
    path.unlink()
    assert not is_sealed(campaign.paths, campaign.finished)
    campaign.seal()
    with Tables(campaign.paths.tables) as opened:
        assert opened.query(f"SELECT count(*) FROM {table}") == before
    path.unlink()
    os.mkfifo(path)
    campaign.seal()
    assert path.is_file()


def test_a_damaged_run_is_left_out_and_the_rest_is_reported(campaign, tmp_path):
    copy = Campaign(shutil.copytree(campaign.path, tmp_path / "copy"))
    shutil.rmtree(copy.paths.tables)
    damaged, ended = list(copy.planned)[:2]
    test = copy.paths.run(damaged) / "test.json"
    whole = test.read_text()
    test.write_text(whole.replace('"labels"', '"lables"'))
    for name, content in (
        (ended, b""),
        ("utf-16", '{"status": "failed"}'.encode("utf-16")),
        ("random", bytes(range(256))),
        ("nested", b"[" * 50_000),
    ):
        copy.paths.ended(name).write_bytes(content)
    os.mkfifo(copy.paths.ended("pipe"))
    copy.seal()
    with Tables(copy.paths.tables) as tables:
        runs = [run for (run,) in tables.query("SELECT run FROM runs")[1]]
    assert sorted(runs) == sorted(set(copy.planned) - {damaged})
    names = (ended, "utf-16", "random", "nested", "pipe")
    page = write_report(copy, tmp_path / "report")
    unread = unread_of(page)
    assert set(unread) == {f"runs/{damaged}", *(f"ended/{name}.json" for name in names)}
    words = "test.json is damaged: champion.labels is missing"
    assert unread[f"runs/{damaged}"] == f"runs/{damaged}/{words}"
    text = page.read_text()
    assert all(file in text and html.escape(why) in text for file, why in unread.items())
    test.write_text(whole)  # it counts as soon as it is complete
    copy.seal()
    with Tables(copy.paths.tables) as tables:
        assert tables.query("SELECT count(*) FROM runs")[1] == [(len(copy.planned),)]


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("test.json", '"mean": ', '"mean": 1'),
        ("generations.jsonl", '"team_fitness": ', '"team_fitness": 1'),
        ("provenance.json", '"stopped_by": "', '"stopped_by": "x'),
    ],
)
@pytest.mark.parametrize("has_tables", [True, False])
def test_a_run_that_was_changed_is_left_out(campaign, tmp_path, file, old, new, has_tables):
    copy = Campaign(shutil.copytree(campaign.path, tmp_path / "copy"))
    if not has_tables:
        shutil.rmtree(copy.paths.tables)
    label = list(copy.planned)[1]
    path = copy.paths.run(label) / file
    whole = path.read_text()
    assert old in whole
    path.write_text(whole.replace(old, new, 1))
    copy.seal()
    with Tables(copy.paths.tables) as tables:
        runs = [run for (run,) in tables.query("SELECT run FROM runs")[1]]
        (table,) = (one for one in overview(tables, copy).exhibits if one.name == "left-out")
    assert sorted(runs) == sorted(set(copy.planned) - {label})
    assert [(row["file"], row["why"]) for row in table.rows] == [
        (f"runs/{label}", f"runs/{label} was changed since it was finished: {file}")
    ]
