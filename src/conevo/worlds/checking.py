"""Check a world in a process of its own, and explain what ends that process.

An index outside an array ends a process without a word. So the checks run in a child, which writes
a line for each finding; if it dies, a second child runs a copy of the world's file that marks its
lines, and the last mark shows where.
"""

import json
import linecache
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import IO

from conevo.worlds.checks import Finding, findings
from conevo.worlds.marking import BYTES, MARKS, marked, read_mark
from conevo.worlds.registry import WorldEntry, resolve

__all__ = ["check"]

MOST_SECONDS = 120  # between two findings
CAUSES = {
    signal.SIGILL: "an index lies outside its array",  # how Warp's assertions end
    signal.SIGABRT: "an index lies outside its array",
    signal.SIGTRAP: "an index lies outside its array",
    signal.SIGSEGV: "memory outside all arrays is accessed",
    signal.SIGBUS: "memory outside all arrays is accessed",
    signal.SIGFPE: "an integer is divided by zero",
    signal.SIGKILL: "the check did not end: a loop may run forever",
}


def check(path: str) -> Iterator[Finding]:
    """Yield what is found in a world: one finding for each thing looked at.

    Args:
        path: "FILE.py:ENVIRONMENT" or "rover/complex-1"; the first environment if it has none.

    Raises:
        UsageError: there is no such world, or its file cannot be run.
    """
    entry, environment = resolve(path, is_whole=False)
    ended, last = yield from _in_child(entry.address(environment), {})
    if ended < 0:
        cause = CAUSES.get(signal.Signals(-ended), f"the process ended with signal {-ended}")
        yield Finding("problem", "memory", _place(entry, environment) + cause)
    elif ended > 0:
        yield Finding("problem", "world", f"the check ended with an error: {last}")


def _in_child(path: str, variables: dict[str, str]) -> Generator[Finding, None, tuple[int, str]]:
    """Yield the findings of a child; return its exit code and the last line of its errors."""
    got, put = os.pipe()
    command = [sys.executable, "-m", __name__, path, str(put)]
    with open(got) as lines, tempfile.TemporaryFile("w+") as errors:
        child = subprocess.Popen(
            command,
            pass_fds=[put],
            env=os.environ | variables,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
        )
        os.close(put)
        try:
            yield from _heard(child, lines)
        finally:
            child.kill()
            child.wait()
        errors.seek(0)
        return child.returncode, (errors.read().splitlines() or [""])[-1]


def _heard(child: subprocess.Popen[bytes], lines: IO[str]) -> Iterator[Finding]:
    """Yield what a child writes until it ends; end it if it writes nothing for too long."""
    while True:
        limit = threading.Timer(MOST_SECONDS, child.kill)
        limit.start()
        try:
            line = lines.readline()
        finally:
            limit.cancel()
        if not line:
            child.wait()
            return
        yield Finding(*json.loads(line))


def _place(entry: WorldEntry, environment: str) -> str:
    """Return "FILE:LINE: " of the line that ends the process, nothing if it is not in a file."""
    if not entry.files:
        return ""
    with tempfile.TemporaryDirectory() as folder:
        for k, file in enumerate(map(Path, entry.files)):
            (Path(folder) / file.name).write_text(marked(file.read_text("utf-8"), k), "utf-8")
        marks = Path(folder) / "marks"
        marks.write_bytes(bytes(BYTES))
        copy = f"{folder}/{Path(entry.file).name}:{environment}"
        for _ in _in_child(copy, {MARKS: str(marks)}):
            pass
        found = read_mark(marks)
    if found is None:
        return ""
    name, line = entry.files[found[0]], found[1]
    return f"{name}:{line}: in `{linecache.getline(name, line).strip()}` "


def main(path: str, output: int) -> None:
    """Write the findings of a world as lines of JSON."""
    with os.fdopen(output, "w", buffering=1) as lines:
        for finding in findings(path):
            lines.write(f"{json.dumps([finding.status, finding.topic, finding.text])}\n")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
