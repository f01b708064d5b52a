"""Recombination and mutation, by exact cases and by distribution."""

import numpy as np
import pytest

from conevo.evolution.variation import VariationConfig, across, breed, crossover, mutate, within


def generator(seed=1):
    return np.random.default_rng(seed)


def marked(n_units, n_elite, n_genes=6):
    """Return elites whose every gene names their unit and rank: 100 * unit + rank."""
    names = 100 * np.arange(n_units)[:, None] + np.arange(n_elite)
    return np.repeat(names[:, :, None], n_genes, axis=2).astype(np.float32)


def test_crossover_swaps_the_tails_at_one_point():
    a, b = np.zeros((50, 6)), np.ones((50, 6))
    first, second = crossover(a, b, generator())
    np.testing.assert_array_equal(first + second, 1)
    assert (np.diff(first, axis=1) >= 0).all()  # 0 ... 0 1 ... 1
    np.testing.assert_array_equal(first[:, 0], 0)
    np.testing.assert_array_equal(first[:, -1], 1)


def test_crossover_point_is_uniform_between_genes():
    first, _ = crossover(np.zeros((20_000, 6)), np.ones((20_000, 6)), generator())
    counts = np.bincount((first == 0).sum(axis=1), minlength=7)
    assert counts[[0, 6]].tolist() == [0, 0]
    assert ((counts[1:6] - 4000) ** 2 / 4000).sum() < 18.5  # chi squared, 4 degrees, p = 0.001


def test_crossover_of_single_genes_passes_them_on():
    first, second = crossover(np.array([[3.0]]), np.array([[5.0]]), generator())
    assert (first.item(), second.item()) == (3.0, 5.0)


def test_within_takes_each_elite_in_turn_with_another():
    children = within(marked(2, 3), 8, generator())
    assert children.shape == (2, 8, 6)
    # Four pairs: first parents of rank 0, 1, 2 and round again 0.
    assert children[0, 0::2, 0].tolist() == [0, 1, 2, 0]
    assert children[1, 0::2, 0].tolist() == [100, 101, 102, 100]
    assert children[0, 1::2, -1].tolist() == [0, 1, 2, 0]
    second = children[:, 0::2, -1]
    np.testing.assert_array_equal(second, children[:, 1::2, 0])
    assert (second != children[:, 0::2, 0]).all()
    assert set(second[0]) <= {0, 1, 2}
    assert set(second[1]) <= {100, 101, 102}


def test_within_draws_the_other_parent_evenly():
    children = within(marked(3000, 4), 2, generator())
    second = children[:, 0, -1] % 100  # the partner of rank 0
    share = np.bincount(second.astype(int), minlength=4) / 3000
    assert share[0] == 0
    np.testing.assert_allclose(share[1:], 1 / 3, atol=0.03)


def test_within_makes_an_odd_number_of_children():
    assert within(marked(1, 2), 5, generator())[0, :, 0].tolist() == [0, 1, 1, 0, 0]


def test_across_pairs_equal_ranks_and_gives_each_side_its_child():
    first, second = across(marked(4, 3), np.array([[0, 3], [2, 1]]), 5, generator())
    # Ranks 0, 1, 2 and round again; the head of the first child is the first unit's.
    assert first[0, :, 0].tolist() == [0, 1, 2, 0, 1]
    assert first[0, :, -1].tolist() == [300, 301, 302, 300, 301]
    assert second[0, :, 0].tolist() == [300, 301, 302, 300, 301]
    assert second[0, :, -1].tolist() == [0, 1, 2, 0, 1]
    assert first[1, :, 0].tolist() == [200, 201, 202, 200, 201]
    assert first[1, :, -1].tolist() == [100, 101, 102, 100, 101]


def test_mutation_rate_and_cauchy_quantiles():
    genes = np.zeros((1000, 400), dtype=np.float32)
    mutated = mutate(genes, 0.05, 0.1, generator())
    step = mutated[mutated != 0]
    # 400,000 genes at 0.05: 20,000 +- 4 standard deviations of 138.
    assert abs(step.size - 20_000) < 4 * 138
    # |Cauchy| with scale 0.1 has quantiles 0.1 tan(q pi / 2).
    for q in (0.25, 0.5, 0.75, 0.9):
        assert np.quantile(np.abs(step), q) == pytest.approx(0.1 * np.tan(q * np.pi / 2), rel=0.05)
    # Steps beyond the mutation range are cut to it: 1 - 2/pi atan(10) = 6.3 %.
    assert (np.abs(step) == 1).mean() == pytest.approx(0.0635, abs=0.006)
    assert (step > 0).mean() == pytest.approx(0.5, abs=0.015)
    assert not genes.any()


def test_mutation_keeps_genes_in_range_and_can_be_switched_off():
    genes = np.full((50, 50), 0.99, dtype=np.float32)
    mutated = mutate(genes, 1.0, 10.0, generator())
    assert mutated.dtype == np.float32
    assert mutated.max() == 1.0
    assert mutated.min() >= np.float32(-0.01) - 1e-6  # a step is at most 1
    np.testing.assert_array_equal(mutate(genes, 0.0, 0.1, generator()), genes)
    np.testing.assert_array_equal(mutate(genes, 1.0, 0.0, generator()), genes)


def test_breed_replaces_all_genotypes_and_lets_pairs_mix():
    genotypes = marked(3, 4) / 1000  # units 0.0, 0.1, 0.2; ranks by thousandths
    elite = np.array([[2, 0], [1, 3], [0, 1]])
    config = VariationConfig(mutation_probability=0.0)
    children = breed(genotypes, elite, generator(), config, pairs=np.array([[0, 2]]))
    assert children.shape == genotypes.shape
    heads, tails = children[..., 0], children[..., -1]
    np.testing.assert_allclose(heads[0], [0.002, 0.0, 0.002, 0.0])
    np.testing.assert_allclose(tails[0], [0.200, 0.201, 0.200, 0.201])
    np.testing.assert_allclose(heads[2], [0.200, 0.201, 0.200, 0.201])
    np.testing.assert_allclose(tails[2], [0.002, 0.0, 0.002, 0.0])
    np.testing.assert_allclose(heads[1], [0.101, 0.103, 0.103, 0.101])  # within, both children
    np.testing.assert_allclose(tails[1], [0.103, 0.101, 0.101, 0.103])


def test_breed_keeps_the_fittest_unchanged_if_asked():
    genotypes = np.random.default_rng(5).uniform(-1, 1, (2, 6, 4)).astype(np.float32)
    elite = np.array([[3, 1, 0], [5, 4, 2]])
    config = VariationConfig(mutation_probability=1.0, n_elitist=2)
    children = breed(genotypes, elite, generator(), config)
    np.testing.assert_array_equal(children[0, :2], genotypes[0, [3, 1]])
    np.testing.assert_array_equal(children[1, :2], genotypes[1, [5, 4]])
    assert children.shape == (2, 6, 4)
    parents = genotypes[0, [3, 1, 0]]
    assert all((child != parents).all() for child in children[0, 2:])
