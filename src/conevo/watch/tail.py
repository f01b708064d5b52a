"""Files that others write, read again only where they have changed. Nothing is ever written.

Links, pipes and devices are never opened: what is read lies in the folder that is watched.
"""

from __future__ import annotations

import json
import math
import os
import stat
from array import array
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

from conevo.errors import EnvironmentFailure, UsageError
from conevo.runs import locks

__all__ = ["Generations", "Log", "Stamp", "Whole", "is_locked", "readable", "stamp"]

T = TypeVar("T")
Stamp = tuple[int, int, int]  # when it was last changed (ns), its size (bytes), its inode

MOST = 16 * 2**20  # bytes of a file that is read whole
CHUNK = 2**20  # bytes of a log that are read at once
DAMAGE = (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError)
LARGEST = 1e100
NAMES = 64  # measures, castes or settings at most
NUMBERS = (
    "team_evaluations",
    "seconds",
    "best_fitness",
    "mean_fitness",
    "team_fitness",
    "specialization",
    "sst",
    "gst",
    "recombinations",
    "n_nonfinite",
)
FURTHER = ("favourite_share", "neurons")  # not in all logs, or a mean


def stamp(path: Path) -> Stamp | None:
    """Return what changes whenever a file does, None if there is no regular file."""
    try:
        found = os.lstat(path)
    except (OSError, ValueError):
        return None
    return _stamp(found) if stat.S_ISREG(found.st_mode) else None


def is_locked(path: Path) -> bool:
    """Whether a process holds a directory's lock file."""
    try:
        handle = _open(path)
    except EnvironmentFailure:
        return False
    if handle is None:
        return False
    try:
        return locks.is_taken(handle)
    finally:
        os.close(handle)


class Whole(Generic[T]):
    """A file that is replaced whole.

    Args:
        path: the file.
        parse: makes something of its content; what it raises is told as damage.
    """

    def __init__(self, path: Path, parse: Callable[[bytes], T]) -> None:
        self.path = path
        self._parse = parse
        self._stamp: Stamp | None = None
        self._value: T | None = None
        self._problem = ""

    @property
    def stamp(self) -> Stamp | None:
        """That of the file as it is now."""
        return stamp(self.path)

    def read(self) -> T | None:
        """Return what is in the file, None if there is none.

        Raises:
            UsageError: it is damaged.
            EnvironmentFailure: it cannot be read.
        """
        now = stamp(self.path)
        if now is None:
            self._stamp, self._value, self._problem = None, None, ""
        elif now != self._stamp:
            handle = _open(self.path)
            if handle is None:
                return None
            with os.fdopen(handle, "rb") as file:
                self._stamp, self._value = _stamp(os.fstat(handle)), None
                self._problem = self._take(file.read(MOST + 1))
        if self._problem:
            raise UsageError(self._problem)
        return self._value

    def _take(self, content: bytes) -> str:
        """Parse the content; return what is wrong with it, "" if nothing is."""
        if len(content) > MOST:
            return f"{self.path.name} is larger than {MOST // 2**20} MiB"
        try:
            self._value = self._parse(content)
        except DAMAGE as error:
            return f"{self.path.name} is damaged: {_one_line(error)}"
        return ""


class Generations:
    """What every generation of a log came to, a column [n] for each number; NaN for none.

    Attributes:
        numbers: of the record, by name; ``neurons`` is the mean over the team.
        performance: measures by name.
        castes: robots of each caste by name, in the order in which they appeared.
        favourites: robots by their favourite setting, the same way; none of earlier versions.
    """

    def __init__(self) -> None:
        self.numbers: dict[str, array[float]] = {name: array("d") for name in (*NUMBERS, *FURTHER)}
        self.performance: dict[str, array[float]] = {}
        self.castes: dict[str, array[float]] = {}
        self.favourites: dict[str, array[float]] = {}

    def __len__(self) -> int:
        return len(self.numbers["seconds"])

    def add(self, record: Mapping[str, Any]) -> None:
        """Add a generation.

        Raises:
            ValueError, KeyError, TypeError: something is missing or no number; nothing is added.
        """
        n = len(self)
        if record["generation"] != n:
            raise ValueError(f"generation {n} expected")
        row = {name: _number(record[name]) for name in NUMBERS}
        for name in ("team_evaluations", "seconds"):
            if not row[name] >= 0:
                raise ValueError(f"{name} must be a number from 0 on")
        sizes = [_number(size) for size in record["n_hidden"]]
        row["favourite_share"] = _number(record.get("favourite_share"))
        row["neurons"] = sum(sizes) / len(sizes) if sizes else math.nan
        performance = _numbers(record["performance"], self.performance)
        castes = _numbers(record["castes"], self.castes)
        favourites = _numbers(record.get("favourites", {}), self.favourites)
        for column, value in row.items():
            self.numbers[column].append(value)
        _extend(self.performance, performance, n, math.nan)
        _extend(self.castes, castes, n, 0.0)
        _extend(self.favourites, favourites, n, 0.0)


