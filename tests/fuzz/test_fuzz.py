"""Any file damaged in any way, read by any command that reads it: one line, and nothing changed."""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import shutil
import signal
import sys
import traceback
import warnings
from pathlib import Path

import pytest

from conevo.cli.main import main
from conevo.errors import ConevoError
from fuzz.damages import damage
from fuzz.house import READERS, build, find

MOST_SECONDS = 20
LOOKED_AT = {"lock", "ledger.sqlite", "ledger.sqlite-journal"}  # may be written by reading commands
CASES = [(name, command) for name, commands in READERS.items() for command in commands]
ROUNDS = int(os.environ.get("CONEVO_FUZZ_ROUNDS", "12"))  # of the exhaustive test


class TooSlow(BaseException):
    """A command that took too long."""


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one of everything."""
    folder = tmp_path_factory.mktemp("fuzz") / "house"
    folder.mkdir()
    build(folder)
    return folder


def call(command: str, folder: Path) -> tuple[int, str, str]:
    """Return exit code, output and errors of a command in a folder; a traceback is code 70."""
    words = [word.replace("+", " ") for word in command.split()]
    if words[0] == "NOTABLES":
        shutil.rmtree(folder / "tiny" / "tables", ignore_errors=True)
        words = words[1:]
    out, err, here = io.StringIO(), io.StringIO(), Path.cwd()

    def too_slow(*_: object) -> None:
        raise TooSlow

    os.chdir(folder)
    before = [signal.signal(one, too_slow) for one in (signal.SIGPROF, signal.SIGALRM)]
    signal.setitimer(signal.ITIMER_PROF, MOST_SECONDS)  # of processor time, whatever the load
    signal.alarm(6 * MOST_SECONDS)  # a command that waits forever uses none
    code = 0
    try:
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("error", RuntimeWarning)
            if words[0] == "WATCH":
                code = watch(folder / words[1])
            elif words[0] == "TRACK":
                code = track(folder / words[1])
            else:
                sys.argv = ["conevo", *words]
                main(words)
    except SystemExit as ending:
        code = int(ending.code or 0)
    except BaseException:
        code = 70
        err.write(traceback.format_exc())
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        for one, handler in zip((signal.SIGPROF, signal.SIGALRM), before, strict=True):
            signal.signal(one, handler)
        os.chdir(here)
    return code, out.getvalue(), err.getvalue()


def track(path: Path) -> int:
    """Read all rows as a tracker does, without one."""
    from conevo.campaigns.campaign import Campaign
    from conevo.runs.directory import kind_of
    from conevo.track.series import Series

    try:
        runs = [path]
        if kind_of(path) == "campaign":
            campaign = Campaign(path)
            runs = [campaign.paths.run(label) for label in campaign.planned]
        for run in runs:
            series = Series(run)
            rows = series.read()
            json.dumps([[row.step, dict(row.values)] for row in rows], allow_nan=False)
            json.dumps([series.about.settings, series.test()])
    except ConevoError as error:
        sys.stderr.write(f"conevo: error: {error}\n")
        return error.exit_code
    return 0


def watch(path: Path) -> int:
    """Read a folder as the live page does."""
    from conevo.watch.state import Watched

    try:
        watched = Watched([path])
        state = watched.snapshot()
        for label in list(watched.labels):
            json.dumps(watched.details(label), allow_nan=False)
        json.dumps(state, allow_nan=False)
    except ConevoError as error:
        sys.stderr.write(f"conevo: error: {error}\n")
        return error.exit_code
    return 0


def tree(folder: Path) -> dict[str, tuple[int, int]]:
    """Return the contents of a folder: size and modification time of every file."""
    found = {}
    for root, folders, files in os.walk(folder):
        for name in (*folders, *files):
            about = os.lstat(Path(root) / name)
            is_file = name not in folders
            if name not in LOOKED_AT:
                key = os.path.relpath(Path(root) / name, folder)
                found[key] = (about.st_size, about.st_mtime_ns) if is_file else (0, 0)
    return found


def problem(name: str, command: str, seed: int, house: Path, work: Path) -> str:
    """Damage a file, let a command read it, and return the problem, empty if all is well."""
    rng = random.Random(f"{name} {command} {seed}")
    shutil.copytree(house, work, symlinks=True)
    try:
        path = find(work, name)
        others = [find(work, other) for other in READERS]
        done = damage(path, rng, others)
        before = tree(work)
        code, _, err = call(command, work)
        lines = [line for line in err.splitlines() if not line.startswith("conevo: note: ")]
        wrong = ""
        if code == 70 or "Traceback" in err:
            wrong = f"a traceback: {err[-700:]}"
        elif code not in (0, 1, 2, 3):
            wrong = f"exit code {code}"
        elif code in (2, 3):
            if len(lines) != 1 or not lines[0].startswith("conevo: error: "):
                wrong = f"not one line: {err!r}"
            elif len(lines[0]) > 1500:
                wrong = f"a line of {len(lines[0])} letters"
            elif not command.startswith("NOTABLES") and tree(work) != before:
                changed = {k for k, _ in tree(work).items() ^ before.items()}
                if not all(one.startswith(("tiny/tables", "tiny/.")) for one in changed):
                    wrong = f"refused ({lines[0]}) and yet changed: {sorted(changed)[:5]}"
        return f"{name} ({done}), {command!r}, seed {seed}: {wrong}" if wrong else ""
    finally:
        shutil.rmtree(work, ignore_errors=True)


def test_a_sample_of_damages_is_one_line_each(house: Path, tmp_path: Path) -> None:
    quick = [case for case in CASES if "report" not in case[1]]  # which takes seconds each time
    chosen = random.Random(1).sample(quick, 40)
    found = [problem(*case, 0, house, tmp_path / "work") for case in chosen]
    assert [one for one in found if one] == []


@pytest.mark.slow
@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(1, 1 + ROUNDS))
def test_every_file_damaged_is_one_line_for_every_reader(
    seed: int, house: Path, tmp_path: Path
) -> None:
    found = [problem(*case, seed, house, tmp_path / "work") for case in CASES]
    assert [one for one in found if one] == []
