"""How far a run of a campaign is, by its files alone, whoever carries it out and wherever.

A coordinator knows its own workers only. A SLURM task or a ``conevo resume`` holds the lock of the
run's directory, and every worker writes a line per generation. On network file systems that do not
pass locks on to other machines, the time of the last line is all that can be known of theirs.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from conevo.campaigns.places import Places
from conevo.campaigns.plan import PlannedRun
from conevo.errors import ConevoError
from conevo.reading import parse_json, read_last_line, read_toml
from conevo.runs import locks
from conevo.runs.directory import CONFIG, LOCK, SHAPING
from conevo.runs.store import GENERATIONS

__all__ = ["RunProgress", "is_held", "last_written", "progress_of"]


@dataclass(frozen=True)
class RunProgress:
    """How far a run or a shaping is.

    Attributes:
        generations: done, of all stages.
        of: planned generations of all stages, 0 if that cannot be read.
        evaluations: of teams so far.
        budget: of team evaluations, 0 if there is none.
        share: of the run that is over, of its generations or of its budget, in [0, 1].
        written: when its last generation was written, seconds since 1970; None if none was.
    """

    generations: int
    of: int
    evaluations: int
    budget: int
    share: float
    written: float | None


def is_held(places: Places, label: str) -> bool:
    """Whether a process that this machine knows of holds a run."""
    return locks.is_held(places.run(label) / LOCK)


def last_written(places: Places, label: str) -> float | None:
    """Return when the log of a run, or of a shaping's newest stage, was last written.

    Seconds since 1970, by the clock of the machine that wrote it; None if nothing was.
    """
    run = places.run(label)
    found: list[float] = []
    for path in (run / GENERATIONS, *run.glob(f"stage-*/{GENERATIONS}")):
        with suppress(OSError):
            if (about := path.stat()).st_size:
                found.append(about.st_mtime)
    return max(found, default=None)


def progress_of(places: Places, planned: PlannedRun) -> RunProgress:
    """Return how far a run is; what is missing or damaged counts as not done."""
    lengths = _lengths(places.run(planned.label), planned.in_stages)
    done, spent, share = 0, 0, 0.0
    written: list[float] = []
    names = [part for parts in planned.courses.values() for part in parts]
    for k, name in enumerate(names):
        generations, evaluations, at = _last_generation(places.run(name) / GENERATIONS)
        if at is None:
            break
        written.append(at)
        done, spent = done + generations, spent + evaluations
        if k < len(lengths):
            planned_generations, budget = lengths[k]
            over = generations / planned_generations
            share += min(max(over, evaluations / budget if budget else 0.0), 1.0)
    budgets = [budget for _, budget in lengths]
    return RunProgress(
        generations=done,
        of=sum(length for length, _ in lengths),
        evaluations=spent,
        budget=sum(budgets) if all(budgets) else 0,
        share=share / len(names),
        written=max(written, default=None),
    )


def _lengths(path: Path, in_stages: bool) -> list[tuple[int, int]]:
    """Return the generations and the budget of a run, or of each stage; none if unreadable."""
    try:
        tables = read_toml(path / (SHAPING if in_stages else CONFIG))
        runs = [stage["run"] for stage in (tables["stages"] if in_stages else [tables])]
        found = [(int(run["generations"]), int(run["budget_evaluations"])) for run in runs]
    except (ConevoError, KeyError, TypeError, ValueError):
        return []
    return found if all(n >= 1 and budget >= 0 for n, budget in found) else []


def _last_generation(path: Path) -> tuple[int, int, float | None]:
    """Return how many generations a log has, their evaluations, and when it was written."""
    try:
        line = read_last_line(path)
        if not line:
            return 0, 0, None
        record = parse_json(line, str(path))
        return int(record["generation"]) + 1, int(record["team_evaluations"]), path.stat().st_mtime
    except (ConevoError, OSError, KeyError, TypeError, ValueError):
        return 0, 0, None
