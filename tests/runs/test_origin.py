"""A run that starts from the populations of another."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import conevo
from conevo.errors import UsageError
from conevo.runs.config import resolve
from conevo.runs.lab import Lab
from conevo.runs.start import start
from runs.tiny import TASK, content, evolve_tiny, tiny_settings


def descend(origin: conevo.Run, path: Path | None, seed: int = 1) -> conevo.Run:
    settings = tiny_settings("cone")
    config = resolve(TASK, "cone", "smoke", seed, overrides=settings)
    return start(config, path, threads=1, origin=origin)


def test_a_run_may_start_from_the_populations_of_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    origin = evolve_tiny(tmp_path / "origin")
    run = descend(origin, None)
    checkpoint = run.provenance["origin"]["checkpoint"]
    assert run.path.name == f"{origin.config.label}-from-{checkpoint[:6]}"
    shutil.rmtree(origin.path)  # it is no longer needed
    run.resume(threads=1)
    again = evolve_tiny(tmp_path / "again")
    assert run.config.run_id == again.config.run_id
    assert content(run.path)["generations"] != content(again.path)["generations"]


def test_the_same_settings_on_other_populations_are_another_run(tmp_path: Path) -> None:
    """Their files are foreign to each other, although the settings are the same."""
    runs = [
        descend(evolve_tiny(tmp_path / f"origin-{seed}", run__seed=seed), tmp_path / f"run-{seed}")
        for seed in (1, 2)
    ]
    assert runs[0].config.run_id == runs[1].config.run_id
    (last,) = runs[0].resume(threads=1).path.glob("checkpoint-?.npz")
    shutil.copy(last, runs[1].path)
    with pytest.raises(UsageError, match="is foreign: origin is"):
        runs[1].resume(threads=1)
    plain = start(runs[1].config, tmp_path / "plain", threads=1)
    shutil.copy(last, plain.path)
    with pytest.raises(UsageError, match="is foreign: origin is"):
        plain.resume(threads=1)


def test_an_unfinished_or_changed_origin_is_refused(tmp_path: Path) -> None:
    config = resolve(TASK, "cone", "smoke", overrides=tiny_settings("cone"))
    unfinished = start(config, tmp_path / "unfinished", threads=1)
    with pytest.raises(UsageError, match="is not finished, so no run can begin with"):
        descend(unfinished, tmp_path / "run")
    changed = evolve_tiny(tmp_path / "changed")
    (changed.path / "test.json").write_text("{}")
    with pytest.raises(UsageError, match=r"was changed since it was finished \(test\.json\)"):
        descend(changed, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_run_may_be_bred_from_the_champion_of_another(tmp_path: Path) -> None:
    origin = evolve_tiny(tmp_path / "origin", controller__max_hidden=2)
    run = conevo.evolve(
        "rover/complex-2",
        "mesp",
        "smoke",
        out=tmp_path / "run",
        overrides=tiny_settings("mesp", controller__max_hidden=2),
        threads=1,
        origin=origin.path,
        of_champion=True,
    )
    about, champion = run.provenance["origin"], origin.champion
    assert champion is not None
    assert about["of"] == "champion"
    assert about["generation"] == champion.generation
    with np.load(run.path / "origin.npz") as first:
        np.testing.assert_array_equal(first["field.genes"][:, :, 0], champion.genes)
    again = run.team_again(0, Lab.equip(run.config, 1, "cpu"))
    assert again.fitness.tolist() == run.team(0).fitness.tolist()  # type: ignore[union-attr]
    longer = conevo.Run(run.path).resume(generations=7, threads=1)
    assert longer.status == "finished"


@pytest.mark.parametrize("method", ["homcne", "hetcne", "ccga", "mesp", "cone"])
def test_clones_may_be_followed_by_any_method_with_its_own_spread(
    method: str, tmp_path: Path
) -> None:
    origin = evolve_tiny(tmp_path / "origin", "homcne")
    settings = tiny_settings(method, method__start_noise=0.02)
    config = resolve(TASK, method, "smoke", overrides=settings)
    for from_champion, made_from in ((False, origin), (False, None)):
        with pytest.raises(UsageError, match=r"start_noise = 0\.02 does nothing here: .*champion"):
            start(config, tmp_path / "run", threads=1, origin=made_from, of_champion=from_champion)
    assert not (tmp_path / "run").exists()
    run = start(config, tmp_path / "run", threads=1, origin=origin, of_champion=True)
    with np.load(run.path / "origin.npz") as first:
        genes = first["field.genes"]
    assert origin.champion is not None
    away = genes[0] - origin.champion.genes[0][:, None]
    used = away[origin.champion.active[0], 2:]  # hetcne starts with two robots' networks
    assert 0.01 < used.std() < 0.03
    again = conevo.Run(run.path)
    again.extend(generations=4, threads=1)  # before anything else
    assert again.resume(threads=1).status == "finished"


@pytest.mark.parametrize("of_champion", [True, False])
def test_controllers_of_other_sizes_are_refused(of_champion: bool, tmp_path: Path) -> None:
    origin = evolve_tiny(tmp_path / "origin")
    for task, changes, words in (
        ("gacc/complex-1", {}, "16 inputs became 27"),
        (TASK, {"controller__n_hidden": 3}, "23 genes of a part became 24"),
        (TASK, {"controller__max_hidden": 5}, "4 slots for parts became 5"),
    ):
        config = resolve(task, "cone", "smoke", overrides=tiny_settings("cone", task, **changes))
        with pytest.raises(UsageError, match=f"do not fit .*: .*{words}"):
            start(config, tmp_path / "run", threads=1, origin=origin, of_champion=of_champion)
    assert not (tmp_path / "run").exists()
