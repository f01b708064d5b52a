"""The coordinator, with an executor that does nothing by itself; see also tests/contracts."""

import json
import shutil
import time

import pytest

from campaigns.plans import tiny_campaign, write_plan
from conevo.campaigns.campaign import Campaign, create
from conevo.campaigns.coordinator import ATTEMPTS, Stopped
from conevo.campaigns.executors.local import Serial
from conevo.campaigns.executors.protocol import Ending, RunJob
from conevo.campaigns.plan_file import read_plan
from conevo.campaigns.worker import carry_out
from conevo.errors import EnvironmentFailure, UsageError
from conevo.runs.run import Run


class Scripted:
    """Carries out a job when the coordinator waits for it, or does what a test prescribes."""

    name = "scripted"

    def __init__(self, cores=2, fate=None):
        self.cores, self.fate = cores, fate or (lambda job: carry_out(job.root, job.label, 1))
        self.jobs: list[RunJob] = []
        self.begun: list[RunJob] = []
        self.most = 0
        self.stopped = 0

    def submit(self, job):
        self.jobs.append(job)
        self.begun.append(job)
        self.most = max(self.most, sum(one.threads for one in self.jobs))

    def wait(self, seconds):
        job = self.jobs.pop(0)
        lost = self.fate(job)
        return [Ending(job.label, lost if isinstance(lost, str) else "")]

    def stop(self):
        self.stopped += 1


def end_as(campaign, **how):
    """Return a fate: the worker records that it ended in this way."""
    about = {"message": "", "origin": "", "traceback": "", "core_seconds": 1.0} | how

    def fate(job):
        path = campaign.paths.ended(job.label)
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(about))

    return fate


def test_a_campaign_is_carried_out_and_its_runs_are_ordinary_runs(tmp_path):
    campaign = tiny_campaign(tmp_path)
    executor = Scripted()
    entries = campaign.carry_on(executor)
    assert {entry.state for entry in entries.values()} == {"finished"}
    assert [job.label for job in executor.begun] == list(campaign.planned)
    for label, planned in campaign.planned.items():
        run = Run(campaign.paths.run(label))
        assert (run.status, run.config.run_id) == ("finished", planned.run_ids[0])
    again = Scripted()
    campaign.carry_on(again)
    assert again.begun == []


def test_serial_runs_have_all_cores_one_after_the_other(tmp_path):
    campaign = tiny_campaign(tmp_path)
    began = time.process_time()
    entries = campaign.carry_on(Serial(2), threads=2)
    assert {entry.state for entry in entries.values()} == {"finished"}
    costs = [entry.core_seconds for entry in entries.values()]
    assert min(costs) > 0
    assert sum(costs) <= time.process_time() - began + 0.01
    sessions = [Run(campaign.paths.run(x)).provenance["sessions"] for x in campaign.planned]
    assert [[one["threads"] for one in of_run] for of_run in sessions] == [[2]] * 4


def test_cores_are_never_shared_and_none_is_idle_at_the_end(tmp_path):
    campaign = tiny_campaign(tmp_path)
    executor = Scripted(cores=6, fate=end_as(campaign, status="failed"))
    campaign.carry_on(executor)
    assert executor.most == 6
    assert [job.threads for job in executor.begun] == [1, 1, 2, 2]


def test_a_run_has_the_requested_threads(tmp_path):
    campaign = tiny_campaign(tmp_path)
    executor = Scripted(cores=4, fate=end_as(campaign, status="failed"))
    campaign.carry_on(executor, threads=3)
    assert {job.threads for job in executor.begun} == {3, 4}
    assert executor.most <= 4


def test_a_lost_worker_is_tried_again_and_then_failed_with_its_reason(tmp_path):
    campaign = tiny_campaign(tmp_path)
    entries = campaign.carry_on(Scripted(fate=lambda job: "killed by signal 9"))
    first = next(iter(entries.values()))
    assert {entry.attempts for entry in entries.values()} == {ATTEMPTS}
    assert (first.state, first.reason) == ("failed", "killed by signal 9 (attempt 3 of 3)")


def test_a_run_that_fails_by_itself_is_tried_again_only_on_request(tmp_path):
    campaign = tiny_campaign(tmp_path)
    fate = end_as(campaign, status="failed", origin="request", message="why")
    executor = Scripted(fate=fate)
    entries = campaign.carry_on(executor)
    assert {(e.state, e.attempts, e.reason) for e in entries.values()} == {("failed", 1, "why")}
    idle = Scripted()
    campaign.carry_on(idle)
    assert idle.begun == []
    assert campaign.retry() == list(campaign.planned)
    assert {e.state for e in campaign.carry_on(Scripted()).values()} == {"finished"}


def test_a_refusal_of_the_machine_is_tried_again(tmp_path):
    campaign = tiny_campaign(tmp_path)
    fate = end_as(campaign, status="failed", origin="machine", message="disk full")
    entries = campaign.carry_on(Scripted(fate=fate))
    assert {(e.state, e.attempts) for e in entries.values()} == {("failed", ATTEMPTS)}


