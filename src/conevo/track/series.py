"""The generations of a run or a shaping as rows of plain numbers, read while they are written."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from conevo.errors import UsageError
from conevo.runs import locks
from conevo.runs.directory import CONFIG, LOCK, SEAL, kind_of
from conevo.runs.growing import GrowingLog, stamp
from conevo.runs.outline import flattened, span
from conevo.runs.run import Run
from conevo.runs.shaping import Shaping
from conevo.runs.store import GENERATIONS
from conevo.terms import NON_SPECIALIZED
from conevo.typing import Record

__all__ = ["RunProfile", "Row", "Series"]


@dataclass(frozen=True)
class Row:
    """The numbers of one generation.

    Attributes:
        step: team-steps spent until its end, through all stages of a shaping.
        at: time of its end, seconds since 1970: the run's start and the computing time since, so
            that it is the same whenever the row is read.
        values: finite numbers by name; "performance/value" is the measure ``value``.
    """

    step: int
    at: float
    values: Mapping[str, float]


@dataclass(frozen=True)
class RunProfile:
    """The properties of a run that trackers show.

    Attributes:
        id: twelve hex digits that differ between runs of other settings, origin or code. A run
            keeps its id when it is extended, and a copy has the same one.
        name: of its directory.
        group: the campaign it belongs to, "" without one.
        tags: task, method, preset and seed.
        settings: every setting by its name, "method.gst".
        started: seconds since 1970.
        castes: names, of which a generation without robots counts 0.
    """

    id: str
    name: str
    group: str
    tags: Mapping[str, str]
    settings: Mapping[str, Any]
    started: float
    castes: tuple[str, ...]


class Series:
    """The rows of a run or a shaping, finished or not.

    Args:
        path: its directory.
        group: name of its campaign, "" without one.

    Raises:
        UsageError: neither is there, or it is damaged.
        EnvironmentFailure: it cannot be read.
    """

    def __init__(self, path: Path, group: str = "") -> None:
        self.path, self._group = path, group
        self._is_shaping = kind_of(path) == "shaping"
        self._logs: list[_Log] = []
        self._versions: list[int] = []
        self._returned = 0  # generations
        self._inode = path.stat().st_ino if path.is_dir() else 0
        _ = Shaping(path) if self._is_shaping else Run(path)

    @cached_property
    def about(self) -> RunProfile:
        """Its properties; those of a shaping are known when its first stage has begun."""
        make = _about_shaping if self._is_shaping else _about_run
        return make(self.path, self._group)

    @property
    def is_finished(self) -> bool:
        """Whether it is sealed."""
        return stamp(self.path / SEAL) is not None

    @property
    def is_written(self) -> bool:
        """Whether a process is writing it now."""
        return any(locks.is_held(path / LOCK) for path in (self.path, *self._folders()))

    def read(self) -> list[Row]:
        """Return the rows of the generations that have finished since the last time.

        Generations that a resumed run repeats are not returned again.

        Raises:
            UsageError: it was removed or replaced, or its log is damaged after the rows returned.
            EnvironmentFailure: it cannot be read.
        """
        self._refuse_other()
        for folder in self._folders()[len(self._logs) :]:
            self._logs.append(_Log(folder / GENERATIONS))
        for log in self._logs:
            log.read()
        before, self._versions = self._versions, [log.version for log in self._logs]
        found = self._new_rows() if self._versions != before else []
        problem = next((log.problem for log in self._logs if log.problem), "")
        if problem and not found:
            raise UsageError(f"{self.path}: {problem}")
        return found

    def _new_rows(self) -> list[Row]:
        found: list[Row] = []
        number = step = 0
        at = self.about.started
        for stage, log in enumerate(self._logs, start=1):
            for record in log.records:
                at += record["seconds"]
                if number >= self._returned:
                    counts = {"generation": number} | ({"stage": stage} if self._is_shaping else {})
                    values = counts | _numbers(record, self.about.castes)
                    found.append(Row(step + record["team_steps"], at, values))
                number += 1
            step += log.records[-1]["team_steps"] if log.records else 0
        self._returned = max(self._returned, number)
        return found

    def test(self) -> dict[str, float]:
        """Return the means of the champion's testing phase by name, none before its end.

        Raises:
            UsageError: the testing phase is damaged.
        """
        folders = self._folders()
        tested = Run(folders[-1]).test_result if folders else None
        if tested is None:
            return {}
        champion = tested["champion"]
        spreads = {"fitness": champion["fitness"]} | champion["performance"]
        means = {f"test/{name}": spread["mean"] for name, spread in spreads.items()}
        return {name: float(mean) for name, mean in means.items() if mean is not None}

    def _refuse_other(self) -> None:
        """Raise UsageError if the directory is gone, or is another one by now."""
        try:
            inode = self.path.stat().st_ino
        except OSError:
            inode = 0
        if inode != self._inode or not kind_of(self.path):
            how = "replaced by another" if inode else "removed"
            raise UsageError(f"{self.path} was {how} while it was read")

    def _folders(self) -> list[Path]:
        """Return the directory of a run, or those of a shaping's stages that have begun."""
        if not self._is_shaping:
            return [self.path]
        found: list[Path] = []
        while stamp((folder := self.path / f"stage-{len(found) + 1}") / CONFIG) is not None:
            found.append(folder)
        return found


