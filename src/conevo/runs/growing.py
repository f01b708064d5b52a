"""A log of generations that another process writes: only what is new is read, nothing is written.

Links, pipes and devices are never opened: all files read are in the watched folder.
"""

from __future__ import annotations

import os
import stat
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path

from conevo.errors import UsageError
from conevo.reading import parse_json, read_part
from conevo.runs.records import Generation
from conevo.typing import Record

__all__ = ["GrowingLog", "Stamp", "stamp"]

Stamp = tuple[int, int, int]  # last change (ns), size (bytes), inode
CHUNK = 2**20  # bytes of a log that are read at once


def stamp(path: Path) -> Stamp | None:
    """Return a value that changes whenever a file does, None if it is not a regular file."""
    try:
        found = os.lstat(path)
    except (OSError, ValueError):
        return None
    return (found.st_mtime_ns, found.st_size, found.st_ino) if stat.S_ISREG(found.st_mode) else None


class GrowingLog(ABC):
    """A log of generations that grows; a subclass keeps what it needs of each record.

    A torn last line does not count. Lines after a damaged one are not read until the file is
    replaced, as it is when a run is resumed from a checkpoint; reading then begins again.

    Attributes:
        count: generations read so far.
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

    @abstractmethod
    def clear(self) -> None:
        """Forget all records, since they are read again."""

    @abstractmethod
    def add(self, record: Record) -> None:
        """Keep what is needed of the next generation."""

    def _begin(self) -> None:
        self.count, self.problem = 0, ""
        self._offset, self._rest = 0, b""
        self.version += 1
        self.clear()

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
            n = self.count
            try:
                record = parse_json(line, self.path.name, Generation, f" in line {n + 1}")
                if record["generation"] != n:
                    raise UsageError(
                        f"{self.path.name} is damaged in line {n + 1}: generation {n} expected"
                    )
            except UsageError as error:
                self.problem = str(error)
                return
            self.add(record)
            self.count += 1


def _has_grown(before: Stamp, now: Stamp, offset: int) -> bool:
    """Whether a file is the same one with more at its end, or not read to its end yet."""
    same = before[2] == now[2] and now[1] >= max(before[1], offset)
    return same and (now[1] > before[1] or now[0] == before[0])
