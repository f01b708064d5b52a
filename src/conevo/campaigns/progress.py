"""The progress of a campaign's runs, from their files alone, and the time until all are finished.

A coordinator knows its own workers only. A SLURM task or a ``conevo resume`` holds the lock of the
run's directory, and every worker writes a line per generation. Some network file systems do not
pass locks on to other machines; then the time of the last line is the only sign of life.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING

from conevo.campaigns.inputs import shown_as
from conevo.campaigns.ledger import Entry
from conevo.campaigns.paths import Paths
from conevo.campaigns.plan import PlannedRun
from conevo.errors import ConevoError
from conevo.evolution.methods.registry import name_in
from conevo.reading import parse_json, read_last_line, read_toml
from conevo.runs.directory import CONFIG, SHAPING
from conevo.runs.outline import Outline, budget_of, outline_of
from conevo.runs.progress import Done, share_of
from conevo.runs.records import Generation
from conevo.runs.store import GENERATIONS

if TYPE_CHECKING:
    from conevo.campaigns.campaign import Campaign

__all__ = ["RunProgress", "cell_text", "cells", "last_written", "progress_of", "remaining_seconds"]


@dataclass(frozen=True)
class RunProgress:
    """The progress of a run or a shaping.

    Attributes:
        generations: finished, of all stages.
        of: planned generations of all stages, 0 if that cannot be read.
        evaluations: of teams so far.
        budget: of team evaluations, 0 if there is none.
        share: of the run that is over, of its generations or of its budget, in [0, 1].
        written: time of its last generation, seconds since 1970; None if there is none.
    """

    generations: int
    of: int
    evaluations: int
    budget: int
    share: float
    written: float | None


def cells(
    planned: Iterable[PlannedRun], entries: Mapping[str, Entry]
) -> dict[str, dict[str, list[Entry]]]:
    """Return the runs of each environment and variant, and of these by method."""
    found: dict[str, dict[str, list[Entry]]] = {}
    for run in planned:
        if run.label in entries:
            row = found.setdefault(f"{shown_as(run.world)} {run.variant}".rstrip(), {})
            row.setdefault(name_in(run.method), []).append(entries[run.label])
    return found


def cell_text(entries: Sequence[Entry]) -> str:
    """Return "3/6" for the finished runs, with running ("+1") and failed ones ("!1")."""
    if not entries:
        return "-"
    found = Counter(entry.state for entry in entries)
    more = f" +{found['running']}" if found["running"] else ""
    failed = f" !{found['failed']}" if found["failed"] else ""
    return f"{found['finished']}/{len(entries)}{more}{failed}"


def last_written(paths: Paths, label: str) -> float | None:
    """Return when the log of a run, or of a shaping's newest stage, was last written.

    In seconds since 1970, by the clock of the machine that wrote it; None without a log.
    """
    run = paths.run(label)
    found: list[float] = []
    for path in (run / GENERATIONS, *run.glob(f"stage-*/{GENERATIONS}")):
        with suppress(OSError):
            if (about := path.stat()).st_size:
                found.append(about.st_mtime)
    return max(found, default=None)


def progress_of(paths: Paths, planned: PlannedRun) -> RunProgress:
    """Return the progress of a run; missing or damaged files count as no progress."""
    outlines = _outlines(paths.run(planned.label), planned.in_stages)
    done: list[Done] = []
    written: list[float] = []
    for name in (part for parts in planned.courses.values() for part in parts):
        *found, at = _last_generation(paths.run(name) / GENERATIONS)
        if at is None:
            break
        done.append(Done(*found))
        written.append(at)
    return RunProgress(
        generations=sum(one.generations for one in done),
        of=sum(outline.generations for outline in outlines),
        evaluations=sum(one.evaluations for one in done),
        budget=budget_of(outlines),
        share=share_of(outlines, done),
        written=max(written, default=None),
    )


def _outlines(path: Path, in_stages: bool) -> list[Outline]:
    """Return the outline of a run, or of each stage; none if that cannot be read."""
    try:
        tables = read_toml(path / (SHAPING if in_stages else CONFIG))
        return [outline_of(stage) for stage in (tables["stages"] if in_stages else [tables])]
    except (ConevoError, KeyError, TypeError):
        return []


def _last_generation(path: Path) -> tuple[int, int, float | None]:
    """Return a log's number of generations, their evaluations, and when it was written."""
    try:
        line = read_last_line(path)
        if not line:
            return 0, 0, None
        record = parse_json(line, str(path), Generation)
        return record["generation"] + 1, record["team_evaluations"], path.stat().st_mtime
    except (ConevoError, OSError):
        return 0, 0, None


def remaining_seconds(
    campaign: Campaign, entries: Mapping[str, Entry], cores: int, at: float
) -> float | None:
    """Return the seconds until the last run is finished; None if that cannot be estimated yet.

    A run is expected to take the mean core seconds of the finished runs of its cell, else of its
    world, else of all; while none is finished, of the running ones, judged by their progress.

    Args:
        campaign: that the runs are of.
        entries: their states.
        cores: that execute them together.
        at: the present time, seconds since 1970.
    """
    planned = campaign.planned
    spent = {k: one.core_seconds for k, one in entries.items() if one.state == "finished"}
    if not any(spent.values()):
        for label, entry in entries.items():
            if entry.state == "running" and (passed := _passed(entry, at)) > 0:
                share = progress_of(campaign.paths, planned[label]).share
                spent[label] = passed / share if share > 0 else 0.0
    known: dict[tuple[str, ...], list[float]] = defaultdict(list)
    for label, seconds in spent.items():
        for key in _keys(campaign, label) if seconds > 0 else ():
            known[key].append(seconds)
    left = 0.0
    for label, entry in entries.items():
        if label not in planned or entry.state not in ("pending", "running"):
            continue
        costs = next((known[key] for key in _keys(campaign, label) if key in known), None)
        if costs is None:
            return None
        passed = _passed(entry, at) if entry.state == "running" else 0.0
        left += max(fmean(costs) - passed, 0.0)
    longest = max((e.threads for e in entries.values() if e.state == "running"), default=1)
    return left / max(cores, longest, 1)


def _keys(campaign: Campaign, label: str) -> list[tuple[str, ...]]:
    """Return the groups of similar runs that a run belongs to, the most similar first."""
    run = campaign.planned[label]
    return [(run.world, run.method, run.variant), (run.world.partition("/")[0],), ()]


def _passed(entry: Entry, at: float) -> float:
    """Return the core seconds that an attempt has used."""
    return max(at - (entry.began or at), 0.0) * entry.threads
