"""Which run is meant."""

from __future__ import annotations

from pathlib import Path

from conevo.errors import UsageError, unknown_name
from conevo.runs.run import RUNS, Run
from conevo.runs.store import CONFIG

__all__ = ["find_run", "run_directories"]


def find_run(text: str) -> Run:
    """Return the run at a path, or the only one in runs/ whose name begins with ``text``.

    Raises:
        UsageError: there is no such run, or more than one.
    """
    if Path(text).exists():
        return Run(text)
    names = {path.name: path for path in run_directories(RUNS)}
    matches = [name for name in names if name.startswith(text.removeprefix(f"{RUNS}/"))]
    if len(matches) == 1:
        return Run(names[matches[0]])
    if matches:
        raise UsageError(f"{text!r} may be any of these runs: {', '.join(matches)}")
    raise unknown_name("run", text, names, f"in {RUNS}/")


def run_directories(folder: Path) -> list[Path]:
    """Return the directories in ``folder`` that hold a run, by name."""
    if not folder.is_dir():
        return []
    return sorted(
        path
        for path in folder.iterdir()
        if not path.name.startswith(".") and (path / CONFIG).is_file()
    )
