"""Prey that learn in six stages, and the file that they leave for the pursuit world."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.errors import UsageError
from conevo.runs.shaping import Shaping, start_shaping
from conevo.worlds.pursuit import prey_sets
from conevo.worlds.pursuit.evolved import TASKS as PREY_TASKS
from runs.test_shaping import BRIEF, command, stages_content
from runs.tiny import TINY, killed_at

PREY = {key: value for key, value in TINY.items() if key != "world.n_robots"} | BRIEF


def shape_prey(path: Path) -> Shaping:
    shaping = start_shaping(
        PREY_TASKS, "cone", "smoke", out=path, overrides=PREY, threads=1, command="conevo test"
    )
    return shaping.resume(threads=1)


@pytest.fixture(scope="module")
def prey(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the shaping of prey."""
    return shape_prey(tmp_path_factory.mktemp("prey") / "prey").path


def test_the_six_prey_experiments_leave_a_prey_file(prey: Path, tmp_path: Path) -> None:
    shaping = Shaping(prey)
    assert shaping.product == shaping.path / "prey.npz"
    found = prey_sets.load(shaping.product)
    third, sixth = shaping.stages[2].champion, shaping.stages[5].champion
    assert third is not None
    assert sixth is not None
    np.testing.assert_array_equal(found.one, third.genes)
    np.testing.assert_array_equal(found.one_active, third.active)
    np.testing.assert_array_equal(found.two, sixth.genes)
    np.testing.assert_array_equal(found.two_active, sixth.active)
    assert found.about["command"] == "conevo test"
    assert (found.about["method"], found.about["preset"], found.about["seed"]) == (
        "cone", "smoke", 1,
    )  # fmt: skip
    assert found.about["run_ids"] == [run.config.run_id for run in shaping.stages]
    assert found.about["numpy"] == np.__version__
    again = shape_prey(tmp_path / "again")
    assert (again.path / "prey.npz").read_bytes() == shaping.product.read_bytes()
    world = conevo.world("pursuit/team-6", prey=str(shaping.product))
    assert world.params.prey_digest == prey_sets.load(shaping.product).digest  # type: ignore[attr-defined]
    with pytest.raises(
        UsageError, match=r"stage-1: a team of \(2, .* cannot play prey-v2/shaping-1"
    ):
        shaping.test(threads=1)


def test_a_kill_before_the_prey_file_is_written_changes_nothing(prey: Path, tmp_path: Path) -> None:
    path = tmp_path / "killed"
    killed_at(r"stage-6/DONE", "shape-prey", *command(path, PREY))
    shaping = Shaping(path)
    assert (shaping.status, shaping.product) == ("interrupted", None)
    shaping.resume(threads=1)
    assert shaping.product is not None
    one, two = (stages_content(p) for p in (path, prey))  # commands differ
    assert [one.pop("prey")[:2], two.pop("prey")[:2]] == [b"PK", b"PK"]
    assert one == two


@pytest.mark.parametrize(
    ("setting", "value"), [("bias", True), ("recurrent", True), ("weight_scale", 5.0)]
)
def test_prey_that_do_not_fit_a_prey_file_are_refused(
    setting: str, value: Any, tmp_path: Path
) -> None:
    settings = PREY | {f"controller.{setting}": value}
    with pytest.raises(UsageError, match=f"controller.{setting} = {value}: prey of the pursuit"):
        start_shaping(PREY_TASKS, "cone", "smoke", out=tmp_path / "prey", overrides=settings)
    assert not (tmp_path / "prey").exists()
