"""Share of a generation spent outside the simulator, per method.

Everything between two finished generations counts: breeding, assembling teams, scores, the record,
checkpoint and elites on disk. Generation 0 (which compiles) is left out.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from functools import wraps
from pathlib import Path
from typing import Any

from conevo.runs.config import resolve
from conevo.runs.run import start
from conevo.worlds.rollout import Rollout
from machine import machine, table

METHODS = ("homcne", "hetcne", "ccga", "mesp", "cone")


def measure(options: argparse.Namespace, method: str, out: Path) -> list[object]:
    """Evolve for some generations and return a row of the table."""
    simulated = 0.0
    simulate = Rollout.evaluate

    @wraps(simulate)
    def timed(*arguments: Any, **named: Any) -> Any:
        nonlocal simulated
        began = time.perf_counter()
        outcome = simulate(*arguments, **named)
        simulated += time.perf_counter() - began
        return outcome

    marks: list[tuple[float, float, int]] = []

    def watch(_run: Any, record: dict[str, Any]) -> None:
        marks.append((time.perf_counter(), simulated, record["team_evaluations"]))

    overrides = {"run.generations": options.generations + 1, "run.n_tests": 1}
    config = resolve(options.world, method, options.preset, seed=1, overrides=overrides)
    Rollout.evaluate = timed  # type: ignore[method-assign]
    try:
        start(config, out, threads=options.threads).resume(threads=options.threads, watch=watch)
    finally:
        Rollout.evaluate = simulate  # type: ignore[method-assign]
    n = len(marks) - 1
    seconds, inside, teams = (last - first for first, last in zip(marks[0], marks[-1], strict=True))
    outside = seconds - inside
    return [
        method,
        f"{teams / n:.0f}",
        f"{seconds / n:.3f}",
        f"{1e3 * outside / n:.1f}",
        f"{100 * outside / seconds:.2f} %",
    ]


def main() -> None:
    """Measure every method and print a markdown table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", default="rover/complex-5")
    parser.add_argument("--preset", default="desk")
    parser.add_argument("--generations", type=int, default=10)
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--methods", nargs="+", default=METHODS)
    options = parser.parse_args()
    print(machine("conevo", "numpy", "warp-lang"), "\n")
    print(f"{options.world}, preset {options.preset}, {options.generations} generations\n")
    with tempfile.TemporaryDirectory() as folder:
        rows = [measure(options, method, Path(folder) / method) for method in options.methods]
    head = ["method", "team evaluations", "s per generation", "outside, ms", "outside, share"]
    print(table(head, rows))
    print("\n" + machine())


if __name__ == "__main__":
    main()
