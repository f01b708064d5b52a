"""A campaign for marl-eval (Gorsane et al. 2022): raw results in the form its page documents.

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

The library needs a full rectangle: every task of an environment has the same algorithms, runs of
the same names and the same number of steps. Runs are named by their seeds. Choice: either the
tasks that have all algorithms are taken, or the algorithms that all tasks have, whichever keeps
more runs. Of these, the seeds that all have are taken, one run per seed. ``left_out`` names the
rest. Choice: before its first generation has ended a run shows that generation's value. Choice:
"_" becomes "-" in measures and "," becomes ";" in algorithms, because the library cuts names there.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from conevo.campaigns.tables import Tables

__all__ = ["STEPS", "export", "left_out"]

STEPS = 20
"""Points of a learning curve."""


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
    data: dict[str, Any] = {}
    for environment, cells in _environments(tables).items():
        kept = _rectangle(cells)
        if not kept:
            continue
        fewest = min(one.team_steps[-1] for one in _runs(kept))
        counts = [fewest * k // STEPS for k in range(1, STEPS + 1)]
        data[environment] = {
            task: {
                algorithm: {f"seed_{one.seed}": _result(one, counts) for one in runs}
                for algorithm, runs in algorithms.items()
            }
            for task, algorithms in kept.items()
        }
    return data


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


def _result(one: _Run, counts: list[int]) -> dict[str, Any]:
    """Return the steps and the absolute metrics of one run."""
    ended = np.searchsorted(one.team_steps, counts, side="right") - 1
    steps = {
        f"step_{k}": {"step_count": count, one.measure: [one.values[max(at, 0)]]}
        for k, (count, at) in enumerate(zip(counts, ended.tolist(), strict=True), start=1)
    }
    return steps | {"absolute_metrics": {one.measure: one.test}}
