"""Methods outside the package: one Python file each, with its registry entry as ``ENTRY``.

Such a method is named "FILE.py:NAME"; ``conevo.outside`` says what such a file may do. An object of
its class can stand for it, with the parameters that it has.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from conevo import outside
from conevo.errors import UsageError, unknown_name
from conevo.evolution.methods.registry import METHODS, MethodEntry, remember_title

if TYPE_CHECKING:
    from conevo.evolution.protocol import Method

__all__ = ["as_settings", "load"]

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
    remember_title(entry.name, entry.title)
    return replace(
        entry,
        module=source.module.__name__,
        file=source.files[0],
        files=source.files,
        digest=source.digest,
    )


def as_settings(
    method: str | Method | None, more: Mapping[str, Any]
) -> tuple[str | None, Mapping[str, Any]]:
    """Return what ``resolve`` finds a method by, and its parameters with other settings.

    Args:
        method: an object with init, ask, tell and a config; a name or None is returned as it is.
        more: "run.generations" -> 5.

    Raises:
        UsageError: its class is not one of the package, and not in a file that can be copied; or a
            parameter is given twice.
    """
    if method is None or isinstance(method, str):
        return method, more
    entry = _entry_of(method)
    values = {field.name: getattr(method.config, field.name) for field in fields(method.config)}
    own = {f"method.{name}": value for name, value in values.items() if value is not None}
    if twice := sorted(key for key in more if {key, f"method.{key}"} & own.keys()):
        raise UsageError(f"{twice[0]} in overrides: the method that is given has it, too")
    return entry.address, {**own, **more}


def _entry_of(method: object) -> MethodEntry:
    """Return the entry of a method's class."""
    kind = type(method)
    for entry in METHODS.values():
        own = (kind.__module__, kind.__qualname__) == (entry.module, entry.method_name)
        if own and entry.name == getattr(method, "name", ""):
            return entry
    what = f"method {kind.__qualname__}"
    if not all(hasattr(kind, name) for name in FUNCTIONS):
        raise UsageError(f"{what} is neither a name nor a method, which has init, ask and tell")
    file = getattr(sys.modules.get(kind.__module__), "__file__", None)
    if kind.__module__ == "__main__" or not (file and file.endswith(".py")):
        raise UsageError(
            f"{what} is defined in {kind.__module__}, which a run cannot keep a copy of: put the "
            f"class into a file of its own, with its ENTRY, and import it from there"
        )
    entry = load(Path(file))
    if entry.method_name != kind.__qualname__:
        raise UsageError(f"method file {file}: its ENTRY is of {entry.method_name}, not of {what}")
    return entry


def _problem(entry: Any, module: ModuleType) -> str:
    """Return what is wrong with an entry, nothing if it can be used."""
    if entry is None:
        return "it has no ENTRY, the MethodEntry of its method"
    if not isinstance(entry, MethodEntry):
        return f"its ENTRY must be a MethodEntry, not {type(entry).__name__}"
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", str(entry.name)):
        return f"its name {entry.name!r} must be lower case, digits and hyphens, as in team-es"
    if entry.name in METHODS:
        return f"its name {entry.name!r} is that of a method of the package"
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
