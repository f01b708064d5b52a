"""A run resolves its settings once, builds its world once, and uses the written ones."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest

import conevo.runs.config
from conevo.cli.main import main
from conevo.runs.config import resolve
from conevo.runs.start import start
from conevo.worlds.pursuit import prey_sets
from conevo.worlds.registry import WorldEntry
from runs.tiny import tiny_settings

LIGHT = f"{Path(__file__).resolve().parents[2] / 'examples' / 'light.py'}:dark-1"


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Calls of the functions that resolve settings and build a world."""
    calls: Counter[str] = Counter()

    def counting(name: str, function: Any) -> Any:
        def called(*given: Any, **named: Any) -> Any:
            calls[name] += 1
            return function(*given, **named)

        return called

    monkeypatch.setattr(conevo.runs.config, "resolve", counting("resolve", resolve))
    monkeypatch.setattr(WorldEntry, "build", counting("build", WorldEntry.build))
    return calls


@pytest.mark.parametrize(
    ("task", "more"),
    [("rover/complex-1", ()), ("pursuit/team-2", ("--prey", "heuristic")), (LIGHT, ())],
    ids=["rover", "prey", "file"],
)
def test_a_run_resolves_and_builds_once(
    task: str, more: tuple[str, ...], counted: Counter[str], tmp_path: Path
) -> None:
    settings = [f"--set={k}={v}" for k, v in tiny_settings("homcne", task).items()]
    counted.clear()
    with pytest.raises(SystemExit) as ended:
        main(("run", task, "--method=homcne", f"--out={tmp_path / 'run'}", *settings, *more))
    assert not ended.value.code
    assert (tmp_path / "run" / "DONE").exists()
    assert counted == {"resolve": 1, "build": 1}


@pytest.mark.parametrize("case", ["plain", "prey", "file"])
def test_a_run_uses_the_settings_that_it_has_written(case: str, tmp_path: Path) -> None:
    task = {"plain": "rover/complex-1", "prey": "pursuit/team-2", "file": LIGHT}[case]
    overrides = tiny_settings("homcne", task)
    if case == "prey":
        shipped = prey_sets.load(None)
        prey_sets.save(tmp_path / "mine.npz", shipped)
        overrides["world.prey"] = str(tmp_path / "mine.npz")
    run = start(resolve(task, "homcne", overrides=overrides), tmp_path / "run")
    written = run.path / "config.toml"
    assert run.config == resolve(file=written)
    assert run.config.to_toml(run.path) == written.read_text()
    inputs = {"plain": "", "prey": "mine.npz", "file": "light.py"}[case]
    used = run.config.entry.file if case == "file" else getattr(run.config.world_params, "prey", "")
    assert used == (str(run.path.resolve() / "inputs" / inputs) if inputs else "")
