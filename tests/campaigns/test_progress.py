"""The state of runs that a coordinator has not started: those of SLURM, or resumed by hand."""

import contextlib
import json
import os

import pytest

from campaigns.plans import tiny_campaign
from conevo.campaigns.executors.registry import make_executor
from conevo.campaigns.progress import RunProgress, last_written, progress_of
from conevo.campaigns.worker import carry_out
from conevo.runs.directory import Directory
from conevo.runs.start import start
from watch.followed import record

NAMES = 'world = "rover/complex-2"\nmethod = "cone"\npreset = "smoke"\nseed = 1\n'
CONFIG = "[run]\n" + NAMES + "generations = 10\nbudget_evaluations = {budget}\n"
NOTHING = RunProgress(0, 0, 0, 0, 0.0, None)


@pytest.fixture
def campaign(tmp_path):
    return tiny_campaign(tmp_path)


def write_log(path, n, budget=0, more=""):
    path.mkdir(parents=True, exist_ok=True)
    (path / "config.toml").write_text(CONFIG.format(budget=budget))
    lines = [json.dumps(record(k, team_evaluations=7 * (k + 1))) for k in range(n)]
    (path / "generations.jsonl").write_text("".join(f"{line}\n" for line in lines) + more)


def held(campaign, label):
    """Return a context in which a process is working on a run."""
    path = campaign.paths.run(label)
    write_log(path, 3)
    return Directory(path, "run").locked()


def write_ended(campaign, label, **changes):
    path = campaign.paths.ended(label)
    path.parent.mkdir(exist_ok=True)
    text = {"status": "failed", "origin": "machine", "message": "no disk", "core_seconds": 1.5}
    path.write_text(json.dumps(text | changes))
    return path


# --- states -------------------------------------------------------------------------------------


def test_a_run_locked_by_any_process_is_running(campaign):
    first, *others = campaign.planned
    with held(campaign, first):
        states = {label: entry.state for label, entry in campaign.standings().items()}
    assert states == {first: "running"} | dict.fromkeys(others, "pending")
    assert campaign.standings()[first].state == "pending"


def test_a_run_whose_worker_had_no_coordinator_has_failed_with_its_reason(campaign):
    first, second, third, fourth = campaign.planned
    path = write_ended(campaign, first)
    write_ended(campaign, second, status="finished")  # wrong: the run does not exist
    write_ended(campaign, third, message=3)
    write_ended(campaign, fourth).write_text("[" * 50_000)
    entry = campaign.standings()[first]
    assert (entry.state, entry.reason) == ("failed", "no disk")
    assert [campaign.standings()[one].state for one in (second, third, fourth)] == ["pending"] * 3
    assert campaign.retry() == [first]
    assert not path.exists()
    assert campaign.standings()[first].state == "pending"


def test_the_state_of_a_coordinator_counts_for_more_than_that_of_a_worker(campaign):
    first = next(iter(campaign.planned))
    write_ended(campaign, first)
    campaign.ledger.enrol(campaign.planned)
    campaign.ledger.end(first, "pending", "no disk")  # of three attempts
    entry = campaign.standings()[first]
    assert (entry.state, entry.attempts) == ("pending", 1)


# --- a coordinator leaves runs of others alone ----------------------------------------------------


@pytest.mark.parametrize("is_finished_there", [False, True])
def test_a_coordinator_waits_for_runs_that_others_carry_out(campaign, is_finished_there):
    label = next(iter(campaign.planned))
    planned = campaign.planned[label]
    run = start(planned.configs()[0], campaign.paths.run(label), threads=1)
    hold = contextlib.ExitStack()
    hold.enter_context(Directory(run.path, "run").locked())
    endings = []

    def watch(_, ending):
        endings.extend([ending.label] if ending else [])
        if len(endings) == 3 and ending is None and run.status == "running":
            hold.close()
            if is_finished_there:
                run.resume(threads=1)

    standings = campaign.carry_on(make_executor("serial", 1), watch=watch)
    others = [one for one in campaign.planned if one != label]
    assert endings == (others if is_finished_there else [*others, label])
    assert {entry.state for entry in standings.values()} == {"finished"}
    assert standings[label].attempts == (0 if is_finished_there else 1)
    assert standings[others[0]].attempts == 1


