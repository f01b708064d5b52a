"""Files that other processes write: only changes are read again, and nothing is ever written.

Links, pipes and devices are never opened: all files read are in the watched folder.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar

from conevo.errors import ConevoError, UsageError
from conevo.runs.growing import GrowingLog, Stamp, stamp
from conevo.typing import Record

__all__ = ["Generations", "Log", "Whole", "problem_of", "readable"]

T = TypeVar("T")

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


class Log(GrowingLog):
    """A log of generations that grows, as columns.

    Attributes:
        generations: read so far.
    """

    generations: Generations

    def clear(self) -> None:
        """Forget all generations."""
        self.generations = Generations()

    def add(self, record: Record) -> None:
        """Add a generation."""
        self.generations.add(record)


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
