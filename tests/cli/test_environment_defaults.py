"""An environment's own defaults apply wherever it is named, and anything else overrides them."""

from __future__ import annotations

import dataclasses
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

import conevo
from campaigns.plans import write_plan
from conevo.campaigns.plan_file import preset_names, read_plan, read_preset
from conevo.errors import UsageError
from conevo.report.claims.catalogue import CLAIMS
from conevo.runs.conditions import _changed
from conevo.runs.config import resolve
from conevo.runs.shaping import start_shaping, tasks_up_to
from conevo.worlds.registry import WORLDS
from conevo.worlds.rover.rocks import layout
from conevo.worlds.rover.sites import rock_sites
from conevo.worlds.rover.world import RoverParams
from runs.tiny import evolve_tiny, tiny_settings

LIGHT = Path(__file__).resolve().parents[2] / "examples" / "light.py"
APART = {
    "segregation": 1.0, "starts": "by_robot", "fitness": "value",
    "low_range": 0.10, "med_range": 0.08, "hi_range": 0.06,
    "low_accuracy": 0.1, "med_accuracy": 0.2, "hi_accuracy": 0.3,
}  # fmt: skip
DESK = 1250  # iterations of its table for this world


def light(folder: Path, defaults: str) -> Path:
    """Write the example world with a second environment, and defaults of environments."""
    text = LIGHT.read_text()
    old = 'environments=("dark-1",),'
    assert old in text
    path = folder / "light.py"
    path.write_text(text.replace(old, f'environments=("dark-1", "dark-2"), defaults={defaults},'))
    return path


@pytest.mark.parametrize("number", range(1, 11))
def test_python_and_runs_have_them_and_nothing_counts_as_changed(number: int) -> None:
    task = f"rover/apart-{number}"
    config = resolve(task)
    assert config.world_params == RoverParams(**APART, iterations=DESK)
    assert config.changed == ()
    assert config.tables()["world"].items() >= APART.items()
    assert conevo.world(task).params == RoverParams(**APART)
    assert conevo.world(task, segregation=0.5).params == RoverParams(**APART | {"segregation": 0.5})


@pytest.mark.parametrize("family", ["simple", "complex", "extended"])
def test_the_environments_of_the_thesis_have_those_of_the_class(family: str) -> None:
    for number in range(1, 11):
        config = resolve(f"rover/{family}-{number}")
        assert config.world_params == RoverParams(iterations=DESK, fitness="product")
        assert conevo.world(f"rover/{family}-{number}").params == RoverParams()
        assert config.changed == ()


def test_types_and_rovers_are_in_their_regions_of_the_same_canals() -> None:
    apart, mixed = (
        conevo.world(f"rover/{name}-5").scenarios([3, 4]) for name in ("apart", "complex")
    )
    assert apart.canal.tobytes() == mixed.canal.tobytes()
    places = rock_sites(layout("apart-5"))
    for e in range(2):
        rocks = dataclasses.replace(places, x=apart.rock_x[e], y=apart.rock_y[e])
        assert [len(rocks.of_region[k]) for k in range(4)] == [500] * 4
        for k in range(4):
            assert set(apart.rock_type[e][rocks.of_region[k]]) == {k}
            for robot in range(k, 20, 4):
                xy = [apart.start_x[e, robot], apart.start_y[e, robot]]
                assert places.region(np.array(xy, np.float32)) == k


def test_settings_and_files_override_them_and_only_these_count_as_changed(tmp_path: Path) -> None:
    config = resolve("rover/apart-5", overrides={"world.segregation": 0.0})
    assert config.world_params == RoverParams(**APART | {"segregation": 0.0}, iterations=DESK)
    assert config.changed == ("world.segregation",)
    file = tmp_path / "mine.toml"
    file.write_text(
        '[run]\nworld = "rover/apart-5"\n[world]\nstarts = "random"\nlow_range = 0.07\n'
    )
    config = resolve(file=file, overrides={"world.low_range": 0.1})
    assert config.world_params == RoverParams(**APART | {"starts": "random"}, iterations=DESK)
    assert config.changed == ("world.starts",)
    assert config.of_length({"generations": 7}).changed == ("run.generations", "world.starts")


def test_an_environment_s_own_defaults_win_over_a_preset_s(monkeypatch: pytest.MonkeyPatch) -> None:
    own = dataclasses.replace(WORLDS["rover-v2"], defaults={"apart-1": {"iterations": 77}})
    monkeypatch.setitem(WORLDS, "rover-v2", own)
    assert conevo.world("rover/apart-1").params.iterations == 77
    desk = resolve("rover/apart-1", preset="desk")
    assert (desk.world_params.iterations, desk.world_params.fitness) == (77, "product")
    assert desk.changed == ()


def test_a_resolved_configuration_is_restored_from_its_own_file(tmp_path: Path) -> None:
    config = resolve("rover/apart-2", overrides={"world.segregation": 0.5})
    (tmp_path / "config.toml").write_text(config.to_toml())
    again = resolve(file=tmp_path / "config.toml")
    assert (again, again.run_id, again.changed) == (config, config.run_id, config.changed)
    as_complex = resolve("rover/complex-2", overrides={f"world.{k}": v for k, v in APART.items()})
    assert as_complex.run_id != resolve("rover/apart-2").run_id


