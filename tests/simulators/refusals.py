"""A task that cannot be run: the command line refuses it in one line, and writes nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from conevo.cli.main import main

__all__ = ["check_refused"]


def check_refused(task: str, words: str, out: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Run a task into a directory, and check that one line has the words, with exit code 2."""
    with pytest.raises(SystemExit, match="2"):
        main(["run", task, "--out", str(out)])
    printed, error = capfd.readouterr()
    assert words in error
    assert (printed, error.count("\n")) == ("", 1)
    assert not out.exists()
