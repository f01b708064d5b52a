"""Worlds outside the package: one Python file each, with its registry entry as ``ENTRY``.

Such a world is named "FILE.py:ENVIRONMENT"; ``conevo.outside`` describes the rules for such a file.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import is_dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from conevo.errors import UsageError, unknown_name
from conevo.outside import entry_of
from conevo.parameters import WrongValue, checked
from conevo.worlds.entry import WorldEntry

__all__ = ["load"]

CLASS_NAMES = ("name", "actions", "castes", "performance", "heuristics")


def load(path: Path, digest: str = "") -> WorldEntry:
    """Return the entry of the world in a file; see ``conevo.outside.entry_of``."""
    return entry_of(path, "world", WorldEntry, ("params_name", "world_name"), _problem, digest)


def _problem(entry: WorldEntry, module: ModuleType) -> str:
    """Return the mistake in an entry, nothing if it can be used."""
    if not re.fullmatch(r"[a-z0-9-]+-v\d+", str(entry.name)):
        return f"its name {entry.name!r} must be lower case and end with a version, as in light-v1"
    names: Any = entry.environments
    if not (isinstance(names, tuple) and names and all(_is_environment(one) for one in names)):
        return "its environments must be a tuple of names, as in ('dark-1',)"
    for of_the_package in ("drawn", "product"):
        if getattr(entry, of_the_package):
            return f"its ENTRY has {of_the_package}, which only a world of the package has"
    params: Any = getattr(module, entry.params_name)
    made: Any = getattr(module, entry.world_name)
    if not (is_dataclass(params) and "iterations" in params.__dataclass_fields__):
        return f"{entry.params_name} must be a dataclass with a field iterations"
    missing = [name for name in CLASS_NAMES if not hasattr(made, name)]
    if missing:
        return f"{entry.world_name} has no {', no '.join(missing)}"
    if (name := getattr(made, "name", "")) != entry.name:
        return f"{entry.world_name} is named {name!r}, its entry {entry.name!r}"
    return _wrong_defaults(entry, params)


def _wrong_defaults(entry: WorldEntry, params: Any) -> str:
    """Return the mistake in the defaults of an entry's environments, nothing if they are right."""
    own: Any = entry.defaults
    tables = [own, *own.values()] if isinstance(own, Mapping) else [own]
    if not all(isinstance(one, Mapping) for one in tables):
        return "its defaults must be a dict of dicts, as in {'dark-1': {'iterations': 500}}"
    for name, given in own.items():
        where = f"its defaults of environment {name!r}"
        if name not in entry.environments:
            return str(unknown_name("environment", name, entry.environments, "in its defaults"))
        try:
            checked(params, "world")(**{str(key): value for key, value in given.items()})
        except WrongValue as error:
            if error.key in ("", *given):
                return f"{where}: {error}"
        except UsageError as error:
            return f"{where}: {error}"
    return ""


def _is_environment(name: object) -> bool:
    return isinstance(name, str) and bool(re.fullmatch(r"[\w.-]+", name))
