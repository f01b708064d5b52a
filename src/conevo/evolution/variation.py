"""Recombination and mutation: from an elite portion to the next generation.

Nitschke 2009, section 3.4. A unit is a sub-population of neurons, or a population of whole
networks. Shapes: S units, M genotypes each, L of them elite, G genes.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from annotated_types import Ge, Gt, Le

from conevo.evolution.population import ranking
from conevo.evolution.protocol import FloatArray, IntArray
from conevo.parameters import parameters

__all__ = [
    "VariationConfig",
    "across",
    "breed",
    "crossover",
    "mutate",
    "perturb",
    "replaced",
    "upward",
    "within",
]


Genotypes = npt.NDArray[Any]  # of genes, or of whole numbers


@parameters("method")
class VariationConfig:
    """Selection and variation, the same for all methods (Nitschke 2009, 3.4, table 5.5)."""

    elite_portion: Annotated[float, Gt(0), Le(1)] = 0.5
    """fraction of a (sub-)population that may become parents. More keeps more diversity and selects
    less. 0.5 for multi-rover and GACC, 0.25 for pursuit."""
    mutation_probability: Annotated[float, Ge(0), Le(1)] = 0.05
    """chance of each gene of a child to be mutated."""
    mutation_scale: Annotated[float, Ge(0), Le(1000)] = 0.1
    """scale of the Cauchy step in gene units; half of all steps are smaller. Choice: 0.1, since the
    thesis gives none; it is 1 in weight units of [-10, 10]."""
    n_elitist: Annotated[int, Ge(0), Le(1_000_000)] = 0
    """fittest genotypes that survive unchanged, at most the elite portion. 0: children replace all
    genotypes (section 3.4.3)."""
    start_noise: Annotated[float, Ge(0), Le(2)] = 0.0
    """(gene units) standard deviation of the normal noise on each gene of populations that are bred
    from a champion (``--from-champion``). 0: they are mutated like children."""


def crossover(
    a: FloatArray, b: FloatArray, generator: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return both children [..., G] of each pair of parents: one-point crossover.

    The point is uniform between two genes, so that each child has at least one gene of each parent.
    A genotype of one gene is passed on unchanged.
    """
    n_genes = a.shape[-1]
    point = generator.integers(1, max(n_genes, 2), size=(*a.shape[:-1], 1), dtype=np.int32)
    head = np.arange(n_genes, dtype=np.int32) < point
    return np.where(head, a, b), np.where(head, b, a)


