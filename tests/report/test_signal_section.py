"""The signal in a report: a row per method and task, and its effect on comparisons."""

from __future__ import annotations

from pathlib import Path

import duckdb
import pytest

from conevo.campaigns.campaign import Campaign
from conevo.campaigns.tables import Tables
from conevo.report.files import write_report
from conevo.report.sections.comparisons import comparisons
from conevo.report.sections.scope import scopes
from conevo.report.sections.signal import blind_cells, signal
from report.finished_runs import Cell, write_campaign

pytest_plugins = ["report.quick_figures"]
pytestmark = pytest.mark.usefixtures("without_ink")

OF = [
    Cell("rover", "complex-1", "homcne", reliability=0.6),
    Cell("rover", "complex-1", "mesp", reliability=0.02),
    Cell("rover", "complex-1", "ccga"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Tables of three methods: one with signal, one without, one without a study of it."""
    return write_campaign(tmp_path_factory.mktemp("signal") / "c", OF, 4, 3)


def test_every_method_with_a_study_has_its_signal(folder) -> None:
    with Tables(folder / "tables") as tables:
        (scope,) = scopes(tables)
        section = signal(scope)
        blind = blind_cells(scope)
    assert section is not None
    rows = {row["method"]: row for row in section.exhibits[0].rows}
    assert list(rows) == ["homcne", "mesp"]
    assert rows["homcne"]["shown_first"] == "0.0600 ± 0.0030"  # of four, .006 each
    assert rows["homcne"]["reliability_first"] == pytest.approx(0.6)
    assert rows["homcne"]["reliability_last"] == pytest.approx(0.3)
    assert rows["mesp"]["rounds_first"] == pytest.approx(500)
    assert [rows[name]["verdict"] for name in rows] == ["signal", "not tested: no signal"]
    assert section.text == [
        "Not tested: no signal in 1 of 2 cells (Multi-Agent ESP). Selection among these genotypes "
        "is nearly blind, and comparisons of these cells hardly test methods."
    ]
    assert [cell.treatment.method for cell in blind] == ["mesp"]


def test_signal_in_the_last_populations_alone_is_enough(tmp_path) -> None:
    cell = Cell("rover", "complex-1", "mesp", reliability=0.08)
    root = write_campaign(tmp_path / "c", [cell], 2, 2)
    stored = root / "tables" / "signal.parquet"
    with duckdb.connect() as connection:  # .08 first and .04 last, reversed
        connection.execute(
            f"CREATE TABLE swapped AS SELECT * REPLACE (CASE generation WHEN 'first' THEN 'last'"
            f" ELSE 'first' END AS generation) FROM '{stored}'"
        )
        connection.execute(f"COPY swapped TO '{stored}' (FORMAT parquet)")
    with Tables(root / "tables") as tables:
        (scope,) = scopes(tables)
        section = signal(scope)
        blind = blind_cells(scope)
    assert section is not None
    (row,) = section.exhibits[0].rows
    assert row["reliability_first"] == pytest.approx(0.04)
    assert (row["verdict"], blind) == ("signal", set())


def test_comparisons_with_a_blind_method_are_marked(folder) -> None:
    with Tables(folder / "tables") as tables:
        (scope,) = scopes(tables)
        section = comparisons(scope)
    assert section is not None
    table = next(one for one in section.exhibits if one.name == "rover-complex-comparisons")
    told = {frozenset((r["first"], r["second"])): r["verdict"] for r in table.rows}
    for pair, verdict in told.items():
        assert verdict.endswith(", no signal") == ("Multi-Agent ESP" in pair)
    assert "No signal: selection among a method's genotypes was nearly blind" in table.note
    assert "(reliability below 0.05 first and last" in section.text[-1]


def test_the_section_is_absent_without_a_study(tmp_path) -> None:
    root = write_campaign(tmp_path / "c", [Cell("rover", "complex-1", "ccga")], 2, 2)
    with Tables(root / "tables") as tables:
        (scope,) = scopes(tables)
        assert signal(scope) is None
        assert blind_cells(scope) == set()


def test_a_report_has_the_table_in_all_its_forms(folder, tmp_path) -> None:
    report = write_report(Campaign(folder), tmp_path / "report").parent
    assert "not tested: no signal" in (report / "index.html").read_text()
    assert (report / "tables" / "rover-complex-signal.tex").is_file()
    head, *rows = (report / "numbers" / "rover-complex-signal.csv").read_text().splitlines()
    assert {"icc_first", "error_first", "icc_last"} <= set(head.split(","))
    assert len(rows) == 2
