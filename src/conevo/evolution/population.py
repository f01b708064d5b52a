"""Genotypes in sub-populations: making them at random, ranking them, measuring their distance."""

from __future__ import annotations

import numpy as np

from conevo.evolution.protocol import FloatArray, IntArray

__all__ = ["elite_count", "genotype_distance", "join", "random_genes", "ranking", "split"]


def random_genes(generator: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
    """Return float32 genes of the given shape, uniform in [-1, 1] (Nitschke 2009, 3.1.2)."""
    return generator.random(shape, dtype=np.float32) * np.float32(2) - np.float32(1)


def genotype_distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return GD in [0, 1]: the mean of |a - b| over the genes (last axis), rescaled to [0, 1].

    Nitschke 2009, eq. 3.3. Choice: genes in [-1, 1] are rescaled to [0, 1], which halves |a - b|
    and makes GD span the [0, 1] of the parameter tables. Two random genotypes are 1/3 apart.
    """
    distance: FloatArray = np.abs(a - b).mean(axis=-1) / 2
    return distance


def ranking(fitness: FloatArray) -> IntArray:
    """Return the indices along the last axis from the fittest to the least fit.

    Fitness that is not finite ranks last; ties keep the order of their indices.
    """
    key = np.where(np.isfinite(fitness), -fitness, np.inf)
    return np.argsort(key, axis=-1, kind="stable").astype(np.int32)


def elite_count(portion: float, n_genotypes: int) -> int:
    """Return L, the size of the elite portion: the nearest whole number, at least 2."""
    return min(max(2, int(portion * n_genotypes + 0.5)), n_genotypes)


def join(genes: FloatArray, n_hidden: int) -> FloatArray:
    """Return whole-network genotypes [P, M, n_hidden * G]: the concatenation of their neurons.

    Args:
        genes: [P, U, M, G]; the first ``n_hidden`` slots are in use.
        n_hidden: neurons of one network.
    """
    p, _, m, g = genes.shape
    return genes[:, :n_hidden].swapaxes(1, 2).reshape(p, m, n_hidden * g)


def split(networks: FloatArray, n_slots: int, n_genes: int) -> FloatArray:
    """Return whole-network genotypes [P, M, n_hidden * G] as neurons [P, n_slots, M, n_genes]."""
    p, m, length = networks.shape
    n_hidden = length // n_genes
    genes = np.zeros((p, n_slots, m, n_genes), dtype=np.float32)
    genes[:, :n_hidden] = networks.reshape(p, m, n_hidden, n_genes).swapaxes(1, 2)
    return genes
