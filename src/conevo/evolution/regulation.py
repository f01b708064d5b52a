"""Regulation during evolution: similarity thresholds and the size of controllers.

Nitschke 2009, sections 3.5 and 3.6. Choice: the thesis writes "has not progressed over the last V
generations" and "has increased" without a measure. Here one measure, ``trend``, serves all: over
the V + 1 values from V generations ago until now, the mean of the later half minus the mean of the
earlier half (the middle one of an odd number left out). Progress and rise are trends above zero,
fall is a trend below. It takes means of halves because fitness is noisy: the two ends alone would
decide by chance, and the maximum of V values almost always beats a single old one. Windows move
with every generation and are not used before they are full. Values that are not finite are left
out. A half without any makes the trend NaN, which counts as no progress, no rise and no fall.
"""

from __future__ import annotations

import numpy as np

from conevo.evolution.protocol import BoolArray, FloatArray, IntArray

__all__ = ["regulate_gst", "regulate_sst", "resized", "stagnating", "trend"]


def trend(window: FloatArray) -> FloatArray:
    """Return how much the values [V + 1, ...] of a window rose, [...]; the last is the newest."""
    half = len(window) // 2
    finite = np.isfinite(window)
    values = np.where(finite, window, 0.0)
    with np.errstate(invalid="ignore"):
        early, late = (
            values[part].sum(axis=0) / finite[part].sum(axis=0)
            for part in (slice(None, half), slice(-half, None))
        )
    rise: FloatArray = late - early
    return rise


def regulate_sst(
    sst: float, fitness: FloatArray, specialization: FloatArray, step: float = 0.01
) -> float:
    """Return the next specialization similarity threshold, in [0, 1].

    Nitschke 2009, 3.5.1: while the fittest team does not progress, a rise of S lowers the threshold
    (less recombination between populations), a fall of S raises it.

    Args:
        sst: the threshold now; NaN stays NaN.
        fitness: [V + 1] average fitness of the fittest team.
        specialization: [V + 1] its average S.
        step: the thesis' 1 %. Choice: an absolute 0.01.
    """
    if trend(fitness) > 0:
        return sst
    change = -step * float(np.sign(np.nan_to_num(trend(specialization))))
    return float(np.clip(sst + change, 0.0, 1.0))


def regulate_gst(
    gst: float, fitness: FloatArray, recombinations: FloatArray, step: float = 0.01
) -> float:
    """Return the next genotype similarity threshold, in [0, 1].

    Nitschke 2009, 3.5.2: while the fittest team does not progress, more recombinations between
    populations lower the threshold; the same number or fewer raise it.

    Args:
        gst: the threshold now; NaN stays NaN.
        fitness: [V + W + 1] average fitness of the fittest team.
        recombinations: [V + W + 1] recombinations between populations.
        step: the thesis' 1 %. Choice: an absolute 0.01.
    """
    if trend(fitness) > 0:
        return gst
    change = -step if trend(recombinations) > 0 else step
    return float(np.clip(gst + change, 0.0, 1.0))


def stagnating(
    past_fitness: FloatArray, generation: int, watched_since: IntArray, patience: int
) -> BoolArray:
    """Return which populations' fittest controllers [P] have not progressed for long enough.

    Nitschke 2009, section 3.6.

    Args:
        past_fitness: [H, P] fitness of each fittest controller, the newest last, H > patience.
        generation: the generation of the newest.
        watched_since: [P] the generation at which each window started.
        patience: generations a window must span.
    """
    full = generation - watched_since >= patience
    progressed = trend(past_fitness[-(patience + 1) :]) > 0
    stuck: BoolArray = full & ~progressed
    return stuck


def resized(
    active: BoolArray, fitness: FloatArray, without: FloatArray, suspects: BoolArray, ratio: float
) -> BoolArray:
    """Return the slots [P, U] in use after the lesions of section 3.6.

    If at least ``ratio`` of the fitness is left without the least needed neuron, its slot is
    emptied, but two neurons always stay. Otherwise every neuron is worth keeping, and the lowest
    empty slot, if any, gets a new sub-population.

    Choice: for a negative fitness the bound is the same distance below it, f - (1 - ratio) |f|.
    Choice: a controller whose fitness is not finite, or 0, keeps its size: lesions of a controller
    that earns nothing do not show which neurons it needs. (By the letter of the rule such
    controllers would shrink to two neurons.)

    Args:
        active: [P, U] slots in use.
        fitness: [P] fitness of each complete fittest controller.
        without: [P, U] its fitness without the neuron of each slot; NaN where not tried.
        suspects: [P] populations to resize.
        ratio: the share of fitness that must be left.
    """
    changed = active.copy()
    for p in np.flatnonzero(suspects & np.isfinite(fitness) & (fitness != 0)):
        left = np.where(np.isfinite(without[p]), without[p], -np.inf)
        least_needed = left.argmax()
        if left[least_needed] >= fitness[p] - (1 - ratio) * abs(fitness[p]):
            changed[p, least_needed] = active[p].sum() <= 2
        elif not active[p].all():
            changed[p, active[p].argmin()] = True
    return changed
