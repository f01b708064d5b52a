"""A parameter is declared once, and every entrance refuses a wrong value in the same words."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import pytest
import tomli_w
from annotated_types import Ge, Gt, Le

import conevo
from conevo.cli.main import main
from conevo.controllers.srn import Srn
from conevo.evolution.methods.cone import ConeConfig
from conevo.parameters import checked, parameters
from conevo.runs.settings import RunSettings
from conevo.worlds.gacc.world import GaccParams
from conevo.worlds.pursuit.world import PursuitParams
from conevo.worlds.registry import resolve
from conevo.worlds.rover.world import RoverParams

LIGHT = Path(__file__).resolve().parent.parent / "examples" / "light.py"
ROVER, OWN = "rover/complex-1", f"{LIGHT}:dark-1"
WRONG = [
    (ROVER, "world.n_robots", 100, "must be less than or equal to 64"),
    (ROVER, "world.n_robots", True, "must be a valid integer"),
    (ROVER, "world.low_range", 5.0, "must be less than or equal to 0.5"),
    (ROVER, "world.energy", -1, "must be greater than 0"),
    (ROVER, "world.energy", float("inf"), "must be a finite number"),
    (ROVER, "world.energy", "much", "must be a valid number"),
    (ROVER, "world.fitness", "eq_5", "must be 'cumulative', 'activation', 'product' or 'value'"),
    ("gacc/simple-1", "world.needs_detection", 1, "must be a valid boolean"),
    (OWN, "world.step", 0.5, "must be less than or equal to 0.1"),
    (ROVER, "method.sst", 1.5, "must be less than or equal to 1"),
    (ROVER, "method.evaluation", "some", "must be 'systematic' or 'shared'"),
    (ROVER, "controller.n_hidden", 17, "must be less than or equal to 16"),
    (ROVER, "controller.bias", "yes", "must be a valid boolean"),
    (ROVER, "run.generations", 0, "must be greater than or equal to 1"),
]


def of_python(world: str, section: str, key: str, value: Any) -> None:
    entrances: dict[str, Callable[..., Any]] = {
        "world": lambda **given: conevo.world(world, **given),
        "method": lambda **given: conevo.method("cone", **given),
        "controller": lambda **given: conevo.controller("srn", **given),
        "run": RunSettings,
    }
    entrances[section](**{key: value})


def of_class(world: str, section: str, key: str, value: Any) -> None:
    part = {"method": ConeConfig, "controller": Srn, "run": RunSettings}
    part["world"] = resolve(world)[0].params_class
    part[section](**{key: value})


def of_command_line(world: str, section: str, key: str, value: Any) -> None:
    text = value if isinstance(value, str) else tomli_w.dumps({"v": value}).strip()[4:]
    main(("run", world, "--set", f"{section}.{key}={text}", "--dry-run"))


def of_file(world: str, section: str, key: str, value: Any) -> None:
    Path("mine.toml").write_text(tomli_w.dumps({section: {key: value}}))
    main(("run", world, "--config", "mine.toml", "--dry-run"))


def of_plan(world: str, section: str, key: str, value: Any) -> None:
    factors = {"world": [world], "method": ["cone"], f"{section}.{key}": [value]}
    Path("plan.toml").write_text(tomli_w.dumps({"factors": factors}))
    main(("campaign", "start", "plan.toml", "--dry-run"))


ENTRANCES = (of_python, of_class, of_command_line, of_file, of_plan)


@pytest.fixture
def refusals(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[[str, str, Any], dict[str, str]]:
    """Return a function that returns the message of every entrance, without the value's origin."""
    monkeypatch.chdir(tmp_path)

    def ask(world: str, name: str, value: Any) -> dict[str, str]:
        section, _, key = name.partition(".")
        found = {}
        for entrance in ENTRANCES:
            with pytest.raises((conevo.UsageError, SystemExit)) as caught:
                entrance(world, section, key, value)
            message = str(caught.value)
            if isinstance(caught.value, SystemExit):
                assert caught.value.code == 2
                message = capsys.readouterr().err.removeprefix("conevo: error: ").removesuffix("\n")
            place = r" (on the command line|in [^:;(]*\.toml)(?=[:;])"
            found[entrance.__name__] = re.sub(place, "", message)
        assert [path for path in tmp_path.iterdir() if path.suffix not in (".toml", ".py")] == []
        return found

    return ask


