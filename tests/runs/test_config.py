"""Every layer overrides the previous one; every wrong word is named with its place."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path

import pytest

from conevo.errors import UsageError
from conevo.evolution.methods.registry import METHODS
from conevo.runs.assignments import parse_assignment
from conevo.runs.config import resolve
from conevo.runs.layers import PRESETS
from conevo.runs.settings import RunSettings
from conevo.worlds.registry import WORLDS

TASK = "rover/complex-1"
OURS = ("cone-es", "hom-es", "openai-es")


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("world", WORLDS)
def test_every_preset_resolves_for_every_world_and_method(
    preset: str, method: str, world: str
) -> None:
    config = resolve(f"{world}/{WORLDS[world].environments[0]}", method, preset)
    assert (config.world, config.method, config.preset) == (world, method, preset)


@pytest.mark.parametrize("preset", PRESETS)
def test_tables_of_a_preset_are_those_of_known_worlds_and_methods(preset: str) -> None:
    """A misspelt table would leave its world with the sizes for any world."""
    text = (resources.files("conevo.runs") / "presets" / f"{preset}.toml").read_text()
    tables = tomllib.loads(text)
    assert set(tables) <= {"any", *(entry.short_name for entry in WORLDS.values())}
    assert set(tables["any"]) == {"run", "method"}
    for table in tables.values():
        assert set(table) <= {"run", "world", "method"}
        assert set(table.get("method", {})) <= set(METHODS)


def test_a_worlds_own_table_replaces_that_of_any_world(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = {
        "any": {
            "run": {"generations": 3, "epochs": 4},
            "method": {"cone": {"genotypes": 8}, "mesp": {"genotypes": 9}},
        },
        "pursuit": {"run": {"generations": 5}, "method": {"cone": {"rounds": 6}}},
    }
    monkeypatch.setattr("conevo.runs.layers._worlds_of", lambda preset: tables)
    rover, pursuit = (resolve(task, "cone") for task in (TASK, "pursuit/team-3"))
    assert (rover.run.generations, rover.run.epochs) == (3, 4)
    assert (pursuit.run.generations, pursuit.run.epochs) == (5, RunSettings().epochs)
    assert (rover.method_config.genotypes, rover.method_config.rounds) == (8, 10)
    assert (pursuit.method_config.genotypes, pursuit.method_config.rounds) == (50, 6)
    assert resolve("pursuit/team-3", "mesp").method_config.genotypes == 9
    assert resolve("pursuit/team-3", "cone-1").method_config.rounds == 6
    with pytest.raises(UsageError, match="no settings for method 'ccga' in 'pursuit-v2'"):
        resolve("pursuit/team-3", "ccga")


def test_thesis_preset_has_the_sizes_of_the_thesis() -> None:
    sizes = {
        "homcne": 10_000, "hetcne": 10_000, "ccga": 500, "mesp": 50,
        "cone": 50, "cone-1": 50, "cone-2": 50, "cone-3": 50,
    }  # fmt: skip
    for name, size in sizes.items():
        assert resolve(TASK, name, "thesis").method_config.genotypes == size
    for world in WORLDS:  # ours, at the price of HomCNE
        task = f"{world}/{WORLDS[world].environments[0]}"
        teams = resolve(task, "homcne", "thesis").method_config.genotypes
        assert {2 * resolve(task, name, "thesis").method_config.pairs for name in OURS} == {teams}
        for name in ("neat", "hyperneat"):
            assert resolve(task, name, "thesis").method_config.genotypes == teams
        cma = resolve(task, "cma-es", "thesis").method_config
        assert cma.genotypes * cma.rounds == teams
    run = resolve(TASK, "cone", "thesis").run
    assert (run.generations, run.epochs) == (250, 10)


def test_presets_for_short_work_share_evaluations_and_those_for_long_do_not() -> None:
    found = {preset: resolve(TASK, "cone", preset).method_config.evaluation for preset in PRESETS}
    assert found == {
        "smoke": "shared", "desk": "shared", "night": "systematic", "thesis": "systematic",
    }  # fmt: skip


def test_layers_override_one_another_in_order(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[run]\nepochs = 3\ngenerations = 7\n[world]\nlow_range = 0.08\n")
    default = RunSettings()
    preset = resolve(TASK, preset="desk")
    with_file = resolve(TASK, preset="desk", file=file)
    with_set = resolve(TASK, preset="desk", file=file, overrides={"run.epochs": 4})
    assert (default.epochs, preset.run.epochs) == (10, 1)
    assert (with_file.run.epochs, with_file.run.generations) == (3, 7)
    assert with_file.world_params.low_range == 0.08
    assert (with_set.run.epochs, with_set.run.generations) == (4, 7)


def test_names_on_the_command_line_override_files(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(
        '[run]\nworld = "rover/simple-2"\nmethod = "mesp"\npreset = "smoke"\nseed = 9\n'
    )
    from_file = resolve(file=file)
    assert (from_file.task, from_file.method) == ("rover-v2/simple-2", "mesp")
    assert (from_file.preset, from_file.run.seed) == ("smoke", 9)
    mixed = resolve("rover/complex-4", "ccga", seed=2, file=file)
    assert (mixed.task, mixed.method, mixed.preset) == ("rover-v2/complex-4", "ccga", "smoke")
    assert mixed.run.seed == 2


def test_short_keys_are_understood_where_they_are_unique() -> None:
    config = resolve(TASK, overrides={"generations": 5, "low_range": 0.06, "genotypes": 8})
    assert config.run.generations == 5
    assert config.world_params.low_range == 0.06
    assert config.method_config.genotypes == 8


@pytest.mark.parametrize("method", METHODS)
def test_a_resolved_configuration_is_restored_from_its_own_file(
    method: str, tmp_path: Path
) -> None:
    config = resolve(TASK, method, "desk", seed=5, overrides={"run.target": 12.5})
    file = tmp_path / "config.toml"
    file.write_text(config.to_toml())
    assert resolve(file=file) == config
    assert resolve(file=file).run_id == config.run_id


def test_the_run_id_changes_with_every_setting_but_not_with_the_presets_name(
    tmp_path: Path,
) -> None:
    config = resolve(TASK, preset="desk")
    ids = {config.run_id}
    variations = [
        resolve("rover/complex-2", preset="desk"),
        resolve(TASK, "mesp", "desk"),
        resolve(TASK, preset="desk", seed=2),
        resolve(TASK, preset="desk", overrides={"run.epochs": 2}),
        resolve(TASK, preset="desk", overrides={"world.low_range": 0.071}),
        resolve(TASK, preset="desk", overrides={"method.mutation_scale": 0.2}),
    ]
    ids.update(other.run_id for other in variations)
    assert len(ids) == 1 + len(variations)
    file = tmp_path / "config.toml"
    file.write_text(config.to_toml().replace('preset = "desk"', 'preset = "night"'))
    assert resolve(file=file).run_id == config.run_id


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("run.generations=5", ("run.generations", 5)),
        ("world.low_range = 0.08", ("world.low_range", 0.08)),
        ("method.evaluation=shared", ("method.evaluation", "shared")),
        ("method.start_noise=.02", ("method.start_noise", 0.02)),
        ("x=-.5", ("x", -0.5)),
        ("x=.py", ("x", ".py")),
        ("x=true", ("x", True)),
        ("x=a=b", ("x", "a=b")),
    ],
)
def test_assignments_are_toml_or_text(text: str, expected: tuple[str, object]) -> None:
    assert parse_assignment(text) == expected


@pytest.mark.parametrize("text", ["generations", "=5"])
def test_assignment_without_key_or_value_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="expected key=value"):
        parse_assignment(text)


BAD = [
    ({"world": "rovr/complex-1"}, ["unknown world 'rovr'", "'rover'"]),
    ({"world": "rover/complx-1"}, ["unknown environment 'complx-1'", "'complex-1'"]),
    ({"world": "rover"}, ["rover/simple-1"]),
    ({"world": None}, ["which world"]),
    ({"method": "coen"}, ["unknown method 'coen'", "'cone'"]),
    ({"preset": "dek"}, ["unknown preset 'dek'", "'desk'"]),
    ({"seed": -1}, ["run.seed = -1", "greater than or equal to 0"]),
    ({"overrides": {"run.generatoins": 5}}, ["'run.generatoins'", "'run.generations'"]),
    ({"overrides": {"generatoins": 5}}, ["'generatoins'", "'generations'"]),
    ({"overrides": {"world.lowrange": 5}}, ["'world.lowrange'", "'world.low_range'"]),
    ({"overrides": {"method.round": 5}}, ["'method.round'", "'method.rounds'"]),
    ({"overrides": {"robot.x": 5}}, ["unknown section 'robot'"]),
    ({"overrides": {"run.generations": 0}}, ["run.generations = 0", "greater than or equal to 1"]),
    ({"overrides": {"run.generations": "many"}}, ["run.generations = 'many'", "valid integer"]),
    ({"overrides": {"run.generations": 2.5}}, ["run.generations = 2.5", "valid integer"]),
    ({"overrides": {"run.generations": True}}, ["run.generations = True", "valid integer"]),
    ({"overrides": {"run.credit": "me"}}, ["run.credit = 'me'", "'robot', 'team' or 'difference'"]),
    ({"overrides": {"run.target": float("nan")}}, ["run.target = nan", "must be a finite number"]),
    ({"overrides": {"world.energy": 1e308}}, ["world.energy = 1e+308", "1e-18 and 1e+18"]),
    ({"overrides": {"world.min_distance": 1e-320}}, ["world.min_distance", "1e-18 and 1e+18"]),
    ({"overrides": {"world.low_range": 3.0}}, ["world.low_range = 3.0", "must be less than"]),
    ({"overrides": {"world.low_accuracy": "x"}}, ["world.low_accuracy = 'x'", "valid number"]),
    ({"overrides": {"controller.max_hidden": 4}}, ["max_hidden", "n_hidden"]),
    ({"overrides": {"controller.nam": "gru"}}, ["'controller.nam'", "mean 'controller.name'?"]),
    ({"overrides": {"controller.name": "gru", "controller.recurrent": False}},
     ["controller.recurrent in overrides", "gru has no setting 'recurrent'", "of srn", "name"]),
    ({"overrides": {"controller.name": "gru", "recurrent": False}}, ["gru has no setting"]),
    ({"overrides": {"controller.name": "gri"}},
     ["controller.name in overrides: unknown controller 'gri'", "'gru'"]),
    ({"overrides": {"method.evaluation": "all"}}, ["method.evaluation", "'systematic'"]),
    ({"overrides": {"method.elite_portion": 0}}, ["method.elite_portion = 0", "greater than 0"]),
]  # fmt: skip


@pytest.mark.parametrize(("given", "words"), BAD, ids=[str(given) for given, _ in BAD])
def test_bad_input_is_one_line_that_names_what_and_what_is_allowed(
    given: dict[str, object], words: list[str]
) -> None:
    arguments = {"world": TASK} | given
    with pytest.raises(UsageError) as caught:
        resolve(**arguments)  # type: ignore[arg-type]
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[run]\nepochs = 0\n", ["run.epochs = 0", "mine.toml"]),
        ("[run]\nepoch = 1\n", ["'run.epoch'", "'run.epochs'", "mine.toml"]),
        ("[rn]\nepochs = 1\n", ["unknown section 'rn'", "'run'", "mine.toml"]),
        ("run = 5\n", ["must be a table", "mine.toml"]),
        ("[run\n", ["not valid TOML", "mine.toml"]),
        ("[run]\nmethod = 'coen'\n", ["run.method in ", "mine.toml: unknown method 'coen'"]),
        ("[run]\npreset = 'dek'\n", ["run.preset in ", "mine.toml: unknown preset 'dek'"]),
        ("[controller]\nname = 'gri'\n", ["controller.name in ", "mine.toml: unknown"]),
        ("[run]\nmethod = 3\n", ["run.method = 3", "mine.toml"]),
    ],
)
def test_bad_file_is_named(text: str, words: list[str], tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(UsageError) as caught:
        resolve(TASK, file=file)
    for word in words:
        assert word in str(caught.value)


def test_a_missing_file_is_a_wrong_request(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"none\.toml: No such file"):
        resolve(TASK, file=tmp_path / "none.toml")


def test_a_configuration_file_contains_every_field() -> None:
    config = resolve(TASK, "cone", "desk")
    tables = tomllib.loads(config.to_toml())
    assert set(tables["method"]) == set(type(config.method_config).__dataclass_fields__)
    assert set(tables["world"]) == set(type(config.world_params).__dataclass_fields__)


def test_overrides_that_are_not_a_dict_are_refused() -> None:
    with pytest.raises(UsageError, match=r"overrides = \[1\]: must be a dict of settings"):
        resolve("rover/complex-1", overrides=[1])  # type: ignore[arg-type]
