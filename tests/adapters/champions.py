"""The champion of a tiny run, and the epoch of it that the run itself records."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from conevo.export.team import EvolvedTeam, evolved_team
from conevo.replay.recording import record
from conevo.replay.trajectory import Trajectory
from conevo.rng import fold
from conevo.runs.run import Run
from conevo.studies.observation import equip
from runs.tiny import evolve_tiny

__all__ = ["LIGHT", "TASKS", "Champion", "of_run", "tiny_champion"]

LIGHT = f"{Path(__file__).resolve().parents[2] / 'examples' / 'light.py'}:dark-1"
TASKS = ("rover/complex-5", "pursuit/team-3", "gacc/complex-3")


@dataclass(frozen=True)
class Champion:
    """A team with the scenario of its run's first test epoch.

    Attributes:
        task, params: of its world.
        key: of the scenario.
        team: its controllers in numpy.
        trajectory: the run's recording.
        inputs: [T, R, S] float32, as recorded.
        fitness: [R] float32 of ``Outcome``.
        performance: of ``Outcome``, by name.
    """

    task: str
    params: dict[str, Any]
    key: int
    team: EvolvedTeam
    trajectory: Trajectory
    inputs: np.ndarray
    fitness: np.ndarray
    performance: dict[str, float]


@cache
def tiny_champion(task: str) -> Champion:
    """Return the champion of a tiny run with epochs of 60 iterations."""
    with TemporaryDirectory() as folder:
        return of_run(evolve_tiny(Path(folder) / "run", "cone", task, world__iterations=60), task)


def of_run(run: Run, task: str) -> Champion:
    """Return the champion of a run in a task, as ``conevo.world`` takes it."""
    key = fold(run.config.run.seed, "test", 0)
    team, lab = equip(run, 1)
    genes, (rows,) = team.as_trial()
    scenes = lab.world.scenarios([key])
    seen = lab.simulator.record(genes, rows, scenes)
    outcome = lab.simulator.evaluate(genes, rows[None], scenes)
    return Champion(
        task,
        asdict(run.config.world_params),
        key,
        evolved_team(run),
        record(run, threads=1),
        seen["inputs"],
        outcome.fitness[0, 0],
        {name: float(values[0, 0]) for name, values in outcome.performance.items()},
    )
