"""A layer of a run's settings: a preset, a configuration file, or single settings.

Every value has its place, which errors name, and the folder of relative paths.

Presets (``presets/*.toml``) contain the tables of a configuration file for any world, with
``method`` split by method; a world's own table replaces that one. A variant ("cone-1") takes its
family's values ("cone") first, then its own::

    [any.run]
    [any.method.cone]
    [rover.world]
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from conevo.controllers.registry import refuse_foreign, suggested
from conevo.errors import UsageError, unknown_name
from conevo.parameters import WrongValue, refuse_unknown
from conevo.reading import parse_toml, read_toml
from conevo.worlds.families import is_task

if TYPE_CHECKING:
    from conevo.evolution.methods.registry import MethodEntry
    from conevo.worlds.registry import WorldEntry

__all__ = [
    "PRESETS",
    "Layer",
    "Value",
    "as_layer",
    "build",
    "overridden",
    "read_file",
    "read_preset",
    "section_of",
    "spelt_otherwise",
    "split_keys",
]

PRESETS = ("smoke", "desk", "night", "thesis")
SECTIONS = ("run", "world", "controller", "method")
ANY = "any"  # the table of a preset for worlds without one of their own


@dataclass(frozen=True)
class Value:
    """A value and the place it was read from; a file is named from ``folder``."""

    value: Any
    place: str
    folder: Path | None = None

    @property
    def as_file(self) -> Any:
        """The value if it is the name of a file, "prey.npz" or "FILE.py:ENVIRONMENT"."""
        text = self.value
        if self.folder is None or not isinstance(text, str) or is_task(text):
            return text
        name = text.rpartition(":")[0] if ".py:" in text else text
        is_file = Path(name).suffix or ("/" in name and (self.folder / name).is_file())
        return str(self.folder / text) if is_file else text


Layer = dict[str, dict[str, Value]]  # section -> key -> value


def read_file(path: Path) -> Layer:
    """Return the settings of a configuration file."""
    return as_layer(read_toml(path), f"in {path}", path.resolve().parent)


def as_layer(tables: Mapping[str, Any], place: str, folder: Path | None = None) -> Layer:
    """Return tables as a layer; paths in them are relative to ``folder``.

    Raises:
        UsageError: a table that is not a section, or a section that is not a table.
    """
    layer: Layer = {}
    for section, values in tables.items():
        if section not in SECTIONS:
            raise unknown_name("section", section, SECTIONS, place)
        if not isinstance(values, Mapping):
            raise UsageError(f"{section} {place} must be a table: [{section}]")
        layer[section] = {key: Value(value, place, folder) for key, value in values.items()}
    return layer


def overridden(settings: Mapping[str, Any], later: Mapping[str, Any]) -> dict[str, Any]:
    """Return single settings with ``later`` over them: "generations" is also "run.generations"."""
    return {k: v for k, v in settings.items() if not spelt_otherwise(k, later)} | dict(later)


def spelt_otherwise(key: str, settings: Mapping[str, Any]) -> str:
    """Return the key of the same setting with its section, or without; "" if there is none."""
    others = {key.partition(".")[2]} if "." in key else {f"{one}.{key}" for one in SECTIONS}
    return min(others & settings.keys(), default="")


def split_keys(
    given: Mapping[str, Any], place: str, folder: Path | None
) -> tuple[Layer, dict[str, Value]]:
    """Separate settings with a section from short ones."""
    dotted: Layer = {}
    short: dict[str, Value] = {}
    for key, value in given.items():
        section, dot, name = key.partition(".")
        if not dot:
            short[key] = Value(value, place, folder)
        elif section not in SECTIONS:
            raise unknown_name("section", section, SECTIONS, f"in {key!r} {place}")
        elif name in given:
            raise UsageError(f"{key} {place}: the same setting is given as {name}, too")
        else:
            dotted.setdefault(section, {})[name] = Value(value, place, folder)
    return dotted, short


def section_of(key: str, parts: Mapping[str, type], place: str) -> str:
    """Return the only section that has ``key``."""
    known = {name: [f.name for f in dataclasses.fields(part)] for name, part in parts.items()}
    homes = [name for name in known if key in known[name]]
    if len(homes) > 1:
        options = " or ".join(f"{home}.{key}" for home in homes)
        raise UsageError(f"key {key!r} {place} is ambiguous: write {options}")
    if not homes:
        refuse_foreign(parts["controller"], key, place)
        raise unknown_name("key", key, [key for keys in known.values() for key in keys], place)
    return homes[0]


@cache
def _worlds_of(preset: str) -> dict[str, Any]:
    """Return the tables of a preset, by world: not to be changed."""
    source = resources.files(__package__) / "presets" / f"{preset}.toml"
    return parse_toml(source.read_text(encoding="utf-8"), f"preset {preset!r}")


def read_preset(
    preset: str, world: WorldEntry, environment: str, method: MethodEntry, controller: str
) -> Layer:
    """Return a preset's settings for this world and method, with those of the world.

    An environment's own defaults define its task, so they take precedence over the preset's, which
    are about size. The world's settings of a controller are suggestions, without precedence. A
    preset has no settings for a method in a file.
    """
    if preset not in PRESETS:
        raise unknown_name("preset", preset, PRESETS)
    worlds = _worlds_of(preset)
    generic, own = dict(worlds[ANY]), dict(worlds.get(world.short_name, {}))
    by_method = generic.pop("method") | own.pop("method", {})
    name, family = method.name, method.family
    if not (method.file or {family, name} & set(by_method)):
        raise UsageError(f"preset {preset!r} has no settings for method {name!r} in {world.name!r}")
    sizes = {} if method.file else by_method.get(family, {}) | by_method.get(name, {})
    tables = generic | own | {"method": sizes}
    layer = as_layer(tables, f"in preset {preset!r}")
    brought = {
        "world": world.defaults.get(environment, {}),
        "controller": suggested(controller, world.world_class),
    }
    of_world = as_layer(brought, f"of world {world.name!r}")
    return layer | {
        "world": layer.get("world", {}) | of_world["world"],
        "controller": of_world["controller"] | layer.get("controller", {}),
    }


def build(section: str, parts: Mapping[str, Any], layers: Iterable[Layer]) -> Any:
    """Return the component's dataclass with the layers' values over its defaults."""
    part = parts[section]
    values: dict[str, Any] = {}
    places: dict[str, str] = {}
    for layer in layers:
        for key, given in layer.get(section, {}).items():
            also = [f"{one}.{key}" for one in parts if key in parts[one].__dataclass_fields__]
            if section == "controller":
                refuse_foreign(part, key, given.place)
            refuse_unknown(part, section, key, given.place, also)
            is_file = f"{key}_digest" in part.__dataclass_fields__
            values[key] = given.as_file if is_file else given.value
            places[key] = given.place
    try:
        return part(**values)
    except WrongValue as error:
        raise error.at(places[error.key]) if error.key in places else error from error
