"""A report of a world whose main measure is a distance, and of CONE with rare exchange."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import duckdb
import pytest

from conevo.campaigns.schema import SCHEMA
from conevo.campaigns.tables import Tables
from conevo.report.exhibits import Exhibit, Section
from conevo.report.sections.comparisons import comparisons
from conevo.report.sections.interventions import interventions
from conevo.report.sections.performance import performance
from conevo.report.sections.scope import scopes
from report.claims.known_truth import Cell, write_tables

pytest_plugins = ["report.quick_figures"]
pytestmark = pytest.mark.usefixtures("without_ink")

TRUTH = {("complex-1", "mesp"): Cell(100.0), ("complex-1", "cone"): Cell(200.0)}


def directed(folder: Path, truth: dict[tuple[str, str], Cell]) -> Path:
    """Write tables of a world in which a smaller value, in cm, is better."""
    write_tables(folder, "rover-v2", truth, 10, 0.05)
    columns = ", ".join(f'"{name}" {kind}' for name, kind in SCHEMA["measures"].items())
    with duckdb.connect(":memory:") as connection:
        connection.execute(f"CREATE TABLE measures ({columns})")
        connection.execute(
            "INSERT INTO measures (run, measure, unit, larger_is_better)"
            f" SELECT run, 'value', 'cm', false FROM '{folder}/runs.parquet'"
        )
        connection.execute(f"COPY measures TO '{folder}/measures.parquet'")
    return folder


def pairs_of(section: Section) -> Exhibit:
    return next(one for one in section.exhibits if one.name == "rover-complex-comparisons")


def test_the_smaller_of_two_distances_is_the_better(tmp_path: Path) -> None:
    with Tables(directed(tmp_path, TRUTH)) as tables:
        (scope,) = scopes(tables)
        section, reached, lost = comparisons(scope), performance(scope), interventions(scope)[0]
    assert reached.title == "Task performance: value (cm, smaller is better)"
    assert section is not None
    table = pairs_of(section)
    (pair,) = table.rows
    assert (pair["first"], pair["second"], pair["verdict"]) == ("CONE", "Multi-Agent ESP", "worse")
    assert (pair["difference"], pair["a12"]) == (pytest.approx(100), 0.0)
    assert table.note.startswith("Smaller is better.")
    pooled = next(one for one in reached.exhibits if one.name == "rover-complex-aggregate")
    assert pooled.rows[1]["better than Multi-Agent ESP"].startswith("0")
    assert pooled.rows[1]["iqm"] == pytest.approx(200, rel=0.01)
    # The lesioned teams of this campaign come a fifth nearer, which is a gain.
    assert all(row["lost"] == pytest.approx(-20, abs=2) for row in lost.exhibits[0].rows)


def test_the_loss_is_larger_if_more_is_better(tmp_path: Path) -> None:
    with Tables(write_tables(tmp_path, "rover-v2", TRUTH, 10, 0.05)) as tables:
        (scope,) = scopes(tables)
        section, lost = comparisons(scope), interventions(scope)[0]
    assert section is not None
    assert pairs_of(section).rows[0]["verdict"] == "better"
    assert all(row["lost"] == pytest.approx(20, abs=2) for row in lost.exhibits[0].rows)


def test_exchange_is_next_to_every_result_of_cone(tmp_path: Path) -> None:
    idle = dataclasses.replace(TRUTH["complex-1", "cone"], exchanges=0.3, exchange_share=0.003)
    truth = TRUTH | {("complex-1", "cone"): idle}
    with Tables(write_tables(tmp_path, "rover-v2", truth, 10, 0.05)) as tables:
        (scope,) = scopes(tables)
        section, reached = comparisons(scope), performance(scope)
    rows = next(one for one in reached.exhibits if one.name == "rover-complex-performance").rows
    assert [(row["method"], row["exchanges"]) for row in rows] == [
        ("mesp", None),
        ("cone", pytest.approx(0.3)),
    ]
    assert rows[1]["exchange_share"] == pytest.approx(0.3)
    assert section is not None
    assert pairs_of(section).rows[0]["verdict"] == "better, no exchange"
    assert (
        "CONE exchanged next to nothing between populations in 1 of 1 cells, at most 0.3 pairs"
        in (section.text[-1])
    )


def test_the_power_of_alike_is_in_the_row_of_a_pair(tmp_path: Path) -> None:
    truth = {("complex-1", "mesp"): Cell(100.0), ("complex-1", "cone"): Cell(100.0)}
    powers = {}
    for noise in (0.05, 0.3):
        folder = write_tables(tmp_path / str(noise), "rover-v2", truth, 10, noise)
        with Tables(folder) as tables:
            (scope,) = scopes(tables)
            section = comparisons(scope)
        assert section is not None
        powers[noise] = pairs_of(section).rows[0]["power"]
    assert powers[0.05] > 0.9
    assert powers[0.3] < 0.05
