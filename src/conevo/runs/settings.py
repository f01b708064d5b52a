"""Every setting with its default, unit, bounds and meaning, read from where it is declared.

A setting is a field of a dataclass: ``RunSettings``, a world's parameters or a method's. Its bounds
are those of its annotation. Its unit and meaning are in the ``Attributes`` of the class' docstring,
"name (unit): meaning", or in those of the class it inherits the field from.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import textwrap
import types
from dataclasses import dataclass
from importlib import resources
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from conevo.runs.config import RunConfig, RunSettings

__all__ = ["Setting", "declared", "preset_purpose", "settings_of"]

BOUNDS = {"ge": ">=", "gt": ">", "le": "<=", "lt": "<"}
LARGEST = 2**63 - 1  # what a whole number can be in a configuration file
TYPES = {int: "whole number", float: "number", str: "text", bool: "true, false"}
ENTRY = re.compile(r"(\w+)(?: \(([^)]*)\))?: (.*)", re.DOTALL)


@dataclass(frozen=True)
class Setting:
    """One field of a dataclass of settings.

    Attributes:
        name: of the field.
        default: its value unless something sets another; None if it has none.
        unit: of the value, empty for a plain number, a name or a switch.
        allowed: the values that are accepted, in words.
        meaning: what it sets, empty if its class does not say.
    """

    name: str
    default: Any
    unit: str
    allowed: str
    meaning: str


def declared(part: type[Any]) -> list[Setting]:
    """Return the settings of a dataclass, in the order of its fields."""
    hints = get_type_hints(part, include_extras=True)
    texts = _attributes(part)
    found = []
    for field in dataclasses.fields(part):
        unit, meaning = texts.get(field.name, ("", ""))
        default = None if field.default is dataclasses.MISSING else field.default
        found.append(Setting(field.name, default, unit, _allowed(hints[field.name]), meaning))
    return found


def settings_of(config: RunConfig) -> list[tuple[str, Setting, Any]]:
    """Return (section, setting, value) of everything that decides a run, in the file's order."""
    parts = (
        ("run", RunSettings, config.run),
        ("world", type(config.world_params), config.world_params),
        ("method", type(config.method_config), config.method_config),
    )
    return [
        (section, setting, getattr(values, setting.name))
        for section, part, values in parts
        for setting in declared(part)
    ]


def preset_purpose(preset: str) -> str:
    """Return what a preset is for: the beginning of its file's first comment."""
    source = resources.files(__package__) / "presets" / f"{preset}.toml"
    comment = source.read_text(encoding="utf-8").split("\n\n")[0]
    words = " ".join(line.strip("# ") for line in comment.splitlines())
    return re.split(r"[.:](?: |$)", words)[0]


def _attributes(part: type[Any]) -> dict[str, tuple[str, str]]:
    """Return unit and meaning of every field that a class or one it inherits from describes."""
    found: dict[str, tuple[str, str]] = {}
    for one in reversed(part.__mro__):
        _, _, section = inspect.cleandoc(one.__doc__ or "").partition("Attributes:\n")
        section = re.split(r"\n(?=\S)", section)[0]
        for entry in re.split(r"\n(?=\S)", textwrap.dedent(section)):
            if match := ENTRY.fullmatch(" ".join(entry.split())):
                name, unit, meaning = match.groups()
                found[name] = (unit or "", meaning.removesuffix("."))
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
