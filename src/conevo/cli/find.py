"""Which run is meant, or which shaping."""

from __future__ import annotations

from pathlib import Path

from conevo.errors import UsageError, unknown_name
from conevo.runs.directory import kind_of
from conevo.runs.run import RUNS, Run
from conevo.runs.shaping import Shaping

__all__ = ["directories", "find", "find_run", "find_shaping"]


def find(text: str) -> Run | Shaping:
    """Return what is at a path, or the only thing in runs/ whose name begins with ``text``.

    Raises:
        UsageError: there is no such run or shaping, or more than one.
    """
    if Path(text).exists():
        return _open(Path(text))
    names = {path.name: path for path in directories(RUNS)}
    matches = [name for name in names if name.startswith(text.removeprefix(f"{RUNS}/"))]
    if len(matches) == 1:
        return _open(names[matches[0]])
    if matches:
        raise UsageError(f"{text!r} may be any of these runs: {', '.join(matches)}")
    raise unknown_name("run", text, names, f"in {RUNS}/")


def find_run(text: str) -> Run:
    """Return the run that is meant; of a shaping its last stage that has a team.

    Raises:
        UsageError: there is no such run, more than one, or no stage that has begun.
    """
    found = find(text)
    if isinstance(found, Run):
        return found
    stages = [stage for stage in found.stages if stage.champion is not None]
    if not stages:
        raise UsageError(f"{found.path} has no finished generation yet")
    return stages[-1]


def find_shaping(text: str) -> Shaping:
    """Return the shaping that is meant.

    Raises:
        UsageError: there is no such shaping, more than one, or it is a run.
    """
    found = find(text)
    if isinstance(found, Run):
        raise UsageError(f"{found.path} is a run, and only a shaping has stages")
    return found


def directories(folder: Path) -> list[Path]:
    """Return the directories in ``folder`` that hold a run or a shaping, by name."""
    if not folder.is_dir():
        return []
    return sorted(
        path for path in folder.iterdir() if not path.name.startswith(".") and kind_of(path)
    )


def _open(path: Path) -> Run | Shaping:
    return Shaping(path) if kind_of(path) == "shaping" else Run(path)
