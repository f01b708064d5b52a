"""Teams: which genotypes play together."""

import numpy as np

from conevo.evolution.assembly import (
    best_team,
    distinct,
    elite_teams,
    lesion_teams,
    on_trial,
    rows,
    shared,
    systematic,
)
from conevo.evolution.methods.registry import method
from conevo.evolution.protocol import Layout

# Two populations in three slots: the first uses slots 0 and 2, the second slot 1.
ACTIVE = np.array([[True, False, True], [False, True, False]])


def generator(seed=1):
    return np.random.default_rng(seed)


def test_rows_follow_the_pool_and_mark_empty_slots():
    # Row of (p, u, m) with M = 4: (p * 3 + u) * 4 + m.
    choice = np.array([[[1, 1, 3], [0, 2, 0]]])
    assert rows(ACTIVE, choice, 4).tolist() == [[[1, -1, 11], [-1, 18, -1]]]
    assert rows(ACTIVE, choice, 4, offset=100).tolist() == [[[101, -1, 111], [-1, 118, -1]]]
    whole = np.array([[2], [3]])
    assert rows(ACTIVE, whole, 4).tolist() == [[2, -1, 10], [-1, 19, -1]]


def test_systematic_tries_every_genotype_in_its_own_place():
    teams = systematic(ACTIVE, 4, generator())
    population, slot, genotype = on_trial(ACTIVE, 4)
    assert teams.shape == (12, 2, 3)
    tried = teams[np.arange(12), population, slot]
    # Slots 0, 2 of population 0 are rows 0-3 and 8-11, slot 1 of population 1 is rows 16-19.
    assert tried.tolist() == [0, 1, 2, 3, 8, 9, 10, 11, 16, 17, 18, 19]
    assert genotype.tolist() == [0, 1, 2, 3] * 3
    np.testing.assert_array_equal(teams >= 0, np.broadcast_to(ACTIVE, teams.shape))


