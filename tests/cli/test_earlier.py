"""Runs in an earlier version of a world can be shown, but no longer played."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cli.conftest import Said
from conevo.worlds import registry
from conevo.worlds.registry import WORLDS, colours_of, entry_of
from conevo.worlds.rover.world import RoverWorld
from runs.tiny import evolve_tiny


@pytest.fixture
def earlier(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, say: Any) -> Path:
    """Make a finished run, ``old``, and a recorded epoch of it, as made by rover-v1."""
    order = list(WORLDS.items())
    with monkeypatch.context() as then:
        newest = WORLDS["rover-v2"]
        then.delitem(registry.EARLIER, "rover-v1")
        then.delitem(WORLDS, "rover-v2")
        then.setitem(WORLDS, "rover-v1", replace(newest, name="rover-v1"))
        then.setattr(RoverWorld, "name", "rover-v1")
        run = evolve_tiny(tmp_path / "old")
        assert run.config.task == "rover-v1/complex-1"
        made = say("replay", "old", "--no-browser", "--out", "old.html", "--keep", "old.npz")
        assert made.code == 0, made.err
    WORLDS.clear()
    WORLDS.update(order)  # the world that was removed and restored is no longer the last one
    return run.path


def refused(said: Said) -> str:
    assert said.code == 2
    assert said.out == ""
    assert said.err.count("\n") == 1
    return said.err.removeprefix("conevo: error: ").rstrip()


WHY = "this version of conevo plays rover-v2, no longer rover-v1; conevo 0.1.0 plays rover-v1"


def test_a_run_of_an_earlier_version_is_shown_but_not_played(earlier: Path, say: Any) -> None:
    assert say("show", "old").out.startswith("rover-v1/complex-1, CONE, preset smoke, seed 1\n")
    assert "rover-v1/complex-1" in say("list", "runs", ".").out
    again = earlier.with_name("again")
    shutil.copytree(earlier, again)
    (again / "DONE").unlink()
    for command in (
        ("test", "old"),
        ("test", "old", "--on", "complex-2"),
        ("replay", "old", "--out", "new.html"),
        ("film", "old", "--out", "new.gif"),
        ("export", "old", "--to", "new.py"),
        ("resume", "old", "--generations", "9"),
        ("run", "rover/complex-1", "--preset", "smoke", "--from", "old"),
        ("run", "rover/complex-1", "--preset", "smoke", "--from-champion", "old"),
    ):
        assert refused(say(*command)) == f"old: {WHY}", command
    for options in ((), ("--accept-other-code",)):
        assert refused(say("resume", "again", *options)) == f"again: {WHY}"
    names = {path.name for path in earlier.parent.iterdir()}
    assert names == {"old", "again", "old.html", "old.npz"}


def test_no_run_starts_in_an_earlier_version(say: Any, tmp_path: Path) -> None:
    assert refused(say("run", "rover-v1/complex-1", "--preset", "smoke")) == WHY
    assert "prey-v2, no longer prey-v1" in refused(say("list", "settings", "prey-v1/shaping-1"))
    Path("old.toml").write_text('[run]\nworld = "rover-v1/complex-1"\n')
    assert refused(say("run", "--config", "old.toml")) == WHY
    assert "did you mean 'rover-v2'?" in refused(say("run", "rover-v0/complex-1"))
    assert [path.name for path in tmp_path.iterdir()] == ["old.toml"]


def test_an_epoch_recorded_in_an_earlier_version_is_drawn(earlier: Path, say: Any) -> None:
    made = say("replay", "old.npz", "--no-browser", "--out", "kept.html")
    assert made.code == 0, made.err
    old, kept = (Path(f"{name}.html").read_text() for name in ("old", "kept"))
    assert kept == old
    assert earlier.is_dir()


def test_versions_of_a_world_share_colours() -> None:
    for name in registry.EARLIER:
        newest = entry_of(name)
        assert newest is not None
        assert newest.name in WORLDS
        assert colours_of(name) == colours_of(newest.name) != {}
    assert entry_of("rover-v0") is None
    assert entry_of("light-v1") is None
