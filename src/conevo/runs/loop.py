"""The generation loop: ask, evaluate, tell, until a generation is finished or the run ends."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from conevo.errors import UsageError
from conevo.evolution.protocol import Method, Progress, Scores, State, Trials
from conevo.rng import stream
from conevo.runs.evaluation import Evaluate, Portrait
from conevo.runs.settings import RunSettings
from conevo.specialization import castes
from conevo.specialization.favourite import mean_where_defined
from conevo.terms import counted
from conevo.typing import Record
from conevo.worlds.measures import Measure
from conevo.worlds.protocol import Outcome

__all__ = ["check_budget", "evolve_generations", "has_reached", "price", "rehearse", "unscored"]

MOST_REQUESTS = 1000  # of one generation: a method that asks for more never ends it
OF_METHODS = {"type_c_evaluations", "sst", "gst", "recombinations"}  # every log has them


def evolve_generations(
    method: Method,
    state: State,
    evaluate: Evaluate,
    *,
    settings: RunSettings,
    main: Measure,
    portray: Callable[[Outcome], Portrait],
    iterations: int,
    last: Record | None = None,
    on_generation: Callable[[State, Record], None],
    has_time: Callable[[], bool] = lambda: True,
) -> str:
    """Evolve whole generations, one after another, and return why it stopped.

    Args:
        method: init / ask / tell.
        state: the method's state at the beginning of a generation.
        evaluate: evaluates trials.
        settings: the stop conditions.
        main: the world's main measure of task performance.
        portray: returns the portrait of the first team of an outcome.
        iterations: of one epoch of the world.
        last: record of the previous generation, None for the first.
        on_generation: called with the state after a generation and the generation's record.
        has_time: whether another generation may begin; called before each.

    Returns:
        "generations", "target" or "budget" at the end; "time" if the run has none left.
    """
    while True:
        if last is not None and has_reached(settings.target, main, last["performance"]):
            return "target"
        if state.progress.generation >= settings.generations:
            return "generations"
        if not has_time():
            return "time"
        started = time.perf_counter()
        finished = _run_generation(method, state, evaluate, portray, settings, iterations)
        if finished is None:
            return "budget"
        began, (state, portrait, steps) = state.progress, finished
        steps += last["team_steps"] if last else 0
        seconds = time.perf_counter() - started
        last = _record(method, began, state.progress, portrait, steps, seconds)
        on_generation(state, last)


def price(method: Method, state: State, settings: RunSettings) -> int:
    """Return the team evaluations of the generation that begins with a state."""
    after = unscored(method, state, settings)
    return int(after.progress.team_evaluations - state.progress.team_evaluations)


def unscored(method: Method, state: State, settings: RunSettings) -> State:
    """Return the state after a generation with empty scores; nothing is evaluated.

    This shows the cost of a generation, since ask and tell are pure.
    """
    generation, requests = state.progress.generation, 0
    while state.progress.generation == generation:
        requests = _counted(requests, method)
        trials = _asked(method, state)
        empty = replace(_scores(trials, np.zeros), plays=settings.plays(trials.teams.shape[1]))
        state = _told(method, state, trials, empty)
    return state


def rehearse(method: Method, first: State) -> State:
    """Return the state after a first generation with made-up scores; nothing is evaluated.

    ask and tell are pure, so a mistake in them shows before a run begins.

    Raises:
        UsageError: they return something that is not valid.
    """
    state, has_portrait = first, False
    made_up = stream(first.progress.root, "rehearsal")
    requests = 0
    while state.progress.generation == first.progress.generation:
        requests = _counted(requests, method)
        trials = _asked(method, state)
        _refuse_luck(method, trials, _asked(method, state))
        state = _told(method, state, trials, _scores(trials, made_up.random))
        has_portrait = has_portrait or trials.portrait
    portrait = Portrait({}, [], [], {}, [], [], []) if has_portrait else None
    _record(method, first.progress, state.progress, portrait, 0, 0.0)
    return state


def _scores(trials: Trials, numbers: Callable[[tuple[int, ...]], Any]) -> Scores:
    """Return scores of these numbers in [0, 1], as if robots had two actions."""
    shape = trials.teams.shape[:2]
    return Scores(numbers(shape), numbers(shape), numbers((*shape, 2)) / 2)


def _counted(requests: int, method: Method) -> int:
    """Return one more request of a generation, unless there are too many."""
    if requests == MOST_REQUESTS:
        raise UsageError(
            f"{method.title}: tell has not ended the first generation after {requests} requests "
            f"(it ends where progress.generation is one higher)"
        )
    return requests + 1


def _refuse_luck(method: Method, trials: Trials, again: Trials) -> None:
    """Refuse a method that asks for different teams when it is asked twice in the same state."""
    alike = (np.array_equal(getattr(trials, n), getattr(again, n)) for n in ("genes", "teams"))
    if not all(alike):
        raise UsageError(
            f"{method.title}: ask returns other teams when it is asked again in the same state; "
            f"random numbers must be drawn from an address (conevo.rng.stream)"
        )


def _asked(method: Method, state: State) -> Trials:
    """Return the trials that a method asks for.

    Raises:
        UsageError: they cannot be evaluated.
    """
    trials = method.ask(state)
    if not isinstance(trials, Trials):
        raise UsageError(f"{method.title}: ask must return Trials, not {type(trials).__name__}")
    if problem := trials.problem(state.progress):
        raise UsageError(f"{method.title}: what ask returns cannot be evaluated: {problem}")
    return trials


def _told(method: Method, state: State, trials: Trials, scores: Scores) -> State:
    """Return a method's next state.

    Raises:
        UsageError: its header does not follow from the previous state.
    """
    found = method.tell(state, trials, scores)
    before, after = state.progress, getattr(found, "progress", None)
    if not isinstance(after, Progress):
        raise UsageError(f"{method.title}: tell must return a state, not {type(found).__name__}")
    made, counted = (
        len(trials.teams) * scores.plays,
        after.team_evaluations - before.team_evaluations,
    )
    if counted != made:
        raise UsageError(
            f"{method.title}: tell counts {counted} team evaluations, {made} were made "
            f"(Progress.counted counts them)"
        )
    if after.root != before.root or after.generation - before.generation not in (0, 1):
        raise UsageError(
            f"{method.title}: tell may end a generation and keeps the root, but generation "
            f"{before.generation} of {before.root} became {after.generation} of {after.root}"
        )
    if trials.portrait:
        portrayed = before.crowned(trials, scores)
        for name in ("fittest_active", "fittest_genes"):
            if not np.array_equal(getattr(after, name), getattr(portrayed, name)):
                raise UsageError(
                    f"{method.title}: tell must record the team of the portrait as the fittest "
                    f"(Progress.crowned does)"
                )
    return found


def check_budget(method: Method, state: State, settings: RunSettings) -> None:
    """Refuse a budget that does not pay for the first generation.

    Raises:
        UsageError: no generation could be finished.
    """
    budget = settings.budget_evaluations
    if budget and (first := price(method, state, settings)) > budget:
        raise UsageError(
            f"run.budget_evaluations = {budget} does not pay for one generation: "
            f"the first takes {counted(first, 'team evaluation')}"
        )


def _run_generation(
    method: Method,
    state: State,
    evaluate: Evaluate,
    portray: Callable[[Outcome], Portrait],
    settings: RunSettings,
    iterations: int,
) -> tuple[State, Portrait | None, int] | None:
    """Return the results of one generation, None if the budget does not pay for it.

    These are the next state, the portrait of the fittest team, and the number of team-steps, which
    are the iterations that teams were played: fewer where epochs end early.

    Choice: trials that the budget cannot pay are not begun, and a generation that could not be
    finished does not count, so that a run never spends more than its budget.
    """
    generation, budget = state.progress.generation, settings.budget_evaluations
    portrait: Portrait | None = None
    steps = 0
    while state.progress.generation == generation:
        trials = _asked(method, state)
        n_teams = len(trials.teams) * settings.plays(trials.teams.shape[1])
        if budget and state.progress.team_evaluations + n_teams > budget:
            return None
        is_fixed = trials.scenarios == "fixed"
        epochs = n_teams * (settings.fittest_epochs if is_fixed else settings.epochs)
        evaluation = evaluate(trials)
        steps += epochs * iterations if evaluation.steps is None else evaluation.steps
        if trials.portrait:
            portrait = portray(evaluation.outcome)
        state = _told(method, state, trials, evaluation.scores)
    return state, portrait, steps


def _record(
    method: Method,
    began: Progress,
    ended: Progress,
    portrait: Portrait | None,
    team_steps: int,
    seconds: float,
) -> Record:
    """Return the log entry of a generation, given the headers before and after it.

    Team evaluations and team-steps are the run's so far. Sizes are those with which the generation
    was evaluated and bred, not the next one's. A method's own numbers follow; numbers of CONE that
    a method lacks are null or 0.

    Raises:
        UsageError: no portrait, or a number of the method that is not a number or has the name of
            another entry.
    """
    if portrait is None:
        raise UsageError(
            f"{method.title} has finished generation {began.generation} without a portrait: "
            f"one of its trials must ask for that of the fittest team (Trials.portrait)"
        )
    record = {
        "generation": began.generation,
        "team_evaluations": int(ended.team_evaluations),
        "type_c_evaluations": 0,
        "team_steps": team_steps,
        "seconds": round(seconds, 4),
        "best_fitness": _finite(ended.best_fitness),
        "mean_fitness": _finite(ended.mean_fitness),
        "team_fitness": _finite(np.mean(ended.fittest_fitness)),
        "performance": {name: _finite(value) for name, value in portrait.performance.items()},
        "castes": portrait.castes,
        "favourites": castes(name for name in portrait.favourites if name is not None),
        "favourite_share": mean_where_defined(portrait.favourite_shares),
        "specialization": _finite(np.mean(ended.fittest_specialization)),
        "sst": None,
        "gst": None,
        "recombinations": 0,
        "n_hidden": [int(n) for n in np.atleast_1d(began.n_hidden)],
        "n_nonfinite": int(ended.n_nonfinite),
    }
    if taken := sorted(ended.numbers.keys() & (record.keys() - OF_METHODS)):
        raise UsageError(f"{method.title} gives a number the name {taken[0]}, which the log has")
    for name, value in ended.numbers.items():
        if not isinstance(value, int | float | np.number):
            raise UsageError(f"{method.title}: {name} is not a number: {value!r:.60}")
    return record | {
        name: value if isinstance(value, int) else _finite(value)
        for name, value in ended.numbers.items()
    }


def _finite(value: Any) -> float | None:
    """Return a number as JSON has it: not-a-number and infinity become null."""
    return float(value) if math.isfinite(value) else None


def has_reached(
    target: float | None, main: Measure, performance: Mapping[str, float | None]
) -> bool:
    """Whether the main measure is as good as the target."""
    value = performance.get(main.name)
    return target is not None and value is not None and main.reaches(value, target)
