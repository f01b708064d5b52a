"""Failures while a run writes its files."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from conevo.errors import EnvironmentFailure
from conevo.runs import durable


class Crash(BaseException):
    """The end of the process at this point."""


def fail_at(monkeypatch: pytest.MonkeyPatch, call: int, problem: BaseException) -> list[str]:
    """Make the ``call``-th fsync of the run's files fail; return the list that names them."""
    calls: list[str] = []
    sync = os.fsync

    def fsync(handle: int) -> None:
        calls.append(os.readlink(f"/proc/self/fd/{handle}"))
        if len(calls) - 1 == call:
            raise problem
        sync(handle)

    monkeypatch.setattr(durable.os, "fsync", fsync)
    return calls


def crashes_and_refusals(calls: list[str]) -> tuple[list[int], list[int]]:
    """Choose calls of fsync: each kind of write once, in the last and in the first place.

    A file is written, then its directory. A crash after the second leaves the files that a refusal
    of the next file does, so crashes are at directories and at lines of a log, refusals at files.
    Generations and stages, and the letters of drafts, make no difference between kinds.
    """
    kinds = [re.sub(r"(generation|stage)-\d+|(?<=\.)\w{8}(?=/|$)", r"\1", name) for name in calls]
    files = [k for k, name in enumerate(calls) if Path(name).suffix]
    logged = {k for k in files if calls[k].endswith(".jsonl")}
    named = {k: kinds[k - 1] for k in range(1, len(calls)) if k not in files}
    named |= {k: kinds[k] for k in logged}
    last = {kind: k for k, kind in named.items()}
    first = {kinds[k]: k for k in reversed(files)}
    return sorted(last.values()), sorted(first.values())


def assert_resumes(
    problem: BaseException,
    call: int,
    begin: Callable[[Path], object],
    opened: Callable[[Path], Any],
    content: Callable[[Path], dict[str, Any]],
    whole: dict[str, Any],
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Assert that a run or shaping of which one write failed, resumed, has the same content."""
    path = folder / "broken"
    with monkeypatch.context() as patch:
        fail_at(patch, call, problem)
        with pytest.raises((Crash, EnvironmentFailure)) as caught:
            begin(path)
    if isinstance(caught.value, EnvironmentFailure):
        assert caught.value.exit_code == 3
        assert str(path) in str(caught.value)
        assert "No space left on device" in str(caught.value)
    if not path.exists():  # interrupted in the first write: nothing is left
        assert [p.name for p in folder.iterdir()] == ["whole"]
        return
    left = opened(path)
    if left.status != "finished":
        left.resume(threads=1)
    assert content(path) == whole, call
    shutil.rmtree(path)
