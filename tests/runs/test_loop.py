"""The duties of a method towards the loop: each omission is one line."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.evolution.protocol import Layout, Progress, Scores, Trials
from conevo.runs.evaluation import Evaluation, describe
from conevo.runs.loop import check_budget, evolve_generations, price
from conevo.runs.settings import RunSettings
from conevo.worlds.measures import Measure
from conevo.worlds.protocol import Outcome

LAYOUT = Layout(n_robots=2, n_hidden=1, max_hidden=1, n_genes=3)


@dataclass(frozen=True)
class Note:
    """A state that consists of its header alone."""

    progress: Progress


@dataclass(frozen=True)
class Still:
    """A method that asks for the same two teams in every generation, in one request."""

    portrait: bool = True
    numbers: dict[str, float] = field(default_factory=dict)
    config: object = None
    name: str = "still"
    title: str = "Still"

    def init(self, layout: Layout, root: int) -> Note:
        """Return generation 0."""
        return Note(Progress.first(layout, root))

    def ask(self, state: Note) -> Trials:
        """Return two teams."""
        genes, teams = np.zeros((1, 3), np.float32), np.zeros((2, 2, 1), np.int32)
        return Trials(state.progress.generation, genes, teams, "fixed", self.portrait)

    def tell(self, state: Note, trials: Trials, scores: Scores) -> Note:
        """Return the next generation."""
        changes = state.progress.counted(trials, scores, is_first=True).graded(scores.fitness)
        changes = changes.crowned(trials, scores).with_numbers(**self.numbers)
        return Note(replace(changes, generation=changes.generation + 1))


def play(trials: Trials) -> Evaluation:
    """Return scores that do not depend on the teams."""
    n = len(trials.teams)
    fitness = np.full((n, 2), 0.5)
    outcome = Outcome(
        fitness=np.full((n, 3, 2), 0.5, np.float32),
        counts=np.ones((n, 3, 2, 2), np.int32),
        switches=np.zeros((n, 3, 2), np.int32),
        performance={"value": np.ones((n, 3), np.float32)},
    )
    return Evaluation(Scores(fitness, 0 * fitness), outcome)


def log_of(method: Still, generations: int = 2) -> list[dict[str, Any]]:
    """Return the records of a run."""
    records: list[dict[str, Any]] = []
    stopped_by = evolve_generations(
        method,
        method.init(LAYOUT, 1),
        play,
        settings=RunSettings(generations=generations, epochs=7, fittest_epochs=3),
        main=Measure("value"),
        portray=partial(describe, world=SimpleNamespace(castes=("a", "b"))),
        iterations=10,
        on_generation=lambda state, record: records.append(record),
    )
    assert stopped_by == "generations"
    return records


def test_a_header_is_enough_and_the_methods_numbers_are_in_the_log() -> None:
    numbers = {"step_size": 0.25, "restarts": 3, "condition": float("nan"), "sst": 0.5}
    first, second = log_of(Still(numbers=numbers))
    assert (first["step_size"], first["restarts"], first["condition"]) == (0.25, 3, None)
    assert (first["sst"], first["gst"], first["recombinations"]) == (0.5, None, 0)
    assert type(first["restarts"]) is int
    assert (second["generation"], second["team_evaluations"]) == (1, 4)
    assert [one["team_steps"] for one in (first, second)] == [2 * 3 * 10, 2 * 2 * 3 * 10]
    assert price(Still(), Still().init(LAYOUT, 1), RunSettings()) == 2


def test_evaluations_of_a_difference_are_counted_and_paid() -> None:
    """Teams of two robots play three times: six evaluations a generation, in three epochs each."""
    records: list[dict[str, Any]] = []
    settings = RunSettings(epochs=7, fittest_epochs=3, credit="difference", budget_evaluations=13)
    method, first = Still(), Still().init(LAYOUT, 1)
    stopped_by = evolve_generations(
        method,
        first,
        lambda trials: replace(play(trials), scores=replace(play(trials).scores, plays=3)),
        settings=settings,
        main=Measure("value"),
        portray=partial(describe, world=SimpleNamespace(castes=("a", "b"))),
        iterations=10,
        on_generation=lambda state, record: records.append(record),
    )
    assert stopped_by == "budget"
    assert [one["team_evaluations"] for one in records] == [6, 12]
    assert [one["team_steps"] for one in records] == [6 * 3 * 10, 12 * 3 * 10]
    assert price(method, first, settings) == 6
    check_budget(method, first, replace(settings, budget_evaluations=6))
    with pytest.raises(UsageError, match=r"budget_evaluations = 5 .* takes 6 team evaluations"):
        check_budget(method, first, replace(settings, budget_evaluations=5))


def test_a_generation_without_a_portrait_is_refused() -> None:
    with pytest.raises(UsageError, match="Still has finished generation 0 without a portrait"):
        log_of(Still(portrait=False))


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"genes": np.zeros((1, 4), np.float32)}, r"genes must be \[K, 3\] float32, not \[1, 4\]"),
        ({"genes": np.zeros((1, 3))}, r"genes must be .* not \[1, 3\] float64"),
        ({"genes": np.full((1, 3), 1.5, np.float32)}, r"genes must be in \[-1, 1\]"),
        ({"genes": np.full((1, 3), np.nan, np.float32)}, r"genes must be in \[-1, 1\]"),
        (
            {"teams": np.zeros((2, 3, 1), np.int32)},
            r"teams must be \[N, 2, 1\] int32, not",
        ),
        ({"teams": np.zeros((2, 2, 1), int)}, "teams must be .* not .* int64"),
        ({"teams": np.ones((2, 2, 1), np.int32)}, "teams must hold rows of its 1 genotypes"),
        ({"teams": np.zeros((0, 2, 1), np.int32)}, "0 teams cannot be played in 1 equal rounds"),
        ({"rounds": 3}, "2 teams cannot be played in 3 equal rounds"),
        ({"scenarios": "old"}, r"scenarios must be one of \('fresh', 'fixed'\), not 'old'"),
        ({"generation": 4}, "its generation must be 0, not 4"),
    ],
)
def test_wrong_trials_are_refused(asked: dict[str, Any], words: str) -> None:
    @dataclass(frozen=True)
    class Wrong(Still):
        def ask(self, state: Note) -> Trials:
            return replace(super().ask(state), **asked)

    with pytest.raises(UsageError, match=f"Still: what ask returns cannot .*: {words}") as caught:
        log_of(Wrong())
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"team_evaluations": 0}, "tell counts 0 team evaluations, 2 were made"),
        ({"generation": 3}, "generation 0 of 1 became 3 of 1"),
        ({"root": 5}, "generation 0 of 1 became 1 of 5"),
    ],
)
def test_a_header_that_does_not_follow_is_refused(changes: dict[str, Any], words: str) -> None:
    @dataclass(frozen=True)
    class Wrong(Still):
        def tell(self, state: Note, trials: Trials, scores: Scores) -> Note:
            return Note(replace(super().tell(state, trials, scores).progress, **changes))

    for use in (log_of, lambda method: price(method, method.init(LAYOUT, 1), RunSettings())):
        with pytest.raises(UsageError, match=words) as caught:
            use(Wrong())
        assert "\n" not in str(caught.value)


def test_anything_but_a_request_or_a_state_is_refused() -> None:
    @dataclass(frozen=True)
    class Mute(Still):
        def ask(self, state: Note) -> Any:
            return None

    @dataclass(frozen=True)
    class Deaf(Still):
        def tell(self, state: Note, trials: Trials, scores: Scores) -> Any:
            return None

    with pytest.raises(UsageError, match="ask must return Trials, not NoneType"):
        log_of(Mute())
    with pytest.raises(UsageError, match="tell must return a state, not NoneType"):
        log_of(Deaf())


def test_a_number_does_not_take_the_place_of_another_entry() -> None:
    with pytest.raises(UsageError, match="Still gives a number the name castes, which the log has"):
        log_of(Still(numbers={"castes": 1.0}))
