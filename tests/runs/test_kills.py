"""A hundred kills at random moments: nothing is lost, and results are those without kills."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import conevo
from campaigns.plans import write_plan
from conevo.campaigns.campaign import Campaign
from runs.tiny import TASKS, command, content, tiny_settings, wait_for

pytestmark = [pytest.mark.slow, pytest.mark.exhaustive]
KILLS: list[int] = []
PAIRS = [(method, task) for method in conevo.METHODS for task in TASKS]


def spawn(*words: str) -> subprocess.Popen[str]:
    """Start conevo as a process group, so that its workers are killed with it."""
    return subprocess.Popen(
        [sys.executable, "-m", "conevo", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        start_new_session=True,
    )


def to_the_end(words: list[str]) -> float:
    """Execute a command and return its duration in seconds."""
    began, process = time.monotonic(), spawn(*words)
    _, err = process.communicate()
    assert (process.returncode, "Traceback" in err) == (0, False), err
    return time.monotonic() - began


def kill(words: list[str], again: list[str], path: Path, n: int, rng: random.Random) -> None:
    """Kill a command that evolves at ``path`` ``n`` times, and resume it each time.

    The moments are random: after up to 40 generations, and up to a twentieth of a second more.
    """
    for generation in sorted(rng.choices(range(36), k=n)):
        process = spawn(*words)
        wait_for(lambda: done_at(path) >= generation or process.poll() is not None)  # noqa: B023
        time.sleep(rng.uniform(0, 0.05))
        os.killpg(process.pid, signal.SIGKILL)
        _, err = process.communicate()
        assert process.returncode in (0, -signal.SIGKILL), err
        if process.returncode:
            KILLS.append(generation)
        if (path / "DONE").exists() and done_at(path) == 40:
            return
        words = again if (path / "lock").exists() else words
    to_the_end(words)


def done_at(path: Path) -> int:
    """Return the generations on the disk, of a shaping those of its third stage."""
    log = path / ("stage-3" if (path / "shaping.toml").exists() else "") / "generations.jsonl"
    return log.read_bytes().count(b"\n") if log.is_file() and (path / "lock").exists() else -1


@pytest.mark.parametrize("seed", range(20))
def test_runs(seed: int, tmp_path: Path) -> None:
    method, task = random.Random(seed).choice(PAIRS)
    threads = ["--threads", "1", "--quiet"]
    start = [
        [*command(tmp_path / name, method, task, run__generations=40), *threads]
        for name in ("whole", "killed")
    ]
    to_the_end(start[0])
    path = tmp_path / "killed"
    kill(start[1], ["resume", str(path), *threads], path, 4, random.Random(seed))
    assert content(path) == content(tmp_path / "whole")


@pytest.mark.parametrize("seed", range(6))
def test_runs_that_are_given_another_length(seed: int, tmp_path: Path) -> None:
    method, task = random.Random(100 + seed).choice(PAIRS)
    threads = ["--threads", "1", "--quiet"]
    to_the_end([*command(tmp_path / "whole", method, task, run__generations=40), *threads])
    path = tmp_path / "killed"
    to_the_end([*command(path, method, task, run__generations=5), *threads])
    extend = ["resume", str(path), "--generations", "40", *threads]
    kill(extend, extend, path, 4, random.Random(seed))
    assert content(path) == content(tmp_path / "whole")


@pytest.mark.parametrize("seed", range(4))
def test_shapings(seed: int, tmp_path: Path) -> None:
    rng = random.Random(200 + seed)
    method = rng.choice(list(conevo.METHODS))
    task = rng.choice(["rover/complex-3", "gacc/complex-3"])
    settings = tiny_settings(method, task, run__generations=40)
    sets = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    threads = ["--threads", "1", "--quiet"]
    start = [
        ["run", task, "--shape", "--method", method, "--preset", "smoke", "--out", str(out), *sets,
         *threads]
        for out in (tmp_path / "whole", tmp_path / "killed")
    ]  # fmt: skip
    to_the_end(start[0])
    path = tmp_path / "killed"
    kill(start[1], ["resume", str(path), *threads], path, 4, rng)
    for stage in ("stage-1", "stage-2", "stage-3"):
        assert content(path / stage) == content(tmp_path / "whole" / stage)


@pytest.mark.parametrize("seed", range(4))
def test_campaigns(seed: int, tmp_path: Path) -> None:
    plan = write_plan(tmp_path / "plans", 'studies = ["teams"]')
    start = [
        ["campaign", "start", str(plan), "--out", str(out), "--cores", "2", "--quiet"]
        for out in (tmp_path / "whole", tmp_path / "killed")
    ]
    seconds, path, rng = to_the_end(start[0]), tmp_path / "killed", random.Random(300 + seed)
    for _ in range(4):
        process = spawn(*start[1])
        time.sleep(rng.uniform(0.2, 0.6) * seconds)
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        if process.returncode:
            KILLS.append(0)
    to_the_end(start[1])
    whole, killed = Campaign(tmp_path / "whole"), Campaign(path)
    assert {entry.state for entry in killed.standings().values()} == {"finished"}
    for label in whole.planned:
        assert content(killed.paths.run(label)) == content(whole.paths.run(label))
        studies = [one.paths.study(label).read_bytes() for one in (whole, killed)]
        assert studies[0] == studies[1]


def test_these_were_a_hundred_kills() -> None:
    assert len(KILLS) >= 100, f"{len(KILLS)} kills"
