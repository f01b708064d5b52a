"""Short epochs of random and heuristic teams in every world, for tests of films and pages."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from conevo.controllers.registry import controller, genome_of
from conevo.replay.recording import record_epoch
from conevo.replay.trajectory import Trajectory
from conevo.rng import fold, stream
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout

LIGHT = Path(__file__).resolve().parents[2] / "examples" / "light.py"
TASKS = ("rover/complex-5", "pursuit/team-7", "prey/shaping-3", "gacc/complex-5", f"{LIGHT}:dark-1")


def random_team(a_world, seed=0):
    """Return a pool and the rows of a team of networks that have grown beyond their first size."""
    genome, r = genome_of(controller(world=a_world), a_world), a_world.n_robots
    used = min(genome.n_parts + 1, genome.max_parts)
    pool = stream(seed, "pool").uniform(-1, 1, (r * used, genome.n_genes)).astype(np.float32)
    team = np.full((r, genome.max_parts), -1, dtype=np.int32)
    team[:, :used] = np.arange(len(pool)).reshape(r, used)
    team[0, 0] = -1  # an empty slot among the neurons
    return pool, team


@cache
def epoch(task, iterations=200, seed=3, *, is_heuristic=False):
    """Return the trajectory of a team of networks; heuristic: every second robot is."""
    a_world = world(task, iterations=iterations)
    rollout = Rollout(a_world, n_threads=1)
    genes, team = random_team(a_world, seed)
    modes = np.full(a_world.n_robots, -1, dtype=np.int32)
    if is_heuristic:
        modes[::2] = np.arange(len(modes[::2])) % len(a_world.heuristics)
    about, channels = record_epoch(rollout, genes, team, fold(seed, "test", 0), modes)
    return Trajectory(about, channels)


def renamed(trajectory, **changes):
    """Return the trajectory with another description."""
    return replace(trajectory, about=trajectory.about | changes)
