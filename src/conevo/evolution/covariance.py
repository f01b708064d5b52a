"""A normal distribution that adapts its mean, step size and covariance matrix: CMA-ES.

Equations and constants are those of N. Hansen, The CMA evolution strategy: a tutorial,
arXiv:1604.00772 (2016), appendix A, with negative weights for the worse half of the samples. The
separable form has a diagonal matrix and learns it faster (R. Ros and N. Hansen, A simple
modification in CMA-ES achieving linear time and space complexity, PPSN 2008).

A sample is ``mean + step_size * axes @ (lengths * z)`` with standard normal z. The columns of
``axes`` are the eigenvectors of the covariance matrix, ``lengths`` the roots of its eigenvalues.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from conevo.evolution.protocol import FloatArray, IntArray

__all__ = ["Constants", "Distribution", "adapted", "constants", "sampled", "standard"]

CONDITION = 1e14  # the largest ratio of eigenvalues; more than numbers of 64 bits resolve


@dataclass(frozen=True)
class Constants:
    """Constants of the adaptation, which depend on n genes and N samples (tutorial, table 1).

    Attributes:
        weights: [N] of the samples, the best first; the positive ones, for the better half, sum to
            1 and move the mean.
        mu_eff: variance effective selection mass of the positive weights.
        c_sigma: learning rate of the path of the step size.
        d_sigma: its damping.
        c_c: learning rate of the path of the covariance.
        c_1: learning rate of the rank-one update.
        c_mu: learning rate of the rank-mu update.
        gap: generations between two decompositions of the matrix (tutorial, B.2).
    """

    weights: FloatArray
    mu_eff: float
    c_sigma: float
    d_sigma: float
    c_c: float
    c_1: float
    c_mu: float
    gap: int


def constants(n_genes: int, n_samples: int, *, is_full: bool) -> Constants:
    """Return the constants for n genes and N samples.

    Choice: for a diagonal matrix, both learning rates are multiplied by (n + 2) / 3, as Ros and
    Hansen do with the single one of 2008.

    Args:
        n_genes: n.
        n_samples: N, at least 3.
        is_full: whether the covariance matrix is full, not diagonal.
    """
    n, raw = n_genes, np.log((n_samples + 1) / 2) - np.log(np.arange(1, n_samples + 1))
    better, worse = np.maximum(raw, 0), np.minimum(raw, 0)
    mu_eff, mu_eff_worse = (float(part.sum() ** 2 / (part**2).sum()) for part in (better, worse))
    faster = 1.0 if is_full else (n + 2) / 3
    c_1 = min(1.0, faster * 2 / ((n + 1.3) ** 2 + mu_eff))
    c_mu = min(1 - c_1, faster * 2 * (1 / 4 + mu_eff + 1 / mu_eff - 2) / ((n + 2) ** 2 + mu_eff))
    limits = (
        1 + c_1 / c_mu,
        1 + 2 * mu_eff_worse / (mu_eff + 2),
        (1 - c_1 - c_mu) / (n * c_mu),
    )
    c_sigma = (mu_eff + 2) / (n + mu_eff + 5)
    return Constants(
        weights=better / better.sum() + min(limits) * worse / -worse.sum(),
        mu_eff=mu_eff,
        c_sigma=c_sigma,
        d_sigma=1 + 2 * max(0.0, np.sqrt((mu_eff - 1) / (n + 1)) - 1) + c_sigma,
        c_c=(4 + mu_eff / n) / (n + 4 + 2 * mu_eff / n),
        c_1=c_1,
        c_mu=c_mu,
        gap=max(1, int(1 / (10 * n * (c_1 + c_mu)))),
    )


@dataclass(frozen=True)
class Distribution:
    """The distribution of n genes.

    Attributes:
        mean: [n] float64.
        step_size: sigma.
        path_sigma: [n] float64 steps of the mean in units of the distribution, the older the
            fainter.
        path: [n] float64 the same in units of the step size.
        covariance: [n, n] float64, or its diagonal [n] in the separable form.
        axes: [n, n] float64 its eigenvectors in columns; [0, 0] in the separable form.
        lengths: [n] float64 the roots of its eigenvalues.
        steps: updates so far.
    """

    mean: FloatArray
    step_size: float
    path_sigma: FloatArray
    path: FloatArray
    covariance: FloatArray
    axes: FloatArray
    lengths: FloatArray
    steps: int

    def problem(self, n_genes: int) -> str:
        """Return the first field that is not valid for n genes, nothing if all are."""
        is_full, square = self.covariance.ndim == 2, (n_genes, n_genes)
        shapes: dict[str, tuple[int, ...]] = {
            **dict.fromkeys(("mean", "path_sigma", "path", "lengths"), (n_genes,)),
            "covariance": square if is_full else (n_genes,),
            "axes": square if is_full else (0, 0),
        }
        for name, shape in shapes.items():
            found = getattr(self, name)
            if found.shape != shape or not np.isfinite(found).all():
                return name
        if not 0 < self.step_size < np.inf:
            return "step_size"
        if not (self.lengths > 0).all():
            return "lengths"
        return "steps" if self.steps < 0 else ""


def standard(mean: FloatArray, step_size: float, *, is_full: bool) -> Distribution:
    """Return the distribution with the same variance in all directions.

    Args:
        mean: [n].
        step_size: sigma.
        is_full: whether its covariance matrix will be full, not diagonal.
    """
    n = len(mean)
    return Distribution(
        mean=np.array(mean, dtype=np.float64),
        step_size=float(step_size),
        path_sigma=np.zeros(n),
        path=np.zeros(n),
        covariance=np.eye(n) if is_full else np.ones(n),
        axes=np.eye(n) if is_full else np.zeros((0, 0)),
        lengths=np.ones(n),
        steps=0,
    )


def sampled(distribution: Distribution, normal: FloatArray) -> FloatArray:
    """Return samples [N, n] made of standard normal numbers [N, n]."""
    return distribution.mean + distribution.step_size * _turned(
        distribution, normal * distribution.lengths
    )


def adapted(
    distribution: Distribution, samples: FloatArray, order: IntArray, fixed: Constants
) -> Distribution:
    """Return the distribution after an update (tutorial, equations 41 to 47).

    Args:
        distribution: of which the samples were drawn.
        samples: [N, n].
        order: [N] their indices, the best first.
        fixed: the constants.
    """
    old, n, steps = distribution, len(distribution.mean), distribution.steps + 1
    y = (samples[order] - old.mean) / old.step_size
    better = np.maximum(fixed.weights, 0)
    step = better @ y
    c = fixed.c_sigma
    path_sigma = (1 - c) * old.path_sigma + np.sqrt(c * (2 - c) * fixed.mu_eff) * _whitened(
        old, step
    )
    length, usual = float(np.sqrt((path_sigma**2).sum())), _usual_length(n)
    stalls = length / np.sqrt(1 - (1 - c) ** (2 * steps)) >= (1.4 + 2 / (n + 1)) * usual
    keep, c = 1 - fixed.c_c, fixed.c_c
    path = keep * old.path + (not stalls) * np.sqrt(c * (2 - c) * fixed.mu_eff) * step
    distances = (_whitened(old, y) ** 2).sum(axis=1)
    weights = np.where(
        fixed.weights < 0, fixed.weights * n / np.maximum(distances, 1e-300), fixed.weights
    )
    lost = fixed.c_1 * (1 - stalls * c * (2 - c)) + fixed.c_mu * fixed.weights.sum()
    if old.axes.size:
        outer = (weights[:, None] * y).T @ y
        found = fixed.c_1 * np.outer(path, path) + fixed.c_mu * (outer + outer.T) / 2
    else:
        found = fixed.c_1 * path**2 + fixed.c_mu * (weights @ y**2)
    new = replace(
        old,
        mean=old.mean + old.step_size * step,
        step_size=float(
            old.step_size * np.exp(min(1.0, fixed.c_sigma / fixed.d_sigma * (length / usual - 1)))
        ),
        path_sigma=path_sigma,
        path=path,
        covariance=(1 - lost) * old.covariance + found,
        steps=steps,
    )
    return _decomposed(new) if steps % fixed.gap == 0 else new


def _decomposed(distribution: Distribution) -> Distribution:
    """Return the distribution with the axes and lengths of its covariance matrix.

    Choice: eigenvalues below the largest one by more than ``CONDITION`` are raised to that bound,
    so that a run can go on; pycma stops there.
    """
    if distribution.axes.size:
        values, axes = np.linalg.eigh(distribution.covariance)
    else:
        values, axes = distribution.covariance, distribution.axes
    values = np.maximum(values, values.max() / CONDITION)
    return replace(distribution, axes=axes, lengths=np.sqrt(values))


def _turned(distribution: Distribution, vectors: FloatArray) -> FloatArray:
    """Return vectors [..., n] from the axes' coordinates in those of the genes."""
    if not distribution.axes.size:
        return vectors
    turned: FloatArray = vectors @ distribution.axes.T
    return turned


def _whitened(distribution: Distribution, vectors: FloatArray) -> FloatArray:
    """Return vectors [..., n] multiplied by the inverse root of the covariance matrix."""
    if not distribution.axes.size:
        return vectors / distribution.lengths
    return _turned(distribution, vectors @ distribution.axes / distribution.lengths)


def _usual_length(n: int) -> float:
    """Return the expected length of a vector of n standard normal numbers."""
    return math.sqrt(2) * math.exp(math.lgamma((n + 1) / 2) - math.lgamma(n / 2))
