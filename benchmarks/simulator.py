"""Team-steps per second of the simulator.

A team-step is one iteration of one world with all its robots. Teams of random genotypes (uniform in
[-1, 1], every robot different); scenarios are drawn before the clock starts; decoding the
genotypes, resetting the world and scoring are inside it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from conevo.rng import fold, stream
from conevo.worlds.registry import world as build_world
from conevo.worlds.rollout import Rollout
from machine import alternate, machine, spread, table

SEED = 2009


def workload(world: object, rollout: Rollout, batch: int) -> Callable[[], float]:
    """Return a function that evaluates ``batch`` teams once and gives team-steps per second."""
    spec, n_robots = world.controller, world.n_robots
    rng = stream(SEED, "genes", batch)
    slots = np.full(spec.max_hidden, -1, dtype=np.int32)
    slots[: spec.n_hidden] = np.arange(spec.n_hidden, dtype=np.int32)
    robots = np.arange(batch * n_robots, dtype=np.int32) * spec.n_hidden
    teams = np.where(slots >= 0, robots[:, None] + slots, -1).astype(np.int32)
    teams = teams.reshape(batch, n_robots, spec.max_hidden)
    n_genotypes = batch * n_robots * spec.n_hidden
    genes = rng.uniform(-1.0, 1.0, (n_genotypes, spec.n_genes)).astype(np.float32)
    scenarios = world.scenarios([fold(SEED, "epoch", 0, 0)])

    def measure() -> float:
        began = time.perf_counter()
        outcome = rollout.evaluate(genes, teams, scenarios)
        seconds = time.perf_counter() - began
        assert outcome.fitness.shape[0] == batch
        return batch * world.iterations / seconds

    return measure


def main() -> None:
    """Measure every batch with every number of threads, in turns, and print a markdown table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", default="rover/complex-5")
    parser.add_argument("--iterations", type=int, default=2500)
    parser.add_argument("--batch", type=int, nargs="+", default=[64, 512])
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()

    world = build_world(options.world, iterations=options.iterations)
    brief = build_world(options.world, iterations=2)
    work: dict[str, Callable[[], float]] = {}
    for threads in options.threads:
        workload(brief, Rollout(brief, n_threads=threads, device=options.device), 2)()  # compiles
        rollout = Rollout(world, n_threads=threads, device=options.device)
        for batch in options.batch:
            work[f"{batch} {threads}"] = workload(world, rollout, batch)
    print(machine("conevo", "numpy", "warp-lang"), "\n")
    results = alternate(work, options.repeats)

    spec, n_robots = world.controller, world.n_robots
    print(
        f"{options.world}, {n_robots} robots, {spec.n_inputs}-{spec.n_hidden}-{spec.n_outputs} "
        f"recurrent networks, {options.iterations} iterations, {options.device}, "
        f"{options.repeats} repeats in turns; thousands per second\n"
    )
    rows = []
    for name, values in results.items():
        batch, threads = name.split()
        robots = [value * n_robots for value in values]
        rows.append([batch, threads, *spread(values), spread(robots)[0]])
    head = ["batch", "threads", "team-steps/s, median", "lowest - highest", "robot-steps/s"]
    print(table(head, rows))
    print("\n" + machine())


if __name__ == "__main__":
    main()
