"""Statements about methods whose fitness carries no information about genotypes are not tested."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import duckdb
import pytest

from conevo.campaigns.schema import SCHEMA
from conevo.campaigns.tables import Tables
from conevo.report.claims import CLAIMS, Verdict, verdicts
from report.claims.known_truth import rover, write_tables

BY_ID = {claim.id: claim for claim in CLAIMS}


def verdict_of(
    folder: Path, method: str, first: float | None, last: float | None = 0.0, claim: str = "R9"
) -> Verdict:
    """Return the verdict on a claim with studies of signal of one method's runs."""
    columns = ", ".join(f'"{name}" {kind}' for name, kind in SCHEMA["signal"].items())
    with duckdb.connect() as connection:
        connection.execute(f"CREATE TABLE signal ({columns})")
        for generation, reliability in (("first", first), ("last", last)):
            connection.execute(
                "INSERT INTO signal (run, generation, icc_of_scheme) SELECT run, $1, $2 FROM "
                f"'{folder / 'runs.parquet'}' WHERE method = $3",
                [generation, reliability, method],
            )
        connection.execute(f"COPY signal TO '{folder / 'signal.parquet'}' (FORMAT parquet)")
    with Tables(folder) as tables:
        (found,) = verdicts(tables, [BY_ID[claim]])
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Tables in which R9 is true."""
    return write_tables(tmp_path_factory.mktemp("blind") / "tables", "rover-v2", rover(), 10)


@pytest.mark.parametrize("first", [0.0, 0.0499, -0.1, None])
def test_a_method_without_signal_first_and_last_leaves_a_claim_untested(first, folder) -> None:
    found = verdict_of(folder, "cone", first)
    assert found.verdict == "not tested: no signal"
    assert "not tested: no signal, fitness carries no information about genotypes" in found.why


def test_with_signal_or_without_a_study_it_is_judged(folder) -> None:
    assert verdict_of(folder, "cone", 0.05).verdict == "reproduced"
    assert verdict_of(folder, "cone", 0.0, last=0.05).verdict == "reproduced"
    assert verdict_of(folder, "nobody", 0.0).verdict == "reproduced"


def test_statements_about_exchange_are_judged_with_signal_or_without(folder) -> None:
    with_it = verdict_of(folder, "cone", 0.9, claim="C1R").alone
    assert verdict_of(folder, "cone", 0.0, claim="C1R").alone == with_it


def test_no_signal_comes_before_no_exchange(tmp_path) -> None:
    truth = {
        key: dataclasses.replace(cell, exchanges=0.0, exchange_share=0.0)
        for key, cell in rover().items()
    }
    folder = write_tables(tmp_path / "tables", "rover-v2", truth, 10)
    assert verdict_of(folder, "cone", 0.9).verdict == "not tested: no exchange"
    assert verdict_of(folder, "cone", 0.01).verdict == "not tested: no signal"
