"""Peak memory of a thesis-sized generation: 10,000 genotypes, 20 rovers, 10 epochs.

A whole run of one generation, with its checkpoint. It has fewer iterations, because memory does
not depend on their number: a world's state is overwritten in place. Each method has its own
process, so that its peak is its own.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import tempfile
from pathlib import Path

from machine import machine, table

METHODS = ("homcne", "hetcne", "ccga", "mesp", "cone")


def peak(method: str, world: str, iterations: int) -> list[object]:
    """Run one generation in this process and return a row of the table."""
    from conevo.runs.config import resolve
    from conevo.runs.start import start

    overrides = {"run.generations": 1, "run.n_tests": 1, "world.iterations": iterations}
    config = resolve(world, method, "thesis", seed=1, overrides=overrides)
    with tempfile.TemporaryDirectory() as folder:
        run = start(config, Path(folder) / "run").resume()
        teams = run.generations()[-1]["team_evaluations"]
        checkpoint = max(file.stat().st_size for file in run.path.rglob("*.npz"))
    kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return [method, teams, f"{kib / 2**20:.2f}", f"{checkpoint / 2**20:.1f}"]


def main() -> None:
    """Measure every method and print a markdown table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", default="rover/complex-5")
    parser.add_argument("--iterations", type=int, default=25)
    parser.add_argument("--methods", nargs="+", default=METHODS)
    options = parser.parse_args()
    print(machine("conevo", "numpy", "warp-lang"), "\n")
    print(f"{options.world}, preset thesis, one generation, {options.iterations} iterations\n")
    work = [(method, options.world, options.iterations) for method in options.methods]
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        rows = pool.starmap(peak, work, chunksize=1)
    print(table(["method", "team evaluations", "peak RSS, GiB", "largest file, MiB"], rows))
    print("\n" + machine())


if __name__ == "__main__":
    main()
