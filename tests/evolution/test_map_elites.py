"""MAP-Elites: examples worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from conevo.evolution import Layout, Scores, method
from conevo.evolution.behaviour import TeamMap
from conevo.evolution.inheritance import breed_from
from conevo.evolution.methods.map_elites import iso_line

LAYOUT = Layout(n_robots=2, n_hidden=2, max_hidden=3, n_genes=4)
ALIKE, APART, ONE = (
    [[0.5, 0.5]] * 2,
    [[1, 0], [0, 1]],
    [[1, 0], [1, 0]],
)  # cells 2, 3 and 0 of 2 x 2


def scores_of(teams, fitness):
    shares = np.array(teams, dtype=np.float64)
    credit = np.tile(np.asarray(fitness, dtype=np.float64)[:, None], (1, 2))
    return Scores(credit, np.zeros((len(shares), 2)), shares)


def generation(learner, state, children, elites=()):
    """Return the state after a generation with these (team, fitness), and those of its elites."""
    trials = learner.ask(state)
    state = learner.tell(state, trials, scores_of(*zip(*children, strict=True)))
    if state.phase == "elites":
        n = len(learner.ask(state).teams)
        assert n == len(elites)
        state = learner.tell(state, learner.ask(state), scores_of([ONE] * n, elites))
    fittest = learner.ask(state)
    return learner.tell(state, fittest, scores_of([ONE], [0])), trials, fittest


def test_two_generations_by_hand():
    learner = method("map-elites", genotypes=3, bins=2)
    first, tried, _ = generation(
        learner, learner.init(LAYOUT, 1), [(ONE, 1.0), (APART, 5.0), (ONE, 2.0)]
    )
    np.testing.assert_array_equal(first.map.fitness, [2, np.nan, np.nan, 5])
    assert first.progress.numbers == {"coverage": 0.5, "qd_score": 7.0}
    played = tried.networks()[:, 0]  # [M, U, G]
    np.testing.assert_array_equal(first.genes[0, :, 0], played[2])
    np.testing.assert_array_equal(first.genes[0, :, 3], played[1])
    assert not first.genes[:, :, 1:3].any()

    # Cell 2 is empty. Claims on 0 and 3: in these scenarios their elites get 3 and 9.
    second, tried, fittest = generation(
        learner, first, [(ALIKE, 1.0), (APART, 6.0), (ONE, 4.0)], elites=[3.0, 9.0]
    )
    np.testing.assert_array_equal(second.map.fitness, [4, np.nan, 1, 7])  # 7: mean of 5 and 9
    assert second.plays.tolist() == [1, 0, 1, 2]
    played = tried.networks()[:, 0]
    np.testing.assert_array_equal(second.genes[0, :, 0], played[2])
    np.testing.assert_array_equal(second.genes[0, :, 2], played[0])
    np.testing.assert_array_equal(second.genes[0, :, 3], first.genes[0, :, 3])
    np.testing.assert_array_equal(fittest.networks()[0, 0], first.genes[0, :, 3])  # 9 is the best
    assert second.progress.team_evaluations == 3 + 1 + 3 + 2 + 1
    assert second.problem(learner.init(LAYOUT, 1)) == ""


def test_without_a_rematch_fitness_of_different_scenarios_is_compared():
    learner = method("map-elites", genotypes=3, bins=2, rematch=False)
    first, _, _ = generation(
        learner, learner.init(LAYOUT, 1), [(ONE, 1.0), (APART, 5.0), (ONE, 2.0)]
    )
    second, _, _ = generation(learner, first, [(ALIKE, 1.0), (APART, 4.0), (ONE, 3.0)])
    np.testing.assert_array_equal(second.map.fitness, [3, np.nan, 1, 5])
    assert second.plays.tolist() == [1, 0, 1, 1]


def test_a_score_that_is_not_finite_takes_no_cell_and_loses_a_match():
    learner = method("map-elites", genotypes=2, bins=2)
    first, _, _ = generation(learner, learner.init(LAYOUT, 1), [(ONE, 1.0), (APART, np.nan)])
    np.testing.assert_array_equal(first.map.fitness, [1, np.nan, np.nan, np.nan])
    second, _, _ = generation(learner, first, [(ONE, -9.0), (APART, np.inf)], elites=[np.nan])
    np.testing.assert_array_equal(second.map.fitness, [-9, np.nan, np.nan, np.nan])


def test_a_child_is_its_parent_with_noise_and_a_step_toward_another():
    generator = np.random.default_rng(1)
    x = np.full((2, 3, 5000, 4), 0.1, dtype=np.float32)
    y = np.full_like(x, 0.5)
    along = (iso_line(x, y, 0.0, 0.2, generator) - x) / np.float32(0.4)
    np.testing.assert_allclose(along, np.broadcast_to(along[:1, :1, :, :1], x.shape), atol=1e-6)
    assert abs(along[0, 0, :, 0].std() / 0.2 - 1) < 0.05
    noise = iso_line(x, y, 0.02, 0.0, generator) - x
    assert abs(noise.std() / 0.02 - 1) < 0.02
    assert abs(np.corrcoef(noise[0, 0, :, 0], noise[0, 0, :, 1])[0, 1]) < 0.06
    both = iso_line(x, y, 0.03, 0.1, generator) - x  # 0.03^2 + (0.1 * 0.4)^2 = 0.05^2
    assert abs(both.std() / 0.05 - 1) < 0.03
    limits = iso_line(x + np.float32(0.9), y, 0.5, 0.0, generator)
    assert limits.max() == 1
    assert (limits == 1).mean() > 0.4


def test_parents_are_elites_of_any_cell():
    learner = method("map-elites", genotypes=300, bins=2, iso=0.0, line=0.0)
    state = learner.init(LAYOUT, 1)
    genes = state.genes.copy()
    genes[:, :2, [0, 3]] = np.array([0.25, -0.5], dtype=np.float32)[:, None]
    full = replace(state, genes=genes, map=TeamMap(np.array([1, np.nan, np.nan, 99])))
    first = learner.ask(full).networks()[:, :, :2]
    assert abs((first == 0.25).mean() - 0.5) < 0.1
    assert set(np.unique(first)) == {-0.5, 0.25}


@pytest.mark.parametrize("team", ["clones", "whole"])
def test_a_run_may_start_around_a_team(team):
    learner = method("map-elites", genotypes=20, team=team)
    genes = np.random.default_rng(4).uniform(-1, 1, (2, 3, 4)).astype(np.float32)
    active = np.array([[True, False, True]] * 2)
    state = breed_from(learner, LAYOUT, 1, genes, active)
    assert state.progress.n_hidden.tolist() == [2]
    played = learner.ask(state).networks()
    assert not played[:, :, 1].any()
    expected = genes * active[..., None]
    if team == "clones":
        np.testing.assert_array_equal(played[:2, 0], expected)
        np.testing.assert_array_equal(played[:, 0], played[:, 1])
        nearest = np.abs(played[:, 0, None] - expected).mean(axis=(2, 3)).min(axis=1)
    else:
        np.testing.assert_array_equal(played[0], expected)
        nearest = np.abs(played - expected).mean(axis=(1, 2, 3))
    assert 0 < nearest[2:].mean() < 0.1
    assert state.problem(learner.init(LAYOUT, 1)) == ""
