"""Scores by hand: means over epochs, individual and team credit, specialization, castes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from conevo.controllers.registry import controller
from conevo.evolution.protocol import Trials
from conevo.rng import stream
from conevo.runs.evaluation import Evaluate, describe, make_evaluator, score
from conevo.worlds.protocol import Outcome
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from conevo.worlds.rover.world import RoverParams, RoverScenarios, RoverWorld

ACTIONS = ("dig", "move")

# One team, two epochs, three robots.
OUTCOME = Outcome(
    fitness=np.array([[[1, 2, 3], [3, 2, 7]]], dtype=np.float32),
    switches=np.array([[[0, 10, 4], [0, 10, 2]]], dtype=np.int32),
    counts=np.array(
        [[[[11, 0], [6, 5], [3, 8]], [[11, 0], [6, 5], [1, 10]]]],
        dtype=np.int32,
    ),
    performance={"value": np.array([[10, 20]], dtype=np.float32)},
)


@dataclass(frozen=True)
class Counting(RoverWorld):
    """Records the number of scenarios of every draw."""

    n_drawn: list[int] = field(default_factory=list)

    def scenarios(self, keys: Sequence[int]) -> RoverScenarios:
        self.n_drawn.append(len(keys))
        return super().scenarios(keys)


def test_each_robot_is_credited_with_its_own_mean_over_epochs() -> None:
    np.testing.assert_array_equal(score(OUTCOME).fitness, [[2, 2, 5]])


def test_team_credit_is_the_sum_for_every_robot() -> None:
    """Nitschke 2009, eq. 5.5."""
    np.testing.assert_array_equal(score(OUTCOME, "team").fitness, [[9, 9, 9]])


class Rocks:
    """Plays three robots and two rocks; a scenario is a factor of the rocks' values.

    Robot 0 alone finds a rock of 4; robot 1 finds one of 6, and if it does not, robot 2 does.
    """

    def evaluate(self, genes: Any, teams: Any, scenarios: Any, rounds: int = 1) -> Outcome:
        there = (teams >= 0).any(axis=2)
        found = np.stack([4 * there[:, 0], 6 * there[:, 1], 6 * (there[:, 2] & ~there[:, 1])], 1)
        n, part = len(teams), np.repeat(np.arange(rounds), len(teams) // rounds)
        worth = np.asarray(scenarios, np.float32).reshape(rounds, -1)[part]
        return Outcome(
            fitness=(worth[:, :, None] * found[:, None]).astype(np.float32),
            switches=np.zeros((n, worth.shape[1], 3), np.int32),
            counts=np.ones((n, worth.shape[1], 3, 2), np.int32),
            performance={"value": worth},
        )


class Worths:
    """Draws the worths 1, 2, 3, ... as scenarios."""

    def scenarios(self, keys: Sequence[int]) -> Any:
        return np.arange(1, len(keys) + 1)


def test_a_difference_is_the_loss_of_the_team_without_the_robot() -> None:
    """Robot 1 is credited with a rock that robot 2 would have found: it makes no difference."""
    sizes: dict[str, Any] = {"seed": 1, "epochs": 2, "fittest_epochs": 3}
    played = {
        credit: make_evaluator(Rocks(), Worths(), **sizes, credit=credit)  # type: ignore[arg-type]
        for credit in ("robot", "team", "difference")
    }
    genes = np.zeros((1, 4), np.float32)
    whole = np.zeros((1, 3, 2), np.int32)
    halves = whole.copy()
    halves[0, 1] = -1  # robot 1 has no network in any case
    trials = Trials(0, genes, np.concatenate([whole, halves]))

    def fitness(credit: str, trials: Trials) -> list[list[float]]:
        scores = played[credit](trials).scores
        assert scores.plays == (4 if credit == "difference" else 1)
        return [list(map(float, row)) for row in scores.fitness]

    # The mean worth of the two epochs is 1.5.
    assert fitness("robot", trials) == [[6, 9, 0], [6, 0, 9]]
    assert fitness("team", trials) == [[15, 15, 15], [15, 15, 15]]
    assert fitness("difference", trials) == [[6, 0, 0], [6, 0, 9]]
    # In two rounds the second team meets worths of 3 and 4.
    assert fitness("difference", replace(trials, rounds=2)) == [[6, 0, 0], [14, 0, 21]]
    first = replace(trials, teams=whole, scenarios="fixed")  # three epochs: 2 on average
    assert fitness("difference", first) == [[8, 0, 0]]


def test_a_difference_in_a_world_is_played_in_the_same_scenarios() -> None:
    task = world("rover/complex-1", n_robots=3, iterations=200, low_range=0.3)
    small = controller(world=task, n_hidden=2, max_hidden=2)
    rollout = Rollout(task, small, 1)
    sizes: dict[str, Any] = {"seed": 1, "epochs": 2, "fittest_epochs": 3}
    private, difference = (
        make_evaluator(rollout, task, **sizes, credit=credit) for credit in ("robot", "difference")
    )
    genes = stream(1, "genes").uniform(-1, 1, (24, 23)).astype(np.float32)
    teams = np.arange(24, dtype=np.int32).reshape(4, 3, 2)
    asked = Trials(4, genes, teams, rounds=2)
    seen = difference(asked)
    np.testing.assert_array_equal(seen.outcome.fitness, private(asked).outcome.fitness)
    values = private(asked).scores.fitness.sum(axis=1)
    for robot in range(3):
        rest = teams.copy()
        rest[:, robot] = -1
        less = private(replace(asked, teams=rest)).scores.fitness.sum(axis=1)
        np.testing.assert_allclose(seen.scores.fitness[:, robot], values - less, rtol=1e-12)
    assert np.abs(seen.scores.fitness).max() > 0


def test_specialization_is_the_mean_of_switches_over_possible_switches() -> None:
    """Nitschke 2009, eq. 3.4: 0/10, 10/10, (4/10 + 2/10) / 2."""
    np.testing.assert_allclose(score(OUTCOME).specialization, [[0, 1, 0.3]])


def test_shares_are_means_over_epochs_and_doing_nothing_counts() -> None:
    """Robot 2: 3 of 8 and then 1 of 5; robot 0 does nothing in the second of its epochs."""
    counts = OUTCOME.counts.copy()
    counts[0, :, 2] = [[3, 5], [1, 4]]
    counts[0, 1, 0] = 0
    seen = Outcome(OUTCOME.fitness, counts, OUTCOME.switches, OUTCOME.performance)
    shares = [[[0.5, 0], [6 / 11, 5 / 11], [(3 / 8 + 1 / 5) / 2, (5 / 8 + 4 / 5) / 2]]]
    np.testing.assert_allclose(score(seen).shares, shares, rtol=1e-15)


def test_non_finite_fitness_is_passed_on() -> None:
    fitness = OUTCOME.fitness.copy()
    fitness[0, 1, 2] = np.inf
    broken = Outcome(fitness, OUTCOME.counts, OUTCOME.switches, OUTCOME.performance)
    np.testing.assert_array_equal(score(broken).fitness, [[2, 2, np.inf]])


def test_a_portrait_names_castes_by_the_most_executed_action() -> None:
    portrait = describe(OUTCOME, SimpleNamespace(castes=ACTIONS))
    assert portrait.performance == {"value": 15.0}
    assert portrait.labels == ["dig", "non-specialized", "move"]
    assert portrait.castes == {"dig": 1, "move": 1, "non-specialized": 1}
    np.testing.assert_allclose(portrait.specialization, [0, 1, 0.3])


def test_a_portrait_has_favourites_and_the_null_of_s() -> None:
    """Robot 2 moves 8 of 11 times in one epoch and 10 of 11 in the other."""
    everything = describe(OUTCOME, SimpleNamespace(castes=ACTIONS))
    assert everything.favourites == ["dig", "dig", "move"]
    np.testing.assert_allclose(everything.favourite_shares, [1, 12 / 22, 18 / 22])
    drawn = [0, 1 - 61 / 121, 1 - (73 + 101) / 242]
    np.testing.assert_allclose(everything.independent, drawn)
    moves = describe(OUTCOME, SimpleNamespace(castes=ACTIONS, settings=("move",)))
    assert moves.favourites == [None, "move", "move"]
    np.testing.assert_array_equal(moves.favourite_shares, [np.nan, 1, 1])
    assert moves.independent == everything.independent


def test_a_generation_shares_scenarios_and_fixed_ones_are_the_same_in_all() -> None:
    task = world("rover/complex-1", n_robots=3, iterations=60)
    small = controller(world=task, n_hidden=2, max_hidden=2)
    evaluate = make_evaluator(
        Rollout(task, small, 1), task, seed=1, epochs=2, fittest_epochs=3, credit="robot"
    )
    genes = stream(1, "genes").uniform(-1, 1, (6, 23)).astype(np.float32)
    team = np.arange(6, dtype=np.int32).reshape(1, 3, 2)

    def counts(generation: int, **request: Any) -> np.ndarray:
        return evaluate(Trials(generation, genes, team, **request)).outcome.counts

    assert counts(4).shape[1] == 2
    np.testing.assert_array_equal(counts(4), counts(4, purpose="elites", portrait=True))
    assert not np.array_equal(counts(4), counts(5))
    assert counts(4, scenarios="fixed").shape[1] == 3
    fixed = counts(5, scenarios="fixed", purpose="lesion", portrait=True)
    np.testing.assert_array_equal(counts(4, scenarios="fixed"), fixed)


def test_a_run_may_use_the_scenarios_of_generation_0_in_all_generations() -> None:
    """In all rounds of all phases; scenarios shared by all generations are drawn once."""
    task = Counting("complex-1", RoverParams(n_robots=3, iterations=60))
    small = controller(world=task, n_hidden=2, max_hidden=2)
    rollout = Rollout(task, small, 1)
    sizes: dict[str, Any] = {"seed": 1, "epochs": 2, "fittest_epochs": 3, "credit": "robot"}
    fresh = make_evaluator(rollout, task, **sizes)
    fixed = make_evaluator(rollout, task, **sizes, scenarios="fixed")
    genes = stream(1, "genes").uniform(-1, 1, (6, 23)).astype(np.float32)
    teams = np.arange(6, dtype=np.int32).reshape(1, 3, 2).repeat(4, axis=0)

    def counts(evaluate: Evaluate, generation: int, **request: Any) -> np.ndarray:
        return evaluate(Trials(generation, genes, teams, **request)).outcome.counts

    for request in ({}, {"rounds": 2}, {"rounds": 4, "purpose": "elites"}, {"scenarios": "fixed"}):
        first = counts(fresh, 0, **request)
        for generation in (0, 1, 7):
            np.testing.assert_array_equal(counts(fixed, generation, **request), first)
    assert not np.array_equal(counts(fresh, 1), counts(fixed, 1))
    task.n_drawn.clear()
    for generation in (1, 2, 3):
        counts(fresh, generation)
        counts(fresh, generation, scenarios="fixed")
        counts(fixed, generation, rounds=2)
    assert task.n_drawn == [2, 2, 2]  # only the fresh ones of each generation


def test_each_round_of_trials_has_its_own_scenarios() -> None:
    """The first round has those of the generation, every further one the same number of others."""
    task = world("rover/complex-1", n_robots=3, iterations=60)
    small = controller(world=task, n_hidden=2, max_hidden=2)
    evaluate = make_evaluator(
        Rollout(task, small, 1), task, seed=1, epochs=2, fittest_epochs=3, credit="robot"
    )
    genes = stream(1, "genes").uniform(-1, 1, (6, 23)).astype(np.float32)
    team = np.arange(6, dtype=np.int32).reshape(1, 3, 2)
    same = np.repeat(team, 4, axis=0)
    in_rounds = evaluate(Trials(4, genes, same, rounds=2))
    at_once = evaluate(Trials(4, genes, same))
    played = in_rounds.outcome.counts
    assert played.shape[:2] == (4, 2)
    np.testing.assert_array_equal(played[:2], at_once.outcome.counts[:2])
    np.testing.assert_array_equal(played[2], played[3])
    assert not np.array_equal(played[0], played[2])
    assert in_rounds.scores.fitness.shape == (4, 3)
    for name, values in in_rounds.outcome.performance.items():
        np.testing.assert_array_equal(values[:2], at_once.outcome.performance[name][:2])
