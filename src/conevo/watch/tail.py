"""Files that other processes write: only changes are read again, and nothing is ever written.

Links, pipes and devices are never opened: all files read are in the watched folder.
"""

from __future__ import annotations

import math
import os
import stat
from array import array
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar

from conevo.errors import ConevoError, UsageError
from conevo.reading import parse_json, read_part
from conevo.runs.records import Generation

__all__ = ["Generations", "Log", "Stamp", "Whole", "problem_of", "readable", "stamp"]

T = TypeVar("T")
Stamp = tuple[int, int, int]  # last change (ns), size (bytes), inode

CHUNK = 2**20  # bytes of a log that are read at once
LARGEST = 1e100
NUMBERS = (
    "team_evaluations",
    "seconds",
    "best_fitness",
    "mean_fitness",
    "team_fitness",
    "specialization",
    "favourite_share",
    "sst",
    "gst",
    "recombinations",
    "n_nonfinite",
)


def stamp(path: Path) -> Stamp | None:
    """Return a value that changes whenever a file does, None if it is not a regular file."""
    try:
        found = os.lstat(path)
    except (OSError, ValueError):
        return None
    return (found.st_mtime_ns, found.st_size, found.st_ino) if stat.S_ISREG(found.st_mode) else None


class Whole(Generic[T]):
    """An object made of files that are replaced whole.

    Args:
        paths: the files; without the first one it does not exist.
        read: makes it.
    """

    def __init__(self, paths: Sequence[Path], read: Callable[[], T]) -> None:
        self._paths, self._read = paths, read
        self._stamps: list[Stamp | None] = []
        self._value: T | None = None
        self._problem: UsageError | None = None

    def read(self) -> T | None:
        """Return the object, None without the first file.

        Raises:
            UsageError: they are damaged.
            EnvironmentFailure: they cannot be read.
        """
        now = [stamp(path) for path in self._paths]
        if now != self._stamps:
            self._stamps, self._value, self._problem = [], None, None
            try:
                self._value = None if now[0] is None else self._read()
            except UsageError as error:
                self._problem = error
            self._stamps = now
        if self._problem:
            raise self._problem
        return self._value


class Generations:
    """The numbers of a log's generations, a column [n] each; NaN for missing ones.

    Attributes:
        numbers: of the record, by name; ``neurons`` is the mean over the team.
        performance: measures by name.
        castes: robots of each caste by name, in the order in which they appeared.
        favourites: robots by their favourite setting, likewise; empty in logs of earlier versions.
    """

    def __init__(self) -> None:
        self.numbers = {name: array("d") for name in (*NUMBERS, "neurons")}
        self.performance: dict[str, array[float]] = {}
        self.castes: dict[str, array[float]] = {}
        self.favourites: dict[str, array[float]] = {}

    def __len__(self) -> int:
        return len(self.numbers["seconds"])

    def add(self, record: Mapping[str, Any]) -> None:
        """Add a generation."""
        n, sizes = len(self), record["n_hidden"]
        row = {name: record.get(name) for name in NUMBERS} | {"neurons": sum(sizes) / len(sizes)}
        _extend(self.numbers, row, n, math.nan)
        _extend(self.performance, record["performance"], n, math.nan)
        _extend(self.castes, record["castes"], n, 0.0)
        _extend(self.favourites, record.get("favourites", {}), n, 0.0)


def _extend(
    columns: dict[str, array[float]], row: Mapping[str, float | None], n: int, none: float
) -> None:
    """Append a row to columns of n values; ``none`` to a column that it lacks."""
    for name in row:
        if name not in columns:
            columns[name] = array("d", [none]) * n
    for name, column in columns.items():
        value = row.get(name, none)
        # Sums with larger ones may overflow.
        column.append(value if value is not None and abs(value) < LARGEST else math.nan)


class Log:
    """A log of generations that grows: only new lines are read.

    A torn last line does not count. Lines after a damaged one are not read until the file is
    replaced.

    Attributes:
        generations: read so far.
        problem: what is wrong with the file, "" if nothing is.
        version: changes whenever the two others do.
        is_behind: whether it has more to be read.
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
        """Time of the last change to the file, seconds since 1970; 0 without a file."""
        return self._stamp[0] / 1e9 if self._stamp else 0.0

    def read(self, go_on: Callable[[], bool] = lambda: True) -> None:
        """Read what is new, while ``go_on`` returns true."""
        now, before = stamp(self.path), self._stamp
        if now == before and not self.is_behind:
            return
        if before is not None and (now is None or not _has_grown(before, now, self._offset)):
            self._begin()
        self._stamp = now
        self.is_behind = now is not None
        while self.is_behind and go_on():
            piece = read_part(self.path, self._offset, CHUNK)
            self.is_behind = len(piece) == CHUNK
            self._offset += len(piece)
            if piece and not self.problem:
                self._take(piece)

    def _take(self, piece: bytes) -> None:
        """Add the whole lines of a piece; keep the rest for the next time."""
        *lines, self._rest = (self._rest + piece).split(b"\n")
        self.version += 1
        for line in lines:
            n = len(self.generations)
            try:
                record = parse_json(line, self.path.name, Generation, f" in line {n + 1}")
                if record["generation"] != n:
                    raise UsageError(
                        f"{self.path.name} is damaged in line {n + 1}: generation {n} expected"
                    )
            except UsageError as error:
                self.problem = str(error)
                return
            self.generations.add(record)


def _has_grown(before: Stamp, now: Stamp, offset: int) -> bool:
    """Whether a file is the same one with more at its end, or not read to its end yet."""
    same = before[2] == now[2] and now[1] >= max(before[1], offset)
    return same and (now[1] > before[1] or now[0] == before[0])


def readable(name: str) -> str:
    """Return a file's name as valid text: other bytes by their numbers."""
    return name.encode("utf-8", "backslashreplace").decode()


def problem_of(read: Callable[[], None]) -> str:
    """Read files; return what is wrong with them in one line, "" if nothing is."""
    try:
        read()
    except ConevoError as error:
        return readable(str(error))
    except Exception as error:  # of any damage: all other runs are shown
        return readable(f"is damaged: {' '.join(repr(error).split())[:200]}")
    return ""
