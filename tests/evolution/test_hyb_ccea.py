"""Hyb-CCEA: merging and splitting worked out by hand."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.evolution import Layout, Scores, method
from conevo.evolution.methods.hyb_ccea import _as_clones, _parted

LAYOUT = Layout(n_robots=3, n_hidden=2, max_hidden=3, n_genes=4)
SMALL = {"genotypes": 4, "elite_portion": 0.5, "stagnation_v": 1, "mutation_probability": 0.0}


def play(learner, state, shares, fitness=0.0):
    """Return the states of a generation whose robots have these shares [R, A] in all teams."""
    states = [state]
    generation = state.progress.generation
    while states[-1].progress.generation == generation:
        trials = learner.ask(states[-1])
        n = len(trials.teams)
        credit = np.zeros((n, 3)) + fitness
        credit[:, :] += trials.networks()[:, :, 0, 0]  # the first gene is the fitness
        scores = Scores(credit, np.zeros((n, 3)), np.broadcast_to(shares, (n, *np.shape(shares))))
        states.append(learner.tell(states[-1], trials, scores))
    return states


def whole(state, robot):
    """Return the genotypes [M, L] of a robot's population."""
    return state.genes[robot].swapaxes(0, 1).reshape(state.genes.shape[2], -1)


SIMILAR = [[1.0, 0.0], [0.2, 0.8], [0.95, 0.05]]  # 0 and 2 are 0.05 apart, 1 is far from both


@pytest.mark.parametrize("evaluation", ["systematic", "shared"])
def test_robots_that_behave_alike_share_a_population(evaluation):
    learner = method("hyb-ccea", **SMALL, evaluation=evaluation, rounds=2)
    first = learner.init(LAYOUT, 1)
    assert first.group.tolist() == [0, 1, 2]
    after = play(learner, first, SIMILAR)[-1]
    assert after.group.tolist() == [0, 1, 2]  # groups last for at least V generations
    states = play(learner, after, SIMILAR)
    graded, merged = states[1], states[-1]
    assert merged.group.tolist() == [0, 1, 0]
    assert merged.changed == 1
    np.testing.assert_array_equal(merged.genes[0], merged.genes[2])
    assert (merged.genes[0] != merged.genes[1]).any()
    # Two of four are elite: the fittest of population 0, and that of population 2.
    elites = {tuple(whole(graded, robot)[graded.elite[robot, 0]].tolist()) for robot in (0, 2)}
    genes = {gene for elite in elites for gene in elite}
    assert set(whole(merged, 0).ravel().tolist()) <= genes
    assert merged.progress.numbers["populations"] == 2.0

    for state in (merged, play(learner, merged, SIMILAR)[1]):  # all teams, then the fittest
        played = learner.ask(state).networks()
        np.testing.assert_array_equal(played[:, 0], played[:, 2])
    assert len(learner.ask(merged).teams) == len(learner.ask(first).teams)


def test_the_closest_pair_merges_first_and_only_if_it_looks_alike():
    shares = [[1.0, 0.0], [0.94, 0.06], [0.97, 0.03]]  # 0.03 from 0 to 2, and from 1 to 2
    for gst, group in ((1.0, [0, 1, 0]), (0.0, [0, 1, 2])):
        learner = method("hyb-ccea", **SMALL, gst=gst)
        state = play(learner, learner.init(LAYOUT, 1), shares)[-1]
        merged = play(learner, replace(state, past_fitness=np.array([0.0, -9.0])), shares)[-1]
        assert merged.group.tolist() == group
    never = method("hyb-ccea", **SMALL, merge_below=0.0)
    state = play(never, never.init(LAYOUT, 1), [[1.0, 0.0]] * 3)[-1]
    assert play(never, state, [[1.0, 0.0]] * 3)[-1].group.tolist() == [0, 1, 2]


def test_one_group_splits_when_the_fittest_team_stagnates():
    apart = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    learner = method("hyb-ccea", **SMALL, start="one")
    state = learner.init(LAYOUT, 1)
    assert state.group.tolist() == [0, 0, 0]
    np.testing.assert_array_equal(state.genes[0], state.genes[2])
    after = play(learner, state, apart, fitness=1.0)[-1]
    progressed = play(learner, after, apart, fitness=9.0)[-1]
    assert progressed.group.tolist() == [0, 0, 0]
    split = play(learner, after, apart, fitness=-9.0)[-1]
    assert len(set(split.group.tolist())) == 2
    one, other = (np.flatnonzero(split.group == first)[0] for first in np.unique(split.group))
    assert (split.genes[one] != split.genes[other]).any()
    genes = set(whole(after, 0).ravel().tolist())
    for robot in (one, other):  # both are bred from the same population
        assert set(whole(split, robot).ravel().tolist()) <= genes


