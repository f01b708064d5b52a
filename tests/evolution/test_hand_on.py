"""Populations taken into the next task: genes and sizes go with them, all else begins anew."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.evolution import METHODS, Layout, Scores, State, method
from conevo.evolution.inheritance import breed_from, hand_on

LAYOUT = Layout(n_robots=2, n_hidden=3, max_hidden=5, n_genes=4)
TAKEN = {"genes", "active", "n_hidden"}
every_method = pytest.mark.parametrize("name", METHODS)


def build(name: str):
    """Return a method with short windows, so that thresholds and sizes change soon."""
    known = {field.name for field in fields(METHODS[name].config_class)}
    windows = {"stagnation_v", "stagnation_w", "stagnation_y"} & known
    return method(name, genotypes=6, elite_portion=0.5, **dict.fromkeys(sorted(windows), 1))


def evolve(learner, state: State, generations: int) -> State:
    """Return the state after so many generations of falling scores."""
    end = state.generation + generations
    while state.generation < end:
        trials = learner.ask(state)
        networks = trials.networks().astype(np.float64)
        fitness = np.sin(5 * networks).sum(axis=(2, 3)) - 5 * trials.generation
        scores = Scores(fitness, np.abs(networks[:, :, 0, 0]))
        state = learner.tell(state, trials, scores)
    return state


def same(a: State, b: State, names: set[str]) -> None:
    """Check that two states agree in some fields, to the bit and the type."""
    for name in names:
        left, right = getattr(a, name), getattr(b, name)
        assert np.asarray(left).dtype == np.asarray(right).dtype, name
        np.testing.assert_array_equal(left, right, err_msg=name)


@every_method
def test_genes_and_slots_are_taken_over_and_all_else_begins_anew(name: str) -> None:
    learner = build(name)
    old = evolve(learner, learner.init(LAYOUT, 3), 8)
    if "stagnation_y" in METHODS[name].config_class.__dataclass_fields__:
        while (old.n_hidden == LAYOUT.n_hidden).all():  # until a changed size is at stake
            old = evolve(learner, old, 1)
    new, fresh = hand_on(learner, LAYOUT, 7, old), learner.init(LAYOUT, 7)
    same(new, old, TAKEN)
    same(new, fresh, {field.name for field in fields(State)} - TAKEN)


@every_method
@pytest.mark.parametrize("n_robots", [1, 2, 5])
def test_a_team_of_another_size_is_filled_in_turn(name: str, n_robots: int) -> None:
    learner = build(name)
    old = evolve(learner, learner.init(LAYOUT, 3), 8)
    new = hand_on(learner, replace(LAYOUT, n_robots=n_robots), 3, old)
    n_populations = 1 if len(old.genes) == 1 else n_robots
    assert len(new.genes) == n_populations
    for p in range(n_populations):
        np.testing.assert_array_equal(new.genes[p], old.genes[p % len(old.genes)])
        np.testing.assert_array_equal(new.active[p], old.active[p % len(old.genes)])
    assert new.fittest_fitness.shape == (n_robots,)
    trials = learner.ask(new)
    assert trials.teams.shape[1] == n_robots
    rows = {row.tobytes() for row in old.genes.reshape(-1, LAYOUT.n_genes)}
    played = trials.networks()[trials.teams >= 0]
    assert {row.tobytes() for row in played} <= rows
    later = evolve(learner, new, 4)
    assert later.generation == 4
    assert np.abs(later.genes).max() <= 1
    assert not later.genes[~later.active].any()


@every_method
def test_nothing_of_the_old_state_is_changed_or_shared(name: str) -> None:
    learner = build(name)
    old = evolve(learner, learner.init(LAYOUT, 3), 2)
    before = old.genes.copy()
    new = hand_on(learner, LAYOUT, 3, old)
    assert not np.shares_memory(new.genes, old.genes)
    assert not np.shares_memory(new.active, old.active)
    evolve(learner, new, 2)
    np.testing.assert_array_equal(old.genes, before)


@every_method
def test_populations_that_do_not_fit_are_refused(name: str) -> None:
    learner = build(name)
    old = learner.init(LAYOUT, 3)
    for layout, words in (
        (replace(LAYOUT, max_hidden=6), "5 slots became 6"),
        (replace(LAYOUT, n_genes=9), "4 genes per neuron became 9"),
    ):
        with pytest.raises(UsageError, match=words):
            hand_on(learner, layout, 3, old)
    with pytest.raises(UsageError, match="6 genotypes per slot became 8"):
        hand_on(method(name, genotypes=8), LAYOUT, 3, old)


def test_neurons_are_no_networks() -> None:
    mesp, ccga = build("mesp"), build("ccga")
    words = "genotypes that are neurons do not mix with whole networks"
    with pytest.raises(UsageError, match=words):
        hand_on(ccga, LAYOUT, 3, mesp.init(LAYOUT, 3))


@every_method
def test_populations_bred_from_a_team_have_it_whole_and_vary_around_it(name: str) -> None:
    learner = build(name)
    fresh = learner.init(LAYOUT, 3)
    active = np.zeros((2, 5), dtype=bool)
    active[:, :3] = True
    genes = np.linspace(-0.9, 0.9, 2 * 5 * 4, dtype=np.float32).reshape(2, 5, 4)
    genes = np.where(active[..., None], genes, np.float32(0))
    state = breed_from(learner, LAYOUT, 3, genes, active)
    same(state, fresh, {field.name for field in fields(State)} - TAKEN)
    one_population = len(state.genes) == 1
    for p, m in ((0, 0), (0, 1)) if one_population else ((0, 0), (1, 0)):
        np.testing.assert_array_equal(state.genes[p, :, m], genes[m if one_population else p])
    for p in range(len(state.genes)):
        for m in range(1 if not one_population else 2, 6):
            source = genes[m % 2 if one_population else p]
            changed = state.genes[p, :, m] != source
            assert not changed[3:].any()
            assert changed.mean() < 0.5
    assert (state.genes != breed_from(learner, LAYOUT, 4, genes, active).genes).any()
    assert np.unique(state.genes[0].swapaxes(0, 1).reshape(6, -1), axis=0).shape[0] > 2
    same(breed_from(learner, LAYOUT, 3, genes, active), state, {"genes", "active", "n_hidden"})
    assert learner.ask(state).teams.shape == learner.ask(fresh).teams.shape


def test_a_team_of_other_sizes_is_refused() -> None:
    genes, active = np.zeros((2, 5, 3), dtype=np.float32), np.ones((2, 5), dtype=bool)
    with pytest.raises(UsageError, match="3 genes per neuron became 4"):
        breed_from(build("mesp"), LAYOUT, 3, genes, active)
    genes = np.zeros((2, 5, 4), dtype=np.float32)
    assert breed_from(build("mesp"), LAYOUT, 3, genes, active).n_hidden.tolist() == [5, 5]
    with pytest.raises(UsageError, match="has networks of 3 neurons, which never grow"):
        breed_from(build("ccga"), LAYOUT, 3, genes, active)
