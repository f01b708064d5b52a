"""The generation loop: ask, evaluate, tell, until a generation is done; stop when it is time to."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from conevo.errors import UsageError
from conevo.evolution.protocol import Method, Scores, State
from conevo.runs.config import RunSettings
from conevo.runs.evaluation import FITTEST, Evaluate, Portrait, describe
from conevo.terms import counted
from conevo.worlds.measures import Measure

__all__ = ["check_budget", "evolve_generations", "has_reached", "price"]

Record = dict[str, Any]


def evolve_generations(
    method: Method,
    state: State,
    evaluate: Evaluate,
    *,
    settings: RunSettings,
    main: Measure,
    castes: tuple[str, ...],
    iterations: int,
    last: Record | None = None,
    on_generation: Callable[[State, Record], None],
    has_time: Callable[[], bool] = lambda: True,
) -> str:
    """Carry a population forward, one whole generation after another, and say why it stopped.

    Args:
        method: init / ask / tell.
        state: the method's state at the beginning of a generation.
        evaluate: plays trials.
        settings: the stop conditions.
        main: the world's main measure of task performance.
        castes: names of the world's castes.
        iterations: of one epoch of the world.
        last: record of the generation before, if there was one.
        on_generation: called with the state after a generation and the generation's record.
        has_time: asked before each generation whether it may begin.

    Returns:
        "generations", "target" or "budget": the end. "time": not yet, but there is no time left.
    """
    while True:
        if last is not None and has_reached(settings.target, main, last["performance"]):
            return "target"
        if state.generation >= settings.generations:
            return "generations"
        if not has_time():
            return "time"
        started = time.perf_counter()
        finished = _run_generation(method, state, evaluate, castes, settings.budget_evaluations)
        if finished is None:
            return "budget"
        began, (state, portrait, spent) = state, finished
        steps = _team_steps(spent, settings, iterations) + (last["team_steps"] if last else 0)
        last = _record(began, state, portrait, spent, steps, time.perf_counter() - started)
        on_generation(state, last)


def price(method: Method, state: State) -> int:
    """Return the team evaluations of the first generation.

    ask and tell are pure, so it can be priced with empty scores.
    """
    while state.generation == 0:
        trials = method.ask(state)
        empty = np.zeros(trials.teams.shape[:2])
        state = method.tell(state, trials, Scores(fitness=empty, specialization=empty))
    return int(state.team_evaluations)


def check_budget(method: Method, state: State, budget: int) -> None:
    """Refuse a budget that does not pay for the first generation.

    Raises:
        UsageError: no generation could be finished.
    """
    if budget and (first := price(method, state)) > budget:
        raise UsageError(
            f"run.budget_evaluations = {budget} does not pay for one generation: "
            f"the first takes {counted(first, 'team evaluation')}"
        )


def _run_generation(
    method: Method, state: State, evaluate: Evaluate, castes: tuple[str, ...], budget: int
) -> tuple[State, Portrait, Counter[str]] | None:
    """Return what one generation leaves, None if it cannot be paid.

    That is the state after it, its fittest team's portrait, and the team evaluations by phase.

    Choice: a phase that the budget cannot pay is not begun, and a generation that could not be
    finished does not count, so that a run never spends more than its budget.
    """
    generation = state.generation
    portrait: Portrait | None = None
    spent: Counter[str] = Counter()
    while state.generation == generation:
        trials = method.ask(state)
        if budget and state.team_evaluations + len(trials.teams) > budget:
            return None
        spent[trials.phase] += len(trials.teams)
        evaluation = evaluate(trials)
        if trials.phase == "fittest":
            portrait = describe(evaluation.outcome, castes)
        state = method.tell(state, trials, evaluation.scores)
    if portrait is None:
        raise RuntimeError(f"{method.name} finished a generation without its fittest team")
    return state, portrait, spent


def _team_steps(spent: Mapping[str, int], settings: RunSettings, iterations: int) -> int:
    """Return the team-steps of one generation, given its team evaluations by phase."""
    epochs = sum(
        n * (settings.fittest_epochs if phase in FITTEST else settings.epochs)
        for phase, n in spent.items()
    )
    return epochs * iterations


def _record(
    began: State,
    state: State,
    portrait: Portrait,
    spent: Mapping[str, int],
    team_steps: int,
    seconds: float,
) -> Record:
    """Return what the run's log says about a generation, given the states before and after it.

    Team evaluations and team-steps are the run's so far, those for type C the generation's own.
    Thresholds and sizes are those the generation was played and bred with, not the next one's.
    """
    return {
        "generation": began.generation,
        "team_evaluations": int(state.team_evaluations),
        "type_c_evaluations": spent.get("elites", 0),
        "team_steps": team_steps,
        "seconds": round(seconds, 4),
        "best_fitness": _finite(state.best_fitness),
        "mean_fitness": _finite(state.mean_fitness),
        "team_fitness": _finite(np.mean(state.fittest_fitness)),
        "performance": {name: _finite(value) for name, value in portrait.performance.items()},
        "castes": portrait.castes,
        "specialization": _finite(np.mean(state.fittest_specialization)),
        "sst": _finite(began.sst),
        "gst": _finite(began.gst),
        "recombinations": int(state.recombinations),
        "n_hidden": [int(n) for n in np.atleast_1d(began.n_hidden)],
        "n_nonfinite": int(state.n_nonfinite),
    }


def _finite(value: Any) -> float | None:
    """Return a number that JSON can hold: not-a-number and infinity become null."""
    return float(value) if math.isfinite(value) else None


def has_reached(
    target: float | None, main: Measure, performance: Mapping[str, float | None]
) -> bool:
    """Whether the main measure is as good as the target."""
    value = performance.get(main.name)
    return target is not None and value is not None and main.reaches(value, target)
