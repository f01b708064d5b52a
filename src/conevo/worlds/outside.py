"""Worlds outside the package: one Python file each, with its registry entry as ``ENTRY``.

Such a world is named "FILE.py:ENVIRONMENT". It may import other files of its folder. The text of
all of them is known by a digest, which a run keeps, so that it is never carried on with another
text: what a kernel hash cannot see (parameters, how scenarios are drawn) counts as well. The digest
is looked at before anything in the files is run, so imports are found by reading, not by running.
"""

from __future__ import annotations

import ast
import builtins
import hashlib
import linecache
import re
import sys
import threading
import traceback
from collections.abc import Iterable, Mapping
from dataclasses import is_dataclass, replace
from importlib.util import decode_source, module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Any

from conevo.errors import EnvironmentFailure, UsageError, unknown_name
from conevo.reading import read_bytes
from conevo.worlds.registry import WORLDS, WorldEntry

__all__ = ["load", "line_of"]

MOST_BYTES = 2**20  # of a world's text
CLASS_NAMES = ("name", "actions", "castes", "performance", "heuristics")
OWN = "conevo_world_"  # begins the names of the modules that such files become
_loading = threading.RLock()


def load(path: Path, digest: str = "") -> WorldEntry:
    """Return the entry of the world in a file, with the files it is made of and their digest.

    The files are run once in a process for each text that they have.

    Args:
        path: the file.
        digest: that they must have; any if empty.

    Raises:
        UsageError: a file cannot be read or run, holds no world, or they have another digest.
    """
    texts = _texts(path)
    found = _digest(texts)
    if digest not in ("", found):
        others = ", ".join(file.name for file in list(texts)[1:])
        raise UsageError(
            f"world file {path} has changed{f', or what it imports ({others})' * bool(others)}: "
            f"its digest is {found}, not {digest}; bring back the file as it was, or start another "
            f"run"
        )
    with _loading:
        module = sys.modules.get(OWN + found) or _run(path, texts, found)
    entry = getattr(module, "ENTRY", None)
    if problem := _problem(entry, module):
        raise UsageError(f"world file {path}: {problem}")
    assert isinstance(entry, WorldEntry)
    files = tuple(map(str, texts))
    return replace(entry, module=OWN + found, file=files[0], files=files, digest=found)


def _texts(path: Path) -> dict[Path, bytes]:
    """Return the text of a file and of the files next to it that it imports, itself first."""
    texts: dict[Path, bytes] = {}
    rest = [path.resolve()]
    while rest:
        file = rest.pop()
        try:
            texts[file] = read_bytes(file, MOST_BYTES, f"the world file {file if texts else path}")
        except EnvironmentFailure as error:
            raise UsageError(str(error)) from error
        near = {file.parent / f"{name}.py" for name in _imported(texts[file])}
        rest += sorted((one for one in near if one.is_file() and one not in texts), reverse=True)
    return texts


def _imported(text: bytes) -> set[str]:
    """Return the modules that a text imports by a plain name, wherever in it; none of Python's."""
    try:
        nodes = list(ast.walk(ast.parse(text)))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return set()  # running it says what is wrong
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {n.module for n in nodes if isinstance(n, ast.ImportFrom) and n.module and not n.level}
    return names - sys.stdlib_module_names - {"conevo"}


def _digest(texts: Mapping[Path, bytes]) -> str:
    """Return twelve hex digits of the texts, and of the names that are imported."""
    first, *others = texts
    digest = hashlib.blake2b(texts[first], digest_size=6)
    for file in sorted(others):
        digest.update(b"\0" + file.name.encode() + b"\0" + texts[file])
    return digest.hexdigest()


def _run(path: Path, texts: Mapping[Path, bytes], digest: str) -> ModuleType:
    """Return the module that a world's file makes.

    Warp looks for both module and text by their names. Those of neighbours are the world's own, so
    that two worlds may each have a neighbour of the same name: their imports are looked up here.
    """
    first = next(iter(texts))
    names = {file.stem: OWN + digest + ("" if file == first else f"_{file.stem}") for file in texts}

    def find(name: str, *rest: Any, **more: Any) -> ModuleType:
        level = more.get("level", rest[3] if len(rest) > 3 else 0)
        if level or name not in names:
            return builtins.__import__(name, *rest, **more)
        return sys.modules.get(names[name]) or run(files[name])

    def run(file: Path) -> ModuleType:
        name = names[file.stem]
        spec = spec_from_loader(name, loader=None, origin=str(file))
        assert spec is not None
        module = module_from_spec(spec)
        module.__file__ = str(file)
        module.__dict__["__builtins__"] = vars(builtins) | {"__import__": find}
        sys.modules[name] = module
        try:
            lines = decode_source(texts[file]).splitlines(keepends=True)
            linecache.cache[str(file)] = (len(texts[file]), None, lines, str(file))
            exec(compile(texts[file], str(file), "exec"), module.__dict__)
        except BaseException:
            del sys.modules[name]
            raise
        return module

    files = {file.stem: file for file in texts}
    try:
        return run(first)
    except (Exception, SystemExit) as error:
        for name in names.values():
            sys.modules.pop(name, None)
        place = _place(error, texts)
        at = f"{place[0].name} " * (place[0] != first) + f"line {place[1]}: " if place else ""
        raise UsageError(f"cannot run the world file {path}: {at}{_words(error)}") from error


def _place(error: BaseException, files: Iterable[Path]) -> tuple[Path, int] | None:
    """Return the file and line that an error comes from, the innermost of some files."""
    wanted = {str(file): file for file in files}
    if isinstance(error, SyntaxError) and error.filename in wanted and error.lineno:
        return wanted[error.filename], error.lineno
    stack = traceback.extract_tb(error.__traceback__)
    found = ((wanted[s.filename], s.lineno) for s in reversed(stack) if s.filename in wanted)
    return next(((file, line) for file, line in found if line), None)


def _words(error: BaseException) -> str:
    """Return what an error is, in one line."""
    what = error.msg if isinstance(error, SyntaxError) else str(error)
    return " ".join(f"{type(error).__name__}: {what}".split())


def line_of(error: BaseException) -> str:
    """Return "FILE:LINE: in CALL: TYPE: MESSAGE" of an error in a world's file, "" of any other.

    CALL is what conevo called in the file, such as ``scenarios``; the line may be further within.
    """
    modules = [module for name, module in list(sys.modules.items()) if name.startswith(OWN)]
    files = [Path(str(module.__file__)) for module in modules]
    if (place := _place(error, files)) is None:
        return ""
    own = {str(file) for file in files}
    calls = [s.name for s in traceback.extract_tb(error.__traceback__) if s.filename in own]
    call = f"in {calls[0]}: " if calls and calls[0] != "<module>" else ""
    return f"{place[0]}:{place[1]}: {call}{_words(error)}"


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
    own = ((n, one) for n, one in vars(module).items() if isinstance(one, type))
    classes = [name for name, one in own if one.__module__.startswith(OWN)]
    for wanted in (entry.params_name, entry.world_name):
        if not isinstance(getattr(module, str(wanted), None), type):
            return str(unknown_name("class", str(wanted), classes, "in its ENTRY"))
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
