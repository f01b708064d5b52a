"""The settings of a run, and every setting with its unit, bounds and meaning, as it is declared.

A setting is a field of a dataclass: of a run, a world, a controller or a method. Its bounds are
those of its annotation. Its unit and meaning are the text below the field: "(unit) meaning.", or
that below the field of the class from which it is inherited.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import itertools
import re
import textwrap
import types
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from annotated_types import Ge, Le

from conevo.controllers.registry import CONTROLLERS, DEFAULT, suggested
from conevo.errors import UsageError, shown
from conevo.parameters import parameters

if TYPE_CHECKING:
    from conevo.evolution.methods.registry import MethodEntry
    from conevo.runs.config import RunConfig

__all__ = [
    "RunSettings",
    "Setting",
    "controller_of",
    "declared",
    "preset_purpose",
    "refuse_contradiction",
    "refuse_other_controller",
    "settings_of",
]

BOUNDS = {"ge": ">=", "gt": ">", "le": "<=", "lt": "<"}
LARGEST = 2**63 - 1  # largest whole number in a configuration file
TYPES = {int: "whole number", float: "number", str: "text", bool: "true, false"}
TEXT = re.compile(r"(?:\(([^)]*)\) )?(.*?)\.?")  # below a field: "(unit) meaning."


@parameters("run")
class RunSettings:
    """How long and on how much evidence to evolve; belongs to no world and no method.

    Defaults are those of the multi-rover experiments (Nitschke 2009, table 5.5).
    """

    seed: Annotated[int, Ge(0), Le(2**63 - 1)] = 1
    """root of all randomness of the run."""
    generations: Annotated[int, Ge(1), Le(10_000_000)] = 250
    """the run ends after this many."""
    epochs: Annotated[int, Ge(1), Le(10_000)] = 10
    """simulated trials per team evaluation (q); all teams of a generation meet the same."""
    scenarios: Literal["fresh", "fixed"] = "fresh"
    """those of every generation: "fresh" ones, or those of generation 0 in all ("fixed"). Choice:
    fresh, so that nothing is learnt by heart; fixed ones let a population have a place of its
    own."""
    fittest_epochs: Annotated[int, Ge(1), Le(10_000)] = 10
    """simulated trials in which each generation's fittest team is evaluated once more. Choice: as
    many as the thesis' q, and the same in all generations, so that progress and the champion of a
    run are not a matter of lucky scenarios."""
    credit: Literal["robot", "team", "difference"] = "robot"
    """what a robot is credited with: "robot" gives each robot its own fitness as the world reports
    it (eq. 5.4, 6.8); "team" gives every robot the sum over the team (eq. 5.5); "difference" gives
    it that sum less the one in the same scenarios when its network is empty, which costs a further
    team evaluation for each robot."""
    budget_evaluations: Annotated[int, Ge(0), Le(2**63 - 1)] = 0
    """the run never spends more team evaluations than this; 0: no limit. Choice: those that a
    difference takes count, too."""
    target: float | None = None
    """the run ends when the fittest team's main task performance is as good as this: at least, or,
    for a measure where smaller is better, at most."""
    checkpoint_every: Annotated[int, Ge(1), Le(10_000_000)] = 1
    """generations between two checkpoints."""
    n_finalists: Annotated[int, Ge(1), Le(1000)] = 10
    """the fittest teams of the run, which are validated at its end. Choice: 10, as the thesis does
    not describe how a run's best team is found. 1 leaves the choice to the scenarios of the
    evolution phase."""
    n_validations: Annotated[int, Ge(1), Le(10_000)] = 20
    """scenarios in which finalists are validated. Choice: 20, as many as tests."""
    n_tests: Annotated[int, Ge(1), Le(10_000)] = 20
    """fresh scenarios of the testing phase (5.4: 20)."""

    def plays(self, n_robots: int) -> int:
        """Return the number of team evaluations that each team of ``n_robots`` takes."""
        return 1 + n_robots if self.credit == "difference" else 1


@dataclass(frozen=True)
class Setting:
    """One field of a dataclass of settings.

    Attributes:
        name: of the field.
        default: its value unless something sets another; None if it has none.
        unit: of the value, empty for a plain number, a name or a switch.
        allowed: the values that are accepted, in words.
        meaning: its effect, empty if its class has no text for it.
    """

    name: str
    default: Any
    unit: str
    allowed: str
    meaning: str


def refuse_contradiction(run: RunSettings, method: Any, n_robots: int) -> None:
    """Refuse settings of a run and its method if one makes the other meaningless.

    Args:
        run: the run's.
        method: the method's parameters.
        n_robots: robots in a team.

    Raises:
        UsageError: there are such.
    """
    if run.credit == "team" and getattr(method, "clone_credit", "mean") == "one":
        raise UsageError(
            'method.clone_credit = "one" does nothing with run.credit = "team", which credits all '
            'clones alike: use "mean", or run.credit = "robot" or "difference"'
        )
    if run.credit == "difference" and n_robots == 1:
        raise UsageError(
            'run.credit = "difference" compares a team with the rest of it, and a team of one '
            'robot has none: use "robot"'
        )


def controller_of(method: MethodEntry) -> str:
    """Return the name of the controller that a method breeds unless the settings choose another."""
    return method.controllers[0] if method.controllers else DEFAULT


def refuse_other_controller(method: MethodEntry, controller: str, place: str) -> None:
    """Raise UsageError if a method does not breed the genotypes of a controller.

    Args:
        method: of the run.
        controller: its name.
        place: where it was chosen, for the message.
    """
    if method.controllers and controller not in method.controllers:
        raise UsageError(
            f"controller.name = {shown(controller)} {place}: method {method.name!r} only works "
            f"with {' or '.join(method.controllers)}"
        )


def declared(part: type[Any]) -> list[Setting]:
    """Return the settings of a dataclass, in the order of its fields."""
    hints = get_type_hints(part, include_extras=True)
    texts = _meanings(part)  # type: ignore[arg-type]  # a class has a hash
    found = []
    for field in dataclasses.fields(part):
        unit, meaning = texts.get(field.name, ("", ""))
        default = None if field.default is dataclasses.MISSING else field.default
        found.append(Setting(field.name, default, unit, _allowed(hints[field.name]), meaning))
    return found


def settings_of(config: RunConfig) -> list[tuple[str, Setting, Any]]:
    """Return (section, setting, value) of everything that decides a run, in the file's order."""
    parts = {
        "run": config.run,
        "world": config.world_params,
        "controller": config.controller,
        "method": config.method_config,
    }
    found = {section: declared(type(part)) for section, part in parts.items()}
    own = suggested(config.controller.name, config.entry.world_class)
    of_environment = config.entry.defaults.get(config.environment, {})
    found["world"] = [
        replace(one, default=of_environment.get(one.name, one.default)) for one in found["world"]
    ]
    found["controller"] = [
        _kind_of_controller(config.method_entry),
        *(replace(one, default=own.get(one.name, one.default)) for one in found["controller"]),
    ]
    return [
        (section, setting, getattr(parts[section], setting.name))
        for section, settings in found.items()
        for setting in settings
    ]


