"""The script of a job array, run by bash as SLURM would, without SLURM."""

import json
import os
import signal
import subprocess
import sys

import pytest

import conevo
from campaigns.plans import tiny_campaign
from campaigns.processes import n_generations, until, workers
from conevo.campaigns import slurm
from conevo.campaigns.executors.registry import make_executor
from conevo.errors import UsageError


@pytest.fixture
def task(tmp_path):
    """Return a function that starts a task of the array; its SLURM commands are in scontrol.txt."""
    command = tmp_path / "bin" / "scontrol"
    command.parent.mkdir()
    command.write_text(f'#!/bin/bash\necho "$@" >> {tmp_path}/scontrol.txt\n')
    command.chmod(0o755)

    def begin(script, index):
        known = {
            "SLURM_ARRAY_JOB_ID": "77",
            "SLURM_ARRAY_TASK_ID": str(index),
            "SLURM_JOB_ID": "77",  # for one task of an array: the number of the whole array
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
    assert task(script, 0).wait(60) == 0  # as after a requeue: finished runs are left alone
    assert {path: path.stat().st_mtime_ns for path in before} == before
    standings = campaign.carry_on(make_executor("serial", 1))
    assert {one.state for one in standings.values()} == {"finished"}
    assert [len(conevo.Run(campaign.paths.run(n)).provenance["sessions"]) for n in standings] == [
        1, 1, 1, 1,
    ]  # fmt: skip


def test_a_task_whose_time_is_over_stops_its_worker_and_is_requeued(tmp_path, task):
    more = '[[where]]\nmethod = "homcne"\nsettings = { "run.generations" = 1_000_000 }'
    campaign = tiny_campaign(tmp_path, more=more)
    label = next(iter(campaign.planned))
    script = slurm.write_array(campaign.path, [label])
    job = task(script, 0)
    until(lambda: n_generations(campaign, label) > 3)
    job.send_signal(signal.SIGUSR1)
    assert job.wait(60) == 0
    assert (tmp_path / "scontrol.txt").read_text() == "requeue 77_0\n"
    assert workers(campaign.path) == {}
    run = conevo.Run(campaign.paths.run(label))
    assert run.status == "interrupted"
    done = len(run.generations())
    job = task(script, 0)
    until(lambda: n_generations(campaign, label) > done)
    job.send_signal(signal.SIGUSR1)
    assert job.wait(60) == 0
    assert run.provenance["sessions"][1]["from_generation"] in (done - 1, done)  # records go first
    (tmp_path / "scontrol.txt").unlink()
    job = task(script, 0)
    until(lambda: workers(campaign.path))
    job.send_signal(signal.SIGTERM)  # cancelled by a user, who does not want it to be requeued
    assert job.wait(60) == 143
    assert workers(campaign.path) == {}
    assert not (tmp_path / "scontrol.txt").exists()


def test_a_task_continues_after_a_failed_run_and_is_listed_as_failed(tmp_path, task):
    more = '[[where]]\nmethod = "homcne"\nsettings = { "run.budget_evaluations" = 1 }'
    campaign = tiny_campaign(tmp_path, more=more)
    failing, good, *_ = campaign.planned
    script = slurm.write_array(campaign.path, [failing, good])
    lines = script.read_text().replace("k += 2", "k += 1")  # both in one task
    script.write_text(lines)
    assert task(script, 0).wait(60) == 1
    assert (campaign.is_finished(failing), campaign.is_finished(good)) == (False, True)


def test_the_array_requests_the_given_resources(tmp_path):
    campaign = tiny_campaign(tmp_path)
    script = slurm.write_array(
        campaign.path,
        ["a", "b"],
        threads=8,
        hours=1.5,
        at_once=1,
        options=["--gres=gpu:a100:1", "--mem=8G", "--exclusive", "--constraint=a&(b|c)"],
        python="/srv/it's/python",
    )
    lines = script.read_text().splitlines()
    assert {
        "#SBATCH --job-name=conevo-tiny",
        "#SBATCH --array=0-1%1",
        "#SBATCH --cpus-per-task=8",
        "#SBATCH --time=90",
        "#SBATCH --signal=B:USR1@180",
        "#SBATCH --requeue",
        "#SBATCH --gres=gpu:a100:1",
        "#SBATCH --mem=8G",
        "#SBATCH --exclusive",
        "#SBATCH --constraint=a&(b|c)",
    } <= set(lines)
    assert any("'/srv/it'\"'\"'s/python' -m conevo" in line for line in lines)
    assert lines[lines.index("runs=(") + 1 :][:3] == ["a", "b", ")"]
    first_command = next(k for k, line in enumerate(lines[1:], 1) if not line.startswith("#"))
    assert not [line for line in lines[first_command:] if line.startswith("#SBATCH")]
    assert lines[0] == "#!/bin/bash"
    assert sys.executable in slurm.write_array(campaign.path, ["a"]).read_text()


def test_a_finished_run_that_is_extended_is_not_skipped(tmp_path):
    campaign = tiny_campaign(tmp_path)
    ended = campaign.paths.ended("a")
    ended.parent.mkdir()
    about = {"status": "finished", "origin": "", "message": "", "core_seconds": 1.0}
    ended.write_text(json.dumps(about))
    failed = campaign.paths.ended("b")
    failed.write_text(json.dumps(about | {"status": "failed", "origin": "machine"}))
    slurm.write_array(campaign.path, ["a", "b"])
    assert (ended.exists(), failed.exists()) == (False, True)


@pytest.mark.parametrize(
    ("labels", "asked", "message"),
    [
        ([], {}, "no unfinished run"),
        (["a"], {"hours": 0.05}, "--hours 0.05: must be from 0.1 .a worker has 180 s to leave. to"),
        (["a"], {"hours": float("inf")}, "--hours inf: must be from 0.1 "),
        (["a"], {"hours": float("nan")}, "--hours nan: must be from 0.1 "),
        (["a"], {"options": ["-p gpu"]}, "'-p gpu' is not an option for sbatch"),
        (["a"], {"options": ["--mem 8G"]}, "'--mem 8G' is not an option for sbatch"),
        (["a"], {"options": ["--mem=8G\nrm -rf x"]}, "is not an option for sbatch"),
        (["a"], {"options": ["--comment=a#b"]}, "is not an option for sbatch"),
        (["a"], {"options": ['--comment="a']}, "is not an option for sbatch"),
        (["a"], {"options": ["--mem="]}, "is not an option for sbatch"),
        (["a"], {"options": ["--array=0-5"]}, "conevo sets --array itself; use conevo's --at-once"),
        (["a"], {"options": ["--requeue"]}, "conevo sets --requeue itself; leave it out"),
        (["a"], {"options": ["--mem=8G", "--mem=9G"]}, "--mem for sbatch is given twice"),
    ],
)
def test_an_impossible_array_is_refused(tmp_path, labels, asked, message):
    campaign = tiny_campaign(tmp_path)
    with pytest.raises(UsageError, match=message):
        slurm.write_array(campaign.path, labels, **asked)
    assert not (campaign.path / "slurm.sh").exists()
