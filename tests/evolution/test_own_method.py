"""The evolution strategy of examples/own_method.py: its first step by hand, and that it learns."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.evolution import Layout, Scores
from conevo.evolution.methods.registry import resolve
from conevo.rng import stream

ADDRESS = f"{Path(__file__).parents[2] / 'examples' / 'own_method.py'}:team-es"
ONE = Layout(n_robots=1, n_hidden=1, max_hidden=1, n_genes=4)


def scores(fitness: Any) -> Scores:
    found = np.asarray(fitness, dtype=float)
    return Scores(found, np.zeros_like(found))


def test_the_first_step_by_hand() -> None:
    """Lambda 4, mu 2; the best are teams 2 and 0. Appendix A of the tutorial, four genes."""
    learner = conevo.method(ADDRESS, genotypes=4, step_size=0.01)
    state = learner.init(ONE, root=3)
    asked = learner.ask(state)
    z = stream(3, "steps", 0).standard_normal((4, 1, 1, 4))
    np.testing.assert_allclose(asked.networks(), 0.01 * z, rtol=1e-6)
    told = learner.tell(state, asked, scores([[3.0], [1.0], [4.0], [np.nan]]))
    w1 = (math.log(2.5) - math.log(1)) / (2 * math.log(2.5) - math.log(2))
    step = w1 * z[2] + (1 - w1) * z[0]
    np.testing.assert_allclose(told.mean, 0.01 * step, rtol=1e-12)
    mu_eff = 1 / (w1**2 + (1 - w1) ** 2)
    c = (mu_eff + 2) / (4 + mu_eff + 5)
    path = math.sqrt(c * (2 - c) * mu_eff) * step
    np.testing.assert_allclose(told.path, path, rtol=1e-12)
    expected = 2 * (1 - 1 / 16 + 1 / 336)
    growth = math.exp(c / (1 + c) * (np.linalg.norm(path) / expected - 1))
    assert told.step_size == pytest.approx(0.01 * growth, rel=1e-12)
    header = told.progress
    assert (header.best_fitness, header.mean_fitness, header.n_nonfinite) == (4, 8 / 3, 1)
    final = learner.ask(told)
    assert (final.scenarios, final.portrait, final.teams.shape) == ("fixed", True, (1, 1, 1))
    np.testing.assert_array_equal(final.genes, told.mean[0].astype(np.float32))
    after = learner.tell(told, final, scores([[5.0]])).progress
    assert (after.generation, after.team_evaluations, after.numbers) == (1, 5, {"step_size": 0.01})


def far(target: float, generations: int, step_size: float) -> tuple[float, Any]:
    """Return the final distance of the mean from a target in every gene, and the final state."""
    learner = conevo.method(ADDRESS, genotypes=12, step_size=step_size)
    state = learner.init(replace(ONE, n_robots=2, n_hidden=3, max_hidden=5), root=1)
    while state.progress.generation < generations:
        asked = learner.ask(state)
        distance = ((asked.networks()[:, :, :3] - target) ** 2).sum(axis=(2, 3))
        state = learner.tell(state, asked, scores(-distance))
    return float(np.abs(state.mean - target).max()), state


def test_the_step_size_grows_far_from_the_optimum_and_shrinks_on_it() -> None:
    begun, on_its_way = far(0.9, 60, 0.001)
    assert on_its_way.step_size > 0.01
    assert begun < 0.9
    distance, there = far(0.4, 300, 0.2)
    assert there.step_size < 1e-3
    assert distance < 1e-3


def test_a_state_of_another_run_is_refused_with_the_name_of_a_field() -> None:
    learner = conevo.method(ADDRESS, genotypes=4)
    first = learner.init(ONE, root=3)
    assert first.problem(first) == ""
    for changes, name in (
        ({"mean": first.mean + 2}, "mean"),
        ({"mean": first.mean[..., :3]}, "mean"),
        ({"path": first.path * np.nan}, "path"),
        ({"step_size": 0.0}, "step_size"),
        ({"has_moved": True}, "has_moved"),
    ):
        assert replace(first, **changes).problem(first) == name


def test_its_entry() -> None:
    entry = resolve(ADDRESS)
    assert (entry.name, entry.title) == ("team-es", "Team ES")
    assert conevo.method(ADDRESS).config.genotypes == 40
