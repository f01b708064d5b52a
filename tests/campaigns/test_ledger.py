import os
import signal
import sqlite3
import subprocess
import sys

import pytest

from conevo.campaigns.ledger import Ledger
from conevo.errors import EnvironmentFailure, UsageError


@pytest.fixture
def ledger(tmp_path):
    made = Ledger(tmp_path / "a b#.sqlite")
    made.enrol(["one", "two", "three"])
    return made


def states(ledger):
    return {entry.label: entry.state for entry in ledger.entries()}


def test_runs_are_in_the_order_of_the_plan_even_if_some_are_added(ledger):
    ledger.begin("two", 2, 10.0)
    ledger.enrol(["zero", "one", "two", "three"])
    assert states(ledger) == {
        "zero": "pending",
        "one": "pending",
        "two": "running",
        "three": "pending",
    }
    assert [entry.label for entry in ledger.entries()] == ["zero", "one", "two", "three"]
    two = ledger.entries()[2]
    assert (two.threads, two.began, two.attempts, two.reason) == (2, 10.0, 0, "")


def test_endings_are_counted_and_their_costs_added(ledger):
    for state, reason, seconds in (("pending", "lost", 0.0), ("failed", "why", 2.0)):
        ledger.begin("one", 1, 0.0)
        ledger.end("one", state, reason, seconds)
    one = ledger.entries()[0]
    assert (one.state, one.attempts, one.reason, one.core_seconds) == ("failed", 2, "why", 2.0)
    ledger.put(["one"], "pending", "again")
    one = ledger.entries()[0]
    assert (one.state, one.attempts, one.reason) == ("pending", 0, "")


def test_runs_of_a_coordinator_that_ended_are_pending_and_no_attempt_is_counted(ledger):
    ledger.begin("two", 1, 0.0)
    ledger.end("one", "finished")
    ledger.release()
    assert states(ledger) == {"one": "finished", "two": "pending", "three": "pending"}
    assert ledger.entries()[1].attempts == 0


def test_every_change_is_noted(ledger):
    ledger.begin("one", 1, 0.0)
    ledger.end("one", "failed", "why")
    with sqlite3.connect(ledger.path) as db:
        events = db.execute("SELECT label, what, reason FROM events").fetchall()
    assert events == [("one", "begun", ""), ("one", "failed", "why")]


def test_a_ledger_that_was_never_written_is_empty(tmp_path):
    assert Ledger(tmp_path / "none.sqlite").entries() == []


def test_a_damaged_ledger_is_one_line(tmp_path):
    path = tmp_path / "ledger.sqlite"
    path.write_bytes(b"not a database at all" * 100)
    with pytest.raises(UsageError, match=r"damaged.*remove it"):
        Ledger(path).entries()


def test_a_place_that_cannot_be_written_is_a_fault_of_the_machine(tmp_path):
    with pytest.raises(EnvironmentFailure, match=r"cannot use .*ledger\.sqlite"):
        Ledger(tmp_path / "none" / "ledger.sqlite").enrol(["one"])


KILLED = """
import os, signal, sqlite3, sys
db = sqlite3.connect(sys.argv[1], isolation_level=None)
db.execute("PRAGMA cache_size = 2")  # so that pages are written before the end
db.execute("BEGIN IMMEDIATE")
for k in range(5000):
    db.execute("INSERT INTO events VALUES ('now', ?, 'x', ?)", (str(k), "y" * 100))
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_the_next_reader_undoes_the_changes_of_a_killed_writer(ledger):
    ledger.begin("two", 1, 0.0)
    before = states(ledger)
    done = subprocess.run([sys.executable, "-c", KILLED, str(ledger.path)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert os.path.exists(f"{ledger.path}-journal")
    assert states(ledger) == before
    ledger.end("two", "finished")
    assert states(ledger)["two"] == "finished"


def test_a_ledger_with_any_byte_changed_is_read_or_refused(ledger):
    ledger.end("one", "failed", "why")
    whole = ledger.path.read_bytes()
    refused = 0
    for at in [
        *range(0, len(whole), 97),
        *(k for k in range(len(whole) - 3) if whole[k : k + 3] == b"why"),
    ]:
        ledger.path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xA5]) + whole[at + 1 :])
        try:
            ledger.entries()
        except (UsageError, EnvironmentFailure):
            refused += 1
    assert refused > 0


def test_a_ledger_that_is_a_link_to_itself_is_refused(tmp_path):
    path = tmp_path / "ledger.sqlite"
    path.symlink_to(path)
    with pytest.raises(EnvironmentFailure, match="cannot use"):
        Ledger(path).enrol(["one"])
