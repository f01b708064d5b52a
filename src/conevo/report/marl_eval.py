"""Raw results in the form that marl-eval documents (Gorsane et al. 2022): written and read.

::

    {environment: {task: {algorithm: {"seed_1": {
        "step_1": {"step_count": 120, measure: [value]}, ...,
        "absolute_metrics": {measure: [value, ...]}}}}}}

================  ==============================================================================
environment       world, family and preset: "rover-v2 complex night" (budgets are never mixed)
task              "complex-5"
algorithm         the method, and its variant if it has one
measure           the main task performance of the world, [1] in a step; "negated-NAME" with
                  negated values if smaller is better, because the library assumes that larger is
step_count        team-steps, in equal parts of the fewest that a run of the environment spent
step_k            the fittest team of the last generation that had ended by then
absolute_metrics  the champion in its test, [scenarios]
================  ==============================================================================

``export`` writes a campaign. The library needs a full rectangle: every task of an environment has
the same algorithms, runs of the same names and the same number of steps. Runs are named by their
seeds. Choice: either the tasks that have all algorithms are taken, or the algorithms that all tasks
have, whichever keeps more runs. Of these, the seeds that all have are taken, one run per seed.
``left_out`` names the rest. Choice: before its first generation has ended a run shows that
generation's value. Choice: "_" becomes "-" in measures and "," becomes ";" in algorithms, because
the library cuts names there.

``from_json`` reads such a file, whoever wrote it. The library itself is never imported.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from typing_extensions import TypedDict

from conevo.campaigns.tables import Tables
from conevo.errors import shown
from conevo.reading import DamagedFile, check, read_json

__all__ = ["STEPS", "Point", "RawResult", "export", "from_json", "left_out", "to_json"]

STEPS = 20
"""Points of a learning curve."""


ABSOLUTE, COUNT = "absolute_metrics", "step_count"
Values = Mapping[str, list[float]]  # measure -> of the episodes of an evaluation


class _Nested(TypedDict):
    """Environment -> task -> algorithm -> run -> evaluation or absolute metrics -> values."""

    results: dict[str, dict[str, dict[str, dict[str, dict[str, dict[str, Any]]]]]]


class _Lists(TypedDict):
    values: dict[str, list[float]]


class Point(NamedTuple):
    """One evaluation of a run: "step_3", its number of steps, and the values of each measure."""

    name: str
    steps: int
    values: Values


class RawResult(NamedTuple):
    """The results of one run of a file.

    run: "seed_1". points: evaluations by number of steps. absolute: of the final evaluation, or
    whatever the writer keeps there: BenchMARL keeps the best single episode.
    """

    environment: str
    task: str
    algorithm: str
    run: str
    points: tuple[Point, ...]
    absolute: Values


class _Run(NamedTuple):
    """The learning curve and the test of one run."""

    run: str
    seed: int
    measure: str
    team_steps: list[int]
    values: list[float]
    test: list[float]


Cells = dict[str, dict[str, list[_Run]]]  # task -> algorithm -> runs, by seed


def export(tables: Tables) -> dict[str, Any]:
    """Return the raw results of a campaign for marl-eval: plain data for JSON.

    Runs without a test or a generation, or with a value that is not finite, are left out.
    """
    found: list[RawResult] = []
    for environment, cells in _environments(tables).items():
        kept = _rectangle(cells)
        if not kept:
            continue
        fewest = min(one.team_steps[-1] for one in _runs(kept))
        counts = [fewest * k // STEPS for k in range(1, STEPS + 1)]
        found += [
            _sample(environment, task, algorithm, one, counts)
            for task, algorithms in kept.items()
            for algorithm, runs in algorithms.items()
            for one in runs
        ]
    return to_json(found)


def to_json(samples: Iterable[RawResult]) -> dict[str, Any]:
    """Return results as plain data for JSON."""
    data: dict[str, Any] = {}
    for one in samples:
        tasks = data.setdefault(one.environment, {})
        steps: dict[str, Any] = {p.name: {COUNT: p.steps, **p.values} for p in one.points}
        runs = tasks.setdefault(one.task, {}).setdefault(one.algorithm, {})
        runs[one.run] = steps | {ABSOLUTE: dict(one.absolute)}
    return data


def from_json(path: Path) -> list[RawResult]:
    """Return the results in a file, in its order.

    Raises:
        DamagedFile: it is not of this form, or has no result.
        EnvironmentFailure: it cannot be read.
    """
    data = read_json(path)
    problem = f"{path} is not a file of raw results for marl-eval"
    check({"results": data}, _Nested, problem)
    found = [
        _read(RawResult(environment, task, algorithm, run, (), {}), of, problem)
        for environment, tasks in data.items()
        for task, algorithms in tasks.items()
        for algorithm, runs in algorithms.items()
        for run, of in runs.items()
    ]
    if not found:
        raise DamagedFile(f"{problem}: it has no run")
    return found


def _read(one: RawResult, of: Mapping[str, Mapping[str, Any]], problem: str) -> RawResult:
    """Return a run with its evaluations and its absolute metrics."""
    where = f"{problem}: {'.'.join(one[:4])}"
    points = []
    for name, values in of.items():
        if name == ABSOLUTE:
            continue
        rest = dict(values)
        count = rest.pop(COUNT, None)
        if type(count) is not int or count < 0:
            raise DamagedFile(f"{where}.{name}.{COUNT} = {shown(count)}: must be a whole number")
        check({"values": rest}, _Lists, f"{where}.{name}")
        points.append(Point(name, count, rest))
    absolute = of.get(ABSOLUTE, {})
    check({"values": absolute}, _Lists, f"{where}.{ABSOLUTE}")
    points.sort(key=lambda point: point.steps)
    return one._replace(points=tuple(points), absolute=absolute)


def left_out(tables: Tables) -> list[str]:
    """Return the runs of a campaign that ``export`` leaves out, in alphabetical order."""
    exported = {
        one.run for cells in _environments(tables).values() for one in _runs(_rectangle(cells))
    }
    every = tables.query("SELECT run FROM runs ORDER BY run")[1]
    return [run for (run,) in every if run not in exported]


def _environments(tables: Tables) -> dict[str, Cells]:
    """Return all runs that have a test and a curve, by environment."""
    found: dict[str, Cells] = {}
    rows = tables.query(
        """
        WITH judged AS (
            SELECT run, measure, if(coalesce(larger_is_better, true), 1, -1) AS sign
            FROM runs LEFT JOIN measures USING (run, measure)
        ), tests AS (
            SELECT run, list(sign * value ORDER BY scenario) AS test
            FROM scores JOIN judged USING (run, measure)
            WHERE study = 'test' AND team = 'champion'
            GROUP BY run HAVING bool_and(coalesce(isfinite(value), false))
        ), curves AS (
            SELECT run, list(team_steps ORDER BY generation) AS team_steps,
                   list(sign * value ORDER BY generation) AS reached
            FROM generations JOIN judged USING (run)
            GROUP BY run HAVING bool_and(coalesce(isfinite(value), false))
        )
        SELECT concat_ws(' ', world, nullif(family, ''), nullif(preset, '')), environment,
               replace(concat_ws(' ', method, nullif(variant, '')), ',', ';'), run, seed,
               if(sign < 0, 'negated-', '') || replace(measure, '_', '-'),
               curves.team_steps, reached, test
        FROM runs JOIN judged USING (run, measure) JOIN tests USING (run) JOIN curves USING (run)
        ORDER BY world, family, preset, number, environment, method, variant, seed, run
        """
    )[1]
    for environment, task, algorithm, *about in rows:
        found.setdefault(environment, {}).setdefault(task, {}).setdefault(algorithm, []).append(
            _Run(*about)
        )
    return found


def _rectangle(cells: Cells) -> Cells:
    """Return the same algorithms of several tasks, the same number of runs of each."""
    every = {algorithm for algorithms in cells.values() for algorithm in algorithms}
    common = every.intersection(*cells.values())
    complete = {task: algorithms for task, algorithms in cells.items() if every <= set(algorithms)}
    shared = {
        task: {name: runs for name, runs in algorithms.items() if name in common}
        for task, algorithms in cells.items()
        if common
    }
    return max(_evened(complete), _evened(shared), key=lambda kept: len(_runs(kept)))


def _evened(cells: Cells) -> Cells:
    """Return one run of each cell for every seed that all cells have."""
    by_seed = {
        task: {name: {one.seed: one for one in reversed(runs)} for name, runs in of.items()}
        for task, of in cells.items()
    }
    every = [set(runs) for of in by_seed.values() for runs in of.values()]
    seeds = sorted(set.intersection(*every)) if every else []
    if not seeds:
        return {}
    return {
        task: {name: [runs[seed] for seed in seeds] for name, runs in of.items()}
        for task, of in by_seed.items()
    }


def _runs(cells: Cells) -> list[_Run]:
    return [one for algorithms in cells.values() for runs in algorithms.values() for one in runs]


def _sample(environment: str, task: str, algorithm: str, one: _Run, counts: list[int]) -> RawResult:
    """Return the results of one run at these numbers of steps."""
    ended = np.searchsorted(one.team_steps, counts, side="right") - 1
    points = [
        Point(f"step_{k}", count, {one.measure: [one.values[max(at, 0)]]})
        for k, (count, at) in enumerate(zip(counts, ended.tolist(), strict=True), start=1)
    ]
    absolute = {one.measure: one.test}
    return RawResult(environment, task, algorithm, f"seed_{one.seed}", tuple(points), absolute)
