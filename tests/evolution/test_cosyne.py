"""CoSyNE: its permutation and one generation against calculations by hand."""

from dataclasses import replace

import numpy as np
import pytest

from conevo.controllers.registry import controller
from conevo.evolution import Layout, Scores, method
from conevo.evolution.methods.cosyne import marked, permuted, relative
from conevo.kernels.outputs import sigmoid_of

LAYOUT = Layout(n_robots=2, n_hidden=3, max_hidden=4, n_genes=5)


def test_relative_fitness_by_hand():
    fitness = np.array([1.0, 3.0, 2.5, np.nan, -np.inf])
    assert relative(fitness, "fitness").tolist() == [0, 1, 0.75, 0, 0]
    assert relative(fitness, "rank").tolist() == [0.5, 1, 0.75, 0, 0]
    assert relative(fitness, "all").tolist() == [0] * 5
    assert relative(np.full(3, 2.0), "fitness").tolist() == [1, 0, 0]
    assert relative(np.full(3, np.nan), "fitness").tolist() == [0] * 3


def test_relative_fitness_is_the_chance_that_a_network_stays_together():
    q = np.array([0.0, 0.3, 0.9, 1.0]).repeat(10_000)
    together = ~marked(q, 20, np.random.default_rng(1)).any(axis=0)
    assert together.reshape(4, -1).mean(axis=1) == pytest.approx([0, 0.3, 0.9, 1], abs=0.015)


def test_marked_values_are_permuted_within_their_row_and_others_stay():
    matrix = np.arange(30.0).reshape(3, 10)
    mark = np.zeros((3, 10), dtype=bool)
    mark[0, [1, 4, 7]] = mark[2] = True
    found = np.array([permuted(matrix, mark, np.random.default_rng(k)) for k in range(3000)])
    assert (found[:, ~mark] == matrix[~mark]).all()
    assert (np.sort(found, axis=2) == matrix).all()
    where = (found[:, 0, [1, 4, 7]][..., None] == [1, 4, 7]).mean(axis=0)
    np.testing.assert_allclose(where, 1 / 3, atol=0.04)
    assert len({row.tobytes() for row in found[:, 0]}) == 6


@pytest.mark.parametrize("team", ["clones", "whole"])
@pytest.mark.parametrize("permutation", ["fitness", "all"])
def test_a_generation_by_hand(team, permutation):
    """Networks 7 and 6 mate twice, and their four children replace 0 to 3."""
    sizes = {"genotypes": 8, "mutation_probability": 0}
    learner = method("cosyne", **sizes, team=team, permutation=permutation)
    state = learner.init(LAYOUT, 5)
    credit = np.arange(8.0)[:, None] + [-1, 1]  # the team's is the number of the network
    told = learner.tell(state, learner.ask(state), Scores(credit, 0 * credit))
    assert told.elite.tolist() == [[7, 6]] * len(state.genes)
    assert (told.fitness == np.arange(8)).all()
    fittest = learner.ask(told)
    end = learner.tell(told, fittest, Scores(np.ones((1, 2)), np.zeros((1, 2))))
    old, new = state.genes[:, :3], end.genes[:, :3]  # [P, U, M, G]
    np.testing.assert_array_equal(fittest.networks()[0, :, :3] - old[:, :, 7], 0)
    survivors = np.sort(old[:, :, [4, 5, 6, 6, 6, 7, 7, 7]], axis=2)  # of each weight
    np.testing.assert_array_equal(np.sort(new, axis=2), survivors)
    assert not end.genes[:, 3].any()
    stays = (new[:, :, 7] == old[:, :, 7]).mean()
    assert stays == 1 if permutation == "fitness" else stays < 0.8


def test_a_network_of_the_team_takes_the_place_of_each_robot():
    whole, clones = (method("cosyne", genotypes=8, team=team) for team in ("whole", "clones"))
    networks = whole.ask(whole.init(LAYOUT, 5)).networks()
    assert (networks[:, 0] != networks[:, 1])[:, :3].all()
    networks = clones.ask(clones.init(LAYOUT, 5)).networks()
    assert (networks[:, 0] == networks[:, 1]).all()
    five = replace(LAYOUT, n_robots=5)
    assert whole.init(five, 5).genes.shape == (5, 4, 8, 5)
    assert clones.init(five, 5).genes.shape == (1, 4, 8, 5)


XOR = [((0, 0), 0), ((0, 1), 1), ((1, 0), 1), ((1, 1), 0)]


def evaluations_to_xor(seed):
    """Return the networks that are tried until one computes XOR; its third input is 1."""
    net = controller("srn", n_hidden=4, max_hidden=4, recurrent=False, bias=True, weight_scale=20.0)
    genome = net.genome(3, 1)
    learner = method("cosyne", genotypes=100)
    state = learner.init(Layout(1, genome.n_parts, genome.max_parts, genome.n_genes), seed)
    while state.progress.generation < 60:
        trials = learner.ask(state)
        networks, used = trials.networks()[:, 0], trials.teams[:, 0] >= 0
        memory = np.zeros((*used.shape, 1), np.float32)
        errors = []
        for case, answer in XOR:
            inputs = np.tile(np.array([*case, 1], np.float32), (len(networks), 1))
            sums, _ = net.forward(networks, used, memory, inputs, 1)
            errors.append(np.abs(sigmoid_of(sums[:, 0]) - answer))
        if (np.array(errors) < 0.1).all(axis=0).any():
            return state.progress.team_evaluations + len(networks)
        fitness = (4 - np.sum(errors, axis=0)) ** 2
        state = learner.tell(state, trials, Scores(fitness[:, None], np.zeros((len(networks), 1))))
    pytest.fail("no network computes XOR")


def test_networks_without_memory_learn_xor():
    """A known answer. A random network is right once in 1,800 tries."""
    assert np.mean([evaluations_to_xor(seed) for seed in range(1, 13)]) < 800
