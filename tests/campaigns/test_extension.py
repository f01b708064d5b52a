"""A campaign whose plan becomes longer: its runs continue, studies and tables are made again."""

from __future__ import annotations

import json
import os
import shutil
import time
from pathlib import Path

import pytest

from campaigns.plans import tiny_campaign
from campaigns.test_campaign import Scripted
from conevo.campaigns.campaign import Campaign, create
from conevo.campaigns.coordinator import Stopped
from conevo.campaigns.executors.local import Serial
from conevo.campaigns.worker import carry_out
from conevo.errors import UsageError
from conevo.runs.run import Run
from runs.crashes import Crash, fail_at
from runs.tiny import content

LONGER = {"run.generations": 4}


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished campaign of four runs of two generations, to be copied."""
    campaign = tiny_campaign(tmp_path_factory.mktemp("done"), head="")
    campaign.carry_on(Scripted())
    return campaign.path


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """A finished campaign that was planned with four generations."""
    folder = tmp_path_factory.mktemp("whole")
    plan = tiny_campaign(folder, head="").plan.at(settings=LONGER)
    campaign = create(plan, folder / "whole")
    campaign.carry_on(Scripted())
    return campaign


@pytest.fixture
def campaign(done: Path, tmp_path: Path) -> Campaign:
    return Campaign(shutil.copytree(done, tmp_path / "tiny"))


def same_as(whole: Campaign, campaign: Campaign) -> bool:
    """Whether the runs, studies and lists of both are the same."""
    for label in whole.planned:
        if content(campaign.paths.run(label)) != content(whole.paths.run(label)):
            return False
        studies = [json.loads(one.paths.study(label).read_text()) for one in (whole, campaign)]
        if studies[0] != studies[1]:
            return False
    return {k: v.run_ids for k, v in whole.planned.items()} == {
        k: v.run_ids for k, v in campaign.planned.items()
    }


def test_a_longer_plan_extends_every_run(campaign: Campaign, whole: Campaign) -> None:
    tables = (campaign.paths.tables / "tables.json").read_text()
    longer = create(campaign.plan.at(settings=LONGER), campaign.path)
    assert {one.state for one in longer.standings().values()} == {"pending"}
    entries = longer.carry_on(Scripted())
    assert {one.state for one in entries.values()} == {"finished"}
    assert same_as(whole, longer)
    assert (campaign.paths.tables / "tables.json").read_text() != tables
    ends = Run(longer.paths.run(next(iter(longer.planned)))).provenance["extended"]
    assert [end["generations"] for end in ends] == [2]
    again = Scripted()
    Campaign(campaign.path).carry_on(again)
    assert again.begun == []


def test_a_shorter_plan_is_refused(campaign: Campaign) -> None:
    before = campaign.paths.runs.read_bytes()
    with pytest.raises(UsageError, match=r"would be shorter in this plan .*= 1, planned: 2"):
        create(campaign.plan.at(settings={"run.generations": 1}), campaign.path)
    with pytest.raises(UsageError, match=r"shorter .*budget_evaluations = 5000, planned: no limit"):
        create(campaign.plan.at(settings={"run.budget_evaluations": 5000}), campaign.path)
    assert campaign.paths.runs.read_bytes() == before


def test_a_budget_that_adds_nothing_is_a_longer_plan_too(tmp_path: Path) -> None:
    more = '"run.budget_evaluations" = 5000'
    campaign = tiny_campaign(tmp_path, more=more)
    campaign.carry_on(Scripted())
    longer = create(campaign.plan.at(settings={"run.budget_evaluations": 6000}), campaign.path)
    entries = longer.carry_on(Scripted())
    assert {one.state for one in entries.values()} == {"finished"}
    for label, planned in longer.planned.items():
        assert Run(longer.paths.run(label)).provenance["run_id"] == planned.run_ids[0]


def test_a_new_plan_is_written_whole_or_not_at_all(
    campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    new = tmp_path / "new"
    shutil.copytree(campaign.path, new)
    longer = create(campaign.plan.at(settings=LONGER), new)
    plans = (campaign.paths.plan.read_text(), longer.paths.plan.read_text())
    runs = [list(one.planned.values()) for one in (campaign, longer)]
    call, calls = 0, 1
    while call < calls:
        path = tmp_path / "broken"
        shutil.copytree(campaign.path, path)
        with monkeypatch.context() as patch:
            fail_at(patch, call, Crash())
            try:
                create(campaign.plan.at(settings=LONGER), path)
            except Crash:
                calls = call + 2
        broken = Campaign(path)
        with broken.locked():
            broken.settle()
        state = (broken.paths.plan.read_text(), list(broken.planned.values()))
        assert state in list(zip(plans, runs, strict=True)), call
        assert not broken.paths.extension.exists()
        shutil.rmtree(path)
        call += 1
    assert call >= 6


@pytest.mark.slow
def test_a_worker_that_is_killed_while_it_extends_a_run_continues(
    campaign: Campaign, whole: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    longer = create(campaign.plan.at(settings=LONGER), campaign.path)
    label = next(iter(longer.planned))
    for call in (0, 1, 2, 3, 5, 9):
        with monkeypatch.context() as patch:
            fail_at(patch, call, Crash())
            with pytest.raises(Crash):
                carry_out(longer.path, label, 1)
        assert not longer.is_finished(label)
    longer.carry_on(Scripted())
    assert same_as(whole, longer)


def test_a_changed_run_fails_and_the_others_continue(campaign: Campaign) -> None:
    label = next(iter(campaign.planned))
    with (campaign.paths.run(label) / "champion.npz").open("ab") as file:
        file.write(b"x")
    entries = create(campaign.plan.at(settings=LONGER), campaign.path).carry_on(Scripted())
    assert [one.state for one in entries.values()] == ["failed", *["finished"] * 3]
    assert "was changed since it was finished (champion.npz)" in entries[label].reason


def test_a_coordinator_stops_in_time(tmp_path: Path) -> None:
    campaign = tiny_campaign(tmp_path)
    began = time.monotonic()
    with pytest.raises(Stopped, match="time limit reached"):
        campaign.carry_on(Serial(1), time_limit=1e-6)
    assert time.monotonic() - began < 30
    states = [one.state for one in campaign.standings().values()]
    assert set(states) == {"pending"}
    assert os.listdir(campaign.path / "runs")
    assert {one.state for one in campaign.carry_on(Scripted()).values()} == {"finished"}
