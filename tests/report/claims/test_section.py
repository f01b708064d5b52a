"""Claims in a report: only those about its runs, each with the reader's necessary cautions."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import duckdb

from conevo.campaigns.tables import Tables
from conevo.report.claims import CLAIMS
from conevo.report.sections.claims import claims
from report.claims.known_truth import rover, write_tables


def test_two_methods_have_the_claims_about_them_and_one_line_for_the_rest(tmp_path: Path) -> None:
    truth = {
        key: dataclasses.replace(cell, exchanges=0.003, exchange_share=0.00003)
        for key, cell in rover().items()
        if key[0].startswith(("simple", "complex")) and key[1] in ("mesp", "cone")
    }
    with Tables(write_tables(tmp_path, "rover-v2", truth, 10)) as tables:
        section = claims(tables)
    table = section.exhibits[0]
    rows = {row["id"]: row for row in table.rows}
    first, further = ["R1", "R5", "R6", "R9", "R11", "R12"], ["R14", "R15", "R16"]
    further += [*(f"R{n}" for n in (18, 19, 23, 25, 28)), "C1R", "C2R"]
    assert list(rows) == [*first, *further]
    assert (
        f"{len(CLAIMS) - len(rows)} of the thesis' claims are about runs that this campaign does"
        " not have" in (section.text[0])
    )
    assert "2 decided by the world, 1 not judged" in section.text[0]
    assert "it is not consistent: its appendices A, C and D call" in section.text[1]
    assert rows["R9"]["verdict"] == "not tested: no exchange"
    assert rows["R9"]["exchanges"] == "0.003 pairs (0.003 %)"
    assert rows["R6"]["verdict"] == "not judged: the thesis contradicts itself"
    assert rows["R6"]["reasons"].startswith("5.4.1 has it alike in most environments, 5.4.2 in")
    assert "by itself: not tested: no exchange" in rows["R6"]["reasons"]
    assert rows["R5"]["verdict"] == "decided by the world"
    assert rows["R5"]["reasons"].startswith("heuristic teams, which nothing evolved, also differ")
    assert "by itself: not tested: no exchange" in rows["R5"]["reasons"]


def test_the_power_of_the_rule_is_next_to_claims_of_alike(tmp_path: Path) -> None:
    truth = {key: cell for key, cell in rover().items() if key[1] in ("homcne", "hetcne")}
    with Tables(write_tables(tmp_path, "rover-v2", truth, 20, 0.1)) as tables:
        rows = {row["id"]: row for row in claims(tables).exhibits[0].rows}
    assert 0.25 < rows["R4"]["power"] < 0.45
    share = round(100 * rows["R4"]["power"])
    assert f"in which all are alike {share} % show it" in rows["R4"]["reasons"]
    assert rows["R10"]["power"] is None
    assert "power" not in rows["R10"]["reasons"]


def test_a_verdict_names_its_levels(tmp_path: Path) -> None:
    truth = {key: cell for key, cell in rover().items() if key[1] in ("homcne", "hetcne")}
    folder = write_tables(tmp_path, "rover-v2", truth, 3)
    runs = folder / "runs.parquet"
    level = "if(seed = 1, 'gst=0.1, rounds=2', 'gst=0.3, rounds=2')"
    with duckdb.connect() as connection:
        connection.execute(f"CREATE TABLE old AS FROM read_parquet('{runs}')")
        connection.execute(f"COPY (SELECT * REPLACE ({level} AS variant) FROM old) TO '{runs}'")
    with Tables(folder) as tables:
        exhibits = claims(tables).exhibits
    for table in exhibits:
        assert [column.title for column in table.columns][:2] == ["claim", "levels"]
        assert {row["variant"] for row in table.rows} == {"gst=0.1, rounds=2", "gst=0.3, rounds=2"}
    assert "rounds" not in exhibits[0].rows[0]["how"]


def test_a_campaign_about_no_claim_has_one_line(tmp_path: Path) -> None:
    truth = {("simple-1", "cone-3"): next(iter(rover().values()))}
    with Tables(write_tables(tmp_path, "rover-v2", truth, 2)) as tables:
        section = claims(tables)
    assert section.exhibits == ()
    assert section.text == [
        f"{len(CLAIMS)} of the thesis' claims are about runs that this campaign does not have."
    ]
