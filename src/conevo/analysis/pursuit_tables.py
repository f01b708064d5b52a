"""Tables 4.4 and 4.5: what the fittest teams are made of, and what they lose without it.

Nitschke 2009, sections 4.6.4 and 4.6.6. Both are plain data for any set of runs; of each method's
runs the one with the fittest team is taken.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from conevo.analysis.behaviours import BEHAVIOURS, Rules
from conevo.analysis.captures import COLLECTIVES, COMPOSITIONS, Capture, most_frequent
from conevo.analysis.lesions import WHOLE, lesion
from conevo.analysis.pursuit import lab_of, observe
from conevo.errors import UsageError, without_team
from conevo.rng import fold
from conevo.runs.run import Run
from conevo.runs.shrinkage import shrinkage
from conevo.specialization.individual import NON_SPECIALIZED

__all__ = ["composition", "composition_table", "fittest_runs", "lesion_table"]


def composition_table(
    runs: Iterable[Run],
    scenarios: int = 20,
    *,
    threads: int | None = None,
    rules: Rules | None = None,
) -> list[dict[str, Any]]:
    """Return table 4.4: how many predators are specialized to which collective behaviour.

    Plain data, a row per method: method, run, task, predators, a number for each of the four
    collective behaviours (None, the thesis' NA, if the team never showed it), "non-specialized",
    and labels, the individual behaviour of each predator.

    Raises:
        UsageError: no runs, a run of another world, or one without a team.
    """
    rows = []
    for method, run in fittest_runs(runs).items():
        seen = observe(run, scenarios, threads=threads, rules=rules)
        labels = [life.label for life in seen.lifetimes]
        about = {"method": method, "run": str(run.path), "task": run.config.task}
        members = composition(labels, seen.all_captures)
        rows.append(about | {"predators": len(labels)} | members | {"labels": labels})
    return rows


def composition(labels: Sequence[str], captures: Sequence[Capture]) -> dict[str, int | None]:
    """Return how many predators belong to each collective behaviour, and to none.

    Choice: a predator specialized to an individual behaviour belongs to the collective behaviour
    that it took part in most often in that role (4.6.3); to none, and is counted as
    non-specialized, if it never did.

    Args:
        labels: of each predator, an individual behaviour or "non-specialized".
        captures: of its team.
    """
    occurs = most_frequent(captures)[1]
    table: dict[str, int | None] = {
        name: 0 if occurs[name] else None for name in COLLECTIVES if name != "none"
    }
    table[NON_SPECIALIZED] = 0
    for predator, label in enumerate(labels):
        parts = Counter(
            one.collective
            for one in captures
            if label in one.roles[predator] and label in COMPOSITIONS.get(one.collective, ())
        )
        most = max(COMPOSITIONS, key=lambda name: parts[name])
        belongs = most if parts else NON_SPECIALIZED
        table[belongs] = (table[belongs] or 0) + 1
    return table


def lesion_table(
    runs: Iterable[Run],
    scenarios: int = 20,
    *,
    threads: int | None = None,
    rules: Rules | None = None,
) -> list[dict[str, Any]]:
    """Return table 4.5: capture time after specialized predators were replaced by heuristic ones.

    Plain data, a row per method: method, run, task, capture_time (unlesioned), and for each
    individual behaviour the percentage of it that is left when all predators specialized to the
    behaviour are replaced; None if there is no such predator, or nothing was ever captured. All
    teams of a row meet the same fresh scenarios, others than those they were labelled in.

    Raises:
        UsageError: no runs, a run of another world, or one without a team.
    """
    rows = []
    for method, run in fittest_runs(runs).items():
        seen = observe(run, scenarios, threads=threads, rules=rules)
        labels = [life.label for life in seen.lifetimes]
        lesioned = [behaviour for behaviour in BEHAVIOURS if behaviour in labels]
        team, lab = lab_of(run, threads)
        keys = [fold(seen.seed, "lesion", k) for k in range(scenarios)]
        found = lesion(lab.simulator, team, labels, lesioned, lab.world.scenarios(keys))
        means = found.performance["capture_time"].astype(np.float64).mean(axis=1).tolist()
        left = dict(zip(found.teams, means, strict=True))
        whole = left[WHOLE]
        rows.append(
            {"method": method, "run": str(run.path), "task": run.config.task}
            | {"capture_time": whole}
            | {
                behaviour: 100 * left[behaviour] / whole if behaviour in left and whole else None
                for behaviour in BEHAVIOURS
            }
        )
    return rows


def fittest_runs(runs: Iterable[Run]) -> dict[str, Run]:
    """Return each method's run with the fittest champion, the earlier given one if equal.

    Champions are compared by their validation, which did not make them finalists; if a run of the
    method has none, by the fitness that selected them.

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
