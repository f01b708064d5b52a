"""Methods outside the package: one Python file each, with its registry entry as ``ENTRY``.

Such a method is named "FILE.py:NAME"; ``conevo.outside`` says what such a file may do.
"""

from __future__ import annotations

import inspect
import re
from dataclasses import is_dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from conevo import outside
from conevo.errors import UsageError, unknown_name
from conevo.evolution.methods.entry import MethodEntry

if TYPE_CHECKING:
    pass

__all__ = ["FUNCTIONS", "load"]

FUNCTIONS = {"init": 2, "ask": 1, "tell": 3}  # name -> arguments


def load(path: Path, digest: str = "") -> MethodEntry:
    """Return the entry of the method in a file, with the files it is made of and their digest.

    Args:
        path: the file.
        digest: that they must have; any if empty.

    Raises:
        UsageError: a file cannot be read or run, holds no method, or they have another digest.
    """
    source = outside.load(path, "method", digest)
    entry = getattr(source.module, "ENTRY", None)
    if problem := _problem(entry, source.module):
        raise UsageError(f"method file {path}: {problem}")
    assert isinstance(entry, MethodEntry)
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
        return "it has no ENTRY, the MethodEntry of its method"
    if not isinstance(entry, MethodEntry):
        return f"its ENTRY must be a MethodEntry, not {type(entry).__name__}"
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", str(entry.name)):
        return f"its name {entry.name!r} must be lower case, digits and hyphens, as in team-es"
    for wanted in (entry.config_name, entry.method_name):
        if not isinstance(getattr(module, str(wanted), None), type):
            classes = outside.classes_of(module)
            return str(unknown_name("class", str(wanted), classes, "in its ENTRY"))
    if not is_dataclass(getattr(module, entry.config_name)):
        return f"{entry.config_name} must be a dataclass, of the method's parameters"
    made = getattr(module, entry.method_name)
    missing = [name for name in FUNCTIONS if not callable(getattr(made, name, None))]
    if missing:
        return f"{entry.method_name} has no {', no '.join(missing)}"
    for name, n in FUNCTIONS.items():
        if not _takes(getattr(made, name), [None] * (n + 1)):
            return f"{entry.method_name}.{name} must take {n} argument{'s' * (n > 1)}"
    if not _takes(made, [], config=None, name="", title=""):
        return f"{entry.method_name} must be made of config, name and title"
    return ""


def _takes(function: Any, values: list[Any], **named: Any) -> bool:
    """Whether a function can be called with these arguments."""
    try:
        inspect.signature(function).bind(*values, **named)
    except TypeError:
        return False
    return True
