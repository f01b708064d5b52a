"""SANE: fitness of neurons, and offspring of neurons and blueprints, by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from conevo.evolution import Layout, Scores, method
from conevo.evolution.methods.sane import mean_of_best

LAYOUT = Layout(n_robots=2, n_hidden=3, max_hidden=4, n_genes=2)


def told(learner: Any, state: Any, team: np.ndarray | list[float]) -> Any:
    """Return the state after these fitnesses [N] of teams."""
    credit = np.asarray(team)[:, None] + [-1.0, 1.0]
    return learner.tell(state, learner.ask(state), Scores(credit, 0 * credit))


def test_a_neuron_has_the_mean_fitness_of_its_best_networks() -> None:
    blueprints = np.array([[0, 1], [0, 2], [0, 0], [1, 2], [0, 1]])
    merits = np.array([1.0, 4.0, 3.0, np.nan, 2.0])
    found = mean_of_best(blueprints, merits, 4, n_best=2)
    np.testing.assert_array_equal(found, [3.5, 1.5, 4.0, np.nan])
    found = mean_of_best(blueprints, merits, 4, n_best=9)
    np.testing.assert_array_equal(found, [2.5, 1.5, 4.0, np.nan])  # [0, 0] counts once


@pytest.mark.parametrize("team", ["clones", "whole"])
def test_a_generation_by_hand(team: str) -> None:
    """A quarter mates; a child and a copy of each parent replace the least fit half."""
    sizes = {"genotypes": 4, "blueprints": 8, "mutation_probability": 0, "entry_mutation": 0}
    learner = method("sane", **sizes, renewal=0, team=team)
    state: Any = learner.init(LAYOUT, 3)
    trials = learner.ask(state)
    assert len(trials.teams) == 8
    merits = np.arange(8.0)
    after = told(learner, state, merits)
    assert (after.merits == merits).all()
    best = learner.ask(after)
    np.testing.assert_array_equal(best.networks()[0], trials.networks()[7])
    end = told(learner, after, [1.0])

    used = state.active  # [P, U]
    fitness, old, new = after.fitness[used].ravel(), state.genes[used], end.genes[used]
    old, new = old.reshape(-1, 2), new.reshape(-1, 2)  # neurons
    order = np.argsort(np.where(np.isfinite(fitness), -fitness, np.inf), kind="stable")
    n = len(order) // 4  # parents
    np.testing.assert_array_equal(new[order[: 2 * n]], old[order[: 2 * n]])
    child, copy = np.split(new[order[::-1][: 2 * n]], 2)
    np.testing.assert_array_equal(copy, old[order[:n]])
    np.testing.assert_array_equal(child[:, 0], old[order[:n], 0])  # one point, of two genes
    for k in range(n):
        mates = old[order[: max(k, 2)], 1]  # the fittest mates with the second
        assert child[k, 1] in mates

    entries, bred = state.blueprints[:, used], end.blueprints[:, used]
    np.testing.assert_array_equal(bred[4:], entries[4:])
    np.testing.assert_array_equal(bred[[2, 3]], entries[[7, 6]])
    own, mate = bred[:2] == entries[[7, 6]], bred[:2] == entries[[6, 7]]
    assert (own | mate).all()
    assert own[:, 0].all()
    assert mate[:, -1].all()


def test_new_blueprints_name_offspring_of_their_neurons() -> None:
    sizes = {"genotypes": 40, "blueprints": 40, "mutation_probability": 0, "entry_mutation": 0}
    kept, renewed = (
        told(learner, told(learner, learner.init(LAYOUT, 3), np.arange(40.0)), [1.0])
        for learner in (method("sane", **sizes, renewal=renewal) for renewal in (0, 1))
    )
    before: Any = method("sane", **sizes).init(LAYOUT, 3)
    state = told(method("sane", **sizes), before, np.arange(40.0))
    order = np.argsort(
        np.where(np.isfinite(state.fitness[0, :3]), -state.fitness[0, :3], np.inf),
        axis=None,
        kind="stable",
    )
    parents, places = order[:30], order[::-1][:60]
    heirs = {int(p): {int(places[k]), int(places[30 + k])} for k, p in enumerate(parents)}
    old, new = kept.blueprints[:20, 0, :3].ravel(), renewed.blueprints[:20, 0, :3].ravel()
    assert np.isin(old, parents).any()
    for entry, other in zip(old.tolist(), new.tolist(), strict=True):
        assert other in heirs.get(entry, {entry})
    np.testing.assert_array_equal(kept.blueprints[20:], renewed.blueprints[20:])


def test_few_entries_of_new_blueprints_change_to_any_neuron() -> None:
    sizes = {"genotypes": 40, "blueprints": 400, "renewal": 0}
    ends = []
    for chance in (0, 0.1):
        learner = method("sane", **sizes, entry_mutation=chance)
        ends.append(told(learner, told(learner, learner.init(LAYOUT, 3), np.arange(400.0)), [1.0]))
    changed = (ends[0].blueprints != ends[1].blueprints)[..., :3]
    assert not changed[200:].any()
    assert changed[:200].mean() == pytest.approx(0.1, abs=0.03)
    assert not (ends[0].blueprints != ends[1].blueprints)[..., 3].any()
