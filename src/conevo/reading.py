"""Reading files that may be damaged, replaced or made up: the whole file, or a one-line error.

Everything that conevo reads from a run, a campaign, a world, a prey file, a recording or a
configuration is read here. Only regular files are opened (a link to one is followed), so that
conevo never waits for a pipe or a device in place of a file. Sizes are checked before memory is
allocated: that of the file, and those in the headers of an archive and its arrays.

Errors name the file and the expected content:

- ``DamagedFile``: the file exists, but is not what it should be.
- ``EnvironmentFailure``: the operating system refuses to read it.
"""

from __future__ import annotations

import io
import json
import math
import os
import re
import stat
import tomllib
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import is_dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal

from conevo.errors import EnvironmentFailure, UsageError, shown

if TYPE_CHECKING:
    import numpy.typing as npt

__all__ = [
    "DamagedFile",
    "check",
    "packed",
    "parse_json",
    "parse_toml",
    "read_arrays",
    "read_bytes",
    "read_json",
    "read_json_lines",
    "read_last_line",
    "read_part",
    "read_text",
    "read_toml",
    "refuse_wide",
    "whole_lines",
]

MIB = 2**20
MOST_TEXT = 16 * MIB  # bytes of a JSON or text file; parsed it may take twenty times as much
MOST_TOML = 2 * MIB  # its parser reads about one MiB per second
MOST_LOG = 512 * MIB
MOST_ARRAYS = 1024 * MIB  # bytes of an archive when it is unpacked
MEMBERS = 1000  # of an archive
DEPTH = 32  # nested lists and tables; conevo's own files have six levels
ABOUT_KEYS = {  # pydantic's errors, in words
    "missing": "is missing",
    "extra_forbidden": "is not a known key",
    "unexpected_keyword_argument": "is not a known key",
}
# A key of that number of parts. The same in a quoted text is not a valid setting, either.
DOTTED = re.compile(rf"""(?<![\w"'.-])(?:[\w"'-]+[ \t]*\.[ \t]*){{{DEPTH}}}""")
KINDS = {
    stat.S_IFDIR: "Is a directory",
    stat.S_IFIFO: "it is a pipe, not a regular file",
    stat.S_IFSOCK: "it is a socket, not a regular file",
    stat.S_IFCHR: "it is a device, not a regular file",
    stat.S_IFBLK: "it is a device, not a regular file",
}


class DamagedFile(UsageError):
    """A file exists but is not what it should be: damaged, too large or of another kind."""


# --- bytes and text -------------------------------------------------------------------------------


def read_bytes(path: Path, limit: int = MOST_ARRAYS, name: str = "") -> bytes:
    """Return the content of a regular file.

    Args:
        path: the file, or a link to it.
        limit: bytes that it may have.
        name: of the file in messages, by default its path.

    Raises:
        DamagedFile: it is not a regular file, or is larger.
        UsageError: there is no such file.
        EnvironmentFailure: it cannot be read.
    """
    name = name or str(path)
    with _opened(path, name) as file:
        size = os.fstat(file.fileno()).st_size
        _refuse_large(size, limit, name)
        return file.read(size)


@contextmanager
def _opened(path: Path, name: str) -> Iterator[BinaryIO]:
    """Yield a regular file that is open for reading.

    Raises:
        DamagedFile: it is not a regular file.
        UsageError: there is no such file.
        EnvironmentFailure: it cannot be read.
    """
    try:
        # Checked before it is opened: opening alone makes some devices act.
        _refuse_special(os.stat(path), name)
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            _refuse_special(os.fstat(handle), name)
            yield file
    except OSError as error:
        is_missing = isinstance(error, FileNotFoundError | NotADirectoryError)
        failure = UsageError if is_missing else EnvironmentFailure
        raise failure(f"cannot read {name}: {error.strerror or error}") from error
    except ValueError as error:  # a null byte in the path
        raise UsageError(f"cannot read {shown(name)}: {error}") from error


