"""A run continued beyond its end equals one planned with that length, bit for bit."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import Any

import pytest

import conevo
from conevo.errors import UsageError
from conevo.runs.config import resolve
from conevo.runs.shaping import start_shaping
from conevo.runs.start import start
from runs.crashes import Crash, crashes_and_refusals, fail_at
from runs.tiny import (
    PAIRS,
    TASK,
    command,
    content,
    evolve_tiny,
    is_past,
    spawn,
    tiny_settings,
    wait_for,
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The content of a run that was planned with nine generations."""
    return content(evolve_tiny(tmp_path_factory.mktemp("runs") / "whole", run__generations=9).path)


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of five generations, to be copied."""
    return evolve_tiny(tmp_path_factory.mktemp("runs") / "short").path


@pytest.fixture
def run(short: Path, tmp_path: Path) -> conevo.Run:
    """A finished run of five generations."""
    return conevo.Run(shutil.copytree(short, tmp_path / "run"))


@pytest.mark.parametrize(("method", "task"), PAIRS)
def test_a_continued_run_equals_one_planned_with_that_length(
    method: str, task: str, tmp_path: Path
) -> None:
    planned = evolve_tiny(tmp_path / "planned", method, task, run__generations=8)
    run = evolve_tiny(tmp_path / "run", method, task, run__generations=6)
    run = conevo.Run(run.path).resume(generations=8, threads=2)
    assert run.status == "finished"
    assert not run.changed_files
    assert content(run.path) == content(planned.path)
    for key in ("run_id", "changed", "config_digest", "stem_id"):
        assert run.provenance[key] == planned.provenance[key], key
    assert run.provenance["run_id"] == run.config.run_id


def test_both_ends_stay_in_the_provenance(run: conevo.Run, whole: dict[str, Any]) -> None:
    before, seal = run.provenance, json.loads((run.path / "DONE").read_text())["files"]
    run.resume(generations=7, threads=1)
    run.resume(generations=9, threads=1)
    assert content(run.path) == whole
    first, second = run.provenance["extended"]
    assert first["run_id"] == before["run_id"] != second["run_id"] != run.provenance["run_id"]
    assert (first["generations"], second["generations"]) == (5, 7)
    assert first["finished"] == before["finished"]
    assert first["stopped_by"] == second["stopped_by"] == "generations"
    assert first["files"] == {name: seal[name] for name in ("champion.npz", "test.json")}
    assert [session["from_generation"] for session in run.provenance["sessions"]] == [0, 5, 7]


def test_a_run_ended_by_its_budget_continues_with_a_larger_one(tmp_path: Path) -> None:
    cost = evolve_tiny(tmp_path / "one", run__generations=1).generations()[0]["team_evaluations"]
    small, large = int(2.5 * cost), int(6.5 * cost)
    planned = evolve_tiny(tmp_path / "planned", run__generations=50, run__budget_evaluations=large)
    run = evolve_tiny(tmp_path / "run", run__generations=50, run__budget_evaluations=small)
    assert run.provenance["stopped_by"] == "budget"
    with pytest.raises(UsageError, match=f"has spent its budget of {small} team evaluations"):
        run.resume(generations=60)
    run.resume(budget_evaluations=large, threads=1)
    assert content(run.path) == content(planned.path)


def test_a_run_ended_by_its_target_continues_without_it(
    run: conevo.Run, whole: dict[str, Any], tmp_path: Path
) -> None:
    ended = evolve_tiny(tmp_path / "ended", run__generations=9, run__target=-1.0)
    assert ended.provenance["stopped_by"] == "target"
    with pytest.raises(UsageError, match=r"has reached run\.target = -1\.0 in generation 0"):
        ended.resume(generations=10)
    ended.resume(target="none", threads=1)
    assert content(ended.path) == whole
    with pytest.raises(UsageError, match=r"reached run\.target = -1\.0 in generation 0 of 9"):
        ended.resume(target=-1.0, generations=10)


def test_a_run_that_is_not_finished_is_given_another_length(
    tmp_path: Path, whole: dict[str, Any]
) -> None:
    for planned in (30, 6):  # a shorter and a longer one
        settings = tiny_settings("cone", run__generations=planned)
        config = resolve(TASK, "cone", "smoke", overrides=settings)
        run = start(config, tmp_path / f"run-{planned}", threads=1)
        run.resume(time_limit=1e-6, threads=1)
        assert (run.status, len(run.generations())) == ("interrupted", 1)
        run = conevo.Run(run.path).resume(generations=9, threads=1)
        assert content(run.path) == whole
        assert run.provenance["extended"][0]["stopped_by"] is None


def test_less_than_the_finished_length_is_refused(run: conevo.Run) -> None:
    before = {p: p.read_bytes() for p in run.path.rglob("*") if p.is_file() and p.name != "lock"}
    for length, words in (
        ({"generations": 4}, r"has done 5 generations: run\.generations = 4 is fewer"),
        ({"generations": 5}, "has finished 5 generations .*--generations above 5"),
        ({"generations": 9, "budget_evaluations": 3}, r"has spent \d+ team evaluations: .* fewer"),
        ({"budget_evaluations": 10**9}, "has finished 5 generations"),
        ({"generations": 0}, r"run\.generations = 0 .*must be greater than or equal to 1"),
        ({"generations": 2.5}, r"run\.generations = 2\.5"),
    ):
        with pytest.raises(UsageError, match=words):
            run.resume(**length)
    after = {p: p.read_bytes() for p in run.path.rglob("*") if p.is_file() and p.name != "lock"}
    assert after == before


def test_a_changed_run_is_refused_before_it_is_unsealed(run: conevo.Run) -> None:
    path = run.path / "champion.npz"
    path.write_bytes(path.read_bytes()[:-1] + b"x")
    with pytest.raises(UsageError, match=r"was changed since it was finished \(champion\.npz\)"):
        run.resume(generations=9)
    assert run.status == "finished"
    assert not (run.path / "extension.json").exists()


@pytest.mark.parametrize("at_each", [False, pytest.param(True, marks=pytest.mark.exhaustive)])
@pytest.mark.parametrize("is_finished", [True, False])
def test_a_crash_in_an_extension_leaves_the_old_run_or_the_new_one(
    is_finished: bool,
    at_each: bool,
    run: conevo.Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At each kind of write, or at each write."""
    if not is_finished:
        (run.path / "DONE").unlink()
    old = content(run.path)
    path = shutil.copytree(run.path, tmp_path / "new")
    with monkeypatch.context() as patch:
        calls = fail_at(patch, -1, Crash())
        new = content(conevo.Run(path).resume(generations=6, threads=1).path)
    crashes = range(len(calls)) if at_each else [0, *crashes_and_refusals(calls)[0]]
    assert len(crashes) > 10
    endings = set()
    for call in crashes:
        path = shutil.copytree(run.path, tmp_path / "broken")
        with monkeypatch.context() as patch:
            fail_at(patch, call, Crash())
            with pytest.raises(Crash):
                conevo.Run(path).resume(generations=6, threads=1)
        broken = conevo.Run(path)
        if broken.status != "finished":
            broken.resume(threads=1)
        endings.add(content(path) == new)
        assert content(path) in (old, new), call
        if content(path) == old:
            conevo.Run(path).resume(generations=6, threads=1)
            assert content(path) == new
        assert not conevo.Run(path).changed_files
        assert not (path / "extension.json").exists()
        shutil.rmtree(path)
    assert endings == {True, False}


