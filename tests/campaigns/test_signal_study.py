"""The signal as a study of a campaign: measured once per run, in a table, part of its progress."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from campaigns.plans import tiny_campaign, write_plan
from conevo.campaigns.campaign import Campaign, create
from conevo.campaigns.executors.local import Serial
from conevo.campaigns.plan_file import read_plan
from conevo.campaigns.schema import SCHEMA
from conevo.campaigns.tables import Tables
from conevo.reading import read_json
from conevo.report.files import sections_of
from conevo.runs.run import Run
from conevo.studies.signal import measure_signal

pytest_plugins = ["report.quick_figures"]

OWN = Path(__file__).resolve().parents[2] / "examples" / "own_method.py"


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """A finished campaign of two tiny runs, to which the study was added afterwards."""
    folder = tmp_path_factory.mktemp("signal")
    tiny_campaign(folder, "studies = []")
    made = Campaign(folder / "tiny")
    made.carry_on(Serial(1))
    plan = write_plan(folder, 'studies = ["signal"]')
    return create(read_plan(plan), made.path)


def test_only_a_study_added_to_a_plan_later_is_missing(without_ink, campaign) -> None:
    before = {name: campaign.paths.run(name) / "DONE" for name in campaign.planned}
    sealed = {name: path.stat().st_mtime_ns for name, path in before.items()}
    assert not any(campaign.is_finished(label) for label in campaign.planned)
    campaign.carry_on(Serial(1))
    assert all(campaign.is_finished(label) for label in campaign.planned)
    assert {name: path.stat().st_mtime_ns for name, path in before.items()} == sealed
    for label in campaign.planned:
        study = read_json(campaign.paths.study(label, "signal"))
        run = Run(campaign.paths.run(label))
        assert study == measure_signal(run, threads=1) | {"not_measured": ""}
        assert not campaign.paths.study(label).exists()
    with Tables(campaign.paths.tables) as tables:
        for label in campaign.planned:
            columns = [name for name in SCHEMA["signal"] if name != "run"]
            sql = f"SELECT {', '.join(columns)} FROM signal WHERE run = '{label}' ORDER BY ALL"
            study = read_json(campaign.paths.study(label, "signal"))["signal"]
            rows = [tuple(row[name] for name in columns) for row in study]
            assert tables.query(sql)[1] == rows
        sections = sections_of(tables, campaign)
        titles = [part.title for section in sections for part in section.sections]
    assert "Signal" in titles


def test_for_a_method_without_populations_the_study_gives_the_reason(tmp_path) -> None:
    where = f"""
[[where]]
method = ["{OWN}:team-es"]
settings = {{ "method.genotypes" = 6 }}
"""
    plan = write_plan(tmp_path, 'studies = ["signal"]', more=where)
    text = plan.read_text().replace('["homcne", "cone"]', f'["{OWN}:team-es"]')
    plan.write_text(text.replace("seeds = 2", "seeds = 1"))
    campaign = create(read_plan(plan), tmp_path / "tiny")
    campaign.carry_on(Serial(1))
    (label,) = campaign.planned
    assert campaign.is_finished(label)
    study = json.loads(campaign.paths.study(label, "signal").read_text())
    assert study["signal"] == []
    assert study["not_measured"].startswith("Team ES has no populations")
    with Tables(campaign.paths.tables) as tables:
        assert tables.query("SELECT count(*) FROM signal")[1] == [(0,)]
