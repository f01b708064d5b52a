"""A robot's favourite activity and its share of the work: castes that S does not detect.

S (eq. 3.4) measures how often a robot switches. A robot that moves and detects in turn has S = 1
even if it detects with one setting all its life. The measures here count activities instead. All
take counts [..., K]: of all actions, or only of those among which a robot of its world chooses
(``worlds.protocol.World``: settings). Solow and Szmerekovsky, O'Donnell and Jeanne 1990, Murciano,
Millan and Zamora 1997; Nitschke 2009, section 2.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.specialization.activity import shares

__all__ = [
    "MAJORITY",
    "affinity",
    "favourite",
    "favourite_share",
    "mean_where_defined",
    "portion_devoted",
]

Floats = npt.NDArray[np.floating[Any]]

MAJORITY = 0.5
"""The part of its work that a specialist exceeds with one activity (Nitschke 2009, section 2.3)."""


def favourite(counts: npt.ArrayLike, names: Sequence[str]) -> str | None:
    """Return a robot's most frequent activity; ties go to the first; None if all counts are 0.

    Args:
        counts: [K] how often it did each activity.
        names: K names.
    """
    executed = np.asarray(counts)
    return names[int(executed.argmax())] if executed.sum() > 0 else None


def favourite_share(counts: npt.ArrayLike) -> Floats:
    """Return the share of a robot's most frequent activity [...], from 1 / K to 1.

    1 = always the same, 1 / K = all equally often; NaN for a robot whose counts are 0. For all
    actions: the share of time in one activity, which Solow and Szmerekovsky require to be 100 %
    (Nitschke 2009, section 2.3).

    Args:
        counts: [..., K] how often each activity was done.
    """
    share = shares(counts).max(axis=-1)
    found: Floats = np.where(share > 0, share, np.nan)
    return found


def portion_devoted(counts: npt.ArrayLike) -> float:
    """Return the portion of robots that do more than half of their work in one way.

    From 0 (no robot) to 1 (all). O'Donnell and Jeanne 1990: a specialist "devotes most of its work
    time (> 50%)" to one resource (Nitschke 2009, section 2.3). Choice: only actions with one of the
    world's settings are work, as gathering was theirs; moving between rocks is not. A robot that
    did no work is not specialized.

    Args:
        counts: [R, K] how often each robot used each setting.
    """
    return float((favourite_share(counts) > MAJORITY).mean())


def affinity(counts: npt.ArrayLike) -> Floats:
    """Return how much a robot prefers one setting to any other [...], from 0 to 1.

    The share of the favourite less that of the next: 1 = always the same, 0 = two or more equally
    often; NaN for a robot that used none. Murciano et al. 1997: a robot is specialized if its
    probability of collecting one type of object is close to 1, and of the other types close to 0.
    Choice: this difference, since section 2.3 (Nitschke 2009) has no formula. The shares are of
    objects used, since objects that a robot passed by are not counted.

    Args:
        counts: [..., K] how often each setting was used.
    """
    share = np.sort(shares(counts), axis=-1)
    second = share[..., -2] if share.shape[-1] > 1 else 0.0
    found: Floats = np.where(share[..., -1] > 0, share[..., -1] - second, np.nan)
    return found


def mean_where_defined(values: npt.ArrayLike) -> float | None:
    """Return the mean of the values of a team's robots, with equal weights; None without any.

    Choice: robots without a value, such as those that never used a setting, are left out.

    Args:
        values: [R], NaN for a robot without a value.
    """
    found = np.asarray(values, dtype=np.float64)
    found = found[np.isfinite(found)]
    return float(found.mean()) if found.size else None