def test_systematic_draws_partners_evenly_from_the_right_sub_population():
    active = np.ones((2, 2), dtype=bool)
    teams = systematic(active, 5, generator())
    many = np.concatenate([systematic(active, 5, generator(seed)) for seed in range(400)])
    np.testing.assert_array_equal(many // 5, np.broadcast_to([[0, 1], [2, 3]], many.shape))
    assert teams.shape == (20, 2, 2)
    partner = many.reshape(400, 20, 4)[:, 5:, 0] % 5  # robot 0, slot 0, when others are on trial
    counts = np.bincount(partner.ravel(), minlength=5)
    expected = partner.size / 5
    assert ((counts - expected) ** 2 / expected).sum() < 18.5  # chi squared, 4 degrees, p = 0.001


def test_shared_rounds_are_permutations_of_every_sub_population():
    teams = shared(ACTIVE, 6, 3, generator())
    assert teams.shape == (18, 2, 3)
    for one_round in teams.reshape(3, 6, 2, 3):
        assert sorted(one_round[:, 0, 0]) == list(range(6))
        assert sorted(one_round[:, 0, 2]) == list(range(12, 18))
        assert sorted(one_round[:, 1, 1]) == list(range(24, 30))
    assert (teams[:, ~ACTIVE] == -1).all()


def test_shared_permutations_are_independent_between_rounds_and_slots():
    teams = shared(np.ones((2, 2), dtype=bool), 5, 4000, generator()).reshape(4000, 5, 4) % 5
    # Independent permutations of five agree in a given place one time in five.
    for a, b in [(0, 1), (0, 2), (1, 3)]:
        assert abs((teams[..., a] == teams[..., b]).mean() - 0.2) < 0.01
    assert abs((teams[1:, :, 0] == teams[:-1, :, 0]).mean() - 0.2) < 0.01


def test_shared_networks_keep_a_genotypes_neurons_together():
    active = np.array([[True, True, False]] * 2)
    teams = shared(active, 4, 2, generator(), networks=True)
    np.testing.assert_array_equal(teams[:, 0, 1], teams[:, 0, 0] + 4)
    np.testing.assert_array_equal(teams[:, 1, 1], teams[:, 1, 0] + 4)
    assert sorted(teams[:4, 1, 0]) == [12, 13, 14, 15]


def test_elite_teams_try_equal_ranks_among_random_elites():
    # M = 5. Elites, the fittest first: P0: slot 0 -> 4, 1; slot 2 -> 0, 3. P1: slot 1 -> 2, 0.
    elite = np.array([[[4, 1], [0, 0], [0, 3]], [[0, 0], [2, 0], [0, 0]]])
    teams = elite_teams(ACTIVE, elite, 5, generator())
    assert teams.shape == (4, 2, 3)
    assert teams[0, 0].tolist() == [4, -1, 10]  # population 0, rank 0: rows 0 + 4 and 10 + 0
    assert teams[1, 0].tolist() == [1, -1, 13]
    assert teams[2, 1].tolist() == [-1, 22, -1]  # population 1, rank 0: row 20 + 2
    assert teams[3, 1].tolist() == [-1, 20, -1]
    many = np.concatenate([elite_teams(ACTIVE, elite, 5, generator(s)) for s in range(100)])
    partners = many.reshape(100, 4, 2, 3)[:, 2:, 0]  # population 0 while 1 is on trial
    assert set(partners[..., 0].ravel()) == {4, 1}
    assert set(map(tuple, partners[..., [0, 2]].reshape(-1, 2))) == {
        (4, 10),
        (4, 13),
        (1, 10),
        (1, 13),
    }


def test_best_team_is_rank_one_in_every_slot():
    elite = np.array([[[4, 1], [0, 0], [0, 3]], [[0, 0], [2, 0], [0, 0]]])
    assert best_team(ACTIVE, elite, 5).tolist() == [[[4, -1, 10], [-1, 22, -1]]]


def test_lesion_teams_lack_one_neuron_each():
    team = np.array([[4, -1, 10], [-1, 22, -1]])
    teams, robot, slot = lesion_teams(team, np.array([True, False]))
    assert teams[0].tolist() == team.tolist()
    assert teams[1:].tolist() == [[[-1, -1, 10], [-1, 22, -1]], [[4, -1, -1], [-1, 22, -1]]]
    assert robot.tolist() == [0, 0]
    assert slot.tolist() == [0, 2]
    assert team.tolist() == [[4, -1, 10], [-1, 22, -1]]


def test_distinct_members_are_different_and_evenly_used():
    drawn = distinct(5000, 3, 7, generator())
    assert drawn.shape == (5000, 3)
    assert (np.diff(np.sort(drawn, axis=1), axis=1) > 0).all()
    share = np.bincount(drawn[:, 0], minlength=7) / 5000
    np.testing.assert_allclose(share, 1 / 7, atol=0.015)
    assert sorted(distinct(1, 7, 7, generator())[0]) == list(range(7))
    assert distinct(4, 0, 7, generator()).shape == (4, 0)


def test_shared_rounds_are_distinguished_only_if_they_have_their_own_scenarios():
    for name in ("ccga", "mesp", "cone"):
        told = {}
        for fresh in (False, True):
            chosen = method(name, genotypes=4, evaluation="shared", rounds=3, fresh_rounds=fresh)
            state = chosen.init(Layout(n_robots=2, n_hidden=2, max_hidden=3, n_genes=5), root=1)
            told[fresh] = chosen.ask(state)
        assert (told[False].rounds, told[True].rounds) == (1, 3)
        np.testing.assert_array_equal(told[False].teams, told[True].teams)
        for part in np.split(told[True].teams, 3):  # every genotype once in every round
            used = part[part >= 0]
            assert len(used) == len(np.unique(used)) == 2 * 2 * 4
        alone = method(name, genotypes=4, evaluation="systematic", fresh_rounds=True)
        assert alone.ask(alone.init(Layout(2, 2, 3, 5), root=1)).rounds == 1
