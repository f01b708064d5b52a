"""The testing phase: the fittest team of a run, re-executed in fresh scenarios.

Nitschke 2009, section 5.4: evolution phase, then testing phase with 20 executions.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.rng import fold
from conevo.runs.champions import Team
from conevo.runs.evaluation import describe
from conevo.worlds.protocol import World
from conevo.worlds.rollout import Rollout

__all__ = ["test_team"]


def test_team(
    rollout: Rollout, world: World, team: Team, *, n_scenarios: int, seed: int
) -> dict[str, Any]:
    """Re-execute a team in scenarios that no generation has met.

    Returns:
        Plain data: the team's generation; mean, sd and all values of each performance measure and
        of the robots' mean fitness; S and caste of each robot over all scenarios; the caste table.
    """
    scenarios = world.scenarios([fold(seed, "test", k) for k in range(n_scenarios)])
    outcome = rollout.evaluate(*team.as_trial(), scenarios)
    portrait = describe(outcome, world.castes)
    fitness = outcome.fitness[0].astype(np.float64).mean(axis=1)
    return {
        "generation": team.generation,
        "scenarios": n_scenarios,
        "seed": seed,
        "performance": {name: _spread(v[0]) for name, v in outcome.performance.items()},
        "fitness": _spread(fitness),
        "specialization": [round(value, 6) for value in portrait.specialization],
        "labels": portrait.labels,
        "castes": portrait.castes,
        "n_hidden": [int(n) for n in team.active.sum(axis=1)],
    }


def _spread(values: npt.NDArray[Any]) -> dict[str, Any]:
    """Return mean, sample standard deviation (0 for a single value) and the finite values."""
    numbers = values.astype(np.float64)
    finite = numbers[np.isfinite(numbers)]
    return {
        "mean": float(finite.mean()) if finite.size else None,
        "sd": float(finite.std(ddof=1)) if finite.size > 1 else 0.0,
        "values": [float(value) for value in finite],
    }
