"""A run or a shaping, from its files: its progress, its end, and its last generation."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.campaigns.ledger import Entry
from conevo.campaigns.plan import levels_of
from conevo.errors import UsageError
from conevo.numbers import finite
from conevo.runs import locks
from conevo.runs.directory import CONFIG, LOCK, SEAL, SHAPING, kind_of, refuse_unreadable
from conevo.runs.growing import stamp
from conevo.runs.outline import Outline, budget_of, flattened, span
from conevo.runs.progress import Done, seconds_left, share_of
from conevo.runs.provenance import declared
from conevo.runs.run import Run
from conevo.runs.shaping import Shaping
from conevo.runs.store import GENERATIONS, PROVENANCE
from conevo.watch.settings import CODE, FROM, Choices, choices_of
from conevo.watch.tail import Log, Whole, problem_of, readable
from conevo.worlds.measures import Measure

__all__ = ["Subject"]

SHOWN = 2000  # generations of a run in its details, at most
LAST = ("fitness", "best", "specialization", "favourite_share", "sst", "gst")
COLUMN = {"fitness": "team_fitness", "best": "best_fitness"}  # other names in a log


@dataclass(frozen=True)
class Declared:
    """The declarations in a run's files; no world is loaded, so no Python file is executed.

    Attributes:
        outline: its names and length.
        choices: its settings.
        measures: by name; empty for runs of conevo 0.1.0.
        origin: the run whose populations or champion it started with, and their digest, or "".
        codes: every conevo that evolved it.
    """

    outline: Outline
    choices: Choices
    measures: Mapping[str, Measure]
    origin: str
    codes: str

    @staticmethod
    def of(path: Path) -> Declared:
        """Return the declarations in the files of a run.

        Raises:
            UsageError: they are damaged, or have changed since it was started.
        """
        run = Run(path)
        provenance = run.provenance
        codes = [
            f"{one['conevo']} ({one['code']})" for one in provenance["sessions"] if "code" in one
        ]
        return Declared(
            outline=run.outline,
            choices=choices_of(flattened(run.tables())),
            measures=declared(provenance),
            origin=_origin(provenance.get("origin")),
            codes=readable(" + ".join(dict.fromkeys(codes))),
        )


def _origin(origin: Mapping[str, str] | None) -> str:
    if origin is None:
        return ""
    whose = "champion of " if origin.get("of") == "champion" else ""
    return readable(f"{whose}{PurePath(origin['path']).name} ({origin['checkpoint'][:6]})")


class Stage:
    """A run, or a stage of a shaping, that has begun."""

    def __init__(self, path: Path) -> None:
        self.path, self.log = path, Log(path / GENERATIONS)
        files = (path / CONFIG, path / PROVENANCE)
        self._files = Whole(files, lambda: Declared.of(path))
        self.about: Declared | None = None

    def look(self, go_on: Callable[[], bool]) -> None:
        """Read what has changed.

        Raises:
            ConevoError: it is damaged, or cannot be read; of a damaged log its ``problem`` is set.
        """
        self.about = None
        self.about = self._files.read()
        self.log.read(go_on)

    @property
    def done(self) -> Done:
        """Its finished generations and team evaluations."""
        spent = self.log.generations.numbers["team_evaluations"]
        return Done(len(spent), int(spent[-1]) if spent else 0)


class Subject:
    """A run or a shaping that is followed. Generations are counted through a shaping's stages.

    Args:
        label: its name on the page.
        path: its directory.
        about: known before it has begun, from a plan: task, method, preset, seed, variant.

    Attributes:
        version: changes whenever something that is shown does.
        is_behind: whether a part of its logs has not been read yet.
    """

    def __init__(self, label: str, path: Path, about: Mapping[str, Any] | None = None) -> None:
        self.label, self.path = label, path
        self.version = 0
        self.is_behind = False
        self._about, self._is_planned = dict(about or {}), about is not None
        self._kind = ""
        self._shaping: Whole[Shaping] | None = None
        self._outlines: list[Outline] = []
        self._stages: list[Stage] = []
        self._key: tuple[Any, ...] = ()
        self._status, self._reason, self._problem = "pending", "", ""
        self._summary: dict[str, Any] = {}

    # --- looking ----------------------------------------------------------------------------------

    def look(self, entry: Entry | None = None, go_on: Callable[[], bool] = lambda: True) -> None:
        """Read what has changed; an error becomes the run's problem.

        Args:
            entry: its entry in a campaign's ledger.
            go_on: reading of logs continues while it returns true.
        """
        problem = problem_of(lambda: self._read(go_on))
        logs = [stage.log for stage in self._stages]
        self._problem = next(
            (log.problem for log in logs if log.problem),
            problem.replace(readable(f"{self.path}/"), ""),
        )
        self.is_behind = any(log.is_behind for log in logs)
        self._status, self._reason = self._stand(entry)
        key = (
            self._status,
            self._reason,
            self._problem,
            *self._outlines,
            *(stage.about for stage in self._stages),
            *(log.version for log in logs),
        )
        if key != self._key:
            self._key = key
            self.version += 1
            self._summary = {}

    def _read(self, go_on: Callable[[], bool]) -> None:
        if not self._kind or stamp(self.path / (SHAPING if self._shaping else CONFIG)) is None:
            self._kind, self._shaping, self._outlines, self._stages = "", None, [], []
            if self.path.is_symlink():
                raise UsageError("is a link, and links are not followed: watch its target")
            refuse_unreadable(self.path)
            if not (kind := kind_of(self.path)):
                if self._is_planned:
                    return
                raise UsageError("the run has been removed")
            if kind == "campaign":
                raise UsageError("is a campaign, not a run")
            self._kind = kind
            if kind == "shaping":
                self._shaping = Whole((self.path / SHAPING,), lambda: Shaping(self.path))
            else:
                self._stages = [Stage(self.path)]
        self._outlines = []
        if self._shaping is not None:
            self._read_stages(self._shaping)
        for stage in self._stages:
            stage.look(go_on)
        if self._shaping is None and (about := self._stages[0].about) is not None:
            self._outlines = [about.outline]

    def _read_stages(self, file: Whole[Shaping]) -> None:
        """Find the stages that have begun."""
        found = file.read()
        self._outlines = found.outlines if found else []
        del self._stages[len(self._outlines) :]
        for number in range(len(self._stages), len(self._outlines)):
            folder = self.path / f"stage-{number + 1}"
            if folder.is_symlink() or stamp(folder / CONFIG) is None:
                break
            self._stages.append(Stage(folder))

    def _stand(self, entry: Entry | None) -> tuple[str, str]:
        """Return the status, and why a run has failed."""
        if entry is not None and entry.state == "failed":
            return "failed", entry.reason
        if self._problem:
            return "damaged", ""
        if entry is None and self._kind and stamp(self.path / SEAL) is not None:
            return "finished", ""
        if entry is not None and entry.state in ("finished", "running"):
            return entry.state, ""  # running: maybe on another machine
        if self._kind and locks.is_held(self.path / LOCK):
            return "running", ""
        return ("pending" if entry is not None and not self._n_generations else "interrupted"), ""

    # --- what is shown ----------------------------------------------------------------------------

    @property
    def summary(self) -> dict[str, Any]:
        """Its row of the table; the same object until something changes."""
        if not self._summary:
            self._summary = self._about_now() | self._last() | self._prospects()
        return self._summary

    def _about_now(self) -> dict[str, Any]:
        found: dict[str, Any] = {"label": self.label, "path": readable(str(self.path))}
        found |= dict.fromkeys(("variant", "task", "method", "preset"), "") | {"seed": None}
        found |= self._about
        if self._outlines:
            last = self._outlines[-1]
            found |= {"task": span([one.task for one in self._outlines]), "method": last.method}
            found |= {"preset": last.preset, "seed": last.seed}
        return found | {
            "status": self._status,
            "reason": self._reason,
            "problem": self._problem,
            "kind": self._kind or "run",
            "stage": len(self._stages) if self._shaping else 0,
            "n_stages": len(self._outlines) if self._shaping else 0,
        }

    def _last(self) -> dict[str, Any]:
        """Return the last generation; of a shaping that of the last stage that has one."""
        found: dict[str, Any] = {"champion": None, "champion_stage": 0}
        found |= {"performance": {}, "declared": {}, "castes": {}, "favourites": {}}
        found |= dict.fromkeys(LAST)
        if (fittest := self._fittest) is None:
            return found
        number, generation = fittest
        last = self._stages[number].log.generations
        return {
            "champion": generation,
            "champion_stage": number + 1 if self._shaping else 0,
            "performance": {name: finite(c[-1]) for name, c in last.performance.items()},
            "declared": {name: one.about for name, one in self.measures.items()},
            "castes": {name: int(c[-1]) for name, c in last.castes.items() if c[-1] > 0},
            "favourites": {name: int(c[-1]) for name, c in last.favourites.items() if c[-1] > 0},
            **{name: finite(last.numbers[COLUMN.get(name, name)][-1]) for name in LAST},
        }

    def _prospects(self) -> dict[str, Any]:
        """Return its progress, and the time (seconds since 1970) when it will be finished."""
        logs = [stage.log for stage in self._stages]
        done = [stage.done for stage in self._stages]
        share = 1.0 if self._status == "finished" else share_of(self._outlines, done)
        return {
            "generation": self._n_generations,
            "generations": sum(one.generations for one in self._outlines),
            "evaluations": sum(one.evaluations for one in done),
            "budget": budget_of(self._outlines),
            "seconds": round(sum(sum(log.generations.numbers["seconds"]) for log in logs), 1),
            "share": round(share, 4),
            "ends_at": self._ends_at(done),
        }

    def _ends_at(self, done: Sequence[Done]) -> float | None:
        """Return when it will be finished; None if it is not running, or has no generation yet."""
        if self._status != "running" or self._fittest is None:
            return None
        at = self._fittest[0]
        numbers = self._stages[at].log.generations.numbers
        columns = (numbers["seconds"], numbers["team_evaluations"])
        left = seconds_left(self._outlines, done[: at + 1], *columns)
        written = max(stage.log.written for stage in self._stages)
        return round(written + (left if math.isfinite(left) else 0.0), 1)

    @property
    def measures(self) -> Mapping[str, Measure]:
        """The measures that it declares, by name; of a shaping those of its newest stage."""
        return about.measures if (about := self._last_about) else {}

    @property
    def _last_about(self) -> Declared | None:
        return self._stages[-1].about if self._stages else None

    @property
    def apart(self) -> Choices:
        """Its differences from runs of the same names: settings, origin and code.

        In a campaign these are the plan's factors only, not all settings. A shaping has the
        settings of every stage.
        """
        made = []
        if (about := self._last_about) is not None:
            # Each stage of a shaping starts with the populations of the previous one.
            origin = "" if self._shaping else about.origin
            made = [(k, v) for k, v in ((FROM, origin), (CODE, about.codes)) if v]
        if self._is_planned:
            levels = levels_of(str(self._about["variant"])).items()
            return (*((f"plan.{k}", v) for k, v in levels), *made)
        if self._shaping is None:
            return (*(about.choices if about else ()), *made)
        shaping = self._shaping.read() if self._outlines else None
        stages = enumerate(shaping.settings if shaping else (), start=1)
        found = [(f"stage-{n}.{key}", value) for n, one in stages for key, value in choices_of(one)]
        return (("shaping.stages", str(len(self._outlines))), *found, *made)

    @property
    def _n_generations(self) -> int:
        return sum(len(stage.log.generations) for stage in self._stages)

    @property
    def champion(self) -> tuple[Path, int] | None:
        """The directory and the generation of its fittest team so far, None before the first."""
        found = self._fittest
        return None if found is None else (self._stages[found[0]].path, found[1])

    @property
    def _fittest(self) -> tuple[int, int] | None:
        """The stage, from 0, and the generation of the fittest team so far.

        It is the one that the run itself chooses, with the highest mean credit; ties go to the
        earlier. Of a shaping it is that of the last stage that has one.
        """
        for number in reversed(range(len(self._stages))):
            fitness = np.array(self._stages[number].log.generations.numbers["team_fitness"])
            if fitness.size:
                return number, int(np.argmax(np.where(np.isfinite(fitness), fitness, -np.inf)))
        return None

    def curve(self, quantity: str, over: str) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Return x and y [n] of a curve through all stages.

        Args:
            quantity: "performance" (the main measure) or "fitness" (of the fittest team).
            over: "generation" (number finished) or "evaluations" (of teams so far).
        """
        xs, ys, before = [np.zeros(0)], [np.zeros(0)], 0.0
        for stage in self._stages:
            found = stage.log.generations
            if not found:
                break
            x = np.arange(1.0, len(found) + 1)
            if over == "evaluations":
                x = np.array(found.numbers["team_evaluations"])
            main = next(iter(found.performance.values()), array("d", [math.nan]) * len(found))
            xs.append(before + x)
            ys.append(
                np.array(main if quantity == "performance" else found.numbers["team_fitness"])
            )
            before += float(x[-1])
        return np.concatenate(xs), np.concatenate(ys)

    def details(self) -> dict[str, Any]:
        """Return the summary and every generation.

        Of more than ``SHOWN`` generations it returns evenly spaced ones, with the first and last.
        """
        n = self._n_generations
        rows = np.linspace(0, n - 1, min(n, SHOWN)).round().astype(np.int64)
        stages, first = [], 0
        for number, (one, stage) in enumerate(zip(self._outlines, self._stages, strict=False), 1):
            stages.append({"stage": number, "task": one.task, "first": first})
            first += len(stage.log.generations)
        return {
            **self.summary,
            "stages": stages if self._shaping else [],
            "number": rows.tolist(),
            "columns": self._columns("numbers", rows, math.nan),
            "measures": self._columns("performance", rows, math.nan),
            "robots": self._columns("castes", rows, 0.0),
        }

    def _columns(
        self, kind: str, rows: npt.NDArray[np.int64], none: float
    ) -> dict[str, list[float | None]]:
        """Return the columns of all stages at some rows, as JSON has them, to six digits.

        Args:
            kind: attribute of ``Generations``.
            rows: numbers of generations, counted through the stages.
            none: value in the stages that lack a column.
        """
        logs = [stage.log.generations for stage in self._stages]
        columns = {}
        for name in dict.fromkeys(name for log in logs for name in getattr(log, kind)):
            parts = [getattr(log, kind).get(name, [none] * len(log)) for log in logs]
            values = np.concatenate([np.array(part, np.float64) for part in parts])[rows]
            columns[name] = [finite(float(f"{value:.6g}")) for value in values.tolist()]
        return columns