def _kind_of_controller(method: MethodEntry) -> Setting:
    """Return the setting that chooses a controller."""
    allowed = ", ".join(method.controllers or CONTROLLERS)
    return Setting("name", controller_of(method), "", allowed, "kind of controller")


def preset_purpose(preset: str) -> str:
    """Return the purpose of a preset: the beginning of its file's first comment."""
    source = resources.files(__package__) / "presets" / f"{preset}.toml"
    comment = source.read_text(encoding="utf-8").split("\n\n")[0]
    words = " ".join(line.strip("# ") for line in comment.splitlines())
    return re.split(r"[.:](?: |$)", words)[0]


@cache
def _meanings(part: type[Any]) -> dict[str, tuple[str, str]]:
    """Return unit and meaning of every field that has a text below it, also of inherited ones."""
    found: dict[str, tuple[str, str]] = {}
    for one in reversed([one for one in part.__mro__ if dataclasses.is_dataclass(one)]):
        (declaration,) = ast.parse(textwrap.dedent(inspect.getsource(one))).body
        assert isinstance(declaration, ast.ClassDef)
        for field, text in itertools.pairwise(declaration.body):
            match field, text:
                case ast.AnnAssign(ast.Name(name)), ast.Expr(ast.Constant(str(meaning))):
                    if parts := TEXT.fullmatch(" ".join(meaning.split())):
                        found[name] = (parts[1] or "", parts[2])
    return found


def _allowed(hint: Any) -> str:
    """Return the values that a type annotation allows."""
    if get_origin(hint) is Literal:
        return ", ".join(map(str, get_args(hint)))
    if get_origin(hint) in (Union, types.UnionType):
        several = [_allowed(one) for one in get_args(hint) if one is not types.NoneType]
        return " or ".join([*several, "left out"])
    if get_origin(hint) is Annotated:
        kind, *bounds = get_args(hint)
        limits = [(f, getattr(b, f)) for b in bounds for f in BOUNDS if hasattr(b, f)]
        shown = [f"{BOUNDS[name]} {limit:,}" for name, limit in limits if limit < LARGEST]
        return ", ".join(shown) or _allowed(kind)
    return TYPES.get(hint, "")
