"""Failures while a run writes its files."""

from __future__ import annotations

import os

import pytest

from conevo.runs import durable


class Crash(BaseException):
    """The end of the process at this point."""


def fail_at(monkeypatch: pytest.MonkeyPatch, call: int, problem: BaseException) -> list[int]:
    """Make the ``call``-th fsync of the run's files fail; return the list that counts them."""
    calls: list[int] = []
    sync = os.fsync

    def fsync(handle: int) -> None:
        calls.append(handle)
        if len(calls) - 1 == call:
            raise problem
        sync(handle)

    monkeypatch.setattr(durable.os, "fsync", fsync)
    return calls
