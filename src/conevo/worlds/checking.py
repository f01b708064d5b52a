"""Check a world in a process of its own, and explain what ends that process.

An index outside an array ends a process without a word. So the checks run in a child, which writes
a line for each finding; if it dies, a second child runs a copy of the world's file that marks its
lines, and the last mark shows where.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Generator, Iterator
from dataclasses import astuple
from pathlib import Path
from typing import IO, Any

from conevo.errors import EnvironmentFailure
from conevo.worlds.checks import Finding, findings
from conevo.worlds.marking import BYTES, MARKS, marked, read_mark, statement_at
from conevo.worlds.registry import WorldEntry, resolve

__all__ = ["check"]

MOST_SECONDS = 120  # between two findings: kernels are compiled
STEP_SECONDS = 20  # after one that is "running": a few scenarios are drawn, or one phase is run
AGAIN_SECONDS = 5  # of a world that took too long, to see where
END, FAILURE = "end", "failure"  # in place of findings: all has been checked; the machine failed
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
        EnvironmentFailure: the machine failed, as where compiled kernels cannot be kept.
    """
    entry, environment = resolve(path, is_whole=False)
    status, words = yield from _in_child(entry.address(environment), {}, STEP_SECONDS)
    if status is not None and status < 0:
        cause = CAUSES.get(signal.Signals(-status), f"the process ended with signal {-status}")
        yield Finding("problem", "memory", _place(entry, environment) + cause)
    elif status is not None:
        text = f"the process that checked it ended with exit status {status}"
        yield Finding("problem", "world", f"{text}: {words}" if words else text)


def _in_child(
    path: str, variables: dict[str, str], seconds: float
) -> Generator[Finding, None, tuple[int | None, str]]:
    """Yield the findings of a child; ``seconds`` is how long it may run without a sign of life.

    Returns:
        Its exit status, None if it has checked all, and the last line of its errors.
    """
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
        has_ended = False
        try:
            for status, topic, text in _heard(child, lines, seconds):
                if status == FAILURE:
                    raise EnvironmentFailure(text)
                if status == END:
                    has_ended = True
                elif status != "running":
                    yield Finding(status, topic, text)
        finally:
            child.kill()
            child.wait()
        errors.seek(0)
        last = (errors.read().splitlines() or [""])[-1]
        return None if has_ended else child.returncode, last


def _heard(child: subprocess.Popen[bytes], lines: IO[str], seconds: float) -> Iterator[list[Any]]:
    """Yield what a child writes until it ends; end it if it writes nothing for too long."""
    limit: float = MOST_SECONDS
    while True:
        timer = threading.Timer(limit, child.kill)
        timer.start()
        try:
            line = lines.readline()
        finally:
            timer.cancel()
        if not line:
            child.wait()
            return
        said = json.loads(line)
        limit = seconds if said[0] == "running" else MOST_SECONDS
        yield said


def _place(entry: WorldEntry, environment: str) -> str:
    """Return "FILE:LINE: " of the line that ends the process, nothing if it is not in a file."""
    if not entry.files:
        return ""
    texts = [Path(file).read_text("utf-8") for file in entry.files]
    with tempfile.TemporaryDirectory() as folder:
        for k, (file, text) in enumerate(zip(entry.files, texts, strict=True)):
            (Path(folder) / Path(file).name).write_text(marked(text, k), "utf-8")
        marks = Path(folder) / "marks"
        marks.write_bytes(bytes(BYTES))
        copy = f"{folder}/{Path(entry.file).name}:{environment}"
        for _ in _in_child(copy, {MARKS: str(marks)}, AGAIN_SECONDS):
            pass
        found = read_mark(marks)
    if found is None:
        return ""
    which, line = found
    return f"{entry.files[which]}:{line}: in `{statement_at(texts[which], line)}` "


def main(path: str, output: int) -> None:
    """Write the findings of a world as lines of JSON."""
    with os.fdopen(output, "w", buffering=1) as lines:
        try:
            for finding in findings(path):
                lines.write(f"{json.dumps(astuple(finding))}\n")
            lines.write(f"{json.dumps([END, '', ''])}\n")
        except EnvironmentFailure as error:
            lines.write(f"{json.dumps([FAILURE, '', str(error)])}\n")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
