"""Python files outside the package, such as worlds: run once, and identified by their texts.

Such a file may import other files of its folder. A digest identifies the texts of all of them. A
run keeps it, so that it is never resumed with other texts. The digest also covers everything that a
kernel hash does not (parameters, how scenarios are drawn, how genotypes are bred). It is checked
before anything in the files is run, so imports are found by reading, not by running.
"""

from __future__ import annotations

import ast
import builtins
import hashlib
import inspect
import linecache
import sys
import threading
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from importlib.util import decode_source, module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, TypeVar, cast

from conevo.errors import UsageError, unknown_name
from conevo.reading import read_bytes, refuse_wide

__all__ = ["entry_of", "files_of", "is_outside", "line_of", "source_of", "takes"]

MOST_BYTES = 2**20  # of a text
OWN = {  # prefixes of their modules' names
    "world": "conevo_world_",
    "method": "conevo_method_",
    "labels": "conevo_labels_",
    "others": "conevo_others_",
}
Sort = Literal["world", "method", "labels", "others"]
_loading = threading.RLock()

Entry = TypeVar("Entry")


@dataclass(frozen=True)
class Source:
    """A file that has been run.

    Attributes:
        module: made from the file.
        files: paths of the file and of those next to it that it imports, itself first.
        digest: of their texts.
    """

    module: ModuleType
    files: tuple[str, ...]
    digest: str


def source_of(path: Path, kind: Sort, digest: str = "") -> Source:
    """Return a file, run once in a process for each version of its and its neighbours' texts.

    Args:
        path: the file.
        kind: of its contents.
        digest: that the texts must have; any if empty.

    Raises:
        UsageError: a file is missing, damaged or cannot be run, or they have another digest.
        EnvironmentFailure: one cannot be read.
    """
    with _loading:  # Python 3.11 parses in one thread at a time: python/cpython issue 106905
        texts = _texts(path, kind)
    found = _digest(texts)
    if digest not in ("", found):
        others = ", ".join(file.name for file in list(texts)[1:])
        raise UsageError(
            f"{kind} file {path} has changed{f', or its imports have ({others})' * bool(others)}: "
            f"its digest is {found}, not {digest}; bring back the file as it was, or start another "
            f"run"
        )
    own = OWN[kind] + found
    with _loading:
        module = sys.modules.get(own) or _run(path, texts, kind, own)
    return Source(module, tuple(map(str, texts)), found)


def entry_of(
    path: Path,
    kind: Sort,
    entry_class: type[Entry],
    classes: tuple[str, str],
    problem: Callable[[Entry, ModuleType], str],
    digest: str = "",
) -> Entry:
    """Return the entry of the world or method in a file, with its files and their digest.

    Args:
        path: the file.
        kind: of its contents.
        entry_class: of its ``ENTRY``.
        classes: fields of the entry that name classes of the file.
        problem: returns the entry's mistake, nothing if it can be used.
        digest: that the files must have; any if empty.

    Raises:
        UsageError: a file is missing, damaged or cannot be run, has no entry, or they have another
            digest.
        EnvironmentFailure: one cannot be read.
    """
    source = source_of(path, kind, digest)
    entry = getattr(source.module, "ENTRY", None)
    if entry is None:
        wrong = f"it has no ENTRY, the {entry_class.__name__} of its {kind}"
    elif not isinstance(entry, entry_class):
        wrong = f"its ENTRY must be a {entry_class.__name__}, not {type(entry).__name__}"
    else:
        names = [str(getattr(entry, field)) for field in classes]
        lacking = [n for n in names if not isinstance(getattr(source.module, n, None), type)]
        wrong = _no_class(lacking[0], source.module) if lacking else problem(entry, source.module)
    if wrong:
        raise UsageError(f"{kind} file {path}: {wrong}")
    found = {"module": source.module.__name__, "file": source.files[0]}
    whole: Any = replace(cast("Any", entry), **found, files=source.files, digest=source.digest)
    return cast("Entry", whole)


def files_of(path: Path) -> list[Path]:
    """Return a file and the files next to it that it imports, without running them.

    Raises:
        UsageError: one is missing or damaged.
        EnvironmentFailure: one cannot be read.
    """
    return list(_texts(path, "Python"))


def is_outside(name: str) -> bool:
    """Return whether a module of this name is such a file."""
    return name.startswith(tuple(OWN.values()))