class _Log(GrowingLog):
    """All records of a log: they are few and small next to a tracker's own memory."""

    records: list[Record]

    def clear(self) -> None:
        self.records = []

    def add(self, record: Record) -> None:
        self.records.append(record)


def _about_run(path: Path, group: str) -> RunProfile:
    run = Run(path)
    about, outline = run.provenance, run.outline
    origin = about.get("origin", {}).get("checkpoint", "")
    parts = [about.get("stem_id", about["run_id"]), origin, about.get("code", "")]
    return RunProfile(
        id=_digest(parts),
        name=path.resolve().name,
        group=group,
        tags=_tags(outline.task, outline.method, outline.preset, outline.seed),
        settings=flattened(run.tables()),
        started=_seconds(about["created"]),
        castes=_castes(about),
    )


def _about_shaping(path: Path, group: str) -> RunProfile:
    shaping = Shaping(path)
    last, about = shaping.outlines[-1], Run(path / "stage-1").provenance
    settings = enumerate(shaping.settings, start=1)
    return RunProfile(
        id=_digest([*shaping.run_ids, about.get("code", "")]),
        name=path.resolve().name,
        group=group,
        tags=_tags(span(shaping.tasks), last.method, last.preset, last.seed),
        settings={f"stage-{n}.{key}": value for n, one in settings for key, value in one.items()},
        started=_seconds(about["created"]),
        castes=_castes(about),
    )


def _digest(parts: list[str]) -> str:
    return hashlib.blake2b(json.dumps(parts).encode(), digest_size=6).hexdigest()


def _tags(task: str, method: str, preset: str, seed: int) -> dict[str, str]:
    return {"task": task, "method": method, "preset": preset, "seed": str(seed)}


def _castes(provenance: Record) -> tuple[str, ...]:
    return (*provenance.get("world", {}).get("castes", ()), NON_SPECIALIZED)


def _seconds(text: str) -> float:
    """Return a time as seconds since 1970, 0 if it is not one."""
    try:
        return datetime.fromisoformat(text).timestamp()
    except ValueError:
        return 0.0


def _numbers(record: Record, castes: tuple[str, ...]) -> dict[str, float]:
    """Return the finite numbers of a record by name, without those that ``Row`` has itself."""
    sizes = record["n_hidden"]
    rest = {k: v for k, v in record.items() if k not in ("generation", "n_hidden")}
    robots = dict.fromkeys(castes, 0) | record["castes"]
    found = _flat(rest | {"castes": robots, "n_hidden": sum(sizes) / len(sizes)})
    return {name: float(value) for name, value in found.items() if _is_number(value)}


def _flat(record: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in record.items():
        key = f"{prefix}{name}"
        found |= _flat(value, f"{key}/") if isinstance(value, dict) else {key: value}
    return found


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
