"""The script of a job array, run by bash as SLURM would, without SLURM."""

import os
import signal
import subprocess
import sys

import pytest

import conevo
from campaigns.plans import tiny_campaign
from campaigns.processes import n_generations, until, workers
from conevo.campaigns import slurm
from conevo.campaigns.executors import make_executor
from conevo.errors import UsageError


@pytest.fixture
def task(tmp_path):
    """Return a function that begins a task of the array; what it asks of SLURM is in said.txt."""
    command = tmp_path / "bin" / "scontrol"
    command.parent.mkdir()
    command.write_text(f'#!/bin/bash\necho "$@" >> {tmp_path}/said.txt\n')
    command.chmod(0o755)

    def begin(script, index):
        known = {
            "SLURM_ARRAY_TASK_ID": str(index),
            "SLURM_JOB_ID": "77",
            "SLURM_CPUS_PER_TASK": "1",
        }
        path = f"{command.parent}:{os.environ['PATH']}"
        return subprocess.Popen(["bash", str(script)], env=os.environ | known | {"PATH": path})

    return begin


def test_the_tasks_carry_out_all_runs_and_the_campaign_finds_them(tmp_path, task, monkeypatch):
    campaign = tiny_campaign(tmp_path / "a folder")
    monkeypatch.setattr(slurm, "TASKS", 3)  # so that task 0 has two of the four runs
    script = slurm.write_array(campaign.path, list(campaign.planned))
    assert "#SBATCH --array=0-2\n" in script.read_text()
    assert [task(script, index).wait(60) for index in (0, 1)] == [0, 0]
    done = [campaign.is_finished(label) for label in campaign.planned]
    assert done == [True, True, False, True]
    before = {path: path.stat().st_mtime_ns for path in campaign.path.glob("ended/*")}
    assert task(script, 0).wait(60) == 0  # as after a requeue: what is finished is left alone
    assert {path: path.stat().st_mtime_ns for path in before} == before
    standings = campaign.carry_on(make_executor("processes", 1))
    assert {one.state for one in standings.values()} == {"finished"}
    assert [len(conevo.Run(campaign.places.run(n)).provenance["sessions"]) for n in standings] == [
        1, 1, 1, 1,
    ]  # fmt: skip


def test_a_task_whose_time_is_up_lets_its_worker_leave_and_goes_back_into_the_queue(tmp_path, task):
    more = '[[where]]\nmethod = "homcne"\nsettings = { "run.generations" = 1_000_000 }'
    campaign = tiny_campaign(tmp_path, more=more)
    label = next(iter(campaign.planned))
    script = slurm.write_array(campaign.path, [label])
    job = task(script, 0)
    until(lambda: n_generations(campaign, label) > 3)
    job.send_signal(signal.SIGUSR1)
    assert job.wait(60) == 0
    assert (tmp_path / "said.txt").read_text() == "requeue 77\n"
    assert workers(campaign.path) == {}
    run = conevo.Run(campaign.places.run(label))
    assert run.status == "interrupted"
    done = len(run.generations())
    job = task(script, 0)
    until(lambda: n_generations(campaign, label) > done)
    job.send_signal(signal.SIGUSR1)
    assert job.wait(60) == 0
    assert run.provenance["sessions"][1]["from_generation"] in (done - 1, done)  # records go first


def test_what_the_array_asks_for_is_what_was_said(tmp_path):
    campaign = tiny_campaign(tmp_path)
    script = slurm.write_array(
        campaign.path, ["a", "b"], threads=8, hours=1.5, at_once=1, python="/srv/it's/python"
    )
    lines = script.read_text().splitlines()
    assert {
        "#SBATCH --job-name=conevo-tiny",
        "#SBATCH --array=0-1%1",
        "#SBATCH --cpus-per-task=8",
        "#SBATCH --time=90",
        "#SBATCH --signal=B:USR1@180",
        "#SBATCH --requeue",
    } <= set(lines)
    assert any("'/srv/it'\"'\"'s/python' -m conevo" in line for line in lines)
    assert (campaign.path / "slurm-runs.txt").read_text() == "a\nb\n"
    assert lines[0] == "#!/bin/bash"
    assert sys.executable in slurm.write_array(campaign.path, ["a"]).read_text()


@pytest.mark.parametrize(
    ("labels", "hours", "says"),
    [([], 1.0, "no run left"), (["a"], 0.05, "0.05 hours are too short: a worker has 180 s")],
)
def test_an_array_that_cannot_be_is_refused(tmp_path, labels, hours, says):
    campaign = tiny_campaign(tmp_path)
    with pytest.raises(UsageError, match=says):
        slurm.write_array(campaign.path, labels, hours=hours)
    assert not (campaign.path / "slurm.sh").exists()