class Log:
    """A log of generations that grows: only what was appended is read.

    A torn last line does not count. A damaged one ends what is read until the file is replaced.

    Attributes:
        generations: read so far.
        problem: what is wrong with the file, "" if nothing is.
        version: changes whenever the two others do.
        is_behind: whether there is more to be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.version = 0
        self.is_behind = False
        self._stamp: Stamp | None = None
        self._begin()

    def _begin(self) -> None:
        self.generations, self.problem = Generations(), ""
        self._offset, self._rest = 0, b""
        self.version += 1

    @property
    def written(self) -> float:
        """When the file was last written, seconds since 1970; 0 if it never was."""
        return self._stamp[0] / 1e9 if self._stamp else 0.0

    def read(self, go_on: Callable[[], bool] = lambda: True) -> None:
        """Read what is new; ``go_on`` is asked before each further piece."""
        now = stamp(self.path)
        if now == self._stamp and not self.is_behind:
            return
        handle = None if now is None else _open(self.path)
        if handle is None:
            if self._stamp is not None:
                self._stamp, self.is_behind = None, False
                self._begin()
            return
        with os.fdopen(handle, "rb") as file:
            found = _stamp(os.fstat(handle))
            if self._stamp is not None and not _has_grown(self._stamp, found, self._offset):
                self._begin()
            self._stamp = found
            file.seek(self._offset)
            self.is_behind = True
            while self.is_behind and go_on():
                piece = file.read(CHUNK)
                self.is_behind = len(piece) == CHUNK
                self._offset += len(piece)
                if piece and not self.problem:
                    self._take(piece)

    def _take(self, piece: bytes) -> None:
        """Add the whole lines of what was read; keep the rest for the next time."""
        *lines, self._rest = (self._rest + piece).split(b"\n")
        self.version += 1
        for line in lines:
            try:
                self.generations.add(json.loads(line))
            except DAMAGE as error:
                number = len(self.generations) + 1
                self.problem = f"{self.path.name} is damaged in line {number}: {_one_line(error)}"
                return


def readable(name: str) -> str:
    """Return a file's name as text that can be written: bytes that are none by their numbers."""
    return name.encode("utf-8", "backslashreplace").decode()


def _has_grown(before: Stamp, now: Stamp, offset: int) -> bool:
    """Whether a file is the same one with more at its end, or not read to its end yet."""
    same = before[2] == now[2] and now[1] >= max(before[1], offset)
    return same and (now[1] > before[1] or now[0] == before[0])


def _open(path: Path) -> int | None:
    """Return a handle of a regular file, None if there is none or it may not be read."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except PermissionError as error:
        raise EnvironmentFailure(f"cannot read {path.name}: {error.strerror}") from error
    except (OSError, ValueError):
        return None
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        return None
    return handle


def _stamp(found: os.stat_result) -> Stamp:
    return found.st_mtime_ns, found.st_size, found.st_ino


def _number(value: Any) -> float:
    """Return a number, or NaN for none; also for one so large that sums with it may overflow.

    Raises:
        TypeError: no number.
    """
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"a number expected, not {str(value)[:40]!r}")
    number = float(value)
    return number if abs(number) < LARGEST else math.nan


def _numbers(values: Mapping[str, Any], known: Mapping[str, object]) -> dict[str, float]:
    """Return numbers by name; together with the names that are known there may be only so many."""
    if len(known.keys() | values.keys()) > NAMES:
        raise ValueError(f"more than {NAMES} names")
    return {name: _number(value) for name, value in values.items()}


def _extend(
    columns: dict[str, array[float]], row: Mapping[str, float], n: int, none: float
) -> None:
    """Append a row to columns of n values; a column that it lacks gets ``none``."""
    for name in row:
        if name not in columns:
            columns[name] = array("d", [none]) * n
    for name, column in columns.items():
        column.append(row.get(name, none))


def _one_line(error: BaseException) -> str:
    """Return what an error says, in one line."""
    if isinstance(error, KeyError):
        return f"no {error.args[0]!r}"
    return " ".join(str(error).split())[:200]