def read_text(path: Path, limit: int = MOST_TEXT) -> str:
    """Return a text: UTF-8, with or without a byte order mark.

    Raises:
        DamagedFile: it is another encoding, not a text, not a regular file, or too large.
        EnvironmentFailure: it cannot be read.
    """
    return _decode(read_bytes(path, limit), str(path))


def refuse_wide(content: bytes, name: str) -> None:
    """Raise DamagedFile if a text has two or four bytes a character, marked as such or not."""
    evens, odds = content[::2].count(0), content[1::2].count(0)
    if content[:4] in (b"\xff\xfe\0\0", b"\0\0\xfe\xff"):
        raise DamagedFile(f"{name} is UTF-32 text; save it as UTF-8")
    is_marked = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    is_whole = len(content) % 2 == 0 == min(evens, odds)
    if is_marked or (is_whole and max(evens, odds) > len(content) / 4):
        raise DamagedFile(f"{name} is UTF-16 text; save it as UTF-8")


def _decode(content: bytes, name: str) -> str:
    refuse_wide(content, name)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DamagedFile(
            f"{name} is damaged or not a text (byte {error.start} is not UTF-8); save it as UTF-8"
        ) from error
    if "\0" in text:
        raise DamagedFile(f"{name} is damaged or not a text (it has null bytes)")
    return text


def _refuse_special(found: os.stat_result, name: str) -> None:
    if not stat.S_ISREG(found.st_mode):
        kind = KINDS.get(stat.S_IFMT(found.st_mode), "it is not a regular file")
        raise DamagedFile(f"cannot read {name}: {kind}")


def _refuse_large(size: int, limit: int, name: str) -> None:
    if size > limit:
        raise DamagedFile(f"{name} is too large: more than {limit:,} bytes")


# --- JSON and TOML --------------------------------------------------------------------------------


def read_json(path: Path, model: type | None = None, limit: int = MOST_TEXT) -> dict[str, Any]:
    """Return the object in a JSON file.

    Args:
        path: the file.
        model: type of the object, see ``check``; anything if None.
        limit: bytes that the file may have.

    Raises:
        DamagedFile: it is not such an object, not a regular file, or too large.
        EnvironmentFailure: it cannot be read.
    """
    return parse_json(read_bytes(path, limit), str(path), model)


def read_json_lines(
    path: Path, model: type | None = None, *, is_log: bool = False
) -> list[dict[str, Any]]:
    """Return the objects in a file with one per line.

    Args:
        path: the file.
        model: type of the objects, see ``check``; anything if None.
        is_log: whether lines are appended, so that a kill may leave an incomplete last line, which
            is ignored.

    Raises:
        DamagedFile: a line is not such an object; the error names its number.
        EnvironmentFailure: it cannot be read.
    """
    content = read_bytes(path, MOST_LOG)
    lines = whole_lines(content)
    if not is_log and content and not content.endswith(b"\n"):
        raise DamagedFile(f"{path} is damaged: line {len(lines) + 1} is incomplete")
    return [
        parse_json(line, f"{path}", model, f" in line {number}")
        for number, line in enumerate(lines, 1)
    ]


def read_part(path: Path, offset: int, limit: int) -> bytes:
    """Return the bytes of a file from an offset on, at most ``limit`` of them.

    Raises:
        DamagedFile: it is not a regular file.
        EnvironmentFailure: it cannot be read.
    """
    with _opened(path, str(path)) as file:
        file.seek(offset)
        return file.read(limit)


def read_last_line(path: Path, limit: int = MIB) -> bytes:
    """Return the last whole line of a file, b"" if it has none; only the file's end is read.

    Raises:
        DamagedFile: it is not a regular file, or the line is longer than ``limit`` bytes.
        EnvironmentFailure: it cannot be read.
    """
    name = str(path)
    with _opened(path, name) as file:
        size = os.fstat(file.fileno()).st_size
        for most in (min(8192, limit), limit):
            file.seek(max(size - most, 0))
            lines = whole_lines(file.read(most))
            if len(lines) > 1 or (lines and size <= most):
                return lines[-1]
            if size <= most:
                return b""
    raise DamagedFile(f"{name} is damaged: its last line has more than {limit:,} bytes")


