"""Team-steps per second of worlds that are stepped from outside.

A team-step is one iteration of one world with all its robots. Outputs are random. Writing
them before each step is measured, too; resets are not.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

from conevo.rng import stream
from conevo.worlds.protocol import World
from conevo.worlds.registry import world as build_world
from conevo.worlds.stepper import Stepper
from machine import alternate, machine, spread, table
from simulator import SEED, WORLDS

KINDS = 16  # different outputs of all robots
LEAST = 20  # steps of a measurement
TEAM_STEPS = 200_000


def workload(world: World, n: int, threads: int, device: str) -> Callable[[], float]:
    """Return a function that steps ``n`` worlds for a while and returns seconds per step."""
    stepper = Stepper(world, n, 64, SEED, device, threads)
    rng = stream(SEED, "outputs", n)
    shape = (KINDS, n, world.n_robots, len(world.outputs))
    outputs = rng.normal(0.0, 3.0, shape).astype("float32")
    steps = min(world.params.iterations, max(LEAST, TEAM_STEPS // n))
    view = stepper.outputs.numpy() if stepper.device == "cpu" else None

    def measure() -> float:
        stepper.reset()
        began = time.perf_counter()
        for t in range(steps):
            if view is None:
                stepper.outputs.assign(outputs[t % KINDS])
            else:
                view[:] = outputs[t % KINDS]
            stepper.step()
        stepper.clock.numpy()  # waits for a device
        return (time.perf_counter() - began) / steps

    measure()
    return measure


def main() -> None:
    """Measure every world with every number of worlds and threads, in turns; print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", nargs="+", default=WORLDS)
    parser.add_argument("--worlds", type=int, nargs="+", default=[1, 64, 512, 4096])
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()

    work: dict[tuple[str, int, int], Callable[[], float]] = {}
    for path in options.world:
        world = build_world(path)
        for n in options.worlds:
            for threads in options.threads:
                if threads <= n:
                    work[path, n, threads] = workload(world, n, threads, options.device)
    print(machine("conevo", "numpy", "warp-lang"))
    results = alternate(work, options.repeats)
    rows = []
    for (path, n, threads), seconds in results.items():
        speeds = [n / one for one in seconds]
        rows.append([path, n, threads, spread(seconds, 1e-6, 1)[0], *spread(speeds)])
    head = ["world", "worlds", "threads", "us per step", "thousand team-steps/s"]
    print(f"\n{options.device}, {options.repeats} repeats in turns; medians\n")
    print(table([*head, "lowest - highest"], rows))
    print("\n" + machine())


if __name__ == "__main__":
    main()
