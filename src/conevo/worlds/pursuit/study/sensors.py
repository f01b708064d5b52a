"""Sensing during behaviours: averages for reproduction, profiles as in figures B-1 to B-9.

Nitschke 2009, section 4.6.2 and appendix B: 20 instances of every individual behaviour are sampled;
sensors are averaged over the duration of each, then over all of them. The range [0, 1] is cut into
ten segments, and "the portion of a given behavior's duration that the light or proximity sensors
are active" is measured in each.

Choice: an instance is an unbroken stretch of one behaviour within an interaction. A predator that
is idle away from all others senses nothing, so it is not an instance. Choice: a sensor at exactly 0
is not active, so the ten portions add up to the portion in which sensors are active. Choice: the
portion is the average over the eight sensors. A segment includes its upper end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from conevo.worlds.pursuit.study.behaviours import BEHAVIOURS, Conduct, spells

__all__ = ["N_SEGMENTS", "Profile", "Spell", "average", "find_spells", "profile", "sample"]

N_SEGMENTS = 10
N_EACH = 8  # proximity sensors come first, then eight light sensors
Inputs = Sequence[npt.NDArray[Any]]


class Spell(NamedTuple):
    """An instance of an individual behaviour: iterations [start, stop) of an epoch."""

    epoch: int
    predator: int
    behaviour: str
    start: int
    stop: int


@dataclass(frozen=True)
class Profile:
    """Portions of a behaviour's duration, [10] each, in which sensors are active in a segment."""

    proximity: npt.NDArray[np.float64]
    light: npt.NDArray[np.float64]


def find_spells(conducts: Sequence[Conduct]) -> list[Spell]:
    """Return all instances of individual behaviours in the interactions of some epochs."""
    return [
        Spell(epoch, predator, behaviour, start, stop)
        for epoch, one in enumerate(conducts)
        for predator in range(one.behaviour.shape[1])
        for k, behaviour in enumerate(BEHAVIOURS)
        for start, stop in spells(
            (one.behaviour[:, predator] == k) & one.interacts[:, predator],
        )
    ]


def sample(found: Sequence[Spell], n: int, rng: np.random.Generator) -> list[Spell]:
    """Return ``n`` of the instances, drawn without replacement; all if there are fewer."""
    chosen = rng.permutation(len(found))[:n]
    return [found[int(k)] for k in np.sort(chosen)]


def average(found: Sequence[Spell], inputs: Inputs) -> npt.NDArray[np.float64]:
    """Return the average of each sensor [16]: over each instance, then over the instances.

    Args:
        found: at least one instance.
        inputs: of each epoch [T, R, 16], proximity first.
    """
    means = [_during(one, inputs).mean(axis=0) for one in found]
    return np.asarray(np.mean(means, axis=0), dtype=np.float64)


def profile(found: Sequence[Spell], inputs: Inputs) -> Profile:
    """Return the ten-segment profile: over each instance, then over the instances.

    Args:
        found: at least one instance.
        inputs: of each epoch [T, R, 16], proximity first.
    """
    portions = np.mean([_portions(_during(one, inputs)) for one in found], axis=0)
    return Profile(
        proximity=portions[:N_EACH].mean(axis=0),
        light=portions[N_EACH:].mean(axis=0),
    )


def _during(one: Spell, inputs: Inputs) -> npt.NDArray[np.float64]:
    sensed = inputs[one.epoch][one.start : one.stop, one.predator, : 2 * N_EACH]
    return sensed.astype(np.float64)


def _portions(sensed: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the portion of iterations [T, S] in which each sensor is in each segment, [S, 10]."""
    segment = np.ceil(sensed * N_SEGMENTS).astype(np.int64)  # 0 is not active, 1 the first
    return np.stack([(segment == k).mean(axis=0) for k in range(1, N_SEGMENTS + 1)], axis=-1)
