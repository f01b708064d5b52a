"""A task learned in stages: each starts from the previous populations, and kills change nothing."""

from __future__ import annotations

import errno
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.errors import EnvironmentFailure, UsageError
from conevo.evolution.methods.registry import METHODS
from conevo.rng import fold
from conevo.runs.code import last_code
from conevo.runs.shaping import Shaping, start_shaping, tasks_up_to
from conevo.worlds.pursuit.evolved import TASKS as PREY_TASKS
from runs.crashes import Crash, assert_resumes, crashes_and_refusals, fail_at
from runs.tiny import TINY, arrays, content, evolve_tiny, killed_at, tiny_settings

TASKS = tasks_up_to("rover/complex-3")
BRIEF = {"run.generations": 3}


def begin(path: Path, method: str = "cone", tasks: list[str] = TASKS, **more: Any) -> Shaping:
    """Start a tiny shaping that uses every feature of a method."""
    settings = tiny_settings(method) | BRIEF | more
    return start_shaping(tasks, method, "smoke", out=path, overrides=settings, threads=1)


def stages_content(path: Path) -> dict[str, Any]:
    """Return all results of a shaping, without times."""
    found: dict[str, Any] = {"run_ids": [config.run_id for config in Shaping(path).configs]}
    lines = (path / "generations.jsonl").read_text().splitlines()
    found["generations"] = [json.loads(line) | {"seconds": 0} for line in lines]
    for stage in sorted(path.glob("stage-*")):
        found[stage.name] = content(stage)
        if (stage / "origin.npz").exists():
            found[f"{stage.name} origin"] = arrays(stage / "origin.npz")
    if (path / "prey.npz").exists():
        found["prey"] = (path / "prey.npz").read_bytes()
    return found


def genes(path: Path) -> np.ndarray:
    """Return the genotypes or the fittest team that a checkpoint hands on, or those it received."""
    with np.load(path) as archive:
        has_map = "field.start" in archive  # of MAP-Elites, which starts around a team of clones
        if has_map and not archive["field.progress.fittest_active"].any():
            return archive["field.start"][0].swapaxes(0, 1)
        if "field.genes" in archive and not has_map:
            return archive["field.genes"]
        if "field.cppns.graphs.genes" in archive:
            return archive["field.cppns.graphs.genes"]
        if archive["field.progress.fittest_active"].any():
            return archive["field.progress.fittest_genes"]
        if "field.graphs.genes" in archive:  # clones of the first genotype
            first, on = archive["field.graphs.genes"][0], archive["field.graphs.enabled"][0]
            first[:, : on.shape[1]] *= on
            return np.broadcast_to(first, archive["field.progress.fittest_genes"].shape)
        if "field.distribution.mean" in archive:  # of a clone
            found = np.zeros_like(archive["field.progress.fittest_genes"], dtype=np.float64)
            mean = archive["field.distribution.mean"]
            found[:, archive["field.active"][0]] = mean.reshape(-1, found.shape[2])
            return found
        return archive["field.mean"] + archive["field.deviations"]


@pytest.mark.parametrize("method", METHODS)
def test_every_stage_starts_from_the_populations_of_the_previous_one(
    method: str, tmp_path: Path
) -> None:
    shaping = begin(tmp_path / "shaped", method).resume(threads=1)
    assert shaping.status == "finished"
    assert [run.config.task for run in shaping.stages] == TASKS
    first, *others = shaping.stages
    assert not (first.path / "origin.npz").exists()
    assert "origin" not in first.provenance
    alone = evolve_tiny(tmp_path / "alone", method, run__generations=3)
    assert content(first.path) == content(alone.path)  # the first stage is an ordinary run
    for before, run in zip(shaping.stages, others, strict=False):
        (last,) = before.path.glob("checkpoint-?.npz")
        rounded = 2.0**-23 if method in ("cone-es", "openai-es", "cma-es") else 0  # float64
        begun = genes(run.path / "origin.npz")
        np.testing.assert_allclose(begun, genes(last), rtol=0, atol=rounded)
        origin = run.provenance["origin"]
        with np.load(last) as archive:
            checkpoint = json.loads(archive["about"].tobytes())["digest"]
        assert origin == {
            "path": str(before.path),
            "run_id": before.config.run_id,
            "code": last_code(before.provenance),
            "generation": 3,
            "checkpoint": checkpoint,
        }
        assert [record["generation"] for record in run.generations()] == [0, 1, 2]


