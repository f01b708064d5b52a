"""Everything about the behaviours of a run's fittest team, as plain data."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from conevo.analysis.behaviours import Rules
from conevo.analysis.captures import most_frequent
from conevo.analysis.pursuit import observe
from conevo.analysis.reproduction import reproduce_individuals
from conevo.runs.run import Run

__all__ = ["behaviour_report"]


def behaviour_report(
    run: Run,
    scenarios: int = 20,
    seed: int | None = None,
    *,
    threads: int | None = None,
    rules: Rules | None = None,
) -> dict[str, Any]:
    """Observe the fittest team of a run and return what ``conevo behaviours`` prints.

    Plain data: run, task, generation (of the team), scenarios, seed, rules, capture_time;
    predators, each one's shares, windows, switches, specialization and label; collective (the most
    frequent) and captures (of each name); sensors (averages and profiles) and reproduction (what
    each predator does with its sensors held at the averages).

    Raises:
        UsageError: another world, no generation has finished yet, or made with other kernels.
    """
    seen = observe(run, scenarios, seed, threads=threads, rules=rules)
    collective, captures = most_frequent(seen.all_captures)
    return {
        "run": str(run.path),
        "task": run.config.task,
        "generation": seen.team.generation,
        "scenarios": scenarios,
        "seed": seen.seed,
        "rules": asdict(seen.rules),
        "capture_time": seen.capture_time,
        "predators": [asdict(life) for life in seen.lifetimes],
        "collective": collective,
        "captures": captures,
        "sensors": seen.sensor_table(),
        "reproduction": reproduce_individuals(seen),
    }