def test_all_groups_of_several_robots_split_and_in_all_parts():
    generator = np.random.default_rng(2)
    found = {tuple(_parted(np.array([0, 0, 0, 3, 4, 3]), generator).tolist()) for _ in range(300)}
    of_three = {(0, 1, 1), (0, 0, 2), (0, 1, 0)}
    assert found == {(*three, 3, 4, 3) for three in of_three} | {(0, 0, 0, 3, 4, 5)}
    assert _parted(np.arange(3), generator).tolist() == [0, 1, 2]


def test_a_genotype_is_ranked_by_the_mean_of_its_copies():
    """Robots 0 and 1 share four genotypes; one gets 4, 3, 2, 1 with them, the other 0, 3, 9, 1."""
    learner = method("hyb-ccea", **SMALL)
    state = replace(learner.init(LAYOUT, 1), group=np.array([0, 0, 2]))
    trials = learner.ask(state)
    credit = np.zeros((12, 3))
    credit[:4, 0], credit[4:8, 1], credit[8:, 2] = [4, 3, 2, 1], [0, 3, 9, 1], [1, 2, 3, 4]
    scores = Scores(credit, 0 * credit, np.zeros((12, 3, 2)))
    told = learner.tell(state, trials, scores)
    assert told.elite.tolist() == [[2, 1], [2, 1], [3, 2]]  # means 2, 3, 5.5, 1
    assert told.fitness[:2].tolist() == [[4, 3, 2, 1], [0, 3, 9, 1]]


def test_behaviour_is_that_of_the_elite():
    """Each robot's shares are 1 for its two elite genotypes, and 0 for the others."""
    learner = method("hyb-ccea", **SMALL, evaluation="shared", rounds=3)
    state = learner.init(LAYOUT, 1)
    trials = learner.ask(state)
    genotype = trials.teams[:, :, 0] - np.arange(3) * 3 * 4
    scores = Scores(genotype * 1.0, 0.0 * genotype, (genotype >= 2)[:, :, None] * 1.0)
    told = learner.tell(state, trials, scores)
    assert told.elite.tolist() == [[3, 2]] * 3
    assert told.behaviour.tolist() == [[1.0]] * 3


def test_clones_have_rows_of_their_own_copies():
    """Three populations of two slots, four genotypes and two partners: rows 0 to 23, 24 to 35."""
    teams = np.array([[[1, 5], [8, 12], [19, 23]], [[24, 26], [29, 31], [32, 34]]], dtype=np.int32)
    source = np.array([[0, 0, 2], [1, 1, 1]])
    expected = [[[1, 5], [9, 13], [19, 23]], [[25, 27], [29, 31], [33, 35]]]
    assert _as_clones(teams, source, 4, 2).tolist() == expected
    empty = teams.copy()
    empty[:, :, 1] = -1
    assert (_as_clones(empty, source, 4, 2)[:, :, 1] == -1).all()


@pytest.mark.parametrize("evaluation", ["systematic", "shared"])
def test_copies_of_a_group_stay_equal_while_groups_merge_and_split(evaluation):
    learner = method("hyb-ccea", **SMALL | {"genotypes": 6}, evaluation=evaluation, rounds=2)
    state, kinds = learner.init(LAYOUT, 5), set()
    generator = np.random.default_rng(1)
    for _ in range(24):
        shares = generator.dirichlet([2.0, 2.0], size=3) if len(kinds) < 3 else np.eye(3)[:, :2]
        state = play(learner, state, shares, fitness=-float(state.generation))[-1]
        assert state.problem(learner.init(LAYOUT, 5)) == ""
        kinds.add(tuple(state.group.tolist()))
        for robot, first in enumerate(state.group):
            np.testing.assert_array_equal(state.genes[robot], state.genes[first])
            np.testing.assert_array_equal(state.partners[robot], state.partners[first])
        played = learner.ask(state).networks()
        for a, b in pairwise(np.flatnonzero(state.group == 0)):
            np.testing.assert_array_equal(played[:, a], played[:, b])
    assert len(kinds) >= 3


def test_scores_without_shares_are_refused_in_one_line():
    learner = method("hyb-ccea", **SMALL)
    state = learner.init(LAYOUT, 1)
    trials = learner.ask(state)
    zeros = np.zeros(trials.teams.shape[:2])
    with pytest.raises(UsageError, match=r"^hyb-ccea needs scores\.shares"):
        learner.tell(state, trials, Scores(zeros, zeros))
