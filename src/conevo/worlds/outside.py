"""Worlds outside the package: one Python file each, with its registry entry as ``ENTRY``.

Such a world is named "FILE.py:ENVIRONMENT"; ``conevo.outside`` says what such a file may do.
"""

from __future__ import annotations

import re
from dataclasses import is_dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

from conevo import outside
from conevo.errors import UsageError, unknown_name
from conevo.outside import classes_of
from conevo.worlds.entry import WorldEntry

__all__ = ["load"]

CLASS_NAMES = ("name", "actions", "castes", "performance", "heuristics")


def load(path: Path, digest: str = "") -> WorldEntry:
    """Return the entry of the world in a file, with the files it is made of and their digest.

    Args:
        path: the file.
        digest: that they must have; any if empty.

    Raises:
        UsageError: a file cannot be read or run, holds no world, or they have another digest.
    """
    source = outside.load(path, "world", digest)
    entry = getattr(source.module, "ENTRY", None)
    if problem := _problem(entry, source.module):
        raise UsageError(f"world file {path}: {problem}")
    assert isinstance(entry, WorldEntry)
    return replace(
        entry,
        module=source.module.__name__,
        file=source.files[0],
        files=source.files,
        digest=source.digest,
    )


def _problem(entry: Any, module: ModuleType) -> str:
    """Return what is wrong with an entry, nothing if it can be used."""
    if entry is None:
        return "it has no ENTRY, the WorldEntry of its world"
    if not isinstance(entry, WorldEntry):
        return f"its ENTRY must be a WorldEntry, not {type(entry).__name__}"
    if not re.fullmatch(r"[a-z0-9-]+-v\d+", str(entry.name)):
        return f"its name {entry.name!r} must be lower case and end with a version, as in light-v1"
    names: Any = entry.environments
    if not (isinstance(names, tuple) and names and all(_is_environment(one) for one in names)):
        return "its environments must be a tuple of names, as in ('dark-1',)"
    for of_the_package in ("drawn", "product"):
        if getattr(entry, of_the_package):
            return f"its ENTRY has {of_the_package}, which only a world of the package has"
    for wanted in (entry.params_name, entry.world_name):
        if not isinstance(getattr(module, str(wanted), None), type):
            return str(unknown_name("class", str(wanted), classes_of(module), "in its ENTRY"))
    params: Any = getattr(module, entry.params_name)
    made: Any = getattr(module, entry.world_name)
    if not (is_dataclass(params) and "iterations" in params.__dataclass_fields__):
        return f"{entry.params_name} must be a dataclass with a field iterations"
    missing = [name for name in CLASS_NAMES if not hasattr(made, name)]
    if missing:
        return f"{entry.world_name} has no {', no '.join(missing)}"
    if (name := getattr(made, "name", "")) != entry.name:
        return f"{entry.world_name} is named {name!r}, its entry {entry.name!r}"
    return ""


def _is_environment(name: object) -> bool:
    return isinstance(name, str) and bool(re.fullmatch(r"[\w.-]+", name))
