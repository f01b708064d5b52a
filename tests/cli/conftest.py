"""Commands as a user gives them."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from conevo.cli.main import main


@dataclass(frozen=True)
class Said:
    """Exit code and output of one command."""

    code: int
    out: str
    err: str


@pytest.fixture
def say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """Return a function that runs a command in an empty directory; no browser opens."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("webbrowser.open", lambda address: True)
    monkeypatch.setattr("webbrowser.get", lambda: object())
    monkeypatch.setenv("DISPLAY", ":0")

    def run(*arguments: str) -> Said:
        monkeypatch.setattr(sys, "argv", ["conevo", *arguments])
        with pytest.raises(SystemExit) as caught:
            main(arguments)
        out, err = capsys.readouterr()
        return Said(int(caught.value.code or 0), out, err)

    return run
