"""A campaign's tables as DataFrames, and its card in a notebook."""

from __future__ import annotations

import dataclasses
import re
import sys
from pathlib import Path

import pytest

from campaigns.plans import tiny_campaign
from conevo.campaigns.campaign import Campaign
from conevo.campaigns.executors.local import Serial
from conevo.campaigns.schema import SCHEMA
from conevo.errors import EnvironmentFailure, UsageError


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    campaign = tiny_campaign(tmp_path_factory.mktemp("camp"))
    campaign.carry_on(Serial(1))
    return campaign


def test_every_table_is_a_frame_with_the_columns_of_the_schema(campaign: Campaign) -> None:
    pytest.importorskip("pandas")
    for table, columns in SCHEMA.items():
        assert list(campaign.frame(table)) == list(columns)
    runs = campaign.frame()
    assert sorted(runs["run"]) == sorted(campaign.planned)
    assert runs["seed"].dtype == "int64"
    assert runs["optimum"].dtype == "float64"
    assert runs["planned_evaluations"].isna().all()
    scores = campaign.frame("scores").groupby("run").size()
    assert scores.tolist() == [2 * 2 * 2] * 4  # teams, measures, scenarios


def test_a_query_is_a_frame_and_an_order_is_refused(campaign: Campaign) -> None:
    pytest.importorskip("pandas")
    found = campaign.query("SELECT method, count(*) AS n FROM runs GROUP BY ALL ORDER BY method")
    assert found.to_dict("list") == {"method": ["cone", "homcne"], "n": [2, 2]}
    for sql, why in (
        ("DROP TABLE runs", "DROP is not a query"),
        ("", "no SQL statement"),
        ("SELECT x FROM runs", 'query: Binder Error: .*"x"'),
    ):
        with pytest.raises(UsageError, match=why):
            campaign.query(sql)
    with pytest.raises(UsageError, match=r"unknown table 'robot' .* did you mean 'robots'"):
        campaign.frame("robot")


def test_without_a_finished_run_frames_are_empty_with_the_same_types(
    campaign: Campaign, tmp_path: Path
) -> None:
    pytest.importorskip("pandas")
    other = tiny_campaign(tmp_path)
    for table in ("runs", "measures", "generations"):
        empty, full = other.frame(table), campaign.frame(table)
        assert len(empty) == 0
        assert list(empty) == list(full)
    assert empty["generation"].dtype == full["generation"].dtype == "int32"
    assert not other.paths.tables.exists()


def test_missing_pandas_is_one_line(campaign: Campaign, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(EnvironmentFailure, match=r"need pandas, .* pip install"):
        campaign.frame()


def test_the_card_has_a_bar_for_every_cell(tmp_path: Path) -> None:
    campaign = tiny_campaign(tmp_path / "a<b>")
    campaign.plan = dataclasses.replace(campaign.plan, title="<i>T</i>")
    first = next(iter(campaign.planned))
    campaign.ledger.enrol(campaign.planned)
    campaign.ledger.end(first, "failed", "<script>why")
    html = campaign._repr_html_()
    assert "3 pending, 1 failed" in html
    for text in ("&lt;i&gt;T&lt;/i&gt;", "a&lt;b&gt;", "&lt;script&gt;why"):
        assert text in html
    assert "<script" not in html
    bars = re.findall(r'<span class="bar">(.*?)</span> ([^<]*)</td>', html)
    assert [text for _, text in bars] == ["0/2 !1", "0/2"]
    assert "width:50.0%;background:#d55e00" in bars[0][0]
    Campaign(campaign.path).retry()
    Campaign(campaign.path).carry_on(Serial(1))
    bars = re.findall(r'<span class="bar">(.*?)</span> ([^<]*)</td>', campaign._repr_html_())
    assert bars == [('<i style="width:100.0%;background:#009e73"></i>', "2/2")] * 2
