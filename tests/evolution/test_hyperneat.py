"""HyperNEAT: weights are a function of places; a team is one genotype."""

import numpy as np
import pytest

from conevo.controllers.srn import Srn
from conevo.errors import UsageError
from conevo.evolution import Layout, Scores, method
from conevo.evolution.inheritance import breed_from
from conevo.evolution.methods.hyperneat import N_OUTPUTS, bell, respond, squash, wave

SLOTS = N_OUTPUTS + 1


def layout(n_robots=3, n_inputs=18, n_outputs=3, **sizes):
    genome = Srn(**{"n_hidden": 4, "max_hidden": 6} | sizes).genome(n_inputs, n_outputs)
    return Layout(n_robots, genome.n_parts, genome.max_parts, genome.n_genes, n_inputs, n_outputs)


def test_functions_of_nodes():
    x = np.array([-3.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 2.5])
    np.testing.assert_allclose(squash(x)[[0, 1, 3, 5]], [-0.75, -0.5, 0, 0.5])
    np.testing.assert_allclose(bell(x)[[0, 1, 3, 5]], [0.1, 0.5, 1, 0.5])
    np.testing.assert_allclose(wave(x), [0, 0, -1, 0, 1, 0, 0, 1])
    t = np.linspace(-3, 3, 401)
    np.testing.assert_allclose(wave(t), np.sin(np.pi * t), atol=0.06)


def test_a_cppn_by_hand():
    """A hidden node, a bell of x1 - x2 with weight 2, feeds the second output with weight 3."""
    cppn = np.zeros((SLOTS, 5 + 1 + SLOTS + 2), np.float32)
    active = np.array([True, True, True, True])
    cppn[3, 0], cppn[3, 2] = 0.5, -0.5  # x1, x2; with scale 4 weights of 2
    cppn[3, -2], cppn[3, -1] = -0.4, 0.0  # the second of four functions; its place
    cppn[1, 5], cppn[1, 6 + 3] = -0.25, 0.75  # bias -1, hidden node 3
    points = np.array([[0.5, 0.2], [9, 9], [0.0, 0.2], [9, 9], [0, 0]])
    bells = np.array([1 / (1 + 1.0**2), 1.0])
    wanted = (3 * bells - 1) / (1 + np.abs(3 * bells - 1))
    without = np.array([True, True, True, False])
    first, second, third = respond(
        np.stack([cppn, cppn]), np.stack([active, without]), (points[:, :1], points, points), 4.0
    )
    np.testing.assert_allclose(second, [wanted, [-0.5, -0.5]])
    assert first.shape == (2, 1)
    assert not first.any()
    assert not third.any()


def test_the_substrate_has_rings_of_sensors_and_places_of_robots():
    learner = method("hyperneat", genotypes=3)
    state = learner.init(layout(), 1)
    first, context, outputs = learner._points(state)
    assert first.shape == (5, 3, 4, 18)
    assert context.shape == (5, 3, 4, 4)
    assert outputs.shape == (5, 3, 4, 3)
    np.testing.assert_array_equal(first[4, :, 0, 0], [-1, 0, 1])  # robots
    x, y = first[:2, 0, 0]
    radius = np.hypot(x, y)
    np.testing.assert_allclose(radius[:8], 0.5, atol=0.03)  # the inner of two rings
    np.testing.assert_allclose(radius[8:16], 1, atol=0.06)
    np.testing.assert_allclose(np.arctan2(y, x)[:4], (np.arange(4) + 0.5) * np.pi / 4, atol=0.1)
    np.testing.assert_array_equal([x[16:], y[16:]], [[-1, 1], [0, 0]])  # the rest: a line
    np.testing.assert_array_equal(outputs[:2, 0, :, 0], first[2:4, 0, :, 0])  # hidden neurons
    np.testing.assert_array_equal(outputs[2, 0, 0], [-1, 0, 1])
    plain = method("hyperneat", genotypes=3).init(layout(recurrent=False), 1)
    assert learner._points(plain)[1].shape == (5, 3, 4, 0)
    assert learner.ask(plain).networks().shape == (3, 3, 6, 18 + 3)


@pytest.mark.parametrize("team", ["clones", "whole"])
def test_one_genotype_gives_a_team(team):
    learner = method("hyperneat", genotypes=4, team=team)
    trials = learner.ask(learner.init(layout(), 1))
    networks = trials.networks()
    assert (networks[:, 0] == networks[:, 2]).all() == (team == "clones")
    assert not networks[:, :, 4:].any()
    sizes = np.abs(networks[:, :, :4])
    assert 0.01 < (sizes == 0).mean() < 0.95  # some connections are too weak to exist
    assert sizes.max() < 1


def test_genotypes_are_handed_on_to_a_task_of_another_size():
    learner = method("hyperneat", genotypes=4, new_node=0.9)
    state = learner.init(layout(), 1)
    for _ in range(6):
        trials = learner.ask(state)
        fitness = np.sin(5 * trials.networks()).sum(axis=(2, 3))
        state = learner.tell(state, trials, Scores(fitness, np.zeros_like(fitness)))
    other = layout(n_robots=7, n_inputs=25, n_outputs=5, n_hidden=6)
    handed = learner.inherit(other, 5, state)
    np.testing.assert_array_equal(handed.cppns.graphs.genes, state.cppns.graphs.genes)
    assert handed.cppns.next_mark == state.cppns.next_mark
    assert learner.ask(handed).networks().shape == (4, 7, 6, other.n_genes)
    with pytest.raises(UsageError, match=r"method\.genotypes and method\.nodes must be those"):
        method("hyperneat", genotypes=5).inherit(other, 5, state)
    with pytest.raises(UsageError, match="HyperNEAT can only start from genotypes of HyperNEAT"):
        learner.inherit(other, 5, state.cppns)


def test_another_layout_is_refused():
    with pytest.raises(UsageError, match="HyperNEAT needs the layout of controller 'srn'"):
        method("hyperneat").init(Layout(2, 3, 5, 40, 2, 3), 1)


def test_a_champion_has_no_cppn_and_the_message_names_the_way_that_works():
    genes, active = np.zeros((3, 4, 12), np.float32), np.ones((3, 4), bool)
    with pytest.raises(UsageError, match=r"none that consists of controllers; .* \(--from\)"):
        breed_from(method("hyperneat", genotypes=10), Layout(3, 4, 4, 12, 3, 5), 1, genes, active)
