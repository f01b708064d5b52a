"""Team-steps per second of networks of any topology, next to simple recurrent networks.

Networks of the controller ``graph`` have the connections of the world's recurrent networks: inputs
and hidden nodes (of the previous iteration) to hidden nodes, these to outputs. All else is as in
``simulator.py``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from conevo.controllers.graph import Graph
from conevo.controllers.registry import controller
from conevo.controllers.srn import Srn
from conevo.rng import fold, stream
from conevo.worlds.protocol import World
from conevo.worlds.registry import world as build_world
from conevo.worlds.rollout import Rollout
from machine import alternate, machine, spread, table
from simulator import SEED, WORLDS, Genes, Rows, random_teams


def same_connections(world: World, mind: Srn, rollout: Rollout, batch: int) -> tuple[Genes, Rows]:
    """Return a pool and teams of graphs with the connections of simple recurrent networks."""
    n_inputs, n_outputs, n_hidden = len(world.inputs), len(world.outputs), mind.n_hidden
    n_nodes, n_genes = n_outputs + n_hidden, rollout.genome.n_genes
    shape = (batch * world.n_robots, n_nodes, n_genes)
    genes = stream(SEED, "graphs", batch).uniform(-1, 1, shape).astype(np.float32)
    exists = np.zeros((n_nodes, n_genes), dtype=np.bool_)
    hidden = slice(n_inputs + 1 + n_outputs, n_inputs + 1 + n_nodes)
    exists[n_outputs:, :n_inputs] = True
    exists[n_outputs:, hidden] = mind.recurrent
    exists[:n_outputs, hidden] = True
    slots = np.full((batch * world.n_robots, rollout.genome.max_parts), -1, dtype=np.int32)
    slots[:, :n_nodes] = np.arange(shape[0] * n_nodes).reshape(-1, n_nodes)
    return (genes * exists).reshape(-1, n_genes), slots.reshape(batch, world.n_robots, -1)


def workload(world: World, rollout: Rollout, teams: tuple[Genes, Rows]) -> Callable[[], float]:
    """Return a function that evaluates teams once and returns team-steps per second."""
    scenarios = world.scenarios([fold(SEED, "epoch", 0, 0)])

    def measure() -> float:
        began = time.perf_counter()
        rollout.evaluate(*teams, scenarios)
        return len(teams[1]) * world.params.iterations / (time.perf_counter() - began)

    return measure


def main() -> None:
    """Measure both controllers in every world in turns; print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", nargs="+", default=WORLDS)
    parser.add_argument("--iterations", type=int, help="of an epoch; by default the world's own")
    parser.add_argument("--batch", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()

    length = {} if options.iterations is None else {"iterations": options.iterations}
    work: dict[tuple[str, str], Callable[[], float]] = {}
    sizes = {}
    for path in options.world:
        world = build_world(path, **length)
        mind = controller(world=world)
        assert isinstance(mind, Srn)
        recurrent = Rollout(world, mind, n_threads=1, device=options.device)
        work[path, "srn"] = workload(world, recurrent, random_teams(recurrent, options.batch))
        graph = Rollout(
            world, Graph(max_hidden=mind.max_hidden), n_threads=1, device=options.device
        )
        teams = same_connections(world, mind, graph, options.batch)
        work[path, "graph"] = workload(world, graph, teams)
        n = mind.n_hidden * (len(world.inputs) + mind.n_context + len(world.outputs))
        sizes[path] = f"{world.n_robots} robots, {n} connections each"
        for measure in (work[path, "srn"], work[path, "graph"]):
            measure()  # compiles
    print(machine("conevo", "numpy", "warp-lang"))
    results = alternate(work, options.repeats)
    rows = []
    for path in options.world:
        both = [results[path, name] for name in ("srn", "graph")]
        ratio = np.median(both[1]) / np.median(both[0])
        cells = [f"{middle} ({extremes})" for middle, extremes in map(spread, both)]
        rows.append([f"{path}, {sizes[path]}", *cells, f"{ratio:.2f}"])
    print(f"\n{options.device}, batch {options.batch}, one thread; thousand team-steps/s\n")
    print(table(["world", "srn", "graph", "ratio"], rows))
    print("\n" + machine())


if __name__ == "__main__":
    main()
