"""Showing results is fast, runs no world file and changes nothing."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import conevo
from campaigns.plans import tiny_campaign
from conevo.runs.config import resolve
from conevo.runs.start import start
from runs.tiny import TASK, evolve_tiny, tiny_settings

LIGHT = Path(__file__).parents[2] / "examples" / "light.py"
# Modules that runs need. Loading them takes longer than any command that shows results.
HEAVY = {"numpy", "warp", "scipy", "duckdb", "matplotlib", "conevo.runs.config"}
LOOK = """
import sys
from conevo.cli.main import main
try:
    main(sys.argv[1:])
finally:
    print(*sys.modules, file=sys.stderr)
"""
TINY: dict[str, Any] = {
    "run.generations": 2,
    "run.epochs": 1,
    "run.n_tests": 2,
    "world.iterations": 12,
    "method.genotypes": 4,
}


def look(*arguments: str) -> tuple[str, set[str]]:
    """Return the output of a command, and the modules that it loads."""
    done = subprocess.run(
        [sys.executable, "-c", LOOK, *arguments], text=True, capture_output=True, check=True
    )
    return done.stdout, set(done.stderr.split())


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run in each state; the file of the run in an own world cannot be run."""
    folder = tmp_path_factory.mktemp("runs")
    own = folder / "own"
    conevo.evolve(f"{LIGHT}:dark-1", "cone", "smoke", out=own, overrides=TINY, threads=1)
    (own / "inputs" / "light.py").write_text("raise SystemExit\n")
    evolve_tiny(folder / "finished")
    start(resolve(TASK, "cone", "smoke", overrides=tiny_settings("cone")), folder / "begun")
    for name in ("edited", "torn", "cut"):
        evolve_tiny(folder / name, "homcne")
    for name, file, old, new in (
        ("edited", "config.toml", "seed = 1", "seed = 2"),
        ("torn", "provenance.json", "{", "["),
        ("cut", "generations.jsonl", '{"generation": 3,', '{"generation": 4,'),
    ):
        path = folder / name / file
        path.write_text(path.read_text().replace(old, new, 1))
    return folder


def test_runs_are_listed_without_loading_the_modules_of_runs(runs: Path) -> None:
    out, modules = look("list", "runs", str(runs), "--json")
    assert HEAVY & modules == set()
    rows = {Path(row["run"]).name: row for row in json.loads(out)}
    assert rows["own"]["world"] == "light-v1/dark-1"
    assert {name: row["status"].partition(":")[0] for name, row in rows.items()} == {
        "own": "finished",
        "finished": "finished",
        "begun": "interrupted",
        "edited": "damaged",
        "torn": "damaged",
        "cut": "damaged",
    }
    counts = {name: row["generations"] for name, row in rows.items() if row["generations"]}
    assert counts == {
        name: f"{done} generations"
        for name, done in (("own", "2 of 2"), ("finished", "5 of 5"), ("begun", "0 of 5"))
    }
    assert "config.toml was changed after the run was started" in rows["edited"]["status"]
    assert "is damaged in line 4" in rows["cut"]["status"]


def test_a_run_is_shown_without_its_world(runs: Path) -> None:
    out, modules = look("show", str(runs / "own"))
    assert HEAVY & modules == set()
    assert out.startswith("light-v1/dark-1, CONE, preset smoke, seed 1\n")
    assert "modified since the run: inputs/light.py" in out
    out, modules = look("show", str(runs / "finished"), "--json")
    assert HEAVY & modules == set()
    assert json.loads(out)["config"]["run"]["world"] == "rover-v2/complex-1"


def test_a_campaign_is_shown_without_simulating(tmp_path: Path) -> None:
    made = tiny_campaign(tmp_path)
    out, modules = look("campaign", "status", str(made.path))
    assert "4 pending" in out
    assert {"warp", "scipy", "duckdb", "conevo.runs.lab"} & modules == set()


def test_a_run_by_the_first_release_is_shown(runs: Path, tmp_path: Path) -> None:
    """It stored neither the world's header nor copies, and named files by absolute paths."""
    run = evolve_tiny(tmp_path / "run")
    file = run.path / "provenance.json"
    about = run.provenance
    for key in ("world", "code", "config_digest", "changed"):
        del about[key]
    for session in about["sessions"]:
        for key in set(session) - {"started", "from_generation", "threads"}:
            del session[key]
    file.write_text(json.dumps(about))
    assert look("show", str(run.path))[0].startswith("rover-v2/complex-1, CONE, preset smoke, ")
    config = run.path / "config.toml"
    text = config.read_text()
    config.write_text(text.replace("rover-v2/complex-1", "/gone/light.py:dark-1"))
    found = conevo.Run(run.path)
    assert found.outline.task == "light.py:dark-1"
    with pytest.raises(conevo.UsageError, match=r"cannot read the world file /gone/light\.py"):
        _ = found.config
    config.write_text(text.replace("iterations = 12", "iterations = 13"))
    with pytest.raises(conevo.UsageError, match="was changed after the run was started"):
        conevo.Run(run.path)


def test_showing_and_testing_leave_a_runs_directory_alone(runs: Path, say: Any) -> None:
    def state() -> dict[str, tuple[int, int]]:
        files = [runs, *runs.rglob("*")]
        return {str(p): (p.stat().st_mtime_ns, p.stat().st_size) for p in files}

    before, run = state(), str(runs / "finished")
    for command in (
        ["show", run],
        ["list", "runs", str(runs)],
        ["test", run, "--threads", "1"],
        ["replay", run, "--no-browser", "--threads", "1"],
        ["film", run, "--poster", "0", "--threads", "1"],
    ):
        assert say(*command).code == 0, command
    assert state() == before