def test_the_same_settings_give_the_same_stages(whole: dict[str, Any], tmp_path: Path) -> None:
    assert stages_content(begin(tmp_path / "again").resume(threads=2).path) == whole


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The content of a shaping that nothing interrupted."""
    path = tmp_path_factory.mktemp("shapings") / "whole"
    return stages_content(begin(path).resume(threads=1).path)


def test_generations_are_numbered_through_and_name_their_tasks(tmp_path: Path) -> None:
    shaping = begin(tmp_path / "shaped")
    assert shaping.generations() == []
    interrupt(shaping, stage=2)
    file = shaping.path / "generations.jsonl"
    assert len(file.read_text().splitlines()) == 3  # of the stage that is sealed
    assert len(shaping.generations()) == 5  # including the unfinished stage
    shaping.resume(threads=1)
    seen = shaping.generations()
    assert [json.loads(line) for line in file.read_text().splitlines()] == seen
    assert [(one["number"], one["stage"], one["task"], one["generation"]) for one in seen] == [
        (3 * k + g, k + 1, task, g) for k, task in enumerate(TASKS) for g in range(3)
    ]
    for stage, run in enumerate(shaping.stages):
        for own, one in zip(run.generations(), seen[3 * stage : 3 * stage + 3], strict=True):
            assert own.items() <= one.items()
    file.write_bytes(file.read_bytes()[:-2])
    assert shaping.changed_files == ["generations.jsonl"]


def test_the_last_team_is_tested_in_the_environment_of_every_stage(tmp_path: Path) -> None:
    shaping = begin(tmp_path / "shaped")
    with pytest.raises(UsageError, match="has no finished generation yet"):
        shaping.test()
    interrupt(shaping, stage=2)
    team = shaping.stages[1].champion
    assert team is not None
    tested = shaping.test(2, seed=7, threads=1)
    assert [(one["stage"], one["task"], one["team_of"]) for one in tested] == [
        (1, TASKS[0], 2), (2, TASKS[1], 2),
    ]  # fmt: skip
    assert {one["generation"] for one in tested} == {team.generation}
    shaping.resume(threads=1)
    *others, last = shaping.test(threads=1)
    assert {one["team_of"] for one in (*others, last)} == {3}
    own = shaping.stages[2].test_result
    assert own is not None
    assert own["champion"].items() <= last.items()
    world = conevo.world(TASKS[0], n_robots=3, iterations=12)
    champion = shaping.stages[2].champion
    assert champion is not None
    outcome = conevo.Rollout(world, shaping.stages[0].config.controller, 1).evaluate(
        *champion.as_trial(), world.scenarios([fold(1, "test", k) for k in range(3)])
    )
    values = others[0]["performance"]["value"]["values"]
    assert values == outcome.performance["value"][0].tolist()


FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
TWO = {"tasks": TASKS[:2], "run.generations": 2}


@pytest.mark.parametrize("problem", [Crash(), FULL])
def test_resume_after_a_failure_at_each_kind_of_write(
    problem: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls, whole = written(tmp_path, monkeypatch)
    crashes, refusals = crashes_and_refusals(calls)
    assert len(crashes) > len(refusals) >= 16
    for call in refusals if problem is FULL else crashes:
        assert_resumes(
            problem, call, carried_out, Shaping, stages_content, whole, tmp_path, monkeypatch
        )


@pytest.mark.exhaustive
@pytest.mark.parametrize("problem", [Crash(), FULL])
def test_resume_after_a_failure_at_every_write(
    problem: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls, whole = written(tmp_path, monkeypatch)
    assert len(calls) >= 50
    for call in range(len(calls)):
        assert_resumes(
            problem, call, carried_out, Shaping, stages_content, whole, tmp_path, monkeypatch
        )


def written(folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[list[str], dict[str, Any]]:
    """Return the writes of a whole shaping and its content."""
    with monkeypatch.context() as patch:
        calls = fail_at(patch, -1, Crash())
        return calls, stages_content(carried_out(folder / "whole").path)


def carried_out(path: Path) -> Shaping:
    return begin(path, **TWO).resume(threads=1)


def command(path: Path, settings: dict[str, Any]) -> list[str]:
    sets = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    return ["--preset", "smoke", "--out", str(path), *sets]


@pytest.mark.slow
def test_kills_between_and_within_the_stages_change_nothing(
    whole: dict[str, Any], tmp_path: Path
) -> None:
    path, settings = tmp_path / "killed", tiny_settings("cone") | BRIEF
    first = ["run", "rover/complex-3", "--shape", *command(path, settings)]
    killed_at(r"/\.killed\.\w+/killed/shaping\.toml", *first)
    assert not path.exists()
    killed_at(r"/\.stage-1\.\w+/stage-1/config\.toml", *first)
    assert Shaping(path).status == "interrupted"
    assert Shaping(path).stages == []
    for begun, pattern in (
        (1, r"stage-1/generations\.jsonl$"),  # in the first generation of all
        (1, r"stage-1/DONE"),
        (1, r"killed/generations\.jsonl"),  # between two stages
        (1, r"/\.stage-2\.\w+/stage-2/origin\.npz"),
        (2, r"killed/stage-2/provenance\.json"),
        (2, r"stage-2/teams/generation-0000"),  # before a stage's first generation ends
        (2, r"stage-2/checkpoint-b"),
        (2, r"stage-2/test\.json"),
        (2, r"/\.stage-3\.\w+/stage-3/generations"),
        (3, r"stage-3/checkpoint-a"),
        (3, r"killed/DONE"),  # with all stages finished
    ):
        killed_at(pattern, "resume", str(path))
        assert Shaping(path).status == "interrupted"
        assert len(Shaping(path).stages) == begun, pattern
    Shaping(path).resume(threads=2)
    assert stages_content(path) == whole
    assert list(path.glob(".*")) == []


@pytest.mark.slow
def test_kills_during_stages_of_construction_change_nothing(tmp_path: Path) -> None:
    """The environments differ in objects, obstacles and complex objects, not in teams."""
    tasks, path = tasks_up_to("gacc/complex-4"), tmp_path / "killed"
    settings = tiny_settings("cone", tasks[0]) | {"run.generations": 2, "world.iterations": 150}
    arguments = ["run", "gacc/complex-4", "--shape", *command(path, settings)]
    for begun, pattern in (
        (1, r"stage-1/checkpoint-b"),
        (1, r"/\.stage-2\.\w+/stage-2/config\.toml"),  # between two stages
        (3, r"stage-3/generations\.jsonl$"),
        (4, r"stage-4/test\.json"),
    ):
        killed_at(pattern, *arguments)
        assert len(Shaping(path).stages) == begun, pattern
        arguments = ["resume", str(path)]
    Shaping(path).resume(threads=2)
    whole = start_shaping(tasks, "cone", "smoke", out=tmp_path / "whole", overrides=settings)
    assert stages_content(path) == stages_content(whole.resume(threads=1).path)
    seen = Shaping(path).generations()
    assert [(one["number"], one["task"]) for one in seen] == [
        (number, tasks[number // 2]) for number in range(8)
    ]


def test_an_interrupted_stage_can_also_be_finished_by_itself(
    whole: dict[str, Any], tmp_path: Path
) -> None:
    shaping = begin(tmp_path / "shaped")
    interrupt(shaping, stage=2)
    run = conevo.Run(shaping.path / "stage-2")
    assert run.status == "interrupted"
    run.resume(threads=1)
    assert shaping.status == "interrupted"
    shaping.resume(threads=1)
    assert stages_content(shaping.path) == whole


def interrupt(shaping: Shaping, stage: int) -> None:
    """Continue a shaping up to the second generation of a stage."""

    def stop(run: conevo.Run, record: dict[str, Any]) -> None:
        if run.path.name == f"stage-{stage}" and record["generation"] == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        shaping.resume(threads=1, watch=stop)


def test_a_stage_without_checkpoints_starts_again_from_its_origin(
    whole: dict[str, Any], tmp_path: Path
) -> None:
    shaping = begin(tmp_path / "shaped")
    interrupt(shaping, stage=2)
    for file in (shaping.path / "stage-2").glob("checkpoint-?.npz"):
        file.unlink()
    shaping.resume(threads=1)
    assert stages_content(shaping.path) == whole


def test_a_lost_or_damaged_origin_is_not_silently_replaced(tmp_path: Path) -> None:
    shaping = begin(tmp_path / "shaped")
    interrupt(shaping, stage=2)
    stage = shaping.path / "stage-2"
    for file in stage.glob("checkpoint-?.npz"):
        file.unlink()
    whole = (stage / "origin.npz").read_bytes()
    (stage / "origin.npz").write_bytes(whole[:-50])
    with pytest.raises(UsageError, match=r"origin\.npz is damaged"):
        shaping.resume(threads=1)
    (stage / "origin.npz").unlink()
    with pytest.raises(UsageError, match=r"cannot read .*origin\.npz"):
        shaping.resume(threads=1)


def test_two_processes_do_not_work_in_one_shaping(tmp_path: Path) -> None:
    shaping = begin(tmp_path / "shaped")
    messages: list[str] = []

    def again(run: conevo.Run, record: dict[str, Any]) -> None:
        if messages:
            return
        for path, name in ((shaping.path, "shaping"), (run.path, "run")):
            done = subprocess.run(
                [sys.executable, "-m", "conevo", "resume", str(path)],
                capture_output=True,
                text=True,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
                check=False,
            )
            assert done.returncode == 2
            messages.append(done.stderr)
            with pytest.raises(UsageError, match=f"already holds a {name}, in use by process"):
                begin(path)
        assert shaping.status == "running"

    shaping.resume(threads=1, watch=again)
    assert len(messages) == 2
    for line in messages:
        assert re.fullmatch(rf"conevo: error: .* is in use by process {os.getpid()}; .*\n", line)


# --- wrong requests -----------------------------------------------------------------------------


# For both worlds.
SMALL = {"run.generations": 1, "controller.n_hidden": 2, "controller.max_hidden": 4}


@pytest.mark.parametrize(
    ("tasks", "settings", "words"),
    [
        ([], TINY, "at least one task"),
        ([*TASKS, "rover/complex-77"], TINY, "complex-77"),
        ([*TASKS, "prey/shaping-1"], SMALL, "cannot be handed on: .* genes per neuron became 10"),
        (TASKS, TINY | {"run.budget_evaluations": 3}, "does not pay for one generation"),
        (TASKS, TINY | {"run.generatoins": 3}, "did you mean 'run.generations'"),
    ],
)
def test_a_wrong_setting_of_any_stage_is_refused_before_anything_is_written(
    tasks: list[str], settings: dict[str, Any], words: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=words):
        start_shaping(tasks, "cone", "smoke", out=tmp_path / "shaped", overrides=settings)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_device_is_noticed_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(EnvironmentFailure, match="device 'cuda:77'"):
        start_shaping(TASKS, preset="smoke", out=tmp_path / "shaped", device="cuda:77")
    assert list(tmp_path.iterdir()) == []


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_an_edited_or_damaged_plan_is_refused(tmp_path: Path) -> None:
    file = begin(tmp_path / "shaped").path / "shaping.toml"
    whole = file.read_text()
    for old, new, words in (
        ("iterations = 12", "iterations = 13", "was changed after the shaping was started"),
        ("format = 1", "format = 9", "written by another version"),
        ("format = 1", "format = ", "is not valid TOML"),
        ("run_ids", "run_idz", "is damaged"),
        ("[[stages]]", "", "is not valid TOML"),
    ):
        edit(file, old, new)
        with pytest.raises(UsageError, match=words) as caught:
            Shaping(file.parent)
        assert "\n" not in str(caught.value)
        file.write_text(whole)
    assert Shaping(file.parent).tasks == TASKS


def test_an_exchanged_stage_is_refused(tmp_path: Path) -> None:
    shaping = begin(tmp_path / "shaped")
    evolve_tiny(shaping.path / "stage-1", run__seed=5)
    with pytest.raises(UsageError, match="is not stage 1 of"):
        shaping.resume(threads=1)


def test_a_finished_shaping_is_sealed(tmp_path: Path) -> None:
    shaping = begin(tmp_path / "shaped").resume(threads=1)
    before = {p: p.read_bytes() for p in shaping.path.rglob("*") if p.is_file()}
    with pytest.raises(UsageError, match="is finished"):
        shaping.resume()
    with pytest.raises(UsageError, match="already holds a shaping, finished"):
        begin(shaping.path)
    assert {p: p.read_bytes() for p in shaping.path.rglob("*") if p.is_file()} == before
    assert shaping.changed_files == []
    (shaping.path / "stage-2" / "champion.npz").write_bytes(b"")
    assert shaping.changed_files == ["stage-2/champion.npz"]


def test_other_folders_than_shapings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is not a shaping"):
        Shaping(evolve_tiny(tmp_path / "run").path)


def test_the_family_of_a_task() -> None:
    assert TASKS == ["rover-v2/complex-1", "rover-v2/complex-2", "rover-v2/complex-3"]
    assert tasks_up_to("prey/shaping-6") == list(PREY_TASKS)
    for task, words in (("rover/complex-1", "nothing to shape"), ("rover/complex-11", "unknown")):
        with pytest.raises(UsageError, match=words):
            tasks_up_to(task)
