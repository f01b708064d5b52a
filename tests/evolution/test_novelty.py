"""Behaviour of teams, and novelty search: examples worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.evolution import Layout, Scores, method
from conevo.evolution.behaviour import TeamMap, describe
from conevo.evolution.methods import novelty
from conevo.evolution.methods.novelty import sparseness

LAYOUT = Layout(n_robots=2, n_hidden=2, max_hidden=3, n_genes=4)


def scores_of(*teams, fitness=None, specialization=0.0):
    """Return scores of teams [N, R, A] of shares."""
    shares = np.array(teams, dtype=np.float64)
    n, r, _ = shares.shape
    fitness = np.zeros(n) if fitness is None else np.asarray(fitness, dtype=np.float64)
    return Scores(np.tile(fitness[:, None], (1, r)), np.zeros((n, r)) + specialization, shares)


# --- behaviour ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("team", "evenness", "difference"),
    [
        ([[1, 0], [0, 1]], 1, 1),  # specialists
        ([[0.5, 0.5], [0.5, 0.5]], 1, 0),  # generalists
        ([[1, 0], [1, 0]], 0, 0),
        ([[1, 0], [0, 0]], 0, 1),  # one does nothing
        ([[0, 0], [0, 0]], 0, 0),
        ([[1, 0], [1, 0], [0, 1]], 0.9182958, 2 / 3),  # log2(3) - 2 / 3 bits; two of three pairs
        ([[0.5, 0.5], [0.25, 0.75]], 0.9544340, 0.25),  # entropy of 3 / 8, 5 / 8
        ([[1], [1]], 0, 0),
        ([[0.25, 0.75]], 0.8112781, 0),  # one robot differs from nobody
    ],
)
def test_division_is_evenness_and_difference(team, evenness, difference):
    np.testing.assert_allclose(describe(scores_of(team), "division"), [[evenness, difference]])


def test_shares_are_means_and_switching_is_that_of_s():
    scores = scores_of([[1, 0], [0.5, 0.25], [0, 0.5]], specialization=np.array([0.2, 0.6, 1.0]))
    # pairs, with nothing: (.5, .25, .25), (1, .5, .5), (.5, .25, .25); halves of the sums
    np.testing.assert_allclose(describe(scores, "shares"), [[0.5, 0.25, (0.5 + 1 + 0.5) / 3]])
    np.testing.assert_allclose(describe(scores, "switching"), [[0.6, (0.4 + 0.8 + 0.4) / 3]])


def test_scores_without_shares_are_refused_in_one_line():
    scores = Scores(np.zeros((1, 2)), np.zeros((1, 2)))
    with pytest.raises(UsageError, match=r"^method.behaviour = 'division' needs scores.shares"):
        describe(scores, "division")
    assert describe(scores, "switching").tolist() == [[0, 0]]


def test_a_map_keeps_the_fittest_team_of_each_cell():
    empty = TeamMap.empty(2)
    described = np.array([[0.0, 0.0], [0.49, 0.4], [0.5, 0.0], [1.0, 1.0], [1.0, 0.9]])
    cell = empty.cells(described)
    assert cell.tolist() == [0, 0, 2, 3, 3]
    fitness = np.array([1.0, 3.0, -2.0, np.nan, np.inf])
    assert empty.candidates(cell, fitness).tolist() == [1, 2]
    found = empty.with_teams(cell, fitness)
    np.testing.assert_array_equal(found.fitness, [3, np.nan, -2, np.nan])
    assert found.numbers() == {"coverage": 0.5, "qd_score": 3.0}
    better = found.with_teams(np.array([0, 2]), np.array([2.0, 5.0]))
    np.testing.assert_array_equal(better.fitness, [3, np.nan, 5, np.nan])
    assert np.isnan(empty.fitness).all()


# --- novelty search -------------------------------------------------------------------------------


def test_novelty_is_the_mean_distance_to_the_nearest():
    """On a line at 0, 0.1 and 0.4, with two neighbours; then with 0.5 in the archive."""
    line = np.array([[0.0], [0.1], [0.4]])
    np.testing.assert_allclose(sparseness(line, np.zeros((0, 0)), 2), [0.25, 0.2, 0.35])
    np.testing.assert_allclose(sparseness(line, np.array([[0.5]]), 2), [0.25, 0.2, 0.2])
    np.testing.assert_allclose(sparseness(line, np.array([[0.5]]), 9), [1 / 3, 0.8 / 3, 0.8 / 3])
    plane = np.array([[0.0, 0.0], [0.3, 0.4]])
    np.testing.assert_allclose(sparseness(plane, np.zeros((0, 0)), 15), [0.5, 0.5])
    assert sparseness(plane[:1], np.zeros((0, 0)), 15).tolist() == [0]


def test_novelty_does_not_depend_on_blocks(monkeypatch):
    generator = np.random.default_rng(1)
    described, archive = generator.random((50, 3)), generator.random((20, 3))
    whole = sparseness(described, archive, 5)
    monkeypatch.setattr(novelty, "BLOCK", 3 * 70)
    np.testing.assert_array_equal(sparseness(described, archive, 5), whole)


def told(learner, scores):
    state = learner.init(LAYOUT, 1)
    return learner.tell(state, learner.ask(state), scores)


TEAMS = ([[1, 0], [1, 0]], [[1, 0], [1, 0]], [[0.9, 0.1], [0.9, 0.1]], [[1, 0], [0, 1]])


@pytest.mark.parametrize(("weight", "elite"), [(1.0, [3, 2]), (0.0, [0, 1])])
def test_the_most_novel_are_selected_not_the_fittest(weight, elite):
    """Teams at (0, 0) twice, (0.469, 0) and (1, 1), so the last is the most novel by far."""
    learner = method("novelty", genotypes=4, neighbours=2, weight=weight)
    state = told(learner, scores_of(*TEAMS, fitness=[4, 3, 2, 1]))
    assert state.elite.tolist() == [elite]
    assert state.fitness.tolist() == [[4, 3, 2, 1]]
    fittest = learner.ask(state).networks()
    np.testing.assert_array_equal(fittest[0, 0], state.genes[0, :, 0])


def test_a_score_that_is_not_finite_is_not_novel():
    learner = method("novelty", genotypes=4, neighbours=2)
    state = told(learner, scores_of(*TEAMS, fitness=[4, 3, 2, np.nan]))
    assert state.elite.tolist() == [[2, 0]]
    assert [1.0, 1.0] not in state.archive.tolist()


def test_the_archive_takes_what_is_novel_enough_and_forgets_the_oldest():
    """Novelties are 0.235, 0.235, 0.469 and 1.252: means of the two nearest."""
    scores = scores_of(*TEAMS)
    fine = told(method("novelty", genotypes=4, neighbours=2, threshold=0.3), scores)
    np.testing.assert_allclose(fine.archive, [[0.4689956, 0], [1, 1]])
    assert fine.threshold == 0.3  # one to four have entered
    full = told(method("novelty", genotypes=4, neighbours=2, threshold=0.3, archive=1), scores)
    np.testing.assert_allclose(full.archive, [[1, 1]])
    none = told(
        method("novelty", genotypes=4, neighbours=2, threshold=1.0), scores_of(*TEAMS[:3], TEAMS[0])
    )
    assert none.archive.shape == (0, 2)
    assert none.threshold == 0.95
    corners = [[[a, 1 - a], [a, 1 - a]] for a in (1, 0.9, 0.8, 0.7, 0.5)]
    many = told(method("novelty", genotypes=5, neighbours=1, threshold=0.01), scores_of(*corners))
    assert len(many.archive) == 5
    assert many.threshold == 0.01 * 1.2


def test_a_whole_team_is_one_genotype():
    """Children have their networks from two whole teams, crossed at one point."""
    learner = method(
        "novelty", genotypes=6, team="whole", mutation_probability=0.0, elite_portion=1 / 3
    )
    state = learner.init(LAYOUT, 1)
    trials = learner.ask(state)
    np.testing.assert_array_equal(
        trials.networks().swapaxes(1, 2)[:, 0], state.genes[:, 0].swapaxes(0, 1)
    )
    marked = np.zeros_like(state.genes)
    marked[:, :2] = np.linspace(-1, 1, 6, dtype=np.float32)[:, None]
    state = replace(state, genes=marked)
    teams = [[[1, 0], [1, 0]]] * 4 + [[[1, 0], [0, 1]], [[0.5, 0.5], [0.5, 0.5]]]
    state = learner.tell(state, trials, scores_of(*teams, fitness=range(6)))
    assert sorted(state.elite[0].tolist()) == [4, 5]
    state = learner.tell(state, learner.ask(state), scores_of(teams[5]))
    whole = state.genes[:, :2].transpose(2, 0, 1, 3).reshape(6, -1)
    parents = np.unique(whole)
    np.testing.assert_allclose(parents, [0.6, 1.0])
    assert (np.abs(np.diff(whole, axis=1)) > 0.1).sum(axis=1).tolist() == [1] * 6  # one crossover


def test_it_finds_more_behaviours_than_selection_by_fitness():
    """Shares of actions depend on the first gene, fitness on the second."""
    columns = {}
    for weight in (1.0, 0.0):
        learner = method("novelty", genotypes=40, weight=weight, team="whole", bins=8)
        state = learner.init(Layout(2, 2, 2, 4), root=3)
        while state.progress.generation < 12:
            trials = learner.ask(state)
            gene = trials.networks()[:, :, 0].astype(np.float64)
            a = np.clip(gene[:, :, 0] - 0.9, 0, 0.1) * 10
            shares = np.stack([a, 1 - a], axis=2)
            state = learner.tell(state, trials, Scores(gene[:, :, 1], 0 * a, shares))
            if trials.portrait:
                columns[weight] = state.progress.numbers
    assert columns[1.0]["coverage"] >= 2 * columns[0.0]["coverage"]
    assert columns[1.0]["archive"] > 4
