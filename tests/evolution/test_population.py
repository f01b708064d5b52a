"""Random genotypes, their ranking, and their distance."""

import numpy as np
import pytest

from conevo.evolution.population import (
    elite_count,
    genotype_distance,
    join,
    random_genes,
    ranking,
    split,
)


def test_genotype_distance_worked_by_hand():
    # |a - b| = 2, 0, 1, 0; mean 0.75; genes rescaled from [-1, 1] to [0, 1] halve it.
    a, b = np.array([-1.0, 0.0, 1.0, 0.5]), np.array([1.0, 0.0, 0.0, 0.5])
    assert genotype_distance(a, b) == 0.375
    assert genotype_distance(b, a) == 0.375
    assert genotype_distance(a, a) == 0.0
    assert genotype_distance(-np.ones(7), np.ones(7)) == 1.0


def test_random_genes_fill_the_range_evenly():
    genes = random_genes(np.random.default_rng(3), (400, 100))
    assert genes.dtype == np.float32
    assert genes.min() >= -1
    assert genes.max() <= 1
    quantiles = np.quantile(genes, [0.25, 0.5, 0.75])
    np.testing.assert_allclose(quantiles, [-0.5, 0.0, 0.5], atol=0.02)
    # E|a - b| = 2/3 for uniform genes in [-1, 1]: random genotypes are 1/3 apart.
    assert genotype_distance(genes[:200], genes[200:]).mean() == pytest.approx(1 / 3, abs=0.01)


def test_ranking_puts_non_finite_values_last_and_keeps_the_order_of_ties():
    fitness = np.array([3.0, np.nan, 5.0, 3.0, np.inf, -1.0, -np.inf])
    assert ranking(fitness).tolist() == [2, 0, 3, 5, 1, 4, 6]
    assert ranking(np.stack([fitness, -fitness]))[1].tolist() == [5, 0, 3, 2, 1, 4, 6]


@pytest.mark.parametrize(
    ("portion", "n_genotypes", "expected"),
    [(0.25, 20, 5), (0.5, 50, 25), (0.5, 5, 3), (0.1, 10, 2), (1.0, 7, 7), (0.01, 2, 2)],
)
def test_elite_count(portion, n_genotypes, expected):
    assert elite_count(portion, n_genotypes) == expected


def test_a_network_is_the_concatenation_of_its_neurons():
    genes = np.arange(2 * 3 * 2 * 2, dtype=np.float32).reshape(2, 3, 2, 2)  # P, U, M, G
    networks = join(genes, n_hidden=2)
    # Population 0, genotype 1: slot 0 has genes 2, 3 and slot 1 has 6, 7.
    assert networks[0, 1].tolist() == [2, 3, 6, 7]
    back = split(networks, n_slots=3, n_genes=2)
    np.testing.assert_array_equal(back[:, :2], genes[:, :2])
    assert not back[:, 2].any()
