"""ESP: fitness of neurons, children, bursts and lesions against calculations by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from conevo.evolution import Layout, Scores, method

LAYOUT = Layout(n_robots=2, n_hidden=3, max_hidden=4, n_genes=2)


def told(learner: Any, state: Any, team: np.ndarray | list[float]) -> Any:
    """Return the state after these fitnesses [N] of teams."""
    credit = np.asarray(team)[:, None] + [-1.0, 1.0]
    return learner.tell(state, learner.ask(state), Scores(credit, 0 * credit))


def next_generation(learner: Any, state: Any, fitness: float, best: float) -> Any:
    """Return the state after equal teams of a fitness; the best one then has another."""
    teams = np.full(len(learner.ask(state).teams), fitness)
    return told(learner, told(learner, state, teams), [best])


def stagnated(team: str = "clones", **settings: Any) -> tuple[Any, Any]:
    """Return ESP and its state in phase "lesion": a record, two bursts, and no progress."""
    learner = method("esp", genotypes=4, rounds=2, stagnation=1, team=team, **settings)
    state: Any = learner.init(LAYOUT, 3)
    for bursts in (0, 1, 2):
        state = next_generation(learner, state, 1.0, 10.0)
        assert (state.phase, state.bursts) == ("genotypes", bursts)
    return learner, next_generation(learner, state, 1.0, 10.0)


@pytest.mark.parametrize("team", ["clones", "whole"])
def test_a_neuron_has_the_mean_fitness_of_its_networks(team: str) -> None:
    learner = method("esp", genotypes=4, rounds=3, team=team)
    state: Any = learner.init(LAYOUT, 3)
    trials = learner.ask(state)
    fitness = np.random.default_rng(1).random(12)
    after = told(learner, state, fitness)
    rows = np.arange(state.genes[..., 0].size).reshape(state.genes.shape[:3])
    for p, u, m in np.ndindex(state.genes.shape[0], 3, 4):
        played = (trials.teams == rows[p, u, m]).any(axis=(1, 2))
        assert played.sum() == 3
        assert after.fitness[p, u, m] == pytest.approx(fitness[played].mean())


def test_the_best_network_is_the_one_most_above_the_mean_of_its_round() -> None:
    learner = method("esp", genotypes=4, rounds=2)
    state: Any = learner.init(LAYOUT, 3)
    fitness = [1.0, 2.0, 1.0, 0.0, 50.0, 50.0, 50.5, 49.5]  # the second round is luckier
    after = told(learner, state, fitness)
    np.testing.assert_array_equal(
        learner.ask(after).networks()[0], learner.ask(state).networks()[1]
    )
    fitness[1] = np.nan
    after = told(learner, state, fitness)
    np.testing.assert_array_equal(
        learner.ask(after).networks()[0], learner.ask(state).networks()[6]
    )


def test_children_of_the_fittest_quarter_replace_the_least_fit_half() -> None:
    learner = method("esp", genotypes=8, rounds=1, mutation_probability=0)
    state: Any = learner.init(LAYOUT, 3)
    after = told(learner, state, np.arange(8.0))
    end = told(learner, after, [3.0])
    for u in range(3):
        order = np.argsort(-after.fitness[0, u])
        old, new = state.genes[0, u, order], end.genes[0, u, order]
        np.testing.assert_array_equal(new[:4], old[:4])  # the fitter half stays
        heads = {tuple(child) for child in new[4:]}
        # One-point crossover of two genes swaps the second: 1 with 2, then 2 with 1.
        a, b = old[0], old[1]
        assert heads == {(a[0], b[1]), (b[0], a[1])}
    assert not end.genes[0, 3].any()


def test_a_burst_starts_again_around_the_best_network() -> None:
    learner = method("esp", genotypes=400, rounds=1, stagnation=2, burst_scale=0.02)
    state = next_generation(learner, learner.init(LAYOUT, 3), 1.0, 10.0)
    best = state.best
    assert state.record == 10
    np.testing.assert_array_equal(best, state.progress.fittest_genes[:1])
    state = next_generation(learner, state, 1.0, 10.0)
    assert state.progress.numbers["burst"] == 0
    state = next_generation(learner, state, 1.0, 9.0)
    assert (state.progress.numbers["burst"], state.bursts, state.since) == (1, 1, 2)
    np.testing.assert_array_equal(state.best, best)
    np.testing.assert_array_equal(state.genes[:, :, 0], best)
    steps = np.abs(state.genes[:, :3, 1:] - best[:, :3, None])
    assert np.median(steps) == pytest.approx(0.02, rel=0.1)  # of a Cauchy distribution
    state = next_generation(learner, state, 1.0, 10.5)
    assert (state.record, state.bursts, state.since) == (10.5, 0, 3)


@pytest.mark.parametrize("team", ["clones", "whole"])
def test_a_neuron_that_is_not_needed_is_removed_after_two_bursts(team: str) -> None:
    learner, state = stagnated(team)
    n = len(state.genes)  # networks in a genotype
    networks = learner.ask(state).networks()
    assert len(networks) == 1 + 3 * n
    for k, network in enumerate(networks[1:]):
        robots = slice(None) if n == 1 else k // 3
        assert not network[robots, k % 3].any()
        assert (network != 0).any(axis=2).sum() == 6 - (2 if n == 1 else 1)
    after = told(learner, state, [10.0, 8.9, 9.5, 9.1, 5.0, 6.0, 7.0][: len(networks)])
    expected = [[True, False, True, False], [True, True, True, True]]  # robot 1 needs all of its
    assert after.active.tolist() == expected[:n]
    np.testing.assert_array_equal(after.best, state.best * after.best_active[..., None])
    assert after.best_active[0].tolist() == [True, False, True, False]
    assert (after.bursts, after.since, after.record) == (0, 3, 10)
    assert after.problem(learner.init(LAYOUT, 3)) == ""


def test_a_network_that_needs_all_of_its_neurons_gets_one_more() -> None:
    learner, state = stagnated()
    grown = told(learner, state, [10.0, 8.0, 8.0, 8.0])
    assert grown.active.tolist() == [[True, True, True, True]]
    assert grown.best_active.tolist() == [[True, True, True, False]]
    assert np.ptp(grown.genes[0, 3]) > 0.5
    # No network with it is better: it is replaced, and so are its neurons.
    state = grown
    for _ in range(3):
        state = next_generation(learner, state, 1.0, 10.0)
    assert state.phase == "lesion"
    again = told(learner, state, [10.0, 8.0, 8.0, 8.0])
    assert again.active.tolist() == [[True, True, True, True]]
    assert not np.isin(again.genes[0, 3], state.genes[0, 3]).any()
