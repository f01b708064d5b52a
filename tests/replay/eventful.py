"""Short epochs with many events, and the contents of their files, read with numpy alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.replay.recording import record_epoch
from conevo.replay.trajectory import Trajectory
from conevo.rng import fold
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from replay.epochs import random_team

__all__ = ["WORLDS", "numbers", "played"]

# Parameters with which rocks are detected, prey captured and objects carried in a short epoch.
WORLDS: dict[str, tuple[str, dict[str, float]]] = {
    "rover": ("rover/complex-5", dict.fromkeys(("low_range", "med_range", "hi_range"), 0.1)),
    "pursuit": ("pursuit/team-4", {"capture_distance_cm": 100.0, "n_obstacles": 3}),
    "gacc": ("gacc/complex-5", {"object_range": 0.2, "grip_distance": 0.2}),
}


def played(name: str, seed: int = 2, iterations: int = 240) -> Trajectory:
    """Return an epoch in which two of every three robots are heuristic, one has a random network.

    The scenario is the same for all seeds.
    """
    task, rules = WORLDS[name]
    a_world = world(task, iterations=iterations, **rules)
    genes, team = random_team(a_world, seed)
    heuristic = np.arange(seed, seed + a_world.n_robots, dtype=np.int32) % len(a_world.heuristics)
    heuristic[::3] = -1
    about, channels = record_epoch(
        Rollout(a_world, n_threads=1), genes, team, fold(4, "test", 0), heuristic
    )
    run = {"method": "cone", "label": f"a team of seed {seed}", "seed": seed}
    return Trajectory(about | run, channels)


def numbers(path: Path) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Return the description in a trajectory's file, and its channels."""
    with np.load(path) as file:
        about = json.loads(file["about"].tobytes())
        return about, {
            name: kept["low"] + kept["step"] * file[name].astype(float)
            for name, kept in about["channels"].items()
        }