def test_a_worker_leaves_a_run_that_another_one_has(campaign, monkeypatch):
    monkeypatch.setattr("conevo.campaigns.worker.PATIENCE", 0.0)
    label = next(iter(campaign.planned))
    planned = campaign.planned[label]
    run = start(planned.configs()[0], campaign.paths.run(label), threads=1)
    with Directory(run.path, "run").locked():
        assert not carry_out(campaign.path, label, 1)
    assert not campaign.paths.ended(label).exists()  # the other one writes that


# --- how far --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("n", "budget", "expected"),
    [(4, 0, (4, 10, 28, 0, 0.4)), (4, 56, (4, 10, 28, 56, 0.5)), (12, 0, (12, 10, 84, 0, 1.0))],
)
def test_the_progress_of_a_run_follows_from_its_last_line_and_its_settings(
    campaign, n, budget, expected
):
    label = next(iter(campaign.planned))
    path = campaign.paths.run(label)
    write_log(path, n, budget, more='{"generation": 99, "team_eval')
    os.utime(path / "generations.jsonl", (1000, 2000))
    found = progress_of(campaign.paths, campaign.planned[label])
    assert found == RunProgress(*expected, written=2000.0)
    assert last_written(campaign.paths, label) == 2000.0


@pytest.mark.parametrize("line", ["{}", "[1]", '{"generation": "x"}', "[" * 40_000, "\x00"])
def test_a_log_whose_last_line_is_damaged_counts_as_not_done(campaign, line):
    label = next(iter(campaign.planned))
    write_log(campaign.paths.run(label), 3, more=f"{line}\n")
    found = progress_of(campaign.paths, campaign.planned[label])
    assert (found.generations, found.share, found.written) == (0, 0.0, None)


@pytest.mark.parametrize("text", ["", "run = 3", "[run]\ngenerations = 0\nbudget_evaluations = 0"])
def test_a_run_without_readable_settings_has_no_plan(campaign, text):
    label = next(iter(campaign.planned))
    write_log(campaign.paths.run(label), 3)
    (campaign.paths.run(label) / "config.toml").write_text(text)
    found = progress_of(campaign.paths, campaign.planned[label])
    assert (found.generations, found.of, found.share) == (3, 0, 0.0)


def test_a_run_that_has_not_started_has_no_progress(campaign):
    label = next(iter(campaign.planned))
    assert progress_of(campaign.paths, campaign.planned[label]) == NOTHING
    assert last_written(campaign.paths, label) is None


def test_the_progress_of_a_shaping_is_that_of_its_stages(tmp_path):
    path = tmp_path / "p.toml"
    path.write_text('[campaign]\nseeds = 1\nshape = true\n[factors]\nworld = ["rover/complex-2"]\n'
                    'method = ["cone"]\n')  # fmt: skip
    from conevo.campaigns.campaign import create
    from conevo.campaigns.plan_file import read_plan

    campaign = create(read_plan(path), tmp_path / "c")
    ((label, planned),) = campaign.planned.items()
    run = campaign.paths.run(label)
    write_log(run / "stage-1", 10, 70)
    write_log(run / "stage-2", 5, 140)
    stages = "".join(
        f"[[stages]]\n[stages.run]\n{NAMES}generations = 10\nbudget_evaluations = {budget}\n"
        for budget in (70, 140)
    )
    (run / "shaping.toml").write_text(stages)
    (run / "config.toml").unlink(missing_ok=True)
    os.utime(run / "stage-2" / "generations.jsonl", (1000, 2000))
    os.utime(run / "stage-1" / "generations.jsonl", (1000, 1000))
    found = progress_of(campaign.paths, planned)
    assert found == RunProgress(15, 20, 105, 210, 0.75, 2000.0)
    assert last_written(campaign.paths, label) == 2000.0
