"""Methods outside the package: one Python file each, with its registry entry as ``ENTRY``.

Such a method is named "FILE.py:NAME"; ``conevo.outside`` describes the rules for such a file.
"""

from __future__ import annotations

import re
from dataclasses import is_dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from conevo.evolution.methods.entry import MethodEntry
from conevo.outside import entry_of, takes

__all__ = ["FUNCTIONS", "load"]

FUNCTIONS = {"init": 2, "ask": 1, "tell": 3}  # name -> arguments


def load(path: Path, digest: str = "") -> MethodEntry:
    """Return the entry of the method in a file; see ``conevo.outside.entry_of``."""
    return entry_of(path, "method", MethodEntry, ("config_name", "method_name"), _problem, digest)


def _problem(entry: MethodEntry, module: ModuleType) -> str:
    """Return the mistake in an entry, nothing if it can be used."""
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", str(entry.name)):
        return f"its name {entry.name!r} must be lower case, digits and hyphens, as in team-es"
    if not is_dataclass(getattr(module, entry.config_name)):
        return f"{entry.config_name} must be a dataclass, of the method's parameters"
    made = getattr(module, entry.method_name)
    controllers: Any = entry.controllers
    if not (isinstance(controllers, tuple) and all(isinstance(one, str) for one in controllers)):
        return f'its controllers {controllers!r} must be a tuple of names, as in ("srn",)'
    missing = [name for name in FUNCTIONS if not callable(getattr(made, name, None))]
    if missing:
        return f"{entry.method_name} has no {', no '.join(missing)}"
    for name, n in FUNCTIONS.items():
        if not takes(getattr(made, name), n + 1):
            return f"{entry.method_name}.{name} must take {n} argument{'s' * (n > 1)}"
    if not takes(made, 0, "config", "name", "title"):
        return f"{entry.method_name} must be made of config, name and title"
    return ""
