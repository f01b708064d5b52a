"""Streams of a command that a shell closes, cuts off, or cannot encode."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from runs.tiny import command


def shell(line: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a line of bash in which $CONEVO is the command."""
    return subprocess.run(
        ["bash", "-c", line],
        cwd=folder,
        env=os.environ | {"CONEVO": f"{sys.executable} -m conevo"} | environment,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )


def test_a_reader_that_stops_is_not_an_error(tmp_path: Path) -> None:
    done = shell('$CONEVO list worlds | true; exit "${PIPESTATUS[0]}"', tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


def test_output_that_does_not_fit_its_disk_is_named(tmp_path: Path) -> None:
    done = shell("$CONEVO list worlds > /dev/full", tmp_path)
    assert done.returncode == 3
    assert done.stderr == "conevo: error: standard output: No space left on device\n"


@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_closed_streams_do_not_end_a_run(tmp_path: Path, closed: str) -> None:
    words = " ".join(command(Path("run"), "cone", run__generations=1))
    done = shell(f"$CONEVO {words} --threads 1 {closed}", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "run" / "DONE").is_file()


def test_letters_missing_from_the_terminals_encoding_are_escaped(tmp_path: Path) -> None:
    words = " ".join(command(Path("日本"), "cone", run__generations=1))
    for line in (f"$CONEVO {words} --threads 1", "$CONEVO show 日本", "$CONEVO list runs ."):
        done = shell(line, tmp_path, PYTHONIOENCODING="latin-1")
        assert (done.returncode, done.stderr) == (0, "")
        assert r"\u65e5\u672c" in done.stdout
    refused = shell("$CONEVO show 日", tmp_path, PYTHONIOENCODING="latin-1")
    assert refused.returncode == 2
    assert refused.stderr.startswith(r"conevo: error: unknown run '\u65e5'")


def test_an_accented_path_works_in_the_locale_c(tmp_path: Path) -> None:
    bare = {"LC_ALL": "C", "LANG": "", "PYTHONIOENCODING": ""}
    words = " ".join(command(Path("café"), "cone", run__generations=1))
    for line, code in ((f"$CONEVO {words} --threads 1", 0), ("$CONEVO show café", 0),
                       ("$CONEVO list runs .", 0), ("$CONEVO show cafe", 2)):  # fmt: skip
        done = shell(line, tmp_path, **bare)
        assert done.returncode == code, done.stderr
        assert done.stderr.count("\n") == (code == 2)
        assert "caf" in done.stdout + done.stderr
    done = shell("$CONEVO show café", tmp_path, PYTHONUTF8="0", **bare)
    assert done.returncode == 2
    assert done.stderr.endswith("and the locale's encoding here is ascii; set PYTHONUTF8=1\n")


def test_a_name_that_is_not_utf_8_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    words = " ".join(command(Path("run"), "cone"))
    done = shell(f"$CONEVO {words} --out $'x\\xff'", tmp_path)
    assert done.returncode == 2
    assert "is not valid UTF-8" in done.stderr
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_command_alone_prints_its_help(say) -> None:
    for words in ((), ("campaign",)):
        said = say(*words)
        assert (said.code, said.err) == (0, "")
        assert said.out.startswith("Usage: conevo")


def test_a_run_whose_reader_stops_is_interrupted_with_a_message(tmp_path: Path) -> None:
    words = " ".join(command(Path("run"), "cone", run__generations=4000))
    done = shell(f'$CONEVO {words} --verbose | head -3; exit "${{PIPESTATUS[0]}}"', tmp_path)
    assert done.returncode == 130
    assert done.stderr.startswith("interrupted after ")
    assert done.stderr.endswith("continue with: conevo resume run\n")
    assert done.stderr.count("\n") == 1