@pytest.mark.parametrize(("world", "name", "value", "allowed"), WRONG)
def test_a_wrong_value_is_refused_in_the_same_words_at_every_entrance(
    world: str, name: str, value: Any, allowed: str, refusals: Callable[..., dict[str, str]]
) -> None:
    found = refusals(world, name, value)
    assert found == dict.fromkeys(found, f"{name} = {value!r}: {allowed}")


@pytest.mark.parametrize(
    ("world", "name", "near"),
    [
        (ROVER, "world.n_robot", "world.n_robots"),
        (OWN, "world.stepp", "world.step"),
        (ROVER, "method.genotype", "method.genotypes"),
        (ROVER, "controller.hidden", "controller.n_hidden"),
        (ROVER, "run.generation", "run.generations"),
    ],
)
def test_an_unknown_name_is_refused_in_the_same_words_at_every_entrance(
    world: str, name: str, near: str, refusals: Callable[..., dict[str, str]]
) -> None:
    found = set(refusals(world, name, 1).values())
    assert len(found) == 1
    assert found.pop().startswith(f"unknown key {name!r}; did you mean {near!r}? (known: ")


@pytest.mark.parametrize("part", [RoverParams, GaccParams, PursuitParams, ConeConfig, RunSettings])
def test_a_changed_copy_is_checked_as_well(part: Any) -> None:
    name = "generations" if part is RunSettings else "elite_portion"
    name = name if part in (ConeConfig, RunSettings) else "iterations"
    with pytest.raises(conevo.UsageError, match=rf"\.{name} = -1: must be greater"):
        dataclasses.replace(part(), **{name: -1})


def test_the_value_of_a_field_is_of_its_type() -> None:
    assert isinstance(RoverParams(energy=5).energy, float)
    assert RoverParams(energy=5) == RoverParams(energy=5.0)


@parameters("world")
class Bounded:
    low: Annotated[int, Ge(0)] = 1
    high: Annotated[int, Le(9)] = 5

    def __post_init__(self) -> None:
        if self.high < self.low:
            raise ValueError("low is above high")


@parameters("world")
class Inheriting(Bounded):
    given: Annotated[float, Gt(0)]
    low: Annotated[int, Ge(2)] = 2


@dataclasses.dataclass
class Plain:
    low: Annotated[int, Ge(0)] = 1
    high: Annotated[int, Le(9)] = 50


@pytest.mark.parametrize(
    ("part", "given", "words"),
    [
        (Bounded, {"low": -1}, "world.low = -1: must be greater than or equal to 0"),
        (Bounded, {"low": 6}, "[world]: low is above high"),
        (Inheriting, {}, "world.given: must be given, it has no default"),
        (Inheriting, {"given": 1, "low": 1}, "world.low = 1: must be greater than or equal to 2"),
        (checked(Plain, "world"), {"low": 0.5}, "world.low = 0.5: must be a valid integer"),
        (checked(Plain, "world"), {}, "world.high = 50: must be less than or equal to 9"),
    ],
)
def test_checks_of_inherited_plain_and_several_fields(part: Any, given: Any, words: str) -> None:
    with pytest.raises(conevo.UsageError) as caught:
        part(**given)
    assert str(caught.value) == words


def test_a_plain_dataclass_stays_unchanged() -> None:
    part = checked(Plain, "world")
    assert part is checked(Plain, "world")
    assert issubclass(part, Plain)
    made = part(high=3)
    made.low = 2  # it is not frozen
    assert (made.low, made.high, Plain(high=50).high) == (2, 3, 50)
    assert checked(Bounded, "world") is Bounded


@pytest.fixture
def plain(tmp_path: Path) -> str:
    """The example with parameters in a plain dataclass."""
    text, old = LIGHT.read_text(), '@parameters("world")'
    assert old in text
    (tmp_path / "plain.py").write_text(text.replace(old, "@dataclass(frozen=True)"))
    return f"{tmp_path / 'plain.py'}:dark-1"


def test_a_plain_dataclass_of_a_world_is_checked_at_every_entrance(
    plain: str, refusals: Callable[..., dict[str, str]]
) -> None:
    found = refusals(plain, "world.step", 0.5)
    assert found == dict.fromkeys(found, "world.step = 0.5: must be less than or equal to 0.1")


def test_parameters_of_a_plain_dataclass_are_checked_when_a_world_is_built(plain: str) -> None:
    entry, environment = resolve(plain)
    params = entry.params_class.__mro__[1]
    assert entry.build(environment, params(step=0.05)).params == entry.params_class(step=0.05)
    with pytest.raises(conevo.UsageError, match=r"world\.step = 0\.5: must be less than"):
        entry.build(environment, params(step=0.5))
