"""The ledger of a campaign, the state of every run: SQLite, one writer.

Only the process that holds the campaign's lock writes here; others read. The runs' directories are
the truth: a lost ledger is rebuilt from them.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from conevo.errors import EnvironmentFailure, UsageError
from conevo.runs.provenance import now

__all__ = ["STATES", "Entry", "Ledger"]

STATES = ("pending", "running", "finished", "failed")
SCHEMA = """
CREATE TABLE IF NOT EXISTS runs (
    label TEXT PRIMARY KEY,
    place INTEGER NOT NULL,              -- in the plan
    state TEXT NOT NULL DEFAULT 'pending',
    attempts INTEGER NOT NULL DEFAULT 0, -- that ended by themselves or were lost
    reason TEXT NOT NULL DEFAULT '',     -- of the last failure
    threads INTEGER NOT NULL DEFAULT 0,
    began REAL,                          -- seconds since 1970, of the last attempt
    core_seconds REAL NOT NULL DEFAULT 0 -- of all attempts that ended by themselves
);
CREATE TABLE IF NOT EXISTS events (
    at TEXT NOT NULL, label TEXT NOT NULL, what TEXT NOT NULL, reason TEXT NOT NULL
);
"""


@dataclass(frozen=True)
class Entry:
    """A run in the ledger.

    Attributes:
        label: of the run.
        state: one of ``STATES``.
        attempts: that ended by themselves or were lost.
        reason: of the last failure, "" if there was none.
        threads: of the last attempt.
        began: start of the last attempt, seconds since 1970; None before the first.
        core_seconds: used by all attempts that ended by themselves.
    """

    label: str
    state: str = "pending"
    attempts: int = 0
    reason: str = ""
    threads: int = 0
    began: float | None = None
    core_seconds: float = 0.0


class Ledger:
    """The ledger of a campaign.

    Args:
        path: its file, made when something is first written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def enrol(self, labels: Iterable[str]) -> None:
        """Add the runs that are missing, in the order of the plan."""
        with self._writing() as db:
            db.executemany(
                "INSERT INTO runs (label, place) VALUES (?, ?) "
                "ON CONFLICT (label) DO UPDATE SET place = excluded.place",
                [(label, place) for place, label in enumerate(labels)],
            )

    def entries(self) -> list[Entry]:
        """Return all runs in the order of the plan; none if the file does not exist yet."""
        if not self.path.is_file():
            return []
        query = (
            "SELECT label, state, attempts, reason, threads, began, core_seconds "
            "FROM runs ORDER BY place"
        )
        # A transaction of a killed writer is undone first, which a reader may not do.
        is_torn = self.path.with_name(f"{self.path.name}-journal").exists()
        with self._open("rw" if is_torn else "ro") as db:
            return [Entry(*row) for row in db.execute(query)]

    def begin(self, label: str, threads: int, at: float) -> None:
        """Record that a worker has started."""
        with self._writing() as db:
            db.execute(
                "UPDATE runs SET state = 'running', threads = ?, began = ? WHERE label = ?",
                (threads, at, label),
            )
            _note(db, label, "begun", "")

    def end(self, label: str, state: str, reason: str = "", core_seconds: float = 0.0) -> None:
        """Record how a worker ended: "finished", "failed" or, to be tried again, "pending"."""
        with self._writing() as db:
            db.execute(
                "UPDATE runs SET state = ?, reason = ?, attempts = attempts + 1, "
                "core_seconds = core_seconds + ? WHERE label = ?",
                (state, reason, core_seconds, label),
            )
            _note(db, label, state, reason)

    def put(self, labels: Iterable[str], state: str, why: str) -> None:
        """Set the state of runs without a worker; "pending" resets their attempts."""
        with self._writing() as db:
            for label in labels:
                reset = ", attempts = 0, reason = ''" if state == "pending" else ""
                db.execute(f"UPDATE runs SET state = ?{reset} WHERE label = ?", (state, label))
                _note(db, label, state, why)

    def release(self) -> None:
        """Make running runs pending: their coordinator has left."""
        with self._writing() as db:
            for (label,) in db.execute("SELECT label FROM runs WHERE state = 'running'").fetchall():
                _note(db, label, "pending", "the coordinator left")
            db.execute("UPDATE runs SET state = 'pending' WHERE state = 'running'")

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        with self._open("rwc") as db:
            db.executescript(SCHEMA)
            yield db

    @contextmanager
    def _open(self, mode: str) -> Iterator[sqlite3.Connection]:
        address = f"{self.path.absolute().as_uri()}?mode={mode}"
        # The default journal: write-ahead logs must not lie on network file systems.
        try:
            with closing(sqlite3.connect(address, uri=True, timeout=60)) as db, db:
                yield db
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            if isinstance(error, sqlite3.OperationalError) and "decode" not in str(error):
                raise EnvironmentFailure(f"cannot use {self.path}: {error}") from error
            raise UsageError(
                f"{self.path} is damaged ({error}); remove it and start the campaign again: it is "
                f"rebuilt from the runs"
            ) from error


def _note(db: sqlite3.Connection, label: str, what: str, reason: str) -> None:
    db.execute("INSERT INTO events VALUES (?, ?, ?, ?)", (now(), label, what, reason))
