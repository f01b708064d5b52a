"""Send a run, or the runs of a campaign, to a tracker: once, or while they are written."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from conevo.campaigns.campaign import Campaign
from conevo.errors import ConevoError, UsageError
from conevo.runs import locks
from conevo.runs.directory import CAMPAIGN, LOCK, kind_of
from conevo.runs.durable import is_there, writing
from conevo.terms import counted
from conevo.track.series import Row, Series
from conevo.track.trackers import Module, Target, Tracker

__all__ = ["TRACKS", "Tracking", "folder_of"]

TRACKS = Path("tracks")  # default folder of what trackers write here
EVERY = 1.0  # seconds from one look at the files to the next
PATIENCE = 60.0  # seconds without a process that writes, after which nothing is followed any more


def folder_of(path: Path, kind: Tracker, out: Path) -> Path:
    """Return the folder of the series of a run, or of the runs of a campaign."""
    folder = out / kind.name
    return folder / path.resolve().name if kind_of(path) == "campaign" else folder


class Tracking:
    """Runs that are sent to a tracker.

    Args:
        path: the directory of a run, a shaping or a campaign.
        kind: the tracker.
        out: folder of what trackers write here.
        note: called with a line about each series that begins, ends or fails.

    Attributes:
        see: commands or addresses that show what was sent.
        failed: names of the runs of a campaign that are damaged or were removed.

    Raises:
        UsageError: the tracker cannot be used, or nothing is at ``path``.
    """

    def __init__(self, path: Path, kind: Tracker, out: Path, note: Callable[[str], None]) -> None:
        kind.refuse()
        self._module, self._note = kind.module, note
        self._path, self._is_campaign = path, is_there(path / CAMPAIGN)
        self._folder = folder_of(path, kind, out)
        self._sent: dict[Path, _Sent] = {}
        self.see: dict[str, None] = {}
        self.failed: list[str] = []
        self._planned = [path]
        if self._is_campaign:
            campaign = Campaign(path)
            self._planned = [campaign.paths.run(label) for label in campaign.planned]

    def once(self) -> None:
        """Send all that is there now.

        Raises:
            UsageError: the run is damaged or in use by another tracker.
            EnvironmentFailure: the tracker cannot write, or its server does not answer.
        """
        try:
            self._look(keep_open=False)
        finally:
            self._close()

    def follow(self) -> None:
        """Send all that is there, and what is written until nothing is written any more.

        It ends when all runs are finished, or when no process has written any of them for a
        minute.

        Raises:
            UsageError, EnvironmentFailure: as ``once``, or the run was removed.
        """
        try:
            written = time.monotonic()
            while not self._look(keep_open=True):
                if self._is_written():
                    written = time.monotonic()
                elif time.monotonic() - written > PATIENCE:
                    self._note(f"{self._path} is not running any more")
                    return
                time.sleep(EVERY)
        finally:
            self._close()

    @property
    def generations(self) -> int:
        """The generations that were sent."""
        return sum(one.count for one in self._sent.values())

    def _look(self, keep_open: bool) -> bool:
        """Send what is new; return whether all runs are finished or have failed."""
        is_over = True
        for path in self._planned:
            name = path.name
            if name in self.failed:
                continue
            try:
                is_over &= self._send(path, keep_open)
            except UsageError as error:
                if not self._is_campaign or not kind_of(self._path):
                    raise
                self.failed.append(name)
                self._note(f"left out: {error}")
                if path in self._sent:
                    self._sent[path].close()
        return is_over

    def _send(self, path: Path, keep_open: bool) -> bool:
        """Send what is new in a run; return whether it is finished."""
        if path not in self._sent:
            if self._is_campaign and not kind_of(path):
                return False  # pending
            group = self._path.resolve().name if self._is_campaign else ""
            self._sent[path] = _Sent(Series(path, group), self._module, self._folder, self._note)
        sent = self._sent[path]
        if not sent.is_over:
            sent.send(self.see)
            if not keep_open:
                sent.close()
        return sent.is_over

    def _is_written(self) -> bool:
        coordinator = [self._path / LOCK] if self._is_campaign else []
        open_ones = [one for one in self._sent.values() if not one.is_over]
        return any(map(locks.is_held, coordinator)) or any(
            one.series.is_written for one in open_ones
        )

    def _close(self) -> None:
        """End all series; the first error counts."""
        errors: list[ConevoError] = []
        for one in self._sent.values():
            try:
                one.close()
            except ConevoError as error:
                errors.append(error)
        if errors:
            raise errors[0]


@dataclass
class _Sent:
    """A run that is being sent."""

    series: Series
    module: Module
    folder: Path
    note: Callable[[str], None]
    count: int = 0
    is_over: bool = False
    _last: Row | None = None
    _target: Target | None = None
    _lock: int = field(default=-1)

    def send(self, see: dict[str, None]) -> None:
        """Send the rows that are new, and the test if the run is finished."""
        is_finished = self.series.is_finished  # before the last rows are read
        if rows := self.series.read():
            target = self._open()
            see[target.see] = None
            new = [row for row in rows if row.step >= target.next_step]
            if new:
                target.put(new)
            self.count += len(new)
            self._last = rows[-1]
        if is_finished:
            if self._target is not None and self._last is not None:
                self._target.conclude(self.series.test(), self._last)
            self.is_over = True
            self.close()

    def close(self) -> None:
        """End the series; it can be continued later."""
        target, self._target = self._target, None
        if target is None:
            return
        try:
            target.close(self.is_over)
            self.note(
                f"{self.series.about.name}: {counted(self.count, 'generation')} sent to "
                f"{target.place}"
            )
        finally:
            os.close(self._lock)

    def _open(self) -> Target:
        """Return the series, begun when the first row is there.

        Raises:
            UsageError: another tracker is sending this run.
        """
        if self._target is None:
            about = self.series.about
            folder = self.folder / f"{about.name}-{about.id[:6]}"
            self._lock = _locked(folder)
            try:
                self._target = self.module.begin(about, folder)
            except BaseException:
                os.close(self._lock)
                raise
        return self._target


def _locked(folder: Path) -> int:
    """Make a folder and take its lock; return the handle that holds it."""
    path = folder / LOCK
    with writing(path):
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        is_ours = locks.take(handle)
    except OSError as error:
        os.close(handle)
        raise locks.no_locks(folder, error, "; choose it with --out") from error
    if not is_ours:
        os.close(handle)
        raise UsageError(f"another tracker is sending this run to {folder}; wait for it or end it")
    with suppress(OSError):  # of a full disk: it is only for the reader
        os.pwrite(handle, f"process {os.getpid()}".encode(), 0)
    return handle
