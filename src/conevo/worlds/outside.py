"""Worlds outside the package: one Python file each, with its registry entry as ``ENTRY``.

Such a world is named "FILE.py:ENVIRONMENT". Its text is known by a digest, which a run keeps, so
that it is never carried on with another text: what a kernel hash cannot see (parameters, how
scenarios are drawn) counts as well. The digest is looked at before anything in the file is run.
"""

from __future__ import annotations

import hashlib
import linecache
import re
import sys
import traceback
from dataclasses import is_dataclass, replace
from importlib.util import decode_source, module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Any

from conevo.errors import UsageError
from conevo.worlds.registry import WORLDS, WorldEntry

__all__ = ["load"]

CLASS_NAMES = ("name", "actions", "castes", "performance", "heuristics")


def load(path: Path, digest: str = "") -> WorldEntry:
    """Return the entry of the world in a file, with the file's path and digest.

    A file is run once in a process for each text that it has.

    Args:
        path: the file.
        digest: that its text must have; any if empty.

    Raises:
        UsageError: it cannot be read or run, holds no world, or has another digest.
    """
    try:
        text = path.read_bytes()
    except OSError as error:
        raise UsageError(f"cannot read the world file {path}: {error.strerror}") from error
    found = hashlib.blake2b(text, digest_size=6).hexdigest()
    if digest not in ("", found):
        raise UsageError(
            f"world file {path} has changed: its digest is {found}, not {digest}; bring back the "
            f"file as it was, or start another run"
        )
    name = f"conevo_world_{found}"
    module = sys.modules.get(name) or _run(name, path.resolve(), text)
    entry = getattr(module, "ENTRY", None)
    if problem := _problem(entry, module):
        raise UsageError(f"world file {path}: {problem}")
    assert isinstance(entry, WorldEntry)
    return replace(entry, module=name, file=str(path.resolve()), digest=found)


def _run(name: str, path: Path, text: bytes) -> ModuleType:
    """Return the module that a file makes; Warp looks for both module and text by their names."""
    spec = spec_from_loader(name, loader=None, origin=str(path))
    assert spec is not None
    module = module_from_spec(spec)
    module.__file__ = str(path)
    sys.modules[name] = module
    try:
        lines = decode_source(text).splitlines(keepends=True)
        linecache.cache[str(path)] = (len(text), None, lines, str(path))
        exec(compile(text, str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise UsageError(f"cannot run the world file {path}: {_line(error, path)}") from error
    return module


def _line(error: BaseException, path: Path) -> str:
    """Return an error in one line, with the line of the file that it comes from."""
    if isinstance(error, SyntaxError):
        words, number = f"SyntaxError: {error.msg}", error.lineno
    else:
        words = f"{type(error).__name__}: {error}"
        stack = traceback.extract_tb(error.__traceback__)
        number = next((one.lineno for one in reversed(stack) if one.filename == str(path)), None)
    place = f"line {number}: " if number else ""
    return place + " ".join(words.split())


def _problem(entry: Any, module: ModuleType) -> str:
    """Return what is wrong with an entry, nothing if it can be used."""
    if entry is None:
        return "it has no ENTRY, the WorldEntry of its world"
    if not isinstance(entry, WorldEntry):
        return f"its ENTRY must be a WorldEntry, not {type(entry).__name__}"
    if not re.fullmatch(r"[a-z0-9-]+-v\d+", str(entry.name)):
        return f"its name {entry.name!r} must be lower case and end with a version, as in light-v1"
    if entry.name in WORLDS:
        return f"its name {entry.name!r} is that of a world of the package"
    names: Any = entry.environments
    if not (isinstance(names, tuple) and names and all(_is_environment(one) for one in names)):
        return "its environments must be a tuple of names, as in ('dark-1',)"
    params: Any = getattr(module, str(entry.params_name), None)
    made: Any = getattr(module, str(entry.world_name), None)
    if not (is_dataclass(params) and "iterations" in params.__dataclass_fields__):
        return f"{entry.params_name} must be a dataclass with a field iterations"
    if not isinstance(made, type):
        return f"it has no class {entry.world_name}"
    missing = [name for name in CLASS_NAMES if not hasattr(made, name)]
    if missing:
        return f"{entry.world_name} has no {', no '.join(missing)}"
    if (name := getattr(made, "name", "")) != entry.name:
        return f"{entry.world_name} is named {name!r}, its entry {entry.name!r}"
    return ""


def _is_environment(name: object) -> bool:
    return isinstance(name, str) and bool(re.fullmatch(r"[\w.-]+", name))