@pytest.mark.slow
def test_kill_9_during_an_extension(run: conevo.Run, tmp_path: Path) -> None:
    planned = evolve_tiny(tmp_path / "planned", run__generations=60)
    process = spawn("resume", str(run.path), "--generations", "60", "--quiet")
    wait_for(lambda: is_past(run.path, process, 25))
    time.sleep(0.01)
    process.kill()
    process.wait()
    killed = conevo.Run(run.path)
    assert (killed.status, killed.config.run.generations) == ("interrupted", 60)
    killed.resume(threads=1)
    assert content(run.path) == content(planned.path)


def test_stages_keep_their_length(tmp_path: Path) -> None:
    tasks = ["rover/complex-1", "rover/complex-2"]
    settings = tiny_settings("cone", run__generations=1)
    shaping = start_shaping(tasks, "cone", "smoke", out=tmp_path / "s", overrides=settings)
    shaping.resume(threads=1)
    with pytest.raises(UsageError, match=r"is a stage of .*--from"):
        shaping.stages[0].resume(generations=9)


def test_a_run_of_conevo_0_1_0_keeps_its_length(run: conevo.Run) -> None:
    file = run.path / "provenance.json"
    about = json.loads(file.read_text())
    del about["stem_id"]
    file.write_text(json.dumps(about))
    with pytest.raises(UsageError, match="whose runs cannot be extended"):
        run.resume(generations=9)


def test_a_command_line_stops_in_time_and_continues(tmp_path: Path, whole: dict[str, Any]) -> None:
    path = tmp_path / "run"
    process = spawn(*command(path, "cone", run__generations=9), "--time-limit", "0.001s")
    out, message = process.communicate(timeout=120)
    assert process.returncode == 0, message
    assert f"after 1 generation; continue with: conevo resume {path}" in out + message
    assert conevo.Run(path).status == "interrupted"
    conevo.Run(path).resume(threads=1)
    assert content(path) == whole
