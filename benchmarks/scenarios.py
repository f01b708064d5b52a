"""Milliseconds to draw the scenarios of 10, 100 and 1000 keys, for environments of every world."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

from machine import alternate, machine, spread, table

TASKS = (
    *("rover/simple-1", "rover/complex-5", "rover/extended-10"),
    *("pursuit/team-3", "pursuit/team-10", "prey/shaping-6"),
    *("gacc/simple-1", "gacc/complex-9"),
)


def drawing(task: str, n: int) -> Callable[[], float]:
    """Return a function that draws n scenarios and returns the seconds that it took."""
    from conevo.rng import fold
    from conevo.worlds.registry import world

    a_world, keys = world(task), [fold(1, "epoch", 0, e) for e in range(n)]
    a_world.scenarios(keys[:1])  # reads files, which happens only once

    def draw() -> float:
        begin = time.perf_counter()
        a_world.scenarios(keys)
        return time.perf_counter() - begin

    return draw


def main() -> None:
    """Draw in turns and print a markdown table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", nargs="+", default=TASKS)
    parser.add_argument("--keys", nargs="+", type=int, default=(10, 100, 1000))
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    print(machine("conevo", "numpy"), "\n")
    work = {(task, n): drawing(task, n) for task in options.tasks for n in options.keys}
    seconds = alternate(work, options.repeats)
    rows = [[task, n, *spread(found, 1e-3, 2)] for (task, n), found in seconds.items()]
    print(table(["environment", "keys", "ms, median", "lowest - highest"], rows))
    print("\n" + machine())


if __name__ == "__main__":
    main()
