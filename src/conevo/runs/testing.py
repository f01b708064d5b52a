"""The testing phase, after evolution: finalists are validated, then the champion is tested.

Nitschke 2009, section 5.4: evolution phase, then testing phase with 20 executions. Neither is
counted in a run's team evaluations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError
from conevo.rng import fold
from conevo.runs.champions import Finalists, Team
from conevo.runs.evaluation import describe
from conevo.worlds.protocol import Simulator, World

__all__ = ["refuse_numbers", "spread", "test_team", "validate"]

MOST_TESTS = 10_000  # scenarios of a test, as of ``RunSettings.n_tests``


def refuse_numbers(scenarios: int | None, seed: int | None) -> None:
    """Raise UsageError if a number of scenarios or a seed, where given, is out of bounds."""
    for name, value, least, most in (
        ("scenarios", scenarios, 1, MOST_TESTS),
        ("seed", seed, 0, 2**63 - 1),
    ):
        if value is not None and not (type(value) is int and least <= value <= most):
            raise UsageError(
                f"{name} = {value!r}: must be a whole number from {least:,} to {most:,}"
            )


def validate(
    simulator: Simulator,
    world: World,
    finalists: Sequence[Team],
    *,
    n_scenarios: int,
    seed: int,
    credit: str,
    selected: Mapping[int, Mapping[str, float | None]],
) -> tuple[Team, dict[str, Any]]:
    """Choose the champion among finalists, in scenarios that no generation has met.

    The best of many generations on the same few scenarios was also lucky: the more generations, the
    luckier. Further scenarios distinguish the good teams from the lucky ones.

    Choice: the champion is the finalist whose robots have the highest mean fitness over all
    validation scenarios, one with a scenario that is not finite last, of equal ones the fittest by
    selection.

    Args:
        simulator: of the world.
        world: the task.
        finalists: the fittest teams of the run, the fittest first.
        n_scenarios: validation scenarios, the same for all.
        seed: the run's.
        credit: as in ``RunSettings``.
        selected: task performance of each finalist's generation in the scenarios it was chosen on.

    Returns:
        The champion, and plain data: the number of scenarios, the chosen generation, and for each
        finalist its generation, its robots' mean fitness and its performance: at "selection"
        (without fitness if the credit is a difference, which cannot be compared), and in
        "validation" as results of ``spread``.
    """
    scenarios = world.scenarios([fold(seed, "validation", k) for k in range(n_scenarios)])
    outcome = simulator.evaluate(*Finalists.of(finalists).as_trials(), scenarios)
    fitness = outcome.fitness.astype(np.float64).mean(axis=2)
    robots = len(finalists[0].fitness) if credit == "team" else 1  # each is credited with their sum
    is_fitness = credit != "difference"
    rows = [
        {
            "generation": team.generation,
            "selection": {
                "fitness": _finite(team.mean_fitness / robots) if is_fitness else None,
                "performance": dict(selected[team.generation]),
            },
            "validation": {
                "fitness": spread(fitness[k]),
                "performance": {name: spread(v[k]) for name, v in outcome.performance.items()},
            },
        }
        for k, team in enumerate(finalists)
    ]
    means = np.where(np.isfinite(fitness).all(axis=1), fitness.mean(axis=1), -np.inf)
    champion = finalists[int(np.argmax(means))]
    about = {"scenarios": n_scenarios, "chosen": champion.generation, "finalists": rows}
    return champion, about


def test_team(
    simulator: Simulator, world: World, team: Team, *, n_scenarios: int, seed: int
) -> dict[str, Any]:
    """Re-execute a team in scenarios that no generation has met.

    Returns:
        Plain data: the team's generation; ``spread`` of each performance measure and of the robots'
        mean fitness; S, caste, favourite setting and its share of each robot over all scenarios;
        the caste table.
    """
    scenarios = world.scenarios([fold(seed, "test", k) for k in range(n_scenarios)])
    outcome = simulator.evaluate(*team.as_trial(), scenarios)
    portrait = describe(outcome, world)
    fitness = outcome.fitness[0].astype(np.float64).mean(axis=1)
    return {
        "generation": team.generation,
        "scenarios": n_scenarios,
        "seed": seed,
        "performance": {name: spread(v[0]) for name, v in outcome.performance.items()},
        "fitness": spread(fitness),
        "specialization": [round(value, 6) for value in portrait.specialization],
        "labels": portrait.labels,
        "castes": portrait.castes,
        "favourites": portrait.favourites,
        "favourite_shares": [_finite(round(share, 6)) for share in portrait.favourite_shares],
        "n_hidden": [int(n) for n in team.active.sum(axis=1)],
    }


def spread(values: npt.NDArray[Any]) -> dict[str, Any]:
    """Return the values of one team's scenarios with their mean and standard deviation.

    A value that is not finite becomes None and does not count: "n" is the number of finite values,
    "mean" their mean (None for none), "sd" their sample standard deviation (None below two).
    """
    numbers = values.astype(np.float64)
    finite = numbers[np.isfinite(numbers)]
    return {
        "mean": float(finite.mean()) if finite.size else None,
        "sd": float(finite.std(ddof=1)) if finite.size > 1 else None,
        "n": int(finite.size),
        "values": [_finite(value) for value in numbers],
    }


def _finite(value: float) -> float | None:
    """Return a number as JSON has it."""
    return float(value) if np.isfinite(value) else None