def test_an_old_ending_does_not_count_for_a_new_worker(tmp_path):
    campaign = tiny_campaign(tmp_path)
    for label in campaign.planned:
        end_as(campaign, status="finished")(RunJob(tmp_path, label, 1))
    entries = campaign.carry_on(Scripted(fate=lambda job: None))
    assert {entry.state for entry in entries.values()} == {"failed"}
    assert "worker exited without reporting" in next(iter(entries.values())).reason


def test_files_count_rather_than_the_ledger(tmp_path):
    campaign = tiny_campaign(tmp_path)
    campaign.carry_on(Scripted())
    first, second, *_ = campaign.planned
    shutil.rmtree(campaign.paths.run(first))
    assert campaign.standings()[first].state == "pending"
    campaign.paths.ledger.unlink()
    executor = Scripted()
    entries = campaign.carry_on(executor)
    assert [job.label for job in executor.begun] == [first]
    assert entries[second].state == "finished"


def test_an_order_to_stop_is_obeyed_and_running_runs_continue_later(tmp_path):
    campaign = tiny_campaign(tmp_path)

    def fate(job):
        campaign.stop()
        carry_out(job.root, job.label, 1)

    executor = Scripted(fate=fate)
    with pytest.raises(Stopped):
        campaign.carry_on(executor)
    states = [entry.state for entry in campaign.standings().values()]
    assert states == ["finished", "pending", "pending", "pending"]
    assert executor.stopped == 1
    assert not campaign.paths.stop.exists()
    assert {e.state for e in campaign.carry_on(Scripted()).values()} == {"finished"}
    with pytest.raises(UsageError, match="is not running"):
        campaign.stop()


def test_only_one_coordinator_is_running(tmp_path):
    campaign = tiny_campaign(tmp_path)

    def fate(job):
        with pytest.raises(UsageError, match="in use"):
            Campaign(campaign.path).carry_on(Scripted())
        with pytest.raises(UsageError, match="in use"):
            Campaign(campaign.path).retry()
        assert Campaign(campaign.path).is_running
        carry_out(job.root, job.label, 1)

    assert {e.state for e in campaign.carry_on(Scripted(fate=fate)).values()} == {"finished"}


def test_more_seeds_extend_a_campaign_and_other_settings_do_not(tmp_path):
    campaign = tiny_campaign(tmp_path)
    campaign.carry_on(Scripted())
    bigger = create(campaign.plan.at(seeds=3), campaign.path)
    executor = Scripted()
    bigger.carry_on(executor)
    assert [job.label[-3:] for job in executor.begun] == ["-s3", "-s3"]
    with pytest.raises(UsageError, match="this plan does not have"):
        create(campaign.plan.at(seeds=1), campaign.path)
    with pytest.raises(UsageError, match="has other settings in this plan"):
        create(bigger.plan.at(settings={"run.epochs": 2}), campaign.path)
    assert len(Campaign(campaign.path).planned) == 6


def test_nothing_is_written_over_other_files_or_for_an_impossible_plan(tmp_path):
    plan = read_plan(write_plan(tmp_path))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    with pytest.raises(UsageError, match="already exists and is not a run"):
        create(plan, tmp_path / "mine")
    with pytest.raises(UsageError, match="generations = 0"):
        create(plan.at(settings={"run.generations": 0}), tmp_path / "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine", "tiny.toml"]


def test_a_foreign_run_in_its_place_is_left_alone(tmp_path):
    campaign = tiny_campaign(tmp_path)
    first, second, *_ = campaign.planned
    campaign.carry_on(Scripted())
    shutil.rmtree(campaign.paths.run(first))
    shutil.copytree(campaign.paths.run(second), campaign.paths.run(first))
    shutil.rmtree(campaign.path / "ended")
    assert not carry_out(campaign.path, first, 1)
    ended = json.loads(campaign.paths.ended(first).read_text())
    assert (ended["origin"], "not the run that was planned" in ended["message"]) == (
        "request",
        True,
    )


def test_without_a_place_for_compiled_kernels_no_run_starts(tmp_path, monkeypatch):
    def refuse(rollout):
        raise EnvironmentFailure("compiled kernels cannot be kept in /none")

    begun = tiny_campaign(tmp_path / "begun")
    monkeypatch.setattr("conevo.worlds.rollout.Rollout.build", refuse)
    with pytest.raises(EnvironmentFailure, match="cannot be kept"):
        tiny_campaign(tmp_path / "new")
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["tiny.toml"]
    executor = Scripted()
    with pytest.raises(EnvironmentFailure, match="cannot be kept"):
        begun.carry_on(executor)
    assert executor.begun == []
    assert {entry.attempts for entry in begun.standings().values()} == {0}
