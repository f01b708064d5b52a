"""From the scores of teams to the fitness of genotypes, worked out by hand."""

import numpy as np

from conevo.evolution import credit
from conevo.evolution.assembly import elite_teams


def test_of_robot_takes_the_robot_on_trial():
    fitness = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    assert credit.of_robot(fitness, np.array([1, 0, 1])).tolist() == [2, 3, 6]
    assert credit.of_robot(fitness, 0).tolist() == [1, 3, 5]


def test_of_clones_is_their_mean():
    assert credit.of_clones(np.array([[1.0, 2.0, 6.0], [0.0, 0.0, 3.0]])).tolist() == [3, 1]


def test_mean_of_trials_credits_every_participant_with_its_own_robot():
    # Row 0 plays in robot 0 twice (credits 1 and 5), row 1 in both robots (1 and 8), row 2 in
    # robot 1 (2), row 4 in robot 1 (8), row 3 never.
    teams = np.array([[[0, 1], [2, -1]], [[0, -1], [4, 1]]])
    fitness = np.array([[1.0, 2.0], [5.0, 8.0]])
    mean = credit.mean_of_trials(teams, fitness, 5)
    np.testing.assert_array_equal(mean, [3.0, 4.5, 2.0, np.nan, 8.0])


def test_mean_of_trials_is_spoiled_by_a_score_that_is_not_finite():
    teams = np.array([[[0]], [[0]], [[1]]])
    mean = credit.mean_of_trials(teams, np.array([[1.0], [np.nan], [2.0]]), 2)
    np.testing.assert_array_equal(mean, [np.nan, 2.0])


def test_controllers_of_equal_rank_come_in_the_order_of_their_utility():
    generator = np.random.default_rng(2)
    fitness = generator.random((2, 3, 8))
    active = np.ones((2, 3), dtype=bool)
    elite = np.argsort(-fitness, axis=-1)[..., :4]
    teams = elite_teams(active, elite, 8, generator).reshape(2, 4, 2, 3) % 8
    for population in range(2):
        # Type B fitness, eq. 3.8: the sum of type A over a controller's neurons.
        utilities = [
            sum(fitness[population, slot, team[population, slot]] for slot in range(3))
            for team in teams[population]
        ]
        assert utilities == sorted(utilities, reverse=True)
        assert len(set(utilities)) == 4


def test_overwrite_gives_type_c_to_the_elite_only():
    fitness = np.array([[[1.0, 2.0, 3.0], [6.0, 5.0, 4.0]]])
    elite = np.array([[[2, 1], [0, 1]]], dtype=np.int32)
    changed = credit.overwrite(fitness, elite, np.array([[70.0, 80.0]]))
    assert changed.tolist() == [[[1, 80, 70], [70, 80, 4]]]
    assert fitness[0, 0, 2] == 3
