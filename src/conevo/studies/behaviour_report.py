"""Everything about the behaviours of a run's fittest team, as plain data."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from conevo.runs.run import Run
from conevo.studies.observation import observe

__all__ = ["behaviour_report"]


def behaviour_report(
    run: Run,
    scenarios: int = 20,
    seed: int | None = None,
    *,
    threads: int | None = None,
    device: str | None = None,
    rules: Any = None,
) -> dict[str, Any]:
    """Observe the fittest team of a run and return what ``conevo behaviours`` prints.

    Plain data: run, task, generation (of the team), scenarios, seed; then the details that the
    world's study gives.

    Raises:
        UsageError: another world, no generation has finished yet, or made with other kernels.
    """
    found = observe(run, scenarios, seed, threads=threads, device=device, rules=rules)
    return {
        "run": str(run.path),
        "task": run.config.task,
        "generation": found.team.generation,
        "scenarios": scenarios,
        "seed": found.seed,
    } | found.seen.details([asdict(life) for life in found.lifetimes])
