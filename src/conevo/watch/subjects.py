"""A run or a shaping as it stands by its files: how far, until when, and what it came to."""

from __future__ import annotations

import math
import re
import tomllib
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import ConevoError, UsageError
from conevo.evolution.methods.registry import name_in
from conevo.runs.directory import CONFIG, LOCK, SEAL, SHAPING, kind_of
from conevo.watch.declared import NOTHING, Declaration, Declared
from conevo.watch.settings import CODE, FROM, Choices, choices_of, factors
from conevo.watch.tail import Log, Whole, is_locked, readable, stamp
from conevo.worlds.measures import Measure

__all__ = ["Settings", "Standing", "Subject", "plain", "span"]

RECENT = 10  # generations by which the pace is judged
SHOWN = 2000  # generations of a run in its details, at most


@dataclass(frozen=True)
class Settings:
    """What a run was started with, as far as it is shown.

    The file is read as it stands and no world is loaded, so that following a run never runs the
    Python file of a world outside the package.
    """

    task: str
    method: str
    preset: str
    seed: int
    generations: int
    budget: int
    choices: Choices = ()

    @staticmethod
    def of(tables: Mapping[str, Any]) -> Settings:
        """Return the settings in the tables of a configuration.

        Raises:
            KeyError, TypeError: something is missing or not what it should be.
        """
        run = tables["run"]
        texts = [run[name] for name in ("world", "method", "preset")]
        numbers = [run[name] for name in ("seed", "generations", "budget_evaluations")]
        if not all(isinstance(text, str) for text in texts):
            raise TypeError("[run] names must be texts")
        if not all(type(number) is int and 0 <= number < 2**63 for number in numbers):
            raise TypeError("[run] numbers must be whole numbers from 0 on")
        if not numbers[1]:
            raise TypeError("[run] a run has one generation at least")
        return Settings(
            task=texts[0].rpartition("/")[2] if ".py:" in texts[0] else texts[0],
            method=name_in(texts[1]),
            preset=texts[2],
            seed=numbers[0],
            generations=numbers[1],
            budget=numbers[2],
            choices=choices_of(tables),
        )


@dataclass(frozen=True)
class Standing:
    """How a run stands in what it belongs to, if something besides its own files knows.

    state: "pending", "running", "finished" or "failed". reason: why it failed.
    """

    state: str
    reason: str = ""


