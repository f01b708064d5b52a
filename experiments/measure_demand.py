"""Measure the effect of the other reading of the demand signal in gathering and construction.

    python experiments/measure_demand.py [--seeds 4]

Equations 6.4 to 6.6 divide a type's demand by its missing parts. The world divides by their number;
the other reading is their share of all planned parts of the type. This script plays the same teams
under both: every heuristic controller alone, random networks and their clones, and teams that
HomCNE evolved under the world's own reading. Then it evolves again under the other reading, with
the same seeds. It prints a line for each kind of team, and takes five minutes of a core.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
import warp as wp

import conevo
from conevo.worlds import episode
from conevo.worlds.gacc import resolve as gacc_resolve
from conevo.worlds.gacc.state import GaccConstants as Params
from conevo.worlds.gacc.state import GaccScene as Scene
from conevo.worlds.gacc.state import GaccTeam as Team
from teams import champion, controlled, error, keys_of, play, random_clones, random_networks, sample

TASK = "gacc/complex-1"
SETTINGS = {"run.generations": 20, "world.iterations": 1000, "run.n_tests": 20}
N_SCENARIOS, N_RANDOM, N_EPOCHS = 100, 100, 5
NUMBER = gacc_resolve.signal


@wp.func
def share(team: Team, scene: Scene, p: Params) -> None:
    """Set the demand for each type over the share of its parts that are missing."""
    parts = scene.plan.shape[1]
    NUMBER(team, scene, p)
    for kind in range(3):
        planned = int(0)
        missing = int(0)
        for c in range(p.n_complex):
            missing += team.missing[3 * c + kind]
            for step in range(parts):
                planned += int(scene.plan[c, step] == kind)
        if missing > 0:
            team.demand[kind] = team.demand[kind] * float(planned)


def read(signal: object) -> None:
    """Make all further kernels use a reading."""
    gacc_resolve.signal = signal
    episode._episode_kernel.cache_clear()


def main() -> None:
    """Play and evolve under both readings."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=4)
    seeds = range(1, parser.parse_args().seeds + 1)
    world = conevo.world(TASK, iterations=SETTINGS["world.iterations"])
    hashes = [conevo.Rollout(world).fingerprint]
    teams = [controlled(world, name, h) for h, name in enumerate(world.heuristics)]
    teams.append(random_networks(world, N_RANDOM, 1, "demand"))
    teams.append(random_clones(world, N_RANDOM, 1, "demand"))
    with tempfile.TemporaryDirectory() as folder:
        runs = [evolved(Path(folder) / f"number-{seed}", seed) for seed in seeds]
        teams += [champion(run, f"HomCNE, seed {k}") for k, run in zip(seeds, runs, strict=True)]
        before = [delivered(world, some) for some in teams]
        read(share)
        hashes.append(conevo.Rollout(world).fingerprint)
        assert hashes[0] != hashes[1]
        after = [delivered(world, some) for some in teams]
        others = [evolved(Path(folder) / f"share-{seed}", seed) for seed in seeds]
        tests = [np.array([tested(run) for run in some]) for some in (runs, others)]
    print(f"delivered in {TASK}, {SETTINGS['world.iterations']} iterations: number, share, change")
    for some, one, other in zip(teams, before, after, strict=True):
        print(line(some.kinds[0], one, other))
    print(line("evolved under each", *tests))


def line(name: str, one: np.ndarray, other: np.ndarray) -> str:
    """Return two means and the mean difference of pairs with its standard error."""
    change = other - one
    means = f"{one.mean():7.3f} {other.mean():7.3f}"
    return f"{name:20} {means} {change.mean():+.3f} +- {error(change):.3f}"


def evolved(path: Path, seed: int) -> conevo.Run:
    """Return a run of HomCNE under the present reading."""
    return conevo.evolve(TASK, "homcne", "smoke", seed, path, overrides=SETTINGS)


def tested(run: conevo.Run) -> float:
    """Return the mean task performance of a run's testing phase."""
    return float(run.test_result["champion"]["performance"]["delivered"]["mean"])


def delivered(world, teams) -> np.ndarray:
    """Return objects delivered: by one team per scenario, of random ones each team's mean."""
    n = N_EPOCHS if len(teams.kinds) > 1 else N_SCENARIOS
    out = play(world, teams, keys_of(1, n, "demand"), None)
    return sample(out.performance["delivered"], list(range(len(teams.kinds))))


if __name__ == "__main__":
    main()
