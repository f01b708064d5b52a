"""An object of a method's class in place of the method's name, with its parameters."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from conevo.errors import UsageError
from conevo.evolution.methods.entry import MethodEntry
from conevo.evolution.methods.outside import FUNCTIONS, load
from conevo.evolution.methods.registry import METHODS, remember_title

if TYPE_CHECKING:
    from conevo.evolution.protocol import Method

__all__ = ["as_settings"]


def as_settings(
    method: str | Method | None, more: Mapping[str, Any]
) -> tuple[str | None, Mapping[str, Any]]:
    """Return a method's address for ``resolve``, and its parameters together with other settings.

    Args:
        method: an object with the functions of a ``Method`` and a config; a name or None is
            returned as it is.
        more: other settings, "run.generations" -> 5.

    Raises:
        UsageError: its class is neither in the package nor in a file that can be copied, or a
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
            f"class into a separate file, with its ENTRY, and import it from there"
        )
    entry = load(Path(file))
    remember_title(entry.name, entry.title)
    if entry.method_name != kind.__qualname__:
        raise UsageError(f"method file {file}: its ENTRY is of {entry.method_name}, not of {what}")
    return entry
