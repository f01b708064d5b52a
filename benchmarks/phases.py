"""Cycles of a team-step, phase by phase, on one CPU thread (or one lane of a CUDA block).

Teams of random networks, of heuristic robots, and half and half; see ``simulator.py`` for the rest.
"""

from __future__ import annotations

import argparse

import numpy as np

from conevo.rng import fold
from conevo.worlds.registry import world as build_world
from conevo.worlds.rollout import Rollout
from machine import machine, table
from simulator import SEED, WORLDS, label, random_teams


def main() -> None:
    """Print a table for each world."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", nargs="+", default=WORLDS)
    parser.add_argument("--iterations", type=int, default=1000)
    parser.add_argument("--batch", type=int, default=32)
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()

    for path in options.world:
        world = build_world(path, iterations=options.iterations)
        scenarios = world.scenarios([fold(SEED, "epoch", 0, 0)])
        columns = {}
        for kind in ("networks", "mixed", "heuristic"):
            rollout = Rollout(world, n_threads=1, device=options.device, timed=True)
            genes, teams = random_teams(rollout, options.batch)
            modes = np.full(teams.shape[:2], -1, np.int32)
            step = {"networks": 0, "mixed": 2, "heuristic": 1}[kind]
            if step:
                modes[:, ::step] = np.arange(len(modes[0, ::step])) % len(world.heuristics)
            rollout.evaluate(genes, teams, scenarios, modes)
            columns[kind] = rollout.cycles
        steps = options.batch * options.iterations
        rows = [
            (phase, *(f"{columns[kind][phase] / steps:,.0f}" for kind in columns))
            for phase in columns["networks"]
        ]
        totals = (f"{sum(one.values()) / steps:,.0f}" for one in columns.values())
        print(f"\n{label(world)}: cycles of a team-step\n")
        print(table(("phase", *columns), [*rows, ("all", *totals)]))
    print(f"\n{machine()}")


if __name__ == "__main__":
    main()
