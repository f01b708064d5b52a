"""OpenAI-ES on made-up fitness: a step by hand, and what its robots share."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from conevo.evolution import Layout, Scores, Trials, method
from conevo.evolution.inheritance import breed_from
from conevo.evolution.methods.openai_es import OpenAiEsState
from conevo.rng import fold, stream

LAYOUT = Layout(n_robots=3, n_hidden=2, max_hidden=3, n_genes=4)
UPHILL = np.random.default_rng(2).standard_normal((3, 4))  # of a linear fitness, [U, G]


def worth(trials: Trials) -> np.ndarray:
    """Credits [N, R], linear in each robot's genes."""
    return (trials.networks() * UPHILL).sum(axis=(2, 3))


def told(learner: Any, state: OpenAiEsState, credit: np.ndarray) -> OpenAiEsState:
    """Return the state after these credits [N, R]."""
    scores = Scores(credit, np.zeros(credit.shape))
    found: OpenAiEsState = learner.tell(state, learner.ask(state), scores)
    return found


def evolved(learner: Any, state: OpenAiEsState, generations: int) -> OpenAiEsState:
    """Return the state after a number of generations."""
    end = state.progress.generation + generations
    while state.progress.generation < end:
        state = told(learner, state, worth(learner.ask(state)))
    return state


def around(learner: Any, layout: Layout = LAYOUT, root: int = 3) -> OpenAiEsState:
    """Return a state around a team of zeros, of which two of three slots are in use."""
    active = np.tile(np.arange(3) < 2, (layout.n_robots, 1))
    genes = np.zeros((layout.n_robots, 3, 4), dtype=np.float32)
    state: Any = breed_from(learner, layout, root, genes, active)
    return state


def test_a_step_by_hand() -> None:
    """Two pairs of clones, ranks 1/2, 1/6, -1/6 and -1/2; then Adam, with momentum, and decay."""
    common = {"pairs": 2, "rounds": 1, "spread": 0.1, "step": 0.02, "memory": 0.9}
    adam: Any = method("openai-es", memory_squares=0.99, weight_decay=0.5, **common)
    momentum: Any = method("openai-es", optimiser="momentum", weight_decay=0.5, **common)
    state = replace(around(adam), genes=np.full((1, 3, 4), 0.25) * [[1], [1], [0]])
    noise = stream(3, "pairs", 0).standard_normal((2, 1, 3, 4))[:, 0, :2]
    trials = adam.ask(state)  # two teams, then their mirror images
    for team, e in enumerate((noise[0], noise[1], -noise[0], -noise[1])):
        for robot in range(3):
            np.testing.assert_allclose(
                trials.networks()[team, robot, :2], 0.25 + 0.1 * e, rtol=1e-5
            )
    # the first pair's first team is the best, its mirror image the worst
    credit = np.repeat([[9.0], [5.0], [1.0], [2.0]], 3, axis=1)
    gradient = (1.0 * noise[0] + (1 / 3) * noise[1]) / (2 * 2 * 0.1)
    # the first step of Adam: its means, freed of their bias, are the gradient and its square
    step = 0.02 * gradient / (np.abs(gradient) + 1e-8) - 0.02 * 0.5 * 0.25
    np.testing.assert_allclose(told(adam, state, credit).genes[0, :2], 0.25 + step)
    step = 0.02 * (1 - 0.9) * gradient - 0.02 * 0.5 * 0.25
    after = told(momentum, state, credit)
    np.testing.assert_allclose(after.genes[0, :2], 0.25 + step)
    assert not after.genes[0, 2].any()


def test_the_second_step_of_adam_by_hand() -> None:
    learner: Any = method("openai-es", pairs=2, rounds=1, step=0.02, weight_decay=0.0)
    state = around(learner)
    for gradient in (0.5, -0.2):
        state = learner._step(state, np.full((1, 3, 4), gradient))
    mean = (0.9 * 0.1 * 0.5 + 0.1 * -0.2) / (1 - 0.9**2)
    square = (0.99 * 0.01 * 0.25 + 0.01 * 0.04) / (1 - 0.99**2)
    expected = 0.02 * (1 + mean / np.sqrt(square))
    np.testing.assert_allclose(state.genes[0, :2], expected, rtol=1e-6)


@pytest.mark.parametrize("starts_at_random", [True, False])
def test_robots_that_share_everything_are_clones_bit_for_bit(starts_at_random: bool) -> None:
    one: Any = method("openai-es", pairs=10, team="clones")
    other: Any = method("openai-es", pairs=10, team="robots", share=1.0)
    a, b = (x.init(LAYOUT, 3) if starts_at_random else around(x) for x in (one, other))
    while a.progress.generation < 6:
        trials, others = one.ask(a), other.ask(b)
        np.testing.assert_array_equal(trials.networks(), others.networks())
        credit = worth(trials)
        credit[:, 1] *= -3  # robots' own credits do not agree
        a, b = told(one, a, credit), told(other, b, credit)
        np.testing.assert_array_equal(np.repeat(a.genes, 3, axis=0), b.genes)
    assert np.abs(a.genes).max() > 0.05