def test_a_run_is_written_and_played_with_them(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run", "homcne", "rover/apart-2")
    written = tomllib.loads((run.path / "config.toml").read_text())["world"]
    assert written.items() >= APART.items()
    names = [name for name in run.provenance["changed"] if name.startswith("world.")]
    assert names == ["world.n_robots", "world.iterations"]
    assert run.config.build_world().params == RoverParams(**APART, n_robots=3, iterations=12)


def test_a_champion_meets_the_settings_of_the_other_environment() -> None:
    here = resolve("rover/complex-5", overrides={"world.n_robots": 3, "world.low_range": 0.05})
    there = _changed(here, "rover/apart-5", {}, None)
    assert there.world_params == RoverParams(**APART, n_robots=3, iterations=DESK)
    back = _changed(there, "complex-4", {}, None)
    assert back.world_params == RoverParams(n_robots=3, iterations=DESK, fitness="product")
    half = resolve("rover/apart-5", overrides={"world.segregation": 0.5})
    params = RoverParams(**APART | {"segregation": 0.5}, iterations=DESK)
    assert _changed(half, "apart-6", {}, None).world_params == params
    assert _changed(half, None, {}, None).world_params == params
    params = RoverParams(**APART | {"segregation": 0.0}, iterations=DESK)
    assert _changed(half, "apart-6", {"world.segregation": 0.0}, None).world_params == params


def test_stages_have_them(tmp_path: Path) -> None:
    tasks = tasks_up_to("rover/apart-3")
    assert tasks == ["rover-v2/apart-1", "rover-v2/apart-2", "rover-v2/apart-3"]
    settings = tiny_settings("homcne", "rover/apart-3")
    shaping = start_shaping(tasks, "homcne", "smoke", 1, tmp_path / "s", settings, threads=1)
    params = RoverParams(**APART, n_robots=3, iterations=12)
    assert [stage.world_params for stage in shaping.configs] == [params] * 3


def test_plans_have_them_and_settings_of_a_plan_win(tmp_path: Path) -> None:
    path = write_plan(tmp_path, more='"world.segregation" = 0.0')
    text = path.read_text().replace('"rover/complex-1"', '"rover/apart-1..2", "rover/complex-1"')
    path.write_text(text)
    runs = {run.world: run.configs()[0].world_params for run in read_plan(path).write_out()}
    apart = RoverParams(**APART | {"segregation": 0.0}, iterations=40)
    assert runs == {
        "rover-v2/apart-1": apart,
        "rover-v2/apart-2": apart,
        "rover-v2/complex-1": RoverParams(iterations=40, fitness="product"),
    }


def test_neither_plans_of_the_thesis_nor_claims_are_about_them() -> None:
    plans = {name: read_preset(name) for name in preset_names()}
    about = {name for name, plan in plans.items() if "apart" in " ".join(plan.factors["world"])}
    assert about == {"specialists"}
    assert not plans["specialists"].produces  # nothing of the thesis
    about = {
        place
        for claim in CLAIMS
        for part in claim.parts
        for statement in part.statements
        for place in statement.environments
    }
    assert "complex-5" in about
    assert not [place for place in about if "apart" in place]


def test_the_commands_list_them(say) -> None:
    rows = {
        row["setting"].removeprefix("world."): (row["value"], row["default"])
        for row in json.loads(say("list", "settings", "rover/apart-5", "--json").out)
    }
    assert {key: rows[key] for key in APART} == {key: (v, v) for key, v in APART.items()}
    assert rows["energy"] == (1000.0, 1000.0)
    assert rows["iterations"] == (DESK, 2500)
    worlds = say("list", "worlds").out
    (line,) = [line for line in worlds.splitlines() if "segregation" in line]
    assert line.startswith("rover-v2, by default in apart-1..10: segregation=1.0, starts=by_robot")
    rover, pursuit, *_ = json.loads(say("list", "worlds", "--json").out)
    assert rover["defaults"] == {f"apart-{n}": APART for n in range(1, 11)}
    assert pursuit["defaults"] == {}
    dry = say("run", "rover/apart-5", "--set", "world.segregation=0", "--dry-run").out
    assert tomllib.loads(dry)["world"].items() >= (APART | {"segregation": 0.0}).items()


def test_a_world_in_a_file_may_have_them(tmp_path: Path) -> None:
    path = light(tmp_path, '{"dark-2": {"step": 0.02, "iterations": 50}}')
    assert resolve(f"{path}:dark-1").world_params.step == 0.01
    params = resolve(f"{path}:dark-2").world_params
    assert (params.step, params.iterations) == (0.02, 50)
    assert conevo.world(f"{path}:dark-2").params.step == 0.02
    assert conevo.world(f"{path}:dark-2", step=0.03).params.step == 0.03


@pytest.mark.parametrize(
    ("defaults", "words"),
    [
        ('{"dark-3": {"step": 0.02}}', "environment 'dark-3' in its defaults"),
        ('{"dark-2": {"stepp": 0.02}}', "did you mean 'world.step'"),
        ('{"dark-2": {"step": 2.0}}', "'dark-2': world.step = 2.0: must be"),
        ('{"dark-2": {"step": "far"}}', "'dark-2': world.step = "),
        ('{"dark-2": {1: 2}}', "world.1"),
        ('{"dark-2": 0.02}', "its defaults must be a dict of dicts"),
        ("{'dark-2'}", "its defaults must be a dict of dicts"),
        ("None", "its defaults must be a dict of dicts"),
    ],
)
def test_a_mistake_in_these_defaults_is_one_line(defaults: str, words: str, tmp_path: Path) -> None:
    path = light(tmp_path, defaults)
    for name in (resolve, conevo.world):
        with pytest.raises(UsageError) as caught:
            name(f"{path}:dark-1")
        text = str(caught.value)
        assert text.startswith(f"world file {path}: ")
        assert words in text
        assert "\n" not in text