def takes(function: Any, n: int, *names: str) -> bool:
    """Return whether a function can be called with ``n`` arguments and these keyword arguments."""
    try:
        inspect.signature(function).bind(*[None] * n, **dict.fromkeys(names))
    except TypeError:
        return False
    return True


def _no_class(name: str, module: ModuleType) -> str:
    """Return a message that a file has no such class, with those it and its neighbours define."""
    classes = ((key, one) for key, one in vars(module).items() if isinstance(one, type))
    own = [key for key, one in classes if is_outside(one.__module__)]
    return str(unknown_name("class", name, own, "in its ENTRY"))


def _texts(path: Path, kind: str) -> dict[Path, bytes]:
    """Return the text of a file and of the files next to it that it imports, itself first."""
    texts: dict[Path, bytes] = {}
    rest = [path.resolve()]
    while rest:
        file = rest.pop()
        name = f"the {kind} file {file if texts else path}"
        texts[file] = read_bytes(file, MOST_BYTES, name)
        refuse_wide(texts[file], name)
        near = {file.parent / f"{name}.py" for name in _imported(texts[file])}
        rest += sorted((one for one in near if one.is_file() and one not in texts), reverse=True)
    return texts


def _imported(text: bytes) -> set[str]:
    """Return the modules that a text imports by a plain name, anywhere in it; none of Python's."""
    try:
        nodes = list(ast.walk(ast.parse(text)))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return set()  # running it raises the error
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {n.module for n in nodes if isinstance(n, ast.ImportFrom) and n.module and not n.level}
    return names - sys.stdlib_module_names - {"conevo"}


def _digest(texts: Mapping[Path, bytes]) -> str:
    """Return twelve hex digits that identify the texts and their names."""
    first, *others = texts
    digest = hashlib.blake2b(texts[first], digest_size=6)
    for file in sorted(others):
        digest.update(b"\0" + file.name.encode() + b"\0" + texts[file])
    return digest.hexdigest()


def _run(path: Path, texts: Mapping[Path, bytes], kind: str, own: str) -> ModuleType:
    """Return the module named ``own``, made by running a file.

    Warp looks up both module and text by name. The modules of neighbours belong to the file, so
    that two files may each have a neighbour of the same name: their imports are looked up here.
    """
    first = next(iter(texts))
    names = {file.stem: own + ("" if file == first else f"_{file.stem}") for file in texts}

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
    except BaseException as error:
        for name in names.values():
            sys.modules.pop(name, None)
        if isinstance(error, KeyboardInterrupt):
            raise
        place = _place(error, texts)
        at = f"{place[0].name} " * (place[0] != first) + f"line {place[1]}: " if place else ""
        raise UsageError(f"cannot run the {kind} file {path}: {at}{_words(error)}") from error


def _place(error: BaseException, files: Iterable[Path]) -> tuple[Path, int] | None:
    """Return the file and line that an error comes from, the innermost one in these files."""
    wanted = {str(file): file for file in files}
    if isinstance(error, SyntaxError) and error.filename in wanted and error.lineno:
        return wanted[error.filename], error.lineno
    stack = traceback.extract_tb(error.__traceback__)
    found = ((wanted[s.filename], s.lineno) for s in reversed(stack) if s.filename in wanted)
    return next(((file, line) for file, line in found if line), None)


def _words(error: BaseException) -> str:
    """Return an error's type and message, in one line."""
    what = error.msg if isinstance(error, SyntaxError) else str(error)
    return " ".join(f"{type(error).__name__}: {what}".split()).removesuffix(":")


def line_of(error: BaseException) -> str:
    """Return "FILE:LINE: in CALL: TYPE: MESSAGE" for an error in such a file, "" for any other.

    CALL is the function that conevo called, such as ``scenarios``; the line may be in a function
    that it calls.
    """
    modules = [module for name, module in list(sys.modules.items()) if is_outside(name)]
    files = [Path(str(module.__file__)) for module in modules]
    if (place := _place(error, files)) is None:
        return ""
    own = {str(file) for file in files}
    calls = [s.name for s in traceback.extract_tb(error.__traceback__) if s.filename in own]
    call = f"in {calls[0]}: " if calls and calls[0] != "<module>" else ""
    return f"{place[0]}:{place[1]}: {call}{_words(error)}"
