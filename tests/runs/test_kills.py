"""A hundred kills at random moments: nothing is lost, and all ends as if nothing had happened."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import conevo
from campaigns.plans import write_plan
from conevo.campaigns.campaign import Campaign
from runs.tiny import TASKS, command, content, tiny_settings

pytestmark = [pytest.mark.slow, pytest.mark.exhaustive]
PAIRS = [(method, task) for method in conevo.METHODS for task in TASKS]


def spawn(*words: str) -> subprocess.Popen[str]:
    """Start conevo as a group of processes, so that its workers are killed with it."""
    return subprocess.Popen(
        [sys.executable, "-m", "conevo", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        start_new_session=True,
    )


def to_the_end(words: list[str]) -> float:
    """Carry out a command and return the seconds that it took."""
    began, process = time.monotonic(), spawn(*words)
    _, err = process.communicate()
    assert (process.returncode, "Traceback" in err) == (0, False), err
    return time.monotonic() - began


def kill(
    words: list[str], again: Callable[[], list[str]], n: int, seconds: float, seed: int
) -> None:
    """Kill a command ``n`` times at random moments, and carry on each time."""
    rng = random.Random(seed)
    for _ in range(n):
        process = spawn(*words)
        try:
            process.wait(rng.uniform(0.1, seconds))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
        _, err = process.communicate()
        assert process.returncode in (0, -signal.SIGKILL), err
        if process.returncode == 0:
            break
        words = again()
    else:
        to_the_end(words)


@pytest.mark.parametrize("seed", range(20))
def test_runs(seed: int, tmp_path: Path) -> None:
    method, task = random.Random(seed).choice(PAIRS)
    threads = ["--threads", "1", "--quiet"]
    start = [
        [*command(tmp_path / name, method, task, run__generations=40), *threads]
        for name in ("whole", "killed")
    ]
    seconds = to_the_end(start[0])
    path = tmp_path / "killed"
    resume = ["resume", str(path), *threads]
    kill(start[1], lambda: resume if path.exists() else start[1], 3, seconds, seed)
    assert content(path) == content(tmp_path / "whole")


@pytest.mark.parametrize("seed", range(6))
def test_runs_that_are_given_another_length(seed: int, tmp_path: Path) -> None:
    method, task = random.Random(100 + seed).choice(PAIRS)
    threads = ["--threads", "1", "--quiet"]
    to_the_end([*command(tmp_path / "whole", method, task, run__generations=40), *threads])
    path = tmp_path / "killed"
    to_the_end([*command(path, method, task, run__generations=5), *threads])
    extend = ["resume", str(path), "--generations", "40", *threads]
    resume = ["resume", str(path), *threads]

    def again() -> list[str]:
        return extend if conevo.Run(path).config.run.generations == 5 else resume

    kill(extend, again, 3, 5.0, seed)
    assert content(path) == content(tmp_path / "whole")


@pytest.mark.parametrize("seed", range(4))
def test_shapings(seed: int, tmp_path: Path) -> None:
    rng = random.Random(200 + seed)
    method, task = (
        rng.choice(list(conevo.METHODS)),
        rng.choice(["rover/complex-3", "gacc/complex-3"]),
    )
    settings = tiny_settings(method, task, run__generations=15)
    sets = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    threads = ["--threads", "1", "--quiet"]
    start = [
        ["run", task, "--shape", "--method", method, "--preset", "smoke", "--out", str(out), *sets,
         *threads]
        for out in (tmp_path / "whole", tmp_path / "killed")
    ]  # fmt: skip
    seconds, path = to_the_end(start[0]), tmp_path / "killed"
    resume = ["resume", str(path), *threads]
    kill(start[1], lambda: resume if path.exists() else start[1], 4, seconds, seed)
    for stage in ("stage-1", "stage-2", "stage-3"):
        assert content(path / stage) == content(tmp_path / "whole" / stage)


@pytest.mark.parametrize("seed", range(4))
def test_campaigns(seed: int, tmp_path: Path) -> None:
    plan = write_plan(tmp_path / "plans", 'studies = ["teams"]')
    start = [
        ["campaign", "start", str(plan), "--out", str(out), "--cores", "2", "--quiet"]
        for out in (tmp_path / "whole", tmp_path / "killed")
    ]
    seconds, path = to_the_end(start[0]), tmp_path / "killed"
    kill(start[1], lambda: start[1], 4, seconds, seed)
    whole, killed = Campaign(tmp_path / "whole"), Campaign(path)
    assert {entry.state for entry in killed.standings().values()} == {"finished"}
    for label in whole.planned:
        assert content(killed.places.run(label)) == content(whole.places.run(label))
        studies = [one.places.study(label).read_bytes() for one in (whole, killed)]
        assert studies[0] == studies[1]
