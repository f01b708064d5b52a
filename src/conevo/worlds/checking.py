"""Check a world in a child process, and explain why that process ended.

An index outside an array ends a process without a message. So the checks run in a child, which
writes a line for each finding. If it dies, a second child runs a copy of the world's file that
marks its lines, and the last mark shows where.
"""

import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Generator, Iterator
from contextlib import suppress
from dataclasses import asdict, astuple
from importlib.metadata import version
from pathlib import Path
from typing import IO, Any

import warp as wp

from conevo.errors import EnvironmentFailure, UsageError
from conevo.kernels import engine
from conevo.terms import quoted
from conevo.worlds.checks import Finding, findings
from conevo.worlds.marking import BYTES, MARKS, marked, read_mark, statement_at
from conevo.worlds.registry import WorldEntry, resolve
from conevo.worlds.simulators import has_own_simulator

__all__ = ["check", "refuse_wild_indices"]

Result = tuple[int | None, str]  # a child's exit status, None if it completed; its last error line

MOST_SECONDS = 120  # between two findings: kernels are compiled
STEP_SECONDS = 20  # after one that is "running": a few scenarios are drawn, or one phase is run
AGAIN_SECONDS = 5  # for the second child of a world that took too long, to see where
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
    """Yield the findings of all checks of a world.

    Args:
        path: "FILE.py:ENVIRONMENT" or "rover/complex-1"; the first environment if it has none.

    Raises:
        UsageError: the world does not exist, or its file cannot be run.
        EnvironmentFailure: the machine failed, for example to keep compiled kernels.
    """
    entry, environment = resolve(path, is_whole=False)
    status, words = yield from _in_child(entry.address(environment), {}, STEP_SECONDS)
    if status is not None and status < 0:
        cause = CAUSES.get(signal.Signals(-status), f"the process ended with signal {-status}")
        yield Finding("problem", "memory", _place(entry, environment) + cause)
    elif status is not None:
        text = f"the process that checked it ended with exit status {status}"
        yield Finding("problem", "world", f"{text}: {words}" if words else text)


def refuse_wild_indices(entry: WorldEntry, environment: str, params: Any) -> None:
    """Refuse a world in a file in which an index lies outside its array, before it is evolved.

    Such an index goes unnoticed in evolution: it spoils results, or ends the process without a
    message. A few short epochs are run as in ``check``, once for each version of the file and its
    parameters. A success is remembered next to the compiled kernels.

    Args:
        entry: of the world.
        environment: its name.
        params: of the world.

    Raises:
        UsageError: the world has such an index.
        EnvironmentFailure: the machine failed.
    """
    if not entry.files or has_own_simulator(entry.world_class):
        return
    given = json.dumps(asdict(params), sort_keys=True, default=str)
    about = "\0".join((version("conevo"), entry.digest, environment, given))
    engine.start()
    name = f"sound-{hashlib.blake2b(about.encode(), digest_size=12).hexdigest()}"
    mark = Path(wp.config.kernel_cache_dir) / name
    if mark.exists():
        return
    address = entry.address(environment)
    found, (status, _) = _whole(_in_child(address, {}, STEP_SECONDS, given))
    if status is None and ("ok", "memory") in [(one.status, one.topic) for one in found]:
        with suppress(OSError):
            mark.touch()
    elif (
        status and -status in CAUSES and -status != signal.SIGKILL
    ):  # else nothing is known, and evolution may start
        place = _place(entry, environment, given) or f"{entry.file}: "
        cause = CAUSES[signal.Signals(-status)]
        raise UsageError(f"{place}{cause}; see also: conevo check {quoted(address)}")


def _whole(steps: Generator[Finding, None, Result]) -> tuple[list[Finding], Result]:
    """Return a child's findings, and how it ended."""
    found = []
    while True:
        try:
            found.append(next(steps))
        except StopIteration as ended:
            return found, ended.value


def _in_child(
    path: str, variables: dict[str, str], seconds: float, given: str = ""
) -> Generator[Finding, None, Result]:
    """Yield the findings of a child.

    Args:
        path: of the world.
        variables: of the environment, in addition to those of this process.
        seconds: the longest time without output.
        given: parameters for a check of indices only, as JSON; "": everything is checked.

    Returns:
        Its exit status, None if it has checked everything, and the last line of its errors.
    """
    got, put = os.pipe()
    command = [sys.executable, "-m", __name__, path, str(put), given]
    with (
        open(got) as lines,
        tempfile.TemporaryFile("w+") as errors,
        tempfile.TemporaryDirectory() as scratch,  # a child that dies leaves Warp's headers there
    ):
        child = subprocess.Popen(
            command,
            pass_fds=[put],
            env=os.environ | variables | {"TMPDIR": scratch},
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
    """Yield the lines of a child until it ends; end it if it writes nothing for too long."""
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


def _place(entry: WorldEntry, environment: str, given: str = "") -> str:
    """Return "FILE:LINE: " of the line that ends the process, nothing if it is not in the file."""
    if not entry.files:
        return ""
    texts = [Path(file).read_text("utf-8") for file in entry.files]
    with tempfile.TemporaryDirectory() as folder:
        for k, (file, text) in enumerate(zip(entry.files, texts, strict=True)):
            (Path(folder) / Path(file).name).write_text(marked(text, k), "utf-8")
        marks = Path(folder) / "marks"
        marks.write_bytes(bytes(BYTES))
        copy = f"{folder}/{Path(entry.file).name}:{environment}"
        _whole(_in_child(copy, {MARKS: str(marks)}, AGAIN_SECONDS, given))
        found = read_mark(marks)
    if found is None:
        return ""
    which, line = found
    return f"{entry.files[which]}:{line}: in `{statement_at(texts[which], line)}` "


def main(path: str, output: int, given: str) -> None:
    """Write the findings of a world as lines of JSON."""
    with os.fdopen(output, "w", buffering=1) as lines:
        try:
            for finding in findings(path, json.loads(given) if given else None):
                lines.write(f"{json.dumps(astuple(finding))}\n")
            lines.write(f"{json.dumps([END, '', ''])}\n")
        except EnvironmentFailure as error:
            lines.write(f"{json.dumps([FAILURE, '', str(error)])}\n")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3])
