"""Play the heuristic controllers of a task, each in all robots, in fresh scenarios.

    python experiments/heuristics.py vmas:balance

prints the mean and standard deviation of each measure over the scenarios. Worlds of the package,
worlds from files, and tasks of other packages are named as in ``conevo run``.
"""

from __future__ import annotations

import argparse

import numpy as np

from conevo.controllers.registry import controller
from conevo.errors import ConevoError
from conevo.numbers import plus_minus
from conevo.rng import fold
from conevo.worlds.registry import world
from conevo.worlds.simulators import simulator
from pages import table


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("task")
    parser.add_argument("--scenarios", type=int, default=256)
    parser.add_argument("--seed", type=int, default=77)
    args = parser.parse_args()
    if args.scenarios < 2:
        parser.error("--scenarios must be 2 or more")
    try:
        print(table_of(args.task, args.scenarios, args.seed))
    except ConevoError as error:
        parser.error(str(error))


def table_of(name: str, n: int, seed: int) -> str:
    """Return the table of a task, over n scenarios.

    Raises:
        ConevoError: there is no such task, or its package is missing.
    """
    task = world(name)
    mind = controller(world=task)
    genome = mind.genome(len(task.inputs), len(task.outputs))
    keys = [fold(seed, "heuristics", k) for k in range(n)]
    play = simulator(task, mind)
    pool = np.zeros((1, genome.n_genes), np.float32)
    slots = np.full((1, task.n_robots, genome.max_parts), -1, np.int32)
    rows = []
    for k, name in enumerate(task.heuristics):
        modes = np.full((1, task.n_robots), k, np.int32)
        of = play.evaluate(pool, slots, task.scenarios(keys), modes).performance
        rows.append([name, *(plus_minus(one.mean(), one.std(ddof=1)) for one in of.values())])
    return table(["controller", *of], rows)


if __name__ == "__main__":
    main()
