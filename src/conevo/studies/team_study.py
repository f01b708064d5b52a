"""The castes of a run's fittest team, and its performance without one of them.

Nitschke 2009, sections 4.6.4 to 4.6.6, 5.5.2 to 5.5.4, 6.5.4 and 6.5.5. One study contains all of
it as plain data: each robot's caste, S and fitness, measures of the team's specialization, caste
lesions and teams of clones scenario by scenario, and the behaviours of robots in worlds that
observe them (``studies.observation``).

- Choice: castes are identified in the scenarios of the testing phase. Lesions and clones are played
  in others, and all teams of a comparison meet the same ones, so that the luck that made a caste
  does not judge it.
- Choice: the fittest robot of a caste is the one with the highest private fitness in the scenarios
  that identified the castes, of the run's own fittest team (5.5.4 takes it from CONE's).
- A score that is not a finite number is left out, as in the testing phase; a fitness is None.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.numbers import finite
from conevo.rng import fold
from conevo.runs.champions import Team
from conevo.runs.evaluation import describe
from conevo.runs.lab import Lab
from conevo.runs.run import Run
from conevo.specialization.favourite import affinity, favourite, favourite_share
from conevo.specialization.individual import NON_SPECIALIZED, relative_degree
from conevo.specialization.team import Activity, measure
from conevo.studies.lesions import Compared, Original
from conevo.studies.observation import Observed, equip, watch
from conevo.typing import Record
from conevo.worlds.protocol import Outcome, setting_columns

__all__ = ["study"]

# Not cloned: a team that only moves, or idles, does nothing of the task (4.6.5, 5.5.4, 6.5.5).
NOT_CLONED = ("move", "idle")


@dataclass(frozen=True)
class _Portrait:
    """The castes and fitness of a team's robots.

    Attributes:
        activity: counts in all scenarios, with S and caste of each robot.
        names: of the columns of its counts.
        fitness: [R] private fitness, mean over the scenarios.
        castes: those with robots, in the world's order.
    """

    activity: Activity
    names: Sequence[str]
    fitness: npt.NDArray[np.float64]
    castes: list[str]


def study(
    run: Run, scenarios: int = 20, *, threads: int | None = None, device: str | None = None
) -> dict[str, Any]:
    """Study the fittest team of a run in fresh scenarios; writes nothing.

    Where a world observes behaviours, these are the castes, and only the specialized ones are
    replaced or cloned (table 4.5, figure 4.12); in other worlds the non-specialized are a caste.

    Args:
        run: of any world, finished or not.
        scenarios: how many for each comparison.
        threads, device: as for ``Run.resume``; they change no result.

    Returns:
        Plain data. scores: rows {study, team, measure, scenario, value} of the studies "lesion" and
        "clones", teams "whole" and castes, "rotated", teams "whole" and "moved", and "composed",
        collective behaviours; the testing phase is the run's own (``test_result``).
        robots: robot, caste, specialization (S), fitness, hidden, and what S cannot see:
        favourite_setting and setting_share (its share of the settings used, 1 = always the same),
        affinity, favourite_action and action_share (of its time), independent (the S of
        independent draws), relative (S over it); None where a robot did none. actions: robot,
        action (of ``World.castes``), count. metrics: those of ``specialization.team``, of the
        actions or behaviours that identify castes. behaviours (if observed): kind, behaviour,
        count; for the kind "team" its most frequent collective behaviour, and all its captures.

    Raises:
        UsageError: no generation has finished yet, or made with other kernels.
    """
    team, lab = equip(run, threads, device)
    seed = run.config.run.seed
    fresh = lab.world.scenarios([fold(seed, "test", k) for k in range(scenarios)])
    outcome = lab.simulator.evaluate(*team.as_trial(), fresh)
    watched = watch(team, lab, scenarios, seed)
    portrait = _portray(lab, outcome, watched)
    altered = portrait.castes
    if watched is not None:
        altered = [caste for caste in altered if caste != NON_SPECIALIZED]
    clones = [fold(seed, "clones", k) for k in range(scenarios)]
    others = lab.world.scenarios([fold(seed, "lesion", k) for k in range(scenarios)])
    original = Original(lab.simulator, team, portrait.activity.labels, portrait.fitness)
    lesioned = original.lesion(altered, others)
    moved = [original.rotate(others)] if len(team.genes) > 1 else []
    cloned = original.clone(
        [caste for caste in altered if caste not in NOT_CLONED],
        watched.seen.together(clones) if watched is not None else lab.world.scenarios(clones),
    )
    composed = [] if watched is None else original.compose(watched.seen.compositions(clones))
    return {
        "scores": [
            *_rows("lesion", lesioned),
            *_rows("clones", cloned),
            *(row for one in moved for row in _rows("rotated", one)),
            *(row for one in composed for row in _rows("composed", one)),
        ],
        "robots": _robots(team, portrait),
        "actions": _actions(lab, outcome),
        "metrics": measure(portrait.activity),
        "behaviours": [] if watched is None else watched.behaviours,
    }


def _portray(lab: Lab, outcome: Outcome, watched: Observed | None) -> _Portrait:
    if watched is None:
        found, order = describe(outcome, lab.world), lab.world.castes
        activity = Activity(
            counts=_counts(outcome),
            specialization=np.array(found.specialization),
            labels=found.labels,
            independent=np.array(found.independent),
            settings=setting_columns(lab.world),
        )
        names = order
    else:
        activity, order = watched.activity, watched.study.BEHAVIOURS
        names = (*order, "none")
    named = [name for name in order if name in activity.labels and name != NON_SPECIALIZED]
    return _Portrait(
        activity=activity,
        names=names,
        fitness=outcome.fitness[0].astype(np.float64).mean(axis=0),
        castes=[*named, *([NON_SPECIALIZED] if NON_SPECIALIZED in activity.labels else [])],
    )


def _counts(outcome: Outcome) -> npt.NDArray[np.int64]:
    """Return how often each robot of the only team executed what, in all scenarios [R, C]."""
    counts: npt.NDArray[np.int64] = outcome.counts[0].astype(np.int64).sum(axis=0)
    return counts


def _rows(study: str, compared: Compared) -> list[Record]:
    """Return the values of each team and measure as rows; one that is not finite is None."""
    return [
        {"study": study, "team": team, "measure": measure, "scenario": k, "value": finite(value)}
        for n, team in enumerate(compared.teams)
        for measure, values in compared.performance.items()
        for k, value in enumerate(values[n])
    ]


def _robots(team: Team, portrait: _Portrait) -> list[Record]:
    of, names = portrait.activity, portrait.names
    settings = [names[column] for column in of.settings]
    columns = {
        "caste": of.labels,
        "specialization": [float(s) for s in of.specialization],
        "fitness": [finite(fitness) for fitness in portrait.fitness],
        "hidden": [int(n_hidden) for n_hidden in team.active.sum(axis=1)],
        "favourite_setting": [favourite(robot, settings) for robot in of.work],
        "setting_share": [finite(share) for share in favourite_share(of.work)],
        "affinity": [finite(value) for value in affinity(of.work)],
        "favourite_action": [favourite(robot, names) for robot in of.counts],
        "action_share": [finite(share) for share in favourite_share(of.counts)],
        "independent": [float(s) for s in of.independent],
        "relative": [float(s) for s in relative_degree(of.specialization, of.independent)],
    }
    return [
        {"robot": robot} | dict(zip(columns, values, strict=True))
        for robot, values in enumerate(zip(*columns.values(), strict=True))
    ]


def _actions(lab: Lab, outcome: Outcome) -> list[Record]:
    return [
        {"robot": robot, "action": action, "count": int(count)}
        for robot, executed in enumerate(_counts(outcome))
        for action, count in zip(lab.world.castes, executed, strict=True)
    ]
