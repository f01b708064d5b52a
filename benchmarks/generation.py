"""Share of a generation spent outside the simulator, and outside its kernel, per method.

Everything between two finished generations counts: breeding, assembling teams, scores, the record,
checkpoint and elites on disk. Generation 0 (which compiles) is left out. With ``--iterations 2``
epochs take hardly any time: the rest is the part that a faster device does not shorten.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from functools import wraps
from pathlib import Path
from typing import Any, Self

from conevo.runs.config import resolve
from conevo.runs.start import start
from conevo.worlds.rollout import Rollout
from machine import machine, table

METHODS = ("homcne", "hetcne", "ccga", "mesp", "cone")
HEAD = (
    "method",
    "team evaluations",
    "s per generation",
    "outside the simulator, ms",
    "share",
    "outside the kernel, ms",
    "share",
)


class Timed:
    """A context that adds up the seconds in a method of a class."""

    def __init__(self, owner: type, name: str) -> None:
        self.owner, self.name, self.seconds = owner, name, 0.0
        self._method = getattr(owner, name)

    def __enter__(self) -> Self:
        @wraps(self._method)
        def timed(*arguments: Any, **named: Any) -> Any:
            began = time.perf_counter()
            try:
                return self._method(*arguments, **named)
            finally:
                self.seconds += time.perf_counter() - began

        setattr(self.owner, self.name, timed)
        return self

    def __exit__(self, *_: object) -> None:
        setattr(self.owner, self.name, self._method)


def measure(
    world: str,
    method: str,
    preset: str,
    out: Path,
    *,
    generations: int,
    threads: int | None = None,
    device: str = "cpu",
    settings: dict[str, Any] | None = None,
) -> list[object]:
    """Evolve for some generations after the first and return a row of the table."""
    marks: list[tuple[float, ...]] = []
    overrides = {"run.generations": generations + 1, "run.n_tests": 1} | (settings or {})
    config = resolve(world, method, preset, seed=1, overrides=overrides)
    with Timed(Rollout, "evaluate") as simulated, Timed(Rollout, "_launch") as launched:

        def watch(_run: Any, record: dict[str, Any]) -> None:
            now = time.perf_counter()
            marks.append((now, simulated.seconds, launched.seconds, record["team_evaluations"]))

        start(config, out, threads=threads, device=device).resume(threads=threads, watch=watch)
    n = len(marks) - 1
    seconds, inside, kernel, teams = (b - a for a, b in zip(marks[0], marks[-1], strict=True))
    row: list[object] = [method, f"{teams / n:.0f}", f"{seconds / n:.3f}"]
    for part in (inside, kernel):
        row += [f"{1e3 * (seconds - part) / n:.1f}", f"{100 * (seconds - part) / seconds:.2f} %"]
    return row


def main() -> None:
    """Measure every method and print a markdown table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", default="rover/complex-5")
    parser.add_argument("--preset", default="desk")
    parser.add_argument("--generations", type=int, default=10)
    parser.add_argument("--iterations", type=int, help="of an epoch; by default the preset's")
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--methods", nargs="+", default=METHODS)
    options = parser.parse_args()
    settings = {} if options.iterations is None else {"world.iterations": options.iterations}
    print(machine("conevo", "numpy", "warp-lang"), "\n")
    length = f", {options.iterations} iterations" if settings else ""
    print(
        f"{options.world}, preset {options.preset}{length}, {options.generations} generations, "
        f"{options.device}\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        rows = [
            measure(
                options.world, method, options.preset, Path(folder) / method,
                generations=options.generations, threads=options.threads, device=options.device,
                settings=settings,
            )
            for method in options.methods
        ]  # fmt: skip
    print(table(HEAD, rows))
    print("\n" + machine())


if __name__ == "__main__":
    main()