def whole_lines(content: bytes) -> list[bytes]:
    """Return the lines that end with a newline."""
    return content.split(b"\n")[:-1]


def parse_json(
    content: bytes, name: str, model: type | None = None, where: str = ""
) -> dict[str, Any]:
    """Return the object in a JSON text.

    A number that is not finite, a key that appears twice and deep nesting are refused: other
    programs would read something else, or nothing.

    Args:
        content: the text, UTF-8.
        name: of the text in messages, a path.
        model: type of the object, see ``check``; anything if None.
        where: the place within it, for messages (" in line 3").

    Raises:
        DamagedFile: it is not such an object.
    """
    text = _decode(content, name)
    try:
        found = _DECODER.decode(text)
        if not isinstance(found, dict):
            raise ValueError(f"an object expected, not {shown(found)}")
        if text.count("[") + text.count("{") > DEPTH:
            _refuse_deep(found)
    except RecursionError:
        raise DamagedFile(f"{name} is damaged{where}: it is nested too deeply") from None
    except ValueError as error:
        raise DamagedFile(f"{name} is damaged{where}: {_one_line(error)}") from error
    if model is not None:
        check(found, model, f"{name} is damaged{where}")
    return found


def read_toml(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file.

    Raises:
        DamagedFile: it is not valid TOML, not a regular file, or too large.
        EnvironmentFailure: it cannot be read.
    """
    return parse_toml(read_text(path, MOST_TOML), str(path))


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """Return the tables of a TOML text, called ``name`` in messages.

    Raises:
        DamagedFile: it is not valid TOML.
    """
    try:
        if DOTTED.search(text):  # each part costs a table, and a copy of all previous parts
            raise RecursionError
        found = tomllib.loads(text)
        _refuse_deep(found)
    except RecursionError:
        raise DamagedFile(f"{name} is not valid TOML: it is nested too deeply") from None
    except ValueError as error:
        raise DamagedFile(f"{name} is not valid TOML: {_one_line(error)}") from error
    return found


def check(value: object, model: type, problem: str, *, is_closed: bool = False) -> Any:
    """Return a value that matches a model: as it is, or as a dataclass with tuples for lists.

    Args:
        value: plain data.
        model: a TypedDict, or a dataclass. Types are strict, numbers finite.
        problem: start of the message; the field and the allowed values follow.
        is_closed: whether keys that the model does not have are refused; else they are ignored, as
            a later version may write them.

    Raises:
        DamagedFile: it does not match.
    """
    from pydantic import ValidationError

    try:
        if is_dataclass(model):
            return _adapter(model, is_closed).validate_json(json.dumps(value))
        return _adapter(model, is_closed).validate_python(value)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"])
        field = "".join(parts).removeprefix(".")
        if words := ABOUT_KEYS.get(first["type"]):
            raise DamagedFile(f"{problem}: {field} {words}") from error
        message = first["msg"].replace("Input should", "must")
        raise DamagedFile(f"{problem}: {field} = {shown(first['input'])}: {message}") from error
    except RecursionError:
        raise DamagedFile(f"{problem}: it is nested too deeply") from None


@cache
def _adapter(model: type, is_closed: bool) -> Any:
    from pydantic import ConfigDict, TypeAdapter, with_config

    extra: Literal["forbid", "ignore"] = "forbid" if is_closed else "ignore"
    config = ConfigDict(strict=True, allow_inf_nan=False, extra=extra)
    return TypeAdapter(with_config(config)(model))


def _refuse_deep(value: object) -> None:
    level = [value]
    for _ in range(DEPTH):
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, dict) else outer)  # type: ignore[attr-defined]
            if isinstance(inner, dict | list)
        ]
        if not level:
            return
    raise RecursionError


def _refuse_constant(text: str) -> None:
    raise ValueError(f"{text} is not a finite number")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:40]} is not a finite number")
    return number


def _integer(text: str) -> int:
    if len(text) > 20 or not -(2**63) <= int(text) < 2**64:
        raise ValueError(f"{text[:40]} is beyond 64 bits")
    return int(text)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{shown(twice)} appears twice")
    return found


_DECODER = json.JSONDecoder(
    object_pairs_hook=_unique,
    parse_float=_finite,
    parse_int=_integer,
    parse_constant=_refuse_constant,
)


# --- arrays ---------------------------------------------------------------------------------------


def read_arrays(
    path: Path, limit: int = MOST_ARRAYS, kind: str = "an npz file", *, is_packed: bool = True
) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of an npz file by name.

    Nothing is unpacked before the sizes in its headers are known to be within the limit, and never
    more than these sizes. No object is ever unpickled.

    Args:
        path: the file.
        limit: bytes that it may have, packed and unpacked.
        kind: of file that it should be, for messages.
        is_packed: whether it may be compressed; else it may not unpack to more bytes than it has.

    Raises:
        DamagedFile: it is damaged, not an npz file of numbers, not a regular file, or too large.
        EnvironmentFailure: it cannot be read.
    """
    content = read_bytes(path, limit)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
            _refuse_members(members, limit if is_packed else len(content))
            found: dict[str, npt.NDArray[Any]] = {}
            for member in members:
                with archive.open(member) as file:
                    content = file.read(member.file_size + 1)
                found[member.filename.removesuffix(".npy")] = _array(content)
            return found
    except Exception as error:  # a damaged file may make its readers raise anything
        reason = _one_line(error) or type(error).__name__
        raise DamagedFile(f"{path} is damaged or not {kind} ({reason})") from error


def packed(about: str, arrays: Mapping[str, Any], *, is_compressed: bool = False) -> bytes:
    """Return the content of an npz file; equal arguments give equal bytes.

    Ctrl-C stays Ctrl-C: an archive that it leaves half-written raises an error of its own.

    Args:
        about: a text, kept as the array "about" of bytes.
        arrays: the other arrays.
        is_compressed: whether they are compressed.
    """
    import numpy as np

    buffer = io.BytesIO()
    first = np.frombuffer(about.encode(), dtype=np.uint8)
    pack = np.savez_compressed if is_compressed else np.savez
    try:
        pack(buffer, allow_pickle=False, about=first, **arrays)
    except ValueError as error:
        if isinstance(error.__context__, KeyboardInterrupt):
            raise error.__context__ from None
        raise
    return buffer.getvalue()


def _refuse_members(members: list[zipfile.ZipInfo], limit: int) -> None:
    """Raise ValueError if an archive may not be unpacked."""
    if len(members) > MEMBERS:
        raise ValueError(f"it has more than {MEMBERS} members")
    if len({member.filename for member in members}) < len(members):
        raise ValueError("it has two members of one name")
    if any(one.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for one in members):
        raise ValueError("a member is not packed as numpy packs it")  # and without a bound
    size = sum(member.file_size for member in members)
    if size > limit:
        raise ValueError(f"unpacked it would have {size:,} bytes, more than {limit:,}")


def _array(content: bytes) -> npt.NDArray[Any]:
    """Return the array in an npy file; refuse a header whose size is not that of the file."""
    import numpy as np

    stream = io.BytesIO(content)
    version = np.lib.format.read_magic(stream)
    if version != (1, 0):
        raise ValueError(f"an array of version {version}")
    shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    if dtype.kind not in "biuf" or dtype.subdtype is not None:
        raise ValueError(f"an array of type {dtype}, not of numbers")
    size = len(content) - stream.tell()
    if min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize != size:
        raise ValueError("an array whose size is not that of its header")
    flat: npt.NDArray[Any] = np.frombuffer(content, dtype=dtype, offset=stream.tell())
    if dtype.kind == "b" and flat.view(np.uint8).max(initial=0) > 1:
        raise ValueError("truth values that are neither true nor false")
    return flat.reshape(shape, order="F" if is_fortran else "C").copy(order="K")


def _one_line(error: BaseException) -> str:
    """Return the message of an error, in one short line."""
    text = " ".join(str(error).split())
    text = re.sub(r"Exceeds the limit .*", "a number of more than 4300 digits", text)
    return text if len(text) <= 200 else f"{text[:200]}..."