class Subject:
    """A run or a shaping that is followed. A shaping's stages are numbered through.

    Args:
        label: its name on the page.
        path: its directory.
        about: what is known before it has begun: task, method, seed, variant.

    Attributes:
        version: changes whenever something that is shown does.
    """

    def __init__(self, label: str, path: Path, about: Mapping[str, Any] | None = None) -> None:
        self.label, self.path = label, path
        self.version = 0
        self.is_behind = False
        self._about, self._is_planned = dict(about or {}), about is not None
        self._kind = ""
        self._config: Whole[list[Settings]] | None = None
        self._settings: list[Settings] = []
        self._logs: list[Log] = []
        self._declared: Declared | None = None
        self._key: tuple[Any, ...] = ()
        self._status, self._reason, self._problem = "pending", "", ""
        self._summary: dict[str, Any] = {}

    # --- looking ----------------------------------------------------------------------------------

    def look(
        self, standing: Standing | None = None, go_on: Callable[[], bool] = lambda: True
    ) -> None:
        """Read what has changed; whatever is wrong becomes the run's problem.

        Args:
            standing: what a campaign's ledger says.
            go_on: asked before each further piece of a log.
        """
        self._problem = ""
        try:
            self._read(go_on)
        except ConevoError as error:
            self._problem = readable(str(error))
        except OSError as error:
            self._problem = f"cannot be read: {error.strerror}"
        except Exception as error:  # whatever the files hold: all others are shown
            self._problem = readable(f"is damaged: {' '.join(repr(error).split())[:200]}")
        self._problem = next((log.problem for log in self._logs if log.problem), self._problem)
        self.is_behind = any(log.is_behind for log in self._logs)
        self._status, self._reason = self._stand(standing)
        key = (
            self._status,
            self._reason,
            self._problem,
            tuple(self._settings),
            *(log.version for log in self._logs),
        )
        if key != self._key:
            self._key = key
            self.version += 1
            self._summary = {}

    def _read(self, go_on: Callable[[], bool]) -> None:
        if self._config is None or self._config.stamp is None:
            self._kind, self._config, self._settings, self._logs = "", None, [], []
            if self.path.is_symlink():
                raise UsageError("is a link, and links are not followed: watch its target")
            if not (kind := kind_of(self.path)):
                if self._is_planned:
                    return
                raise UsageError("there is no run here any more")
            if kind == "campaign":
                raise UsageError("is a campaign, not a run")
            self._kind = kind
            self._config = Whole(self.path / (CONFIG if kind == "run" else SHAPING), _configs)
        self._settings = self._config.read() or []
        del self._logs[len(self._settings) :]
        for number in range(len(self._logs), len(self._settings)):
            folder = self._folder(number)
            if folder.is_symlink() or stamp(folder / CONFIG) is None:
                break
            self._logs.append(Log(folder / "generations.jsonl"))
            self._declared = Declared(folder)
        for log in self._logs:
            log.read(go_on)

    def _folder(self, number: int) -> Path:
        """The directory of a run, or of the stage of this number, from 0."""
        return self.path if self._kind == "run" else self.path / f"stage-{number + 1}"

    def _stand(self, standing: Standing | None) -> tuple[str, str]:
        """Return the status, and why a run has failed."""
        if standing is not None and standing.state == "failed":
            return "failed", standing.reason
        if self._problem:
            return "damaged", ""
        if standing is None and self._kind and stamp(self.path / SEAL) is not None:
            return "finished", ""
        if standing is not None and standing.state == "finished":
            return "finished", ""
        if standing is not None and standing.state == "running":
            return "running", ""  # maybe on another machine
        if self._kind and is_locked(self.path / LOCK):
            return "running", ""
        return (
            "pending" if standing is not None and not self._n_generations else "interrupted"
        ), ""

    @property
    def measures(self) -> dict[str, Measure]:
        """The measures that it declares, by name; of a shaping those of its last stage begun."""
        return self._found.measures

    @property
    def _found(self) -> Declaration:
        return self._declared.read() if self._declared is not None else NOTHING

    # --- what is said -----------------------------------------------------------------------------

    @property
    def summary(self) -> dict[str, Any]:
        """What the table says of it; the same object until something changes."""
        if not self._summary:
            self._summary = self._about_now() | self._last() | self._prospects()
        return self._summary

    def _about_now(self) -> dict[str, Any]:
        found: dict[str, Any] = {
            "label": self.label,
            "path": readable(str(self.path)),
            "variant": "",
        }
        found |= self._about
        if self._settings:
            last = self._settings[-1]
            found |= {"task": span([one.task for one in self._settings]), "method": last.method}
            found |= {"preset": last.preset, "seed": last.seed}
        for name, none in (("task", ""), ("method", ""), ("preset", ""), ("seed", None)):
            found.setdefault(name, none)
        return found | {
            "status": self._status,
            "reason": self._reason,
            "problem": self._problem,
            "kind": self._kind or "run",
            "stage": len(self._logs) if self._kind == "shaping" else 0,
            "n_stages": len(self._settings) if self._kind == "shaping" else 0,
        }

    def _last(self) -> dict[str, Any]:
        """Return what the last generation came to; of a shaping of the last stage that has one."""
        stage = next((log.generations for log in reversed(self._logs) if log.generations), None)
        found: dict[str, Any] = {"champion": None, "champion_stage": 0}
        found |= {"performance": {}, "declared": {}, "castes": {}, "favourites": {}}
        found |= dict.fromkeys(
            ("fitness", "best", "specialization", "favourite_share", "sst", "gst")
        )
        if stage is None:
            return found
        names = {"fitness": "team_fitness", "best": "best_fitness"}
        number, generation = self._champion or (0, None)
        return found | {
            "champion": generation,
            "champion_stage": number + 1 if self._kind == "shaping" else 0,
            "performance": {name: _plain(c[-1]) for name, c in stage.performance.items()},
            "declared": {name: one.about for name, one in self.measures.items()},
            "castes": {name: int(c[-1]) for name, c in stage.castes.items() if c[-1] > 0},
            "favourites": {name: int(c[-1]) for name, c in stage.favourites.items() if c[-1] > 0},
            **{
                name: _plain(stage.numbers[names.get(name, name)][-1])
                for name in ("fitness", "best", "specialization", "favourite_share", "sst", "gst")
            },
        }

    def _prospects(self) -> dict[str, Any]:
        """Return how far it is, and the time (seconds since 1970) when it will be finished."""
        stages = [log.generations for log in self._logs]
        ends_at = None
        if self._status == "running" and self._n_generations:
            ends_at = round(max(log.written for log in self._logs) + self._seconds_left(), 1)
        return {
            "generation": self._n_generations,
            "generations": sum(one.generations for one in self._settings),
            "evaluations": int(sum(_last(s.numbers["team_evaluations"]) for s in stages)),
            "budget": sum(s.budget for s in self._settings) if self._has_budget else 0,
            "seconds": round(sum(sum(s.numbers["seconds"]) for s in stages), 1),
            "share": round(self._share(), 4),
            "ends_at": ends_at,
        }

    @property
    def apart(self) -> Choices:
        """What sets it apart from runs of the same names: settings, origin and code.

        Of a plan only its factors, instead of all settings. A shaping has those of every stage.
        """
        declared = self._found
        # The stages of a shaping begin with each other's populations.
        origin = declared.origin if self._kind == "run" else ""
        made = [(k, v) for k, v in ((FROM, origin), (CODE, declared.codes)) if v]
        if self._is_planned:
            levels = factors(str(self._about["variant"])).items()
            return (*((f"plan.{k}", v) for k, v in levels), *made)
        if self._kind == "run":
            return (*(self._settings[0].choices if self._settings else ()), *made)
        stages = enumerate(self._settings, start=1)
        found = [(f"stage-{n}.{key}", value) for n, one in stages for key, value in one.choices]
        return (("shaping.stages", str(len(self._settings))), *found, *made)

    @property
    def _n_generations(self) -> int:
        return sum(len(log.generations) for log in self._logs)

    @property
    def _has_budget(self) -> bool:
        return bool(self._settings) and all(one.budget for one in self._settings)

    def _share(self) -> float:
        """Return how much of it is over: of each stage's generations, or of its budget."""
        if self._status == "finished":
            return 1.0
        shares = [0.0] * len(self._settings)
        for k, (settings, log) in enumerate(zip(self._settings, self._logs, strict=False)):
            over = len(log.generations) / settings.generations
            if settings.budget:
                spent = _last(log.generations.numbers["team_evaluations"])
                over = max(over, spent / settings.budget)
            begun_next = k + 1 < len(self._logs)
            shares[k] = 1.0 if begun_next else min(over, 1.0)
        return fmean(shares) if shares else 0.0

    def _seconds_left(self) -> float:
        """Return the seconds from the last generation's end to the last one's.

        By the pace of the last generations; stages to come are taken to be as fast.
        """
        at = next(k for k in reversed(range(len(self._logs))) if self._logs[k].generations)
        recent = self._logs[at].generations.numbers
        pace = fmean(recent["seconds"][-RECENT:])
        spent = [0.0, *recent["team_evaluations"]]
        n = min(RECENT, len(spent) - 1)
        cost = (spent[-1] - spent[-1 - n]) / n
        left = 0.0
        for k in range(at, len(self._settings)):
            done = len(self._logs[k].generations) if k == at else 0
            used = spent[-1] if k == at else 0.0
            more = float(self._settings[k].generations - done)
            if self._settings[k].budget and cost > 0:
                # What the budget cannot pay is not begun.
                more = min(more, math.floor((self._settings[k].budget - used) / cost))
            left += max(more, 0.0)
        return left * pace if math.isfinite(left * pace) else 0.0

    @property
    def champion(self) -> tuple[Path, int] | None:
        """The directory and the generation of its fittest team so far, None before the first."""
        found = self._champion
        return None if found is None else (self._folder(found[0]), found[1])

    @property
    def _champion(self) -> tuple[int, int] | None:
        """The stage, from 0, and the generation of the fittest team so far.

        Of a shaping the last stage's that has one. As the run itself chooses it: the highest mean
        credit, the earlier one if equal.
        """
        for number in reversed(range(len(self._logs))):
            fitness = np.array(self._logs[number].generations.numbers["team_fitness"])
            if fitness.size:
                return number, int(np.argmax(np.where(np.isfinite(fitness), fitness, -np.inf)))
        return None

    def curve(self, quantity: str, over: str) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Return x and y [n] of a curve through all stages.

        Args:
            quantity: "performance" (the main measure) or "fitness" (of the fittest team).
            over: "generation" (finished ones) or "evaluations" (of teams so far).
        """
        xs, ys, before = [np.zeros(0)], [np.zeros(0)], 0.0
        for log in self._logs:
            found = log.generations
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
        """Return the summary and every generation, evenly spaced ones if there are very many.

        Of more than ``SHOWN`` generations evenly spaced ones, the first and the last among them.
        """
        n = self._n_generations
        shown = (
            sorted({round((n - 1) * k / (SHOWN - 1)) for k in range(SHOWN)}) if n > SHOWN else []
        )
        rows = np.array(shown, dtype=np.int64) if shown else np.arange(n)
        stages, first = [], 0
        for number, (settings, log) in enumerate(zip(self._settings, self._logs, strict=False), 1):
            stages.append({"stage": number, "task": settings.task, "first": first})
            first += len(log.generations)
        return {
            **self.summary,
            "stages": stages if self._kind == "shaping" else [],
            "number": rows.tolist(),
            "columns": {
                name: plain(column[rows]) for name, column in self._columns("numbers", math.nan)
            },
            "measures": {
                name: plain(column[rows]) for name, column in self._columns("performance", math.nan)
            },
            "robots": {name: plain(column[rows]) for name, column in self._columns("castes", 0.0)},
        }

    def _columns(self, kind: str, none: float) -> Iterator[tuple[str, npt.NDArray[np.float64]]]:
        """Yield the columns of all stages, one after the other."""
        parts: list[tuple[int, Mapping[str, Sequence[float]]]] = [
            (len(log.generations), getattr(log.generations, kind)) for log in self._logs
        ]
        for name in dict.fromkeys(name for _, part in parts for name in part):
            yield (
                name,
                np.concatenate(
                    [
                        np.array(part[name]) if name in part else np.full(n, none)
                        for n, part in parts
                    ]
                ),
            )


def span(tasks: Sequence[str]) -> str:
    """Return the tasks of a run or shaping in short: "rover-v2/complex-1 to complex-3"."""
    last = re.split("[/:]", tasks[-1])[-1]
    return tasks[0] if len(set(tasks)) == 1 else f"{tasks[0]} to {last}"


def plain(values: npt.NDArray[np.float64]) -> list[float | None]:
    """Return numbers as JSON has them, to six digits; none for what is not finite."""
    return [None if not math.isfinite(v) else float(f"{v:.6g}") for v in values.tolist()]


def _plain(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _last(column: Sequence[float]) -> float:
    return column[-1] if column else 0.0


def _configs(content: bytes) -> list[Settings]:
    """Return the settings of a run, or of a shaping's stages."""
    tables = tomllib.loads(content.decode())
    return [Settings.of(stage) for stage in tables.get("stages", [tables])]
