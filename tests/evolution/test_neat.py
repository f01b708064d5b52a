"""NEAT: the steps of Stanley and Miikkulainen 2002 worked out by hand, and XOR."""

from dataclasses import replace

import numpy as np
import pytest

from conevo.controllers.graph import Graph
from conevo.errors import UsageError
from conevo.evolution import Layout, Scores, method
from conevo.evolution.species import Compatibility, aligned, distance, offspring, speciate
from conevo.evolution.topology import (
    Graphs,
    Innovations,
    Sizes,
    add_connection,
    add_node,
    cross,
    minimal,
)
from conevo.rng import stream

# Figure 4: inputs 1, 2, 3, output 4, hidden nodes 5, 6. (marking, source, target, is enabled)
FIRST = [(1, 1, 4, 1), (2, 2, 4, 0), (3, 3, 4, 1), (4, 2, 5, 1), (5, 5, 4, 1), (8, 1, 5, 1)]
SECOND = [
    *[(1, 1, 4, 1), (2, 2, 4, 0), (3, 3, 4, 1), (4, 2, 5, 1), (5, 5, 4, 0)],
    *[(6, 5, 6, 1), (7, 6, 4, 1), (9, 3, 5, 1), (10, 1, 6, 1)],
]
FIGURE = Sizes(n_networks=1, n_inputs=3, n_outputs=1, n_slots=3)
SLOTS = {4: 0, 5: 1, 6: 2}
UNIT = Compatibility(excess=1.0, disjoint=1.0, weights=0.0, small=0)


def graph_of(connections, gene, nodes=(4, 5, 6)):
    """Return a genotype of figure 4, [1], with the same gene for all weights."""
    genes = np.zeros((1, 3, FIGURE.n_genes), np.float32)
    marks = np.full((1, 3, FIGURE.n_feeds), -1, np.int32)
    enabled = np.zeros(marks.shape, bool)
    genes[0, :, -1] = (1, -0.5, 0)  # places: the output last
    for mark, source, target, is_on in connections:
        at = 0, SLOTS[target], source - 1 if source <= 3 else 4 + SLOTS[source]
        genes[at], marks[at], enabled[at] = gene, mark, is_on
    return Graphs(genes, marks, enabled, np.array([nodes], np.int32))


BOTH = Graphs.joined([graph_of(FIRST, 0.2), graph_of(SECOND, -0.6)])


def found(graphs, k=0):
    """Return {marking: (gene, is enabled)} of a genotype."""
    at = np.nonzero(graphs.marks[k] >= 0)
    values = graphs.marks[k][at], graphs.genes[k, :, : FIGURE.n_feeds][at], graphs.enabled[k][at]
    return {int(m): (round(float(g), 6), bool(e)) for m, g, e in zip(*values, strict=True)}


def test_the_distance_of_figure_4():
    some = aligned(BOTH)
    assert some.count.tolist() == [6, 9]
    assert some.marks[0, :7].tolist()[:6] == [1, 2, 3, 4, 5, 8]
    # disjoint 6, 7, 8; excess 9, 10; five match, with weights 0.8 apart
    for one, other in ((0, 1), (1, 0)):
        apart = distance(some[other : other + 1], some[one : one + 1], UNIT)
        assert apart == pytest.approx([(3 + 2) / 9])
    three = Compatibility(excess=2.0, disjoint=0.5, weights=0.4, small=20)
    assert distance(some, some[:1], three) == pytest.approx([0, 2 * 2 + 0.5 * 3 + 0.4 * 0.8])


@pytest.mark.parametrize("fitter", [0, 1])
def test_crossover_of_figure_4(fitter):
    own, other = (FIRST, SECOND)[fitter], (FIRST, SECOND)[1 - fitter]
    gene, theirs = (0.2, -0.6)[fitter], (-0.6, 0.2)[fitter]
    n = 400
    parents = np.full(n, fitter), np.full(n, 1 - fitter)
    children = cross(BOTH, *parents, 0.75, stream(1, "cross"))
    match = {m for m, *_ in own} & {m for m, *_ in other}
    assert match == {1, 2, 3, 4, 5}
    seen = [found(children, k) for k in range(n)]
    for mark, *_, is_on in own:
        genes = {one[mark][0] for one in seen}
        assert genes == ({gene, theirs} if mark in match else {gene})
        share = np.mean([one[mark][1] for one in seen])
        is_off = not is_on or mark in (2, 5)  # 2 in both parents, 5 in the second
        assert share == pytest.approx(0.25 if is_off else 1.0, abs=0.07)
    assert {frozenset(one) for one in seen} == {frozenset(m for m, *_ in own)}
    taken = np.array([[one[m][0] == theirs for m in sorted(match)] for one in seen])
    np.testing.assert_allclose(taken.mean(axis=0), 0.5, atol=0.08)


