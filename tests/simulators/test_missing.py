"""A task of a package that is not installed is refused in one line; its runs can be looked at."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from conevo.cli.main import main
from conevo.simulators import tasks


def test_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = tasks.find_spec

    def find_spec(name: str) -> Any:
        return None if name == "vmas" else found(name)

    monkeypatch.setattr(tasks, "find_spec", find_spec)
    with pytest.raises(SystemExit, match="2"):
        main(["run", "vmas:balance", "--out", str(tmp_path / "run")])
    out, error = capsys.readouterr()
    assert (out, error.count("\n")) == ("", 1)
    assert "vmas:balance needs the package vmas, which is not installed" in error
    assert "pip install 'conevo[vmas]'" in error
    assert not (tmp_path / "run").exists()
