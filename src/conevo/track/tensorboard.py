"""Event files for TensorBoard, one per run.

An event file has the whole series. Tracking a run again writes a new file and removes the
previous one once the new one has as much, so that nothing is shown twice. The file begins with a
start of session at step 0, by which a TensorBoard that is open forgets the previous one.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from conevo.runs.durable import writing
from conevo.terms import quoted
from conevo.track.series import Row, RunProfile

__all__ = ["begin", "refuse"]

PREFIX = "events.out.tfevents."


def refuse() -> None:
    """Any configuration is fine."""


def begin(about: RunProfile, folder: Path) -> EventFile:
    """Begin a new event file in ``folder``."""
    return EventFile(about, folder)


class EventFile:
    """An event file, written as it grows: one event per generation.

    ``tensorboardX.SummaryWriter`` writes in a thread, whose errors its caller never gets; so its
    record writer is used directly.
    """

    next_step = 0

    def __init__(self, about: RunProfile, folder: Path) -> None:
        from tensorboardX.proto.event_pb2 import SessionLog
        from tensorboardX.record_writer import RecordWriter
        from tensorboardX.summary import text

        self.place = str(folder)
        self.see = f"tensorboard --logdir {quoted(folder.parent)}"
        self._path = folder / f"{PREFIX}{time.time_ns() // 10**9}.conevo.{time.time_ns()}"
        self._earlier = sorted(folder.glob(f"{PREFIX}*"))
        rows = [f"{name} | {value}" for name, value in {**about.tags, **about.settings}.items()]
        with writing(self._path):
            self._file = RecordWriter(str(self._path))
            self._add(about.started, file_version="brain.Event:2")
            self._add(about.started, session_log=SessionLog(status=SessionLog.START))
            table = "\n".join(["setting | value", "--- | ---", *rows])
            self._add(about.started, summary=text("settings", table))

    def put(self, rows: Sequence[Row]) -> None:
        """Write an event for each row, and remove the previous files."""
        with writing(self._path):
            for row in rows:
                self._scalars(row.values, row)
            self._file.flush()
            for path in self._earlier:
                path.unlink(missing_ok=True)
            self._earlier = []

    def conclude(self, values: Mapping[str, float], last: Row) -> None:
        """Write the results of the testing phase, at the last step."""
        with writing(self._path):
            self._scalars(values, last)

    def close(self, is_finished: bool) -> None:
        """Write what is left."""
        with writing(self._path):
            self._file.flush()
            self._file.close()

    def _scalars(self, values: Mapping[str, float], row: Row) -> None:
        from tensorboardX.proto.summary_pb2 import Summary

        listed = [Summary.Value(tag=name, simple_value=value) for name, value in values.items()]
        self._add(row.at, step=row.step, summary=Summary(value=listed))

    def _add(self, at: float, **what: Any) -> None:
        from tensorboardX.proto.event_pb2 import Event

        self._file.write(Event(wall_time=at, **what).SerializeToString())
