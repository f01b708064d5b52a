"""Results of other tools, which a report shows next to those of a campaign.

They are read from files of marl-eval's form (``marl_eval.from_json``), as BenchMARL writes them.
Such a file has neither the size of a team nor anything else that a fair comparison must state, so a
description can be written next to it, NAME.toml for NAME.json::

    robots = 3                      # of a team
    machine = "one core of ..."
    scenarios = "fresh, 10 per evaluation"
    [tasks]
    pursuit_team_3 = "pursuit/team-3"   # the environment here, if its name differs
    [measures]
    return = "capture_time"         # the measure here that this one is, in the same unit
    [algorithms.mappo]
    seconds = 541.0                 # wall clock of a run
    parameters = 5573               # of a policy
    shared = true                   # by all robots
    memory = "none"
    actions = "5 discrete"
    policy = "stochastic"           # in evaluations, or "deterministic"

Keys of an algorithm may also be given for all of them, at the top. Whatever is missing is shown as
not stated.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Annotated, Any, Literal, NotRequired

from annotated_types import Ge
from typing_extensions import TypedDict

from conevo.errors import UsageError, unknown_name
from conevo.reading import check, read_toml
from conevo.report.exhibits import slug
from conevo.report.marl_eval import Point, RawResult, from_json

__all__ = ["FRAMES", "Foreign", "Stated", "read_foreign"]

FRAMES = ("team", "robot")
"""Units of another tool's steps: a step of the whole team, or one of each of its robots."""


class Stated(TypedDict):
    """The properties of a method that a fair comparison states."""

    robots: NotRequired[Annotated[int, Ge(1)]]
    seconds: NotRequired[Annotated[float, Ge(0)]]
    machine: NotRequired[str]
    parameters: NotRequired[Annotated[int, Ge(0)]]
    shared: NotRequired[bool]
    memory: NotRequired[str]
    actions: NotRequired[str]
    policy: NotRequired[Literal["stochastic", "deterministic"]]
    scenarios: NotRequired[str]


class _File(Stated):
    tasks: NotRequired[dict[str, str]]
    measures: NotRequired[dict[str, str]]
    algorithms: NotRequired[dict[str, Stated]]


@dataclass(frozen=True)
class Foreign:
    """The runs of one algorithm in one task, all of another tool.

    Attributes:
        task: environment and task as the file has them.
        names: slugs of the tasks of this package that it may be.
        algorithm: as the file has it.
        measure: as the file has it.
        is_measure: the measure of this package that it is, perhaps the same.
        runs: evaluations of each run: their steps, and the mean over their episodes.
        frames: one of ``FRAMES``.
        about: its description.
    """

    task: str
    names: frozenset[str]
    algorithm: str
    measure: str
    is_measure: str
    runs: tuple[tuple[tuple[int, float], ...], ...]
    frames: str
    about: Stated

    @property
    def title(self) -> str:
        """Its name in tables and legends."""
        return f"{self.algorithm} (foreign)"

    @property
    def last(self) -> list[float]:
        """The last evaluation of each run."""
        return [run[-1][1] for run in self.runs]

    @property
    def best(self) -> list[float]:
        """The highest evaluation of each run."""
        return [max(value for _, value in run) for run in self.runs]

    def team_steps(self, robots: int | None = None) -> list[list[float]] | None:
        """Return the team-steps at every evaluation of each run, None if they are not known.

        Args:
            robots: in a team, where the description does not state it.
        """
        each = self.about.get("robots", robots)
        if self.frames == "team":
            each = 1
        if each is None:
            return None
        return [[count / each for count, _ in run] for run in self.runs]


def read_foreign(paths: Sequence[Path], frames: str) -> list[Foreign]:
    """Return the results in files, an entry for each task, algorithm and measure.

    Args:
        paths: files of marl-eval's form; runs of one cell may be in several.
        frames: what their steps count, one of ``FRAMES``.

    Raises:
        UsageError: no such unit of steps; a file is damaged, or has a run that another one has,
            too.
        EnvironmentFailure: a file cannot be read.
    """
    if frames not in FRAMES:
        raise unknown_name("unit of steps", frames, FRAMES)
    cells: dict[tuple[str, str, str], list[RawResult]] = {}
    described: dict[tuple[str, str, str], _File] = {}
    for path in paths:
        about = _description(path.with_suffix(".toml"))
        for one in from_json(path):
            key = (one.environment, one.task, one.algorithm)
            if any(one.run == other.run for other in cells.get(key, ())):
                raise UsageError(f"{path}: {'.'.join(key)} has {one.run} twice")
            cells.setdefault(key, []).append(one)
            described.setdefault(key, about)
    return [
        made for key, samples in cells.items() for made in _entries(samples, described[key], frames)
    ]


def _entries(samples: Sequence[RawResult], file: _File, frames: str) -> Iterable[Foreign]:
    """Yield an entry for each measure that all runs of a cell have in all evaluations."""
    first = samples[0]
    points = [point for one in samples for point in one.points]
    given = file.get("measures", {})
    names = list(dict.fromkeys(name for point in points for name in point.values))
    names = [name for name in names if name in given] if given else names
    own = {k: v for k, v in file.items() if k not in ("tasks", "measures", "algorithms")}
    about: Any = own | dict(file.get("algorithms", {}).get(first.algorithm, {}))
    for name in names:
        if not all(point.values.get(name) for point in points):
            continue
        yield Foreign(
            task=f"{first.environment}/{first.task}",
            names=_names(first, file),
            algorithm=first.algorithm,
            measure=name,
            is_measure=given.get(name, name),
            runs=tuple(_means(one.points, name) for one in samples if one.points),
            frames=frames,
            about=about,
        )


def _means(points: Iterable[Point], measure: str) -> tuple[tuple[int, float], ...]:
    return tuple((point.steps, fmean(point.values[measure])) for point in points)


def _names(one: RawResult, file: _File) -> frozenset[str]:
    """Return slugs of the tasks that a foreign task may be.

    "pursuit_team_3" is pursuit/team-3; task "complex-5" of environment "rover-v2 complex night", as
    ``marl_eval.export`` writes it, is rover-v2/complex-5.
    """
    if one.task in (given := file.get("tasks", {})):
        return frozenset({slug(given[one.task])})
    world = one.environment.split(" ")[0]
    return frozenset({slug(one.task), slug(f"{world}/{one.task}")})


def _description(path: Path) -> _File:
    """Return the description in a file; nothing is stated if there is none.

    Raises:
        UsageError: an unknown key, or a value that is not allowed.
    """
    if not path.exists():
        return {}
    found: Any = read_toml(path)
    tables = [(found, _File), *((one, Stated) for one in _tables(found.get("algorithms")))]
    for table, model in tables:
        for key in table:
            if key not in model.__annotations__ and key not in Stated.__annotations__:
                raise unknown_name("key", key, model.__annotations__, f"in {path}")
    check(found, _File, f"{path} is damaged")
    file: _File = found
    return file


def _tables(value: Any) -> list[dict[str, Any]]:
    values = value.values() if isinstance(value, dict) else ()
    return [one for one in values if isinstance(one, dict)]
