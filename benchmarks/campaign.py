"""Overhead of a campaign: its wall time compared with the core time of its runs.

Five methods, two environments, four seeds at smoke scale, with each executor in turn. The ratio is
wall time / (core time of all runs / cores): 1 if every core were busy with runs all the time. A
run's core time is its worker's own, from the start of Python to the end.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from conevo.campaigns.campaign import create
from conevo.campaigns.executors.registry import EXECUTORS, make_executor
from conevo.campaigns.plan import Plan
from conevo.kernels.threads import usable_cores
from machine import machine, table

METHODS = ("homcne", "hetcne", "ccga", "mesp", "cone")


def measure(name: str, plan: Plan, cores: int, folder: Path) -> list[object]:
    """Execute the plan and return a row of the table."""
    campaign = create(plan, folder)
    began = time.perf_counter()
    executor = make_executor(name, cores)
    started = time.perf_counter() - began
    entries = campaign.carry_on(executor).values()
    wall = time.perf_counter() - began
    failed = sum(entry.state != "finished" for entry in entries)
    core = sum(entry.core_seconds for entry in entries)
    return [
        name,
        len(entries),
        failed,
        f"{started:.1f}",
        f"{wall:.1f}",
        f"{core:.1f}",
        f"{wall / (core / cores):.2f}",
        f"{(wall - started) / (core / cores):.2f}",
    ]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--executors", nargs="+", default=["processes"], choices=EXECUTORS)
    parser.add_argument("--cores", type=int, default=usable_cores())
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--studies", action="store_true", help="study every finished run, too")
    options = parser.parse_args()
    plan = Plan(
        name="benchmark",
        title="",
        produces=(),
        seeds=tuple(range(1, options.seeds + 1)),
        preset="smoke",
        shape=False,
        studies=("teams",) if options.studies else (),
        factors={"world": ("rover/complex-1", "pursuit/team-4"), "method": METHODS},
        settings={},
    )
    print(machine())
    rows = []
    for _ in range(options.repeats):
        for name in options.executors:
            with tempfile.TemporaryDirectory() as folder:
                rows.append(measure(name, plan, options.cores, Path(folder) / "campaign"))
    head = ["executor", "runs", "unfinished", "start s", "wall s", "core s", "ratio", "less start"]
    print(table(head, rows))


if __name__ == "__main__":
    main()
