"""Tables 4.4 and 4.5: the composition of the fittest teams, and their losses in lesions.

Nitschke 2009, sections 4.6.4 and 4.6.6. Both are plain data for any set of runs. They take each
method's run with the fittest team.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from conevo.errors import UsageError, without_team
from conevo.rng import fold
from conevo.runs.run import Run
from conevo.runs.shrinkage import shrinkage
from conevo.studies.lesions import WHOLE, Original
from conevo.studies.observation import observe
from conevo.worlds.measures import measures_of

__all__ = ["composition_table", "fittest_runs", "lesion_table"]


def composition_table(
    runs: Iterable[Run],
    scenarios: int = 20,
    *,
    threads: int | None = None,
    rules: Any = None,
) -> list[dict[str, Any]]:
    """Return table 4.4: the number of robots specialized to each collective behaviour.

    Plain data, a row per method: method, run, task, the number of robots (as the study calls them),
    a number for each collective behaviour (None, the thesis' NA, if the team never showed it),
    "non-specialized", and labels, the individual behaviour of each robot.

    Raises:
        UsageError: no runs, a run of another world, or one without a team.
    """
    rows = []
    for method, run in fittest_runs(runs).items():
        seen = observe(run, scenarios, threads=threads, rules=rules)
        about = {"method": method, "run": str(run.path), "task": run.config.task}
        n_robots = {seen.study.WORDS.robots: len(seen.labels)}
        members = seen.seen.composition(seen.labels)
        rows.append(about | n_robots | members | {"labels": seen.labels})
    return rows


def lesion_table(
    runs: Iterable[Run],
    scenarios: int = 20,
    *,
    threads: int | None = None,
    rules: Any = None,
) -> list[dict[str, Any]]:
    """Return table 4.5: task performance after specialized robots were replaced by heuristic ones.

    Plain data, a row per method: method, run, task, the world's main measure by its name
    (unlesioned), and for each individual behaviour the percentage of it that is left when all
    robots specialized to the behaviour are replaced; None if no robot is, or if the whole team has
    0. All teams of a row meet the same fresh scenarios, which differ from those in which they were
    labelled.

    Raises:
        UsageError: no runs, a run of another world, or one without a team.
    """
    rows = []
    for method, run in fittest_runs(runs).items():
        seen = observe(run, scenarios, threads=threads, rules=rules)
        lab, behaviours = seen.lab, seen.study.BEHAVIOURS
        lesioned = [behaviour for behaviour in behaviours if behaviour in seen.labels]
        others = lab.world.scenarios([fold(seen.seed, "lesion", k) for k in range(scenarios)])
        team = Original(lab.simulator, seen.team, seen.labels, seen.team.fitness)
        found = team.lesion(lesioned, others)
        main = measures_of(lab.world)[0].name
        means = found.performance[main].astype(np.float64).mean(axis=1).tolist()
        left = dict(zip(found.teams, means, strict=True))
        whole = left[WHOLE]
        rows.append(
            {"method": method, "run": str(run.path), "task": run.config.task, main: whole}
            | {
                behaviour: 100 * left[behaviour] / whole if behaviour in left and whole else None
                for behaviour in behaviours
            }
        )
    return rows


def fittest_runs(runs: Iterable[Run]) -> dict[str, Run]:
    """Return each method's run with the fittest champion; ties go to the first given one.

    Champions are compared by their validation, which did not select them as finalists; if a run of
    the method has none, by the fitness that selected them.

    Raises:
        UsageError: no runs, or one without a team.
    """
    by_method: dict[str, list[Run]] = {}
    for run in runs:
        if run.champion is None:
            raise without_team(run.path, run.generations())
        by_method.setdefault(run.config.method, []).append(run)
    if not by_method:
        raise UsageError("no runs were given, so there is no table")
    return {method: _fittest(some) for method, some in by_method.items()}


def _fittest(runs: Sequence[Run]) -> Run:
    """Return the first of the runs whose champion has the highest fitness."""
    results = [run.test_result or {} for run in runs]
    if all("validation" in result for result in results):
        found = [shrinkage(result)[0]["validation"]["mean"] for result in results]
        fitness = [-np.inf if mean is None else mean for mean in found]
    else:
        fitness = [-run.champion.rank if run.champion else -np.inf for run in runs]
    return runs[int(np.argmax(fitness))]
