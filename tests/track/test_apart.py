"""Whatever happens to a tracker, the run's files are the same bytes, and its exit code is 0."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

import conevo
from runs.tiny import command, content, evolve_tiny, wait_for

STUBS = Path(__file__).parent / "stubs"
LENGTH = {"run__generations": 30}


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same run without a tracker."""
    return evolve_tiny(tmp_path_factory.mktemp("alone") / "run", "homcne", **LENGTH).path


@pytest.fixture(autouse=True)
def _ended(tmp_path: Path) -> Iterator[None]:
    """End the trackers that a test has left."""
    yield
    for pid in trackers_in(tmp_path):
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def trackers_in(folder: Path) -> list[int]:
    """Return the trackers whose working directory is a folder."""
    found = []
    for one in Path("/proc").iterdir():
        try:
            if one.name.isdecimal() and (one / "cwd").readlink() == folder:
                words = (one / "cmdline").read_bytes().split(b"\0")
                if b"track" in words:
                    found.append(int(one.name))
        except OSError:
            continue
    return found


def start(folder: Path, how: str, *more: str) -> subprocess.Popen[str]:
    """Start a run with a tracker in a folder."""
    words = command(Path("run"), "homcne", **LENGTH)
    path = os.pathsep.join([str(STUBS), *sys.path])
    return subprocess.Popen(
        [sys.executable, "-m", "conevo", *words, "--threads", "1", *more],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": path, "HOW_TRACKED": how},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def end(process: subprocess.Popen[str]) -> str:
    """Return the notes of a run that must end well."""
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, out + err
    return err


@pytest.mark.parametrize(
    ("how", "line"),
    [
        ("a full disk", "conevo: error: cannot write .*No space left on device\n"),
        ("a dead server", "conevo: error: cannot write .*Connection refused\n"),
        ("a server that hangs", ""),
        ("kill -9", ""),
        (
            "well",
            r"run: 30 generations sent to tracks/tensorboard/run-\w{6}\nsee: tensorboard .*\n",
        ),
    ],
)
def test_a_tracker_does_not_change_a_run(tmp_path: Path, alone: Path, how: str, line: str) -> None:
    process = start(tmp_path, how, "--track", "tensorboard")
    if how == "kill -9":
        wait_for(lambda: bool(trackers_in(tmp_path)))
        time.sleep(0.3)
        for pid in trackers_in(tmp_path):
            os.kill(pid, signal.SIGKILL)
    note = end(process)
    log = tmp_path / "tracks" / "tensorboard" / "run.track.log"
    assert note == (
        f"conevo: note: tracked by a process of its own; its log is {log.relative_to(tmp_path)}\n"
    )
    run = tmp_path / "run"
    assert content(run) == content(alone)
    assert sorted(p.name for p in run.iterdir()) == sorted(p.name for p in alone.iterdir())
    assert conevo.Run(run).changed_files == []
    if how == "a server that hangs":
        assert len(trackers_in(tmp_path)) == 1  # the run did not wait for it
    elif line:
        wait_for(lambda: not trackers_in(tmp_path))
        assert re.fullmatch(line, log.read_text())


def test_a_run_goes_on_where_its_tracker_cannot_start(tmp_path: Path, alone: Path) -> None:
    (tmp_path / "tracks").write_text("a file in the place of the folder")
    note = end(start(tmp_path, "well", "--track", "tensorboard"))
    assert note.startswith("conevo: note: not tracked: ")
    assert content(tmp_path / "run") == content(alone)
    assert trackers_in(tmp_path) == []


def test_ctrl_c_ends_the_run_and_not_its_tracker_and_later_tracking_gives_the_same(
    tmp_path: Path, alone: Path
) -> None:
    process = start(tmp_path, "well", "--track", "tensorboard")
    log = tmp_path / "run" / "generations.jsonl"
    wait_for(lambda: log.exists() and log.read_bytes().count(b"\n") > 3)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 130
    assert len(trackers_in(tmp_path)) == 1
    conevo.Run(tmp_path / "run").resume(threads=1)
    wait_for(lambda: not trackers_in(tmp_path))
    assert content(tmp_path / "run") == content(alone)
    (events,) = (tmp_path / "tracks" / "tensorboard").glob("run-*/events.*")
    live = events.read_text()
    assert track(tmp_path).returncode == 0
    (again,) = (tmp_path / "tracks" / "tensorboard").glob("run-*/events.*")
    assert again != events
    assert without_times(again.read_text()) == without_times(live)
    steps = [one["step"] for one in map(json.loads, live.splitlines()) if "step" in one]
    records = conevo.Run(tmp_path / "run").generations()
    assert steps == [*(one["team_steps"] for one in records), records[-1]["team_steps"]]


def test_a_follower_that_is_interrupted_says_how_to_send_the_rest(tmp_path: Path) -> None:
    path = evolve_tiny(tmp_path / "run", "homcne", run__generations=2).path
    (path / "DONE").unlink()
    process = track(tmp_path, "--follow", wait=False)
    events = tmp_path / "tracks" / "tensorboard"
    wait_for(lambda: any(one.stat().st_size for one in events.glob("run-*/events.*")))
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=20)
    assert process.returncode == 130
    assert out.startswith("run: 2 generations sent to tracks/tensorboard/run-")
    assert err == (
        "interrupted after 2 generations; send the rest with: conevo track run --to tensorboard\n"
    )


def track(folder: Path, *more: str, wait: bool = True) -> subprocess.Popen[str]:
    """Track the run in a folder."""
    process = subprocess.Popen(
        [sys.executable, "-m", "conevo", "track", "run", "--to", "tensorboard", *more],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env=os.environ
        | {"PYTHONPATH": os.pathsep.join([str(STUBS), *sys.path]), "HOW_TRACKED": "well"},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    if wait:
        process.wait(timeout=60)
    return process


def without_times(events: str) -> list[object]:
    """Return events without the times that a run took."""
    found = []
    for one in map(json.loads, events.splitlines()):
        del one["wall_time"]
        values = one.get("summary", {}).get("value", [])
        found.append([value for value in values if value["tag"] != "seconds"] or one)
    return found
