"""CMA-ES as a method: genomes, rounds, borders and limits. Its adaptation: test_covariance.py."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.evolution import Layout, Scores, method
from conevo.evolution.covariance import adapted, constants
from conevo.evolution.inheritance import breed_from
from conevo.evolution.methods.cma_es import CmaEsState, reflected

LAYOUT = Layout(n_robots=3, n_hidden=2, max_hidden=3, n_genes=4)


def told(learner: Any, state: CmaEsState, credit: np.ndarray) -> CmaEsState:
    """Return the state after these credits [N, R]."""
    scores = Scores(credit, np.zeros(credit.shape))
    found: CmaEsState = learner.tell(state, learner.ask(state), scores)
    return found


def test_genes_are_reflected_at_the_borders() -> None:
    genes = np.array([-3.5, -3.0, -1.25, -1.0, 0.0, 0.75, 1.0, 1.25, 2.5, 5.25])
    expected = [0.5, 1.0, -0.75, -1.0, 0.0, 0.75, 1.0, 0.75, -0.5, 0.75]
    np.testing.assert_allclose(reflected(genes), expected)


@pytest.mark.parametrize(
    ("team", "form", "n"),
    [("clones", "full", 8), ("whole", "full", 24), ("whole", "separable", 24)],
)
def test_a_genotype_is_a_network_or_a_whole_team(team: str, form: str, n: int) -> None:
    learner: Any = method("cma-es", team=team, form=form, genotypes=50, rounds=2)
    state = learner.init(LAYOUT, 3)
    assert state.distribution.mean.shape == (n,)
    assert state.distribution.covariance.shape == ((n, n) if form == "full" else (n,))
    trials = learner.ask(state)
    networks = trials.networks()
    assert (len(networks), trials.rounds) == (100, 2)
    np.testing.assert_array_equal(networks[:50], networks[50:])  # once more in each round
    assert (networks == networks[:, :1]).all() == (team == "clones")
    assert networks[:, :, :2].std() == pytest.approx(0.3, rel=0.1)
    assert not networks[:, :, 2].any()
    assert state.progress.n_hidden.tolist() == [2] * (1 if team == "clones" else 3)


def test_fitness_is_the_mean_of_robots_and_rounds() -> None:
    learner: Any = method("cma-es", genotypes=6, rounds=2)
    state = learner.init(LAYOUT, 3)
    drawn = learner.ask(state).networks()[:6, 0, :2].reshape(6, 8)
    credit = np.random.default_rng(1).standard_normal((12, 3))
    fitness = (credit[:6] + credit[6:]).sum(axis=1)
    expected = adapted(
        state.distribution, drawn, np.argsort(-fitness), constants(8, 6, is_full=True)
    )
    after = told(learner, state, credit).distribution
    assert np.abs(drawn).max() < 1  # nothing is reflected
    np.testing.assert_allclose(after.mean, expected.mean, atol=1e-6)
    np.testing.assert_allclose(after.covariance, expected.covariance, atol=1e-5)
    spoiled = credit.copy()
    spoiled[2, 1] = np.nan  # ranks last
    least = credit.copy()
    least[2] = -1e9
    np.testing.assert_array_equal(
        told(learner, state, spoiled).distribution.mean,
        told(learner, state, least).distribution.mean,
    )


def test_a_gene_that_belongs_at_the_border_settles_there() -> None:
    """Half of the genes belong at 1, the others at -1."""
    learner: Any = method("cma-es", genotypes=12, rounds=1)
    state = learner.init(LAYOUT, 3)
    aim = np.array([[1.0], [-1.0], [0.0]])
    while state.progress.generation < 60:
        distance = np.abs(learner.ask(state).networks() - aim)[:, :, :2].sum(axis=(2, 3))
        state = told(learner, state, -distance)
    np.testing.assert_allclose(state.progress.fittest_genes[0], aim * np.ones(4), atol=0.02)
    assert state.progress.numbers["step_size"] < 0.05
    assert state.progress.numbers["axis_ratio"] > 1


def test_the_step_size_has_limits() -> None:
    learner: Any = method("cma-es", genotypes=8, rounds=1)
    state = learner.init(LAYOUT, 3)
    for size, limit in ((1e9, 1.0), (1e-12, 1e-6)):
        start = replace(state, distribution=replace(state.distribution, step_size=size))
        after = told(learner, start, np.random.default_rng(1).standard_normal((8, 3)))
        found = after.distribution
        assert found.step_size * np.sqrt((found.lengths**2).mean()) == pytest.approx(limit)


def test_a_genome_too_large_for_a_full_matrix_is_refused() -> None:
    layout = Layout(n_robots=20, n_hidden=10, max_hidden=10, n_genes=31)
    learner: Any = method("cma-es", team="whole")
    with pytest.raises(UsageError, match=r"has 6,200 genes, .* use --set method.form=separable"):
        learner.init(layout, 3)
    apart: Any = method("cma-es", team="whole", form="separable")
    assert apart.init(layout, 3).distribution.mean.shape == (6200,)


def test_it_starts_around_a_team_whose_robots_use_other_slots() -> None:
    genes = np.random.default_rng(1).uniform(-1, 1, (3, 3, 4)).astype(np.float32)
    active = np.array([[True, True, False], [True, False, False], [False, True, True]])
    learner: Any = method("cma-es", team="whole", genotypes=6, rounds=1)
    state: Any = breed_from(learner, LAYOUT, 3, genes, active)
    assert state.progress.n_hidden.tolist() == [2, 1, 2]
    assert state.problem(learner.init(LAYOUT, 3)) == ""
    trials = learner.ask(replace(state, phase="fittest"))
    np.testing.assert_array_equal(trials.teams[0] >= 0, active)
    np.testing.assert_allclose(trials.networks()[0], genes * active[..., None], atol=1e-7)


def test_an_impossible_state_is_recognized() -> None:
    learner: Any = method("cma-es", genotypes=6, rounds=1)
    first = learner.init(LAYOUT, 3)
    apart = method("cma-es", form="separable").init(LAYOUT, 3)
    assert first.problem(first) == ""
    for name, value in (
        ("active", first.active & False),
        ("phase", "fittest"),
        ("mean", replace(first.distribution, mean=np.zeros(7))),
        ("covariance", apart.distribution),
    ):
        at = name if name in ("active", "phase") else "distribution"
        assert replace(first, **{at: value}).problem(first) == name
