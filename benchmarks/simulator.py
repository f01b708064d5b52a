"""Team-steps per second of the simulator.

A team-step is one iteration of one world with all its robots. Teams have random genotypes (uniform
in [-1, 1], every robot different). Scenarios are drawn before the clock starts; decoding the
genotypes, resetting the world and scoring are measured. Robot-steps count the team's robots only:
in pursuit-evasion the prey is simulated, too, but not counted.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from conevo.controllers.registry import controller
from conevo.controllers.srn import Srn
from conevo.rng import fold, stream
from conevo.worlds.protocol import World
from conevo.worlds.registry import world as build_world
from conevo.worlds.rollout import Rollout
from machine import alternate, machine, spread, table

Genes = npt.NDArray[np.float32]
Rows = npt.NDArray[np.int32]

SEED = 2009
WORLDS = ("rover/complex-5", "pursuit/team-3", "gacc/complex-9")


def random_teams(rollout: Rollout, batch: int) -> tuple[Genes, Rows]:
    """Return a pool of random genotypes and ``batch`` teams of them, every robot different."""
    genome, n_robots = rollout.genome, rollout.world.n_robots
    rng = stream(SEED, "genes", batch)
    slots = np.full(genome.max_parts, -1, dtype=np.int32)
    slots[: genome.n_parts] = np.arange(genome.n_parts, dtype=np.int32)
    robots = np.arange(batch * n_robots, dtype=np.int32) * genome.n_parts
    teams = np.where(slots >= 0, robots[:, None] + slots, -1).astype(np.int32)
    teams = teams.reshape(batch, n_robots, genome.max_parts)
    n_genotypes = batch * n_robots * genome.n_parts
    genes = rng.uniform(-1.0, 1.0, (n_genotypes, genome.n_genes)).astype(np.float32)
    return genes, teams


def workload(world: World, rollout: Rollout, batch: int) -> Callable[[], float]:
    """Return a function that evaluates ``batch`` teams once and returns team-steps per second."""
    genes, teams = random_teams(rollout, batch)
    scenarios = world.scenarios([fold(SEED, "epoch", 0, 0)])

    def measure() -> float:
        began = time.perf_counter()
        outcome = rollout.evaluate(genes, teams, scenarios)
        seconds = time.perf_counter() - began
        assert outcome.fitness.shape[0] == batch
        return batch * world.params.iterations / seconds

    return measure


def label(world: World) -> str:
    """Return the simulated world in words: robots, their networks, iterations."""
    mind = controller(world=world)
    assert isinstance(mind, Srn)
    name = f"{world.name.rpartition('-v')[0]}/{world.environment}"
    sizes = f"{len(world.inputs) + mind.n_context}-{mind.n_hidden}-{len(world.outputs)}"
    return (
        f"{name}, {world.n_robots} robots, {sizes} recurrent networks, "
        f"{world.params.iterations} iterations"
    )


def main() -> None:
    """Measure every world with every batch and number of threads, in turns; print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", nargs="+", default=WORLDS)
    parser.add_argument("--iterations", type=int, help="of an epoch; by default the world's own")
    parser.add_argument("--batch", type=int, nargs="+", default=[64, 512])
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()

    length = {} if options.iterations is None else {"iterations": options.iterations}
    worlds = {path: build_world(path, **length) for path in options.world}
    work: dict[tuple[str, int, int], Callable[[], float]] = {}
    for path, world in worlds.items():
        brief = build_world(path, iterations=2)
        for threads in options.threads:
            compile_first = Rollout(brief, n_threads=threads, device=options.device)
            workload(brief, compile_first, 2)()
            rollout = Rollout(world, n_threads=threads, device=options.device)
            for batch in options.batch:
                work[path, batch, threads] = workload(world, rollout, batch)
    print(machine("conevo", "numpy", "warp-lang"))
    results = alternate(work, options.repeats)

    head = ["batch", "threads", "team-steps/s, median", "lowest - highest", "robot-steps/s"]
    for path, world in worlds.items():
        print(f"\n{label(world)}, {options.device}, {options.repeats} repeats in turns; ", end="")
        print("thousands per second\n")
        rows = []
        for (measured, batch, threads), values in results.items():
            if measured == path:
                robots = [value * world.n_robots for value in values]
                rows.append([batch, threads, *spread(values), spread(robots)[0]])
        print(table(head, rows))
    print("\n" + machine())


if __name__ == "__main__":
    main()