def test_a_copy_has_one_parent_and_changes_nothing():
    copy = cross(BOTH, np.array([1]), np.array([1]), 0.75, stream(1, "cross"))
    assert found(copy) == found(BOTH, 1)


def test_a_new_node_splits_a_connection_as_in_figure_3():
    """Figure 3: 3 -> 4 becomes 3 -> 5 with a fixed weight and 5 -> 4 with the old weight."""
    plain = graph_of([(3, 3, 4, 1)], 0.3, nodes=(0, -1, -1))
    graphs = Graphs.joined([plain, plain, plain])
    innovations = Innovations(next_mark=8, next_node=1)
    for k in (0, 1):
        add_node(graphs, k, FIGURE, 0.5, innovations, stream(k, "node"), in_order=True)
        assert found(graphs, k) == {3: (0.3, False), 8: (0.5, True), 9: (0.3, True)}
        assert graphs.nodes[k].tolist() == [0, 1, -1]
        assert graphs.marks[k, 1, 2] == 8  # from input 3
        assert graphs.marks[k, 0, 3 + 1 + 1] == 9  # to the output
        assert -1 < graphs.genes[k, 1, -1] < 1
    later = Innovations(innovations.next_mark, innovations.next_node)
    add_node(graphs, 2, FIGURE, 0.5, later, stream(2, "node"), in_order=True)
    assert graphs.nodes[2].tolist() == [0, 2, -1]  # another generation, another origin
    expressed = graphs.expressed()
    assert expressed[0, 0, 2] == 0
    assert graphs.genes[0, 0, 2] == np.float32(0.3)


def grown(in_order, n=20):
    """Return genotypes of two networks after many structural mutations."""
    sizes = Sizes(n_networks=2, n_inputs=2, n_outputs=2, n_slots=6)
    graphs, innovations = minimal(sizes, n, stream(1, "minimal"))
    generator = stream(1, "growth")
    for _ in range(40):
        for k in range(n):
            add_node(graphs, k, sizes, 0.5, innovations, generator, in_order=in_order)
            add_connection(graphs, k, sizes, innovations, generator, in_order=in_order)
    return sizes, graphs


@pytest.mark.parametrize("in_order", [True, False])
def test_growth_stays_within_its_network_and_its_room(in_order):
    sizes, graphs = grown(in_order)
    assert (graphs.nodes >= 0).all()
    for k in range(len(graphs.nodes)):
        assert len(set(graphs.nodes[k])) == graphs.nodes.shape[1]
        marks = graphs.marks[k][graphs.marks[k] >= 0]
        assert len(set(marks.tolist())) == len(marks)
    place = graphs.genes[..., -1].reshape(-1, 2, 6)
    forward = place[:, :, None] < place[:, :, :, None]  # [M, T, target, source]
    between = (graphs.marks >= 0).reshape(-1, 2, 6, sizes.n_feeds)[..., 3:]
    assert (between & ~forward).any() != in_order
    alike = {}
    for k, slot, feed in np.argwhere(graphs.marks >= 0).tolist():
        network = slot // 6 * 6
        source = graphs.nodes[k, network + feed - 3] if feed >= 3 else -1 - feed
        ends = int(source), int(graphs.nodes[k, slot])
        assert alike.setdefault(int(graphs.marks[k, slot, feed]), ends) == ends


def test_a_genotype_joins_the_first_species_that_is_near():
    some = aligned(Graphs.joined([BOTH, graph_of(FIRST, 0.9), graph_of(SECOND[:6], 0.0)]))
    far = Compatibility(excess=1.0, disjoint=1.0, weights=0.0, small=20)
    representatives = aligned(graph_of(SECOND, 0.1))
    assert speciate(some, representatives, far, 3.0).tolist() == [1, 0, 1, 1]
    assert speciate(some, representatives, far, 6.0).tolist() == [0, 0, 0, 0]
    assert speciate(some, representatives, far, 1.0).tolist() == [1, 0, 1, 2]


def test_species_share_fitness():
    """Means of 3, 6 and 1: of nine children the second gets 6, if the third may have none."""
    fitness, species = np.array([4.0, 2, 6, 1]), np.array([0, 0, 1, 2])
    assert offspring(fitness, species, np.array([True, True, False]), 9).tolist() == [3, 6, 0]
    assert offspring(fitness, species, np.ones(3, bool), 10).tolist() == [3, 6, 1]
    assert offspring(fitness, species, np.ones(3, bool), 7).tolist() == [2, 4, 1]
    assert offspring(0 * fitness, species, np.array([True, False, True]), 4).tolist() == [2, 0, 2]


