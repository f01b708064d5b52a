"""A run has copies of its files: moved, without the originals or with others, it is the same."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

import conevo
from conevo.errors import UsageError
from conevo.runs.config import resolve
from conevo.runs.shaping import Shaping, start_shaping
from conevo.runs.start import start
from conevo.worlds.pursuit import prey_sets
from runs.tiny import content, evolve_tiny

LIGHT = Path(__file__).parents[2] / "examples" / "light.py"
SHIPPED = Path(prey_sets.__file__).parent / prey_sets.SHIPPED
TINY: dict[str, Any] = {
    "run.generations": 2,
    "run.epochs": 1,
    "run.n_tests": 2,
    "world.iterations": 12,
    "method.genotypes": 4,
}


@pytest.fixture
def light(tmp_path: Path) -> Path:
    """A world in its own file, which imports another file."""
    folder = tmp_path / "worlds"
    folder.mkdir()
    text = LIGHT.read_text().replace("ENTRY = ", "import colours\n\nENTRY = ")
    (folder / "light.py").write_text(text)
    (folder / "colours.py").write_text("RED = 1\n")
    return folder / "light.py"


def light_run(path: Path, file: Path) -> conevo.Run:
    return conevo.evolve(f"{file}:dark-1", "cone", "smoke", out=path, overrides=TINY, threads=1)


def test_a_run_in_an_own_world_needs_nothing_outside_its_directory(
    tmp_path: Path, light: Path
) -> None:
    run = light_run(tmp_path / "run", light)
    assert {p.name for p in (run.path / "inputs").iterdir()} == {"light.py", "colours.py"}
    assert 'world = "inputs/light.py:dark-1"' in (run.path / "config.toml").read_text()
    made, team = content(run.path), run.champion
    light.write_text("raise SystemExit")  # edited, then removed
    moved = run.path.rename(tmp_path / "elsewhere")
    shutil.rmtree(light.parent)
    found = conevo.Run(moved)
    assert found.config.address == f"{moved}/inputs/light.py:dark-1"
    assert found.config.run_id == found.provenance["run_id"]
    assert found.test(threads=1) == found.test_result["champion"]
    assert (found.changed_files, found.champion.genes.tolist()) == ([], team.genes.tolist())
    again = conevo.evolve(config=moved / "config.toml", out=tmp_path / "again", threads=1)
    assert content(again.path) == made


def test_a_moved_run_is_continued_with_its_own_prey(tmp_path: Path) -> None:
    file = tmp_path / "p" / "prey.npz"
    file.parent.mkdir()
    shutil.copy(SHIPPED, file)
    settings = TINY | {"world.prey": str(file)}
    whole = evolve_tiny(tmp_path / "whole", task="pursuit/team-3", world__prey=str(file))
    config = resolve("pursuit/team-3", "cone", "smoke", overrides=settings)
    run = start(config, tmp_path / "run", threads=1)
    file.unlink()
    moved = run.path.rename(tmp_path / "moved")
    assert conevo.Run(moved).resume(threads=1).status == "finished"
    assert conevo.Run(moved).config.run_id == config.run_id
    assert whole.test(threads=1) == whole.test_result["champion"]


def test_a_file_is_named_from_the_folder_of_the_configuration(
    tmp_path: Path, light: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(SHIPPED, tmp_path / "worlds" / "own.npz")
    (tmp_path / "worlds" / "light.toml").write_text('[run]\nworld = "light.py:dark-1"\n')
    (tmp_path / "worlds" / "prey.toml").write_text(
        '[run]\nworld = "pursuit/team-1"\n[world]\nprey = "own.npz"\n'
    )
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shaped").touch()  # prey = "shaped" is none of the files here
    assert resolve(file="worlds/light.toml").entry.file == str(light)
    assert resolve(file="worlds/prey.toml").world_params.prey == str(light.parent / "own.npz")
    assert resolve("pursuit/team-1").world_params.prey == "shaped"
    light.unlink()
    with pytest.raises(UsageError, match=f"cannot read the world file {light}"):
        resolve(file="worlds/light.toml")


def test_a_copy_that_was_edited_is_refused(tmp_path: Path, light: Path) -> None:
    run = light_run(tmp_path / "run", light)
    copy = run.path / "inputs" / "light.py"
    copy.write_text(copy.read_text() + "\n")
    assert run.changed_files == ["inputs/light.py"]
    with pytest.raises(UsageError, match=f"world file {copy} has changed"):
        conevo.Run(run.path).test(threads=1)


def test_two_files_of_one_name_are_refused_and_nothing_is_written(
    tmp_path: Path, light: Path
) -> None:
    prey = tmp_path / "light.py"
    shutil.copy(SHIPPED, prey)
    text = light.read_text().replace(
        "n_robots: Anno", 'prey: str = ""\n    prey_digest: str = ""\n    n_robots: Anno'
    )
    light.write_text(text)
    settings = TINY | {"world.prey": str(prey), "world.prey_digest": "0"}
    config = resolve(f"{light}:dark-1", "cone", "smoke", overrides=settings)
    with pytest.raises(UsageError, match=r"another input is named light\.py"):
        start(config, tmp_path / "run", threads=1)
    assert not list(tmp_path.glob("*run*"))


def test_a_shaping_contains_the_files_of_its_stages(tmp_path: Path, light: Path) -> None:
    text = light.read_text().replace('("dark-1",)', '("dark-1", "dark-2")')
    light.write_text(text)
    tasks = [f"{light}:dark-1", f"{light}:dark-2"]
    made = start_shaping(tasks, "cone", "smoke", 1, tmp_path / "shaping", TINY, threads=1)
    shutil.rmtree(light.parent)
    moved = Shaping(made.path.rename(tmp_path / "moved"))
    moved.resume(threads=1)
    assert [run.status for run in Shaping(moved.path).stages] == ["finished", "finished"]
    assert (moved.path / "stage-2" / "inputs" / "colours.py").is_file()


def test_a_preset_without_any_effect_is_refused(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run")
    file = run.path / "config.toml"
    refused = r"'thesis' would change only the run's label.*already set in .*config\.toml"
    with pytest.raises(UsageError, match=refused):
        resolve(file=file, preset="thesis")
    with pytest.raises(UsageError, match=refused):
        resolve(file=file, overrides={"run.preset": "thesis"})
    assert resolve(file=file, preset="smoke") == run.config
    part = tmp_path / "part.toml"
    part.write_text('[run]\nworld = "rover/complex-1"\npreset = "smoke"\ngenerations = 7\n')
    found = resolve(file=part, preset="thesis")
    assert (found.preset, found.run.generations, found.run.epochs) == ("thesis", 7, 10)


def test_settings_that_are_not_the_presets_are_named(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run")
    assert run.provenance["changed"] == list(run.config.changed)
    assert {"run.epochs", "world.n_robots", "method.gst"} <= set(run.config.changed)
    assert resolve("rover/complex-1", "cone", "smoke", 5).changed == ()
    text = (run.path / "config.toml").read_text().replace('preset = "smoke"', 'preset = "thesis"')
    edited = tmp_path / "edited.toml"
    edited.write_text(text)
    assert set(resolve(file=edited).changed) > set(run.config.changed)
