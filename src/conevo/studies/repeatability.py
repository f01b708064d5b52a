"""The part of one trial's fitness that is the genotype's own: the intra-class correlation.

Every genotype of a population is tried K times; in the k-th trial all meet the same scenario. Of
the variance of their fitness a part belongs to the genotypes, the rest to partners and luck; how
hard a scenario is concerns all alike and is removed. The share of the first part, the intra-class
correlation ICC(C,1) of McGraw and Wong (1996, Psychological Methods 1: 30), is the reliability of
one trial. By Spearman-Brown the mean of K trials has reliability K r / (1 + (K - 1) r).

- Choice: populations and slots share one ICC, of their pooled mean squares.
- Choice: its standard error is by jackknife over populations if they are ten or more, since the
  neurons of a robot share its fitness; of fewer over genotypes, the m-th of every population.
- Choice: a genotype with a fitness that is not finite in any trial is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from conevo.typing import Floats

__all__ = [
    "LEAST_RELIABILITY",
    "Repeatability",
    "has_signal",
    "repeatability",
    "spearman_brown",
    "trials_for",
]

Mask = npt.NDArray[np.bool_]
ENOUGH_POPULATIONS = 10

LEAST_RELIABILITY = 0.05
"""Below it selection among genotypes is nearly blind; see ``has_signal``."""


@dataclass(frozen=True)
class Repeatability:
    """The intra-class correlation of one trial.

    Attributes:
        icc: at most 1; below 0 by chance. None if all fitness is the same.
        standard_error: by jackknife; None with too few genotypes.
        low, high: its 95 % interval, by Student's t.
        n_units: genotypes that were used, in all populations and slots.
    """

    icc: float | None
    standard_error: float | None
    low: float | None
    high: float | None
    n_units: int


def repeatability(fitness: Floats) -> Repeatability:
    """Return the intra-class correlation of single trials.

    Args:
        fitness: [K, P, S, M] of the k-th trial of genotype m in slot s of population p, K >= 2.
            NaN where there is no genotype.
    """
    played = np.logical_and.reduce(np.isfinite(fitness), axis=0)
    icc = _icc(fitness, played)
    blocks = _blocks(played)
    without = [_icc(fitness, played & ~block) for block in blocks]
    known = [one for one in without if one is not None]
    if icc is None or len(known) < max(len(without), 3):
        return Repeatability(icc, None, None, None, int(played.sum()))
    from scipy.special import stdtrit

    n = len(known)
    error = math.sqrt((n - 1) / n * sum((one - np.mean(known)) ** 2 for one in known))
    reach = float(stdtrit(n - 1, 0.975)) * error
    return Repeatability(icc, error, icc - reach, icc + reach, int(played.sum()))


def _blocks(played: Mask) -> list[Mask]:
    """Return what the jackknife leaves out, one at a time, as masks that broadcast to [P, S, M]."""
    n_populations, _, n_genotypes = played.shape
    if n_populations >= ENOUGH_POPULATIONS:
        numbers = np.flatnonzero(played.any(axis=(1, 2)))
        return [np.arange(n_populations)[:, None, None] == p for p in numbers]
    numbers = np.flatnonzero(played.any(axis=(0, 1)))
    return [np.arange(n_genotypes) == m for m in numbers]


def _icc(fitness: Floats, played: Mask) -> float | None:
    """Return ICC(C,1) of the genotypes [P, S, M] that are ``played``."""
    played = played & (played.sum(axis=-1, keepdims=True) > 1)
    n_trials, n = len(fitness), played.sum(axis=-1)
    values = np.where(played, fitness, 0.0)
    means = values.sum(axis=-1) / np.maximum(n, 1)  # of a trial, over genotypes
    rest = np.where(played, values - means[..., None], 0.0)
    freedom = int((n - 1)[n > 1].sum())
    if not freedom:
        return None
    between = n_trials * float((rest.mean(axis=0) ** 2).sum())
    within = float((rest**2).sum()) - between
    square, error = between / freedom, max(within, 0.0) / (freedom * (n_trials - 1))
    whole = square + (n_trials - 1) * error
    # Rounding leaves something of equal numbers, which is not a variance.
    if whole <= 1e-20 * float((values**2).mean()):
        return None
    return (square - error) / whole


def spearman_brown(icc: float, n_trials: float) -> float:
    """Return the reliability of the mean of that number of trials; 0 for an ICC below 0."""
    r = max(icc, 0.0)
    return n_trials * r / (1 + (n_trials - 1) * r)


def trials_for(icc: float | None, reliability: float = 0.5) -> float | None:
    """Return how many trials have a mean of this reliability; None if no number has."""
    if icc is None or icc <= 0:
        return None
    return reliability / (1 - reliability) * (1 - icc) / icc


def has_signal(reliability: float | None) -> bool:
    """Whether fitness of this reliability selects genotypes at all.

    Choice: from .05 on. The gain of selection grows with the square root of reliability: at .05 it
    is 22 % of the gain of an exact fitness.

    Args:
        reliability: of a genotype's fitness by the method's scheme; None if all had the same.
    """
    return reliability is not None and reliability >= LEAST_RELIABILITY