def layout(n_robots=1, n_inputs=2, n_outputs=1, max_hidden=8):
    genome = Graph(max_hidden=max_hidden).genome(n_inputs, n_outputs)
    return Layout(n_robots, genome.n_parts, genome.max_parts, genome.n_genes, n_inputs, n_outputs)


def told(learner, state, fitness):
    """Return the state after a generation with the given fitness [M] of its genotypes."""
    for values in (fitness, [max(fitness)]):
        trials = learner.ask(state)
        credit = np.repeat(np.array(values, float)[:, None], trials.teams.shape[1], axis=1)
        state = learner.tell(state, trials, Scores(credit, np.zeros_like(credit)))
    return state


def test_stagnant_species_have_no_children_but_the_best_has():
    learner = method("neat", genotypes=12, species=0, stagnation_species=3, champion_of=0)
    state = learner.init(layout(), 1)
    state = replace(
        state,
        species=np.repeat([0, 1, 2], 4).astype(np.int32),
        record=np.array([9.0, 9.0, 2.0]),
        since=np.array([-4, -4, -1]),
    )
    fitness = np.array([5.0, 1, 1, 1, 4, 1, 1, 1, 3, 1, 1, 1])
    told_once = replace(state, fitness=fitness)
    assert learner._allowed(told_once, fitness).tolist() == [True, False, True]
    stuck = replace(told_once, best=1.0, best_since=-21)
    assert learner._allowed(stuck, fitness).tolist() == [True, True, False]
    after = told(learner, state, fitness)
    champion = state.graphs.genes[0]
    assert (after.graphs.genes == champion).all(axis=(1, 2)).any()  # copied unchanged
    assert not (after.graphs.genes == state.graphs.genes[4]).all(axis=(1, 2)).any()


def test_a_whole_team_has_a_network_for_each_robot():
    learner = method("neat", genotypes=5, team="whole")
    trials = learner.ask(learner.init(layout(n_robots=3), 1))
    assert len(set(trials.teams[trials.teams >= 0].tolist())) == 15
    clones = method("neat", genotypes=5)
    trials = clones.ask(clones.init(layout(n_robots=3), 1))
    assert len(set(trials.teams[trials.teams >= 0].tolist())) == 5
    networks = trials.networks()
    assert (networks == networks[:, :1]).all()


@pytest.mark.parametrize("team", ["clones", "whole"])
def test_a_run_starts_around_a_team(team):
    learner = method("neat", genotypes=6, team=team, new_node=0.9, new_connection=0.9)
    state = learner.init(layout(n_robots=2), 1)
    for _ in range(4):
        state = told(learner, state, range(6))
    before = state.progress
    genes, active = before.fittest_genes, before.fittest_active
    trials = learner.ask(learner.begin_with(layout(n_robots=2), 7, genes, active))
    np.testing.assert_array_equal(trials.networks()[0], genes)
    np.testing.assert_array_equal(trials.teams[0] >= 0, active)
    assert (trials.networks()[1:] != genes).any(axis=(1, 2, 3)).any()
    larger = learner.begin_with(layout(n_robots=3), 7, genes, active)
    assert (learner.ask(larger).networks()[0, 2] == genes[0]).all()


def test_another_layout_is_refused():
    with pytest.raises(UsageError, match="NEAT needs the layout of controller 'graph'"):
        method("neat").init(Layout(2, 3, 5, 4), 1)


INPUTS = np.array([[0, 0], [0, 1], [1, 0], [1, 1]], np.float32)
WANTED = np.array([0, 1, 1, 0], np.float32)


def shares(trials):
    """Return the output of each network for the four inputs, [N, 4], in [0, 1]."""
    n = len(trials.teams)
    genes, active = (np.repeat(a[:, 0], 4, axis=0) for a in (trials.networks(), trials.teams >= 0))
    memory = np.zeros((*active.shape, 1), np.float32)
    _, hidden = Graph(max_hidden=8).forward(genes, active, memory, np.tile(INPUTS, (n, 1)), 1)
    return hidden[:, 0, 0].reshape(n, 4)


def test_neat_finds_the_exclusive_or():
    """Section 4.1: it needs a hidden node, which networks do not have at the start."""
    learner = method("neat", recurrent=False)
    state = learner.init(layout(), 1)
    for _ in range(150):
        trials = learner.ask(state)
        fitness = (4 - np.abs(shares(trials) - WANTED).sum(axis=1)) ** 2
        state = learner.tell(state, trials, Scores(fitness[:, None], np.zeros((len(fitness), 1))))
        if trials.portrait and ((shares(trials)[0] > 0.5) == (WANTED > 0.5)).all():
            break
    assert ((shares(trials)[0] > 0.5) == (WANTED > 0.5)).all()
    assert trials.teams[0, 0, 0] == 0
    assert (trials.teams[0, 0, 1:] >= 0).any()  # a hidden node