@pytest.mark.parametrize("starts_at_random", [True, False])
def test_robots_that_share_nothing_are_independent_strategies(starts_at_random: bool) -> None:
    together: Any = method("openai-es", pairs=10, team="robots", share=0.0)
    alone: Any = method("openai-es", pairs=10)
    single, roots = replace(LAYOUT, n_robots=1), [fold(3, "robot", robot) for robot in range(3)]
    state = together.init(LAYOUT, 3) if starts_at_random else around(together)
    states = [
        alone.init(single, root) if starts_at_random else around(alone, single, root)
        for root in roots
    ]
    factors = np.array([1.0, -2.0, 0.1])  # each robot has another aim
    while state.progress.generation < 6:
        trials = together.ask(state)
        for robot, (one, factor) in enumerate(zip(states, factors, strict=True)):
            own = alone.ask(one)
            np.testing.assert_array_equal(own.networks()[:, 0], trials.networks()[:, robot])
            states[robot] = told(alone, one, worth(own) * factor)
        state = told(together, state, worth(trials) * factors)
        for robot, one in enumerate(states):
            np.testing.assert_array_equal(state.genes[robot], one.genes[0])
    assert np.abs(state.genes[0] - state.genes[1]).max() > 0.05


def test_a_share_of_the_variance_is_common() -> None:
    learner: Any = method("openai-es", pairs=2000, rounds=1, team="robots", share=0.3)
    moves = learner.ask(around(learner)).networks()[:2000, :, :2].astype(np.float64)
    flat = moves.transpose(1, 0, 2, 3).reshape(3, -1)  # by robot
    found = np.cov(flat) / 0.1**2
    np.testing.assert_allclose(found, [[1, 0.3, 0.3], [0.3, 1, 0.3], [0.3, 0.3, 1]], atol=0.06)


def test_the_shared_part_follows_the_team_and_the_rest_the_robot() -> None:
    """The team gains from large genes in the first slot, robot 0 from small ones in the second."""
    learner: Any = method("openai-es", pairs=4000, rounds=40, team="robots", share=0.5)
    state = around(learner)
    genes = learner.ask(state).networks()
    common = genes[:, :, 0].sum(axis=(1, 2))
    credit = np.tile(common[:, None], (1, 3))
    own = genes[:, 0, 1].sum(axis=1) * 3
    credit += np.stack([-own, own, 0 * own], axis=1)  # nothing to the team
    found = told(learner, state, credit).gradient
    assert (found[:, 0] > 0).all()
    assert (found[0, 1] < 0).all()
    assert np.abs(found[2, 1]).max() < np.abs(found[0, 1]).min() / 2


def test_a_whole_team_moves_by_the_teams_fitness() -> None:
    """Only robot 0 earns anything, and only by the genes of robot 2."""
    learner: Any = method("openai-es", pairs=1000, rounds=10, team="whole")
    state = around(learner)
    genes = learner.ask(state).networks()
    credit = np.zeros((2000, 3))
    credit[:, 0] = genes[:, 2].sum(axis=(1, 2))
    found = told(learner, state, credit).gradient[:, :2]
    assert (found[2] > 0.01).all()
    assert np.abs(found[:2]).max() < found[2].min() / 2


def test_without_a_difference_in_fitness_genes_decay() -> None:
    learner: Any = method("openai-es", pairs=4, rounds=2, step=0.1, weight_decay=0.3)
    state = replace(around(learner), genes=np.full((1, 3, 4), 0.5) * [[1], [1], [0]])
    for credit in (np.ones((8, 3)), np.full((8, 3), np.nan)):
        found = told(learner, state, credit).genes
        np.testing.assert_allclose(found[0, :2], 0.5 * (1 - 0.1 * 0.3))
        assert not found[0, 2].any()


def test_the_first_mean_is_the_fittest_of_random_teams() -> None:
    """By the team's fitness; robots that share nothing choose by their own credit."""
    for team, share in (("clones", 0.5), ("whole", 0.5), ("robots", 0.5), ("robots", 0.0)):
        learner: Any = method("openai-es", pairs=20, team=team, share=share)
        first = learner.init(LAYOUT, 5)
        trials = learner.ask(first)
        networks, credit = trials.networks(), worth(trials) * [1.0, 1.0, -2.0]
        is_clones = (networks == networks[:, :1]).all()
        assert is_clones == (team == "clones" or (team == "robots" and share > 0))
        second = told(learner, first, credit)
        again = learner.ask(second)
        assert (len(again.teams), again.rounds) == (40, 5)
        state = told(learner, second, worth(again) * [1.0, 1.0, -2.0])
        fittest = np.repeat(credit.sum(axis=1).argmax(), 3)
        if team == "robots" and share == 0:
            fittest = credit.argmax(axis=0)
        expected = networks[fittest, np.arange(3)]
        played = learner.ask(state)
        assert len(played.teams) == 1
        np.testing.assert_array_equal(played.networks()[0], expected)


@pytest.mark.parametrize("optimiser", ["adam", "momentum"])
def test_it_climbs_and_genes_stay_in_range(optimiser: str) -> None:
    learner: Any = method("openai-es", pairs=20, optimiser=optimiser, step=0.2)
    early = around(learner)
    late = evolved(learner, early, 20)
    assert worth(learner.ask(late)).mean() > worth(learner.ask(early)).mean() + 1
    assert np.abs(late.genes).max() == 1.0 or optimiser == "momentum"
    assert "apart" not in late.progress.numbers
    robots: Any = method("openai-es", pairs=20, team="robots")
    assert evolved(robots, around(robots), 3).progress.numbers["apart"] > 0


def test_an_impossible_state_is_recognized() -> None:
    learner: Any = method("openai-es", pairs=10, team="robots")
    first = learner.init(LAYOUT, 3)
    good = evolved(learner, first, 3)
    assert good.problem(first) == ""
    for name, value in (
        ("genes", good.genes[:2]),
        ("genes", good.genes + 2),
        ("gradient", good.gradient * np.nan),
        ("squares", -good.squares),
        ("active", good.active & False),
        ("steps", -1),
        ("best", good.best - 100),
        ("phase", "fittest"),
    ):
        assert replace(good, **{name: value}).problem(first) == name