def within(elites: FloatArray, n_children: int, generator: np.random.Generator) -> FloatArray:
    """Return children [S, n_children, G] bred inside each unit.

    Nitschke 2009, 3.4.3, "Recombine(P_i)": each elite in turn, from the fittest on, is crossed with
    a random *other* elite. This repeats until there are enough children. Both children are kept.

    Args:
        elites: [S, L, G], the fittest first, L >= 2.
        n_children: children per unit.
        generator: the source of partners and crossover points.
    """
    n_units, n_elite, _ = elites.shape
    n_pairs = -(-n_children // 2)
    first = np.arange(n_pairs) % n_elite
    second = generator.integers(n_elite - 1, size=(n_units, n_pairs))
    second += second >= first
    unit = np.arange(n_units)[:, None]
    pair = crossover(elites[unit, first], elites[unit, second], generator)
    children = np.stack(pair, axis=2).reshape(n_units, 2 * n_pairs, -1)
    return children[:, :n_children]


def across(
    elites: FloatArray, pairs: IntArray, n_children: int, generator: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return the children [Q, n_children, G] for both sides of Q pairs of units.

    Nitschke 2009, 3.4.3, "Recombine(P_i, P_j)": elites of equal rank are crossed. The first child
    goes to the first unit, the second to the second. Choice: when all ranks have been crossed they
    are crossed again from the fittest on, at new points, until every genotype is replaced.

    Args:
        elites: [S, L, G], the fittest first.
        pairs: [Q, 2] the units that recombine with each other.
        n_children: children per unit.
        generator: the source of crossover points.
    """
    rank = np.arange(n_children) % elites.shape[1]
    a, b = (elites[pairs[:, side][:, None], rank] for side in (0, 1))
    return crossover(a, b, generator)


def upward(elites: Genotypes, generator: np.random.Generator) -> tuple[Genotypes, Genotypes]:
    """Return both children [S, L, G] of each elite and a random fitter one.

    Moriarty and Miikkulainen 1996 (SANE), Gomez and Miikkulainen 1997 (ESP). Choice: the fittest,
    which has no fitter one, mates with the second.

    Args:
        elites: [S, L, G], the fittest first, L >= 2.
        generator: the source of partners and crossover points.
    """
    n_units, n_elite, _ = elites.shape
    mate = generator.integers(np.maximum(np.arange(n_elite), 1), size=(n_units, n_elite))
    mate[:, 0] = 1
    return crossover(elites, elites[np.arange(n_units)[:, None], mate], generator)


def replaced(genes: Genotypes, fitness: FloatArray, children: Genotypes) -> Genotypes:
    """Return units [S, M, G] in which children [S, C, G] have replaced the least fit genotypes.

    Args:
        genes: [S, M, G].
        fitness: [S, M]; one that is not finite is the least fit.
        children: C <= M of them, the first in place of the least fit.
    """
    order = ranking(fitness)[:, ::-1][:, : children.shape[1]]
    found = genes.copy()
    np.put_along_axis(found, order[..., None].astype(np.intp), children, axis=1)
    return found


def mutate(
    genes: FloatArray, probability: float, scale: float, generator: np.random.Generator
) -> FloatArray:
    """Return mutated float32 genes: burst mutation with Cauchy steps.

    Nitschke 2009, 3.4.4 and table 5.5: with ``probability``, a gene gets a Cauchy step, limited to
    the mutation range [-1, 1]. The gene is then limited to [-1, 1].
    """
    hit = generator.random(genes.shape, dtype=np.float32) < probability
    step = np.clip(scale * generator.standard_cauchy(int(hit.sum())), -1.0, 1.0)
    mutated = genes.astype(np.float32, copy=True)
    mutated[hit] = np.clip(mutated[hit] + step, -1.0, 1.0)
    return mutated


def perturb(genes: FloatArray, scale: float, generator: np.random.Generator) -> FloatArray:
    """Return float32 genes with normal noise on each, limited to [-1, 1].

    Args:
        genes: of any shape.
        scale: standard deviation of the noise.
        generator: the source of the noise.
    """
    noise = generator.standard_normal(genes.shape, dtype=np.float32) * np.float32(scale)
    perturbed: FloatArray = np.clip(genes + noise, -1.0, 1.0).astype(np.float32)
    return perturbed


def breed(
    genotypes: FloatArray,
    elite: IntArray,
    generator: np.random.Generator,
    config: VariationConfig,
    pairs: IntArray | None = None,
) -> FloatArray:
    """Return the next generation [S, M, G]: recombined, then mutated.

    Args:
        genotypes: [S, M, G] this generation.
        elite: [S, L] its elite portion, the fittest first.
        generator: the source of all random numbers.
        config: parameters of recombination and mutation.
        pairs: [Q, 2] units that recombine with each other, each unit at most once; all others
            recombine within themselves.
    """
    n_units, n_genotypes, _ = genotypes.shape
    elites = genotypes[np.arange(n_units)[:, None], elite]
    kept = elites[:, : config.n_elitist]
    n_children = n_genotypes - kept.shape[1]
    children = within(elites, n_children, generator)
    if pairs is not None and len(pairs):
        first, second = across(elites, pairs, n_children, generator)
        children[pairs[:, 0]], children[pairs[:, 1]] = first, second
    children = mutate(children, config.mutation_probability, config.mutation_scale, generator)
    return np.concatenate([kept, children], axis=1)
