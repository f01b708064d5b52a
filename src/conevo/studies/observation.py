"""The behaviours of the robots of a run's fittest team, in addition to their actions.

A world's study identifies behaviours in recorded epochs (``worlds.study``). The results are of the
same kind in all worlds: each robot's S and caste, and the number of robots and teams per behaviour.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np

from conevo.errors import UsageError, without_team
from conevo.rng import fold
from conevo.runs.champions import Team
from conevo.runs.lab import Lab
from conevo.runs.run import Run
from conevo.specialization.individual import NON_SPECIALIZED, independent_degree
from conevo.specialization.team import Activity
from conevo.studies.lifetimes import Lifetime, lifetimes
from conevo.worlds.registry import WORLDS, studies, study_of
from conevo.worlds.study import Seen, WorldStudy

__all__ = ["Observed", "equip", "observe", "watch"]


@dataclass(frozen=True)
class Observed:
    """A team, watched.

    Attributes:
        study: of its world.
        seen: the results of the study.
        team: its controllers.
        lab: simulates it.
        scenarios: number of scenarios.
        seed: the scenarios' root.
    """

    study: WorldStudy
    seen: Seen
    team: Team
    lab: Lab
    scenarios: int
    seed: int

    @cached_property
    def lifetimes(self) -> list[Lifetime]:
        """Each robot's shares of behaviours, S and label."""
        return lifetimes(self.seen.executed, self.study.BEHAVIOURS)

    @property
    def labels(self) -> list[str]:
        """Caste of each robot: the behaviour it is specialized to, or "non-specialized"."""
        return [life.label for life in self.lifetimes]

    @property
    def activity(self) -> Activity:
        """Windows of each robot in each behaviour and in none, with its S and caste.

        Choice: behaviours are the settings among which such a robot chooses; windows without one
        are not work.
        """
        lives = self.lifetimes
        windows = np.rint(
            [[share * life.windows for share in life.shares.values()] for life in lives]
        )
        return Activity(
            counts=windows,
            specialization=np.array([life.specialization for life in lives]),
            labels=self.labels,
            independent=independent_degree(windows),
            settings=range(len(self.study.BEHAVIOURS)),
        )

    @property
    def behaviours(self) -> list[dict[str, Any]]:
        """Rows {kind, behaviour, count}: individual, collective, its members, the usual one."""
        labels = Counter(self.labels)
        usual, together = self.seen.collectives
        counts = [
            *(("individual", name, labels[name]) for name in self.study.BEHAVIOURS),
            ("individual", NON_SPECIALIZED, labels[NON_SPECIALIZED]),
            *(("collective", name, n) for name, n in together.items()),
            *(("member", name, n or 0) for name, n in self.seen.composition(self.labels).items()),
            ("team", usual, sum(together.values())),
        ]
        return [{"kind": kind, "behaviour": name, "count": n} for kind, name, n in counts]

    @property
    def report(self) -> dict[str, Any]:
        """Plain data: task, generation (of the team), scenarios, seed, details of the study."""
        return {
            "task": self.lab.config.task,
            "generation": self.team.generation,
            "scenarios": self.scenarios,
            "seed": self.seed,
        } | self.seen.details([asdict(life) for life in self.lifetimes])


def equip(run: Run, threads: int | None = None, device: str | None = None) -> tuple[Team, Lab]:
    """Return the fittest team of a run and what simulates it.

    Args:
        run: finished or not.
        threads: CPU threads, all by default.
        device: as for ``Run.resume``.

    Raises:
        UsageError: no generation has finished yet, or made with other kernels.
    """
    team = run.champion
    if team is None:
        raise without_team(run.path, run.generations())
    lab = run.equip(threads, device)
    lab.refuse_other_team(team, run.path)
    return team, lab


def observe(
    run: Run,
    scenarios: int = 20,
    seed: int | None = None,
    *,
    threads: int | None = None,
    device: str | None = None,
    rules: Any = None,
) -> Observed:
    """Watch the fittest team of a run in fresh scenarios.

    Args:
        run: of a world with a study, finished or not.
        scenarios: how many.
        seed: draws other scenarios than those of the run's own testing phase.
        threads, device: as for ``Run.resume``.
        rules: that identify behaviours, those of the study by default.

    Raises:
        UsageError: another world, no generation has finished yet, or made with other kernels.
    """
    if study_of(run.config.entry) is None:
        there = [(WORLDS[name], one.WORDS.robots) for name, one in studies().items()]
        whose = " or ".join(f"the {robots} of {entry.name}" for entry, robots in there)
        first = there[0][0]
        raise UsageError(
            f"{run.path} is a run of {run.config.task}: behaviours are those of {whose}, or of a "
            f"world that inherits it, as in conevo run {first.short_name}/{first.environments[0]}"
        )
    team, lab = equip(run, threads, device)
    root = run.config.run.seed if seed is None else seed
    return cast("Observed", watch(team, lab, scenarios, root, rules))  # its world has a study


def watch(team: Team, lab: Lab, scenarios: int, seed: int, rules: Any = None) -> Observed | None:
    """Watch a team in the scenarios of the testing phase; None if its world has no study.

    Args:
        team, lab: of the run.
        scenarios: how many.
        seed: their root.
        rules: as for ``observe``.
    """
    if (study := study_of(lab.config.entry)) is None:
        return None
    genes, (rows,) = team.as_trial()
    keys = tuple(fold(seed, "test", k) for k in range(scenarios))
    seen = study.observe(lab.simulator, genes, rows, keys, seed, rules)
    return Observed(study, seen, team, lab, scenarios, seed)
