"""Team-steps per second of tasks of other packages, with networks, on one thread by default.

A team-step is one iteration of one epoch with all its robots. Teams have random genotypes, every
robot different. Epochs that have ended are still simulated until all have, but do not count. The
package's environments are made before the clock starts. A column has the share of controllers.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np

from conevo.controllers.registry import controller
from conevo.rng import fold
from conevo.simulators import networks
from conevo.worlds.checks import random_teams
from conevo.worlds.registry import world as build_world
from conevo.worlds.simulators import simulator
from machine import alternate, machine, spread, table

SEED = 2009
TASKS = ("vmas:dispersion", "vmas:balance", "vmas:discovery")
ITERATIONS = 50
PACKAGES = (
    "vmas",
    "torch",
    "pettingzoo",
    "mpe2",
    "jaxmarl",
    "jax",
)  # those that are installed are named


def workload(task: str, n: int, iterations: int, threads: int) -> Callable[[], tuple[float, float]]:
    """Return a function that plays ``n`` teams: team-steps/s, and the share of controllers."""
    world = build_world(task, iterations=iterations)
    made = simulator(world, controller(world=world), threads)
    genes, teams = random_teams(world, n)
    scenarios = world.scenarios([fold(SEED, "epoch", 0, 0)])

    def measure() -> tuple[float, float]:
        thinking, think = [0.0], networks.Networks.think

        def timed(many: networks.Networks, inputs: networks.Floats) -> networks.Floats:
            began = time.perf_counter()
            outputs = think(many, inputs)
            thinking[0] += time.perf_counter() - began
            return outputs

        networks.Networks.think = timed  # type: ignore[method-assign]
        try:
            began = time.perf_counter()
            outcome = made.evaluate(genes, teams, scenarios)
            seconds = time.perf_counter() - began
        finally:
            networks.Networks.think = think  # type: ignore[method-assign]
        assert outcome.steps is not None
        return int(outcome.steps.sum()) / seconds, thinking[0] / seconds

    measure()
    return measure


def thinking(task: str, n: int, kind: type) -> Callable[[], float]:
    """Return a function that lets n robots of a task think: milliseconds."""
    world = build_world(task)
    genes, teams = random_teams(world, n)
    n_outputs, rows = len(world.outputs), teams[:, 0]
    blocks = [
        kind(controller(world=world), genes, rows[k : k + networks.BLOCK], n_outputs)
        for k in range(0, n, networks.BLOCK)
    ]
    inputs = np.ones((networks.BLOCK, len(world.inputs)), np.float32)

    def measure() -> float:
        began = time.perf_counter()
        for block, k in zip(blocks, range(0, n, networks.BLOCK), strict=True):
            block.think(inputs[: min(networks.BLOCK, n - k)])
        return time.perf_counter() - began

    measure()
    return measure


def main() -> None:
    """Measure every task with every number of teams, in turns; print tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", nargs="+", default=TASKS)
    parser.add_argument("--teams", type=int, nargs="+", default=[64, 512, 4096])
    parser.add_argument("--iterations", type=int, default=ITERATIONS)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()

    print(machine("conevo", "numpy", *filter(find_spec, PACKAGES)))
    work = {
        (task, n): workload(task, n, options.iterations, options.threads)
        for task in options.task
        for n in options.teams
    }
    rows = []
    for (task, n), found in alternate(work, options.repeats).items():
        speeds, shares = zip(*found, strict=True)
        rows.append([task, n, *spread(speeds, digits=1), f"{100 * np.median(shares):.0f} %"])
    head = ["task", "teams", "thousand team-steps/s", "lowest - highest", "controllers"]
    print(
        f"\n{options.iterations} iterations, {options.threads} threads, "
        f"{options.repeats} repeats in turns; medians\n"
    )
    print(table(head, rows))

    kinds = {"one after another": networks._Elman, "forward": networks._Any}
    times = alternate(
        {name: thinking(options.task[0], 4096, kind) for name, kind in kinds.items()}, 21
    )
    print("\n4096 robots think once, 21 repeats in turns\n")
    print(
        table(
            ["sums", "ms", "lowest - highest"],
            [[name, *spread(t, 1e-3, 2)] for name, t in times.items()],
        )
    )
    print("\n" + machine())


if __name__ == "__main__":
    main()
