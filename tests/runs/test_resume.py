"""A run that was broken off anywhere ends as if it had not been, bit for bit."""

from __future__ import annotations

import errno
import os
import shutil
import signal
from functools import partial
from pathlib import Path

import pytest

import conevo
from conevo.errors import UsageError
from conevo.evolution.methods.registry import METHODS
from conevo.runs.config import resolve
from conevo.runs.start import start
from runs.crashes import Crash, assert_resumes, crashes_and_refusals, fail_at
from runs.tiny import (
    PAIRS,
    TASK,
    TASKS,
    command,
    content,
    evolve_tiny,
    kill_twice,
    spawn,
    tiny_settings,
    wait_for,
)

# In CI each method with one task: resuming knows neither.
ALL_PAIRS = [
    pytest.param(method, task, marks=[] if (method, task) in PAIRS else [pytest.mark.exhaustive])
    for method in METHODS
    for task in TASKS
]


@pytest.mark.slow
@pytest.mark.parametrize(("method", "task"), ALL_PAIRS)
def test_resume_after_kills_at_random_moments(method: str, task: str, tmp_path: Path) -> None:
    whole = evolve_tiny(tmp_path / "whole", method, task, run__generations=25)
    path = tmp_path / "killed"
    kills = kill_twice(path, command(path, method, task, run__generations=25))
    conevo.Run(path).resume(threads=2)
    assert content(path) == content(whole.path), kills


FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("every", [1, 2])
@pytest.mark.parametrize("problem", [Crash(), FULL])
def test_resume_after_a_failure_at_each_kind_of_write(
    problem: BaseException, every: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls, whole = written(tmp_path, monkeypatch, every)
    crashes, refusals = crashes_and_refusals(calls)
    assert len(crashes) > len(refusals) >= 12
    for call in refusals if problem is FULL else crashes:
        assert_resumes(
            problem, call, partial(evolve_tiny, **lengths(every)), conevo.Run, content, whole,
            tmp_path, monkeypatch,
        )  # fmt: skip


@pytest.mark.exhaustive
@pytest.mark.parametrize("every", [1, 2])
@pytest.mark.parametrize("problem", [Crash(), FULL])
def test_resume_after_a_failure_at_every_write(
    problem: BaseException, every: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls, whole = written(tmp_path, monkeypatch, every)
    assert len(calls) >= 30
    for call in range(len(calls)):
        assert_resumes(
            problem, call, partial(evolve_tiny, **lengths(every)), conevo.Run, content, whole,
            tmp_path, monkeypatch,
        )  # fmt: skip


def lengths(every: int) -> dict[str, int]:
    return {"run__generations": 3, "run__checkpoint_every": every}


def written(
    folder: Path, monkeypatch: pytest.MonkeyPatch, every: int
) -> tuple[list[str], dict[str, object]]:
    """Return the writes of a whole run and its content."""
    with monkeypatch.context() as patch:
        calls = fail_at(patch, -1, Crash())
        return calls, content(evolve_tiny(folder / "whole", **lengths(every)).path)


def test_interrupt_keeps_the_last_finished_generation(tmp_path: Path) -> None:
    changes = {"run__generations": 150, "run__checkpoint_every": 1000}
    path = tmp_path / "run"
    process = spawn(*command(path, "mesp", **changes))
    log = path / "generations.jsonl"
    wait_for(lambda: log.exists() and log.read_bytes().count(b"\n") >= 3)
    process.send_signal(signal.SIGINT)
    _, message = process.communicate(timeout=30)
    assert process.returncode == 130, message
    assert f"continue with: conevo resume {path}" in message
    run = conevo.Run(path)
    count = len(run.generations())
    assert run.status == "interrupted"
    assert 3 <= count < 150
    assert f"interrupted after {count} generations" in message
    starts: list[int] = []
    run.resume(threads=1, watch=lambda _, record: starts.append(record["generation"]))
    # Ctrl-C between the log's line and the next statement: that generation is repeated.
    assert starts[0] in (count - 1, count)
    whole = evolve_tiny(tmp_path / "whole", "mesp", **changes)
    assert content(path) == content(whole.path)


def interrupted(path: Path, *, after: int = 3) -> conevo.Run:
    """Make a run that was interrupted after some generations."""

    def stop(run: conevo.Run, record: dict[str, object]) -> None:
        if record["generation"] == after - 1:
            raise KeyboardInterrupt

    run = start(resolve(TASK, "cone", "smoke", overrides=tiny_settings("cone")), path, threads=1)
    with pytest.raises(KeyboardInterrupt):
        run.resume(threads=1, watch=stop)
    return conevo.Run(path)


def test_a_damaged_newest_checkpoint_falls_back_to_the_previous_one(tmp_path: Path) -> None:
    whole = evolve_tiny(tmp_path / "whole")
    run = interrupted(tmp_path / "run")
    damaged = max(run.path.glob("checkpoint-?.npz"), key=lambda p: p.stat().st_mtime_ns)
    damaged.write_bytes(damaged.read_bytes()[:-100])
    remarks: list[str] = []
    run.resume(threads=1, remark=remarks.append)
    assert len(remarks) == 1
    assert str(damaged) in remarks[0]
    assert "going on from generation 2 instead" in remarks[0]
    assert content(run.path) == content(whole.path)


def test_two_damaged_checkpoints_are_one_clear_line_and_nothing_is_lost(tmp_path: Path) -> None:
    run = interrupted(tmp_path / "run")
    for file in run.path.glob("checkpoint-?.npz"):
        file.write_bytes(b"")
    before = (run.path / "generations.jsonl").read_bytes()
    with pytest.raises(UsageError) as caught:
        run.resume(threads=1)
    assert "no usable checkpoint" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert (run.path / "generations.jsonl").read_bytes() == before
    for file in run.path.glob("checkpoint-?.npz"):
        file.unlink()
    assert content(run.resume(threads=1).path) == content(evolve_tiny(tmp_path / "whole").path)


def test_a_foreign_checkpoint_is_refused(tmp_path: Path) -> None:
    run = interrupted(tmp_path / "run")
    other = evolve_tiny(tmp_path / "other", run__seed=2)
    (source,) = other.path.glob("checkpoint-?.npz")
    for file in run.path.glob("checkpoint-?.npz"):
        shutil.copy(source, file)
    with pytest.raises(UsageError, match="is foreign: stem_id is"):
        run.resume(threads=1)


def test_lost_finalists_are_not_silently_replaced(tmp_path: Path) -> None:
    run = interrupted(tmp_path / "run")
    (run.path / "finalists.npz").unlink()
    with pytest.raises(UsageError, match=r"lost its finalists\.npz"):
        run.resume(threads=1)


def test_a_lost_champion_is_the_first_finalist_again(tmp_path: Path) -> None:
    run = interrupted(tmp_path / "run")
    (run.path / "champion.npz").unlink()
    assert content(run.resume(threads=1).path) == content(evolve_tiny(tmp_path / "whole").path)


def test_a_run_made_with_other_kernels_is_refused(tmp_path: Path) -> None:
    run = interrupted(tmp_path / "run")
    file = run.path / "provenance.json"
    file.write_text(file.read_text().replace(run.provenance["kernel_hash"], "0" * 16))
    for use in (run.resume, run.test):
        with pytest.raises(UsageError, match=r"made with other kernels \(0000000000000000, here"):
            use(threads=1)


def test_an_edited_configuration_is_refused(tmp_path: Path) -> None:
    run = interrupted(tmp_path / "run")
    file = run.path / "config.toml"
    file.write_text(file.read_text().replace("iterations = 12", "iterations = 13"))
    with pytest.raises(UsageError, match="was changed after the run was started"):
        conevo.Run(run.path)


def test_a_finished_run_is_not_resumed(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run")
    before = {p: p.read_bytes() for p in run.path.rglob("*") if p.is_file()}
    with pytest.raises(UsageError, match="is finished"):
        run.resume()
    assert {p: p.read_bytes() for p in run.path.rglob("*") if p.is_file()} == before
