"""Entropies of activity: how a robot divides its work, and how a team divides it.

O'Donnell and Jeanne 1990 (the entropy of one individual's activity, Nitschke 2009, section 2.3),
Gorelick, Bertram, Killeen and Fewell 2004 (division of labour). All in bits.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["activity_entropy", "division_of_labour", "entropy", "mutual_information"]

Floats = npt.NDArray[np.floating[Any]]


def entropy(weights: npt.ArrayLike) -> Floats:
    """Return Shannon's entropy of weights in bits, [...]; 0 if all are 0.

    From 0 (all weight in one) to log2 of their number (all equal).

    Args:
        weights: [..., K] not negative, in any unit.
    """
    found = np.asarray(weights, dtype=np.float64)
    total = found.sum(axis=-1, keepdims=True)
    share = np.divide(found, total, out=np.zeros_like(found), where=total > 0)
    logarithm = np.log2(share, out=np.zeros_like(share), where=share > 0)
    bits: Floats = -(share * logarithm).sum(axis=-1) + 0.0  # no negative zero
    return bits


def activity_entropy(counts: npt.ArrayLike) -> float | None:
    """Return the entropy of a robot's activity in bits, the mean over the robots that did anything.

    0 if each does one thing all its life, log2(A) if each divides its life evenly among all.
    Unlike S, it does not distinguish doing one thing for half a life from switching all the time.
    O'Donnell and Jeanne 1990: the Shannon-Wiener H of an individual, low for a specialist. None if
    no robot did anything. Choice: the team's measure is the mean, with equal weights for robots.

    Args:
        counts: [R, A] how often each robot executed each action.
    """
    executed = np.asarray(counts, dtype=np.float64)
    active = executed[executed.sum(axis=1) > 0]
    return float(entropy(active).mean()) if len(active) else None


def mutual_information(counts: npt.ArrayLike) -> float | None:
    """Return the mutual information of robots and executed actions, in bits.

    0 if all robots divide their work alike; at most the entropy of the actions, and at most that of
    the robots. Gorelick et al. 2004: mutual entropy of the matrix of individuals and tasks. None if
    no robot did anything.

    Args:
        counts: [R, A] how often each robot executed each action.
    """
    executed = np.asarray(counts, dtype=np.float64)
    if executed.sum() == 0:
        return None
    by_action, by_robot = entropy(executed.sum(axis=0)), entropy(executed.sum(axis=1))
    return max(float(by_action + by_robot - entropy(executed.ravel())), 0.0)


def division_of_labour(counts: npt.ArrayLike) -> tuple[float | None, float | None]:
    """Return the mutual information over the entropy of the actions, and over that of the robots.

    Both from 0 (all robots divide their work alike) to 1: for the first, every robot executes one
    action only; for the second, every action is executed by one robot only. Gorelick et al. 2004,
    both normalizations. None where that entropy is 0: one action only, or one robot.

    Args:
        counts: [R, A] how often each robot executed each action.
    """
    executed = np.asarray(counts, dtype=np.float64)
    shared = mutual_information(executed)
    of_actions, of_robots = (float(entropy(executed.sum(axis=axis))) for axis in (0, 1))
    return _portion(shared, of_actions), _portion(shared, of_robots)


def _portion(shared: float | None, whole: float) -> float | None:
    return min(shared / whole, 1.0) if shared is not None and whole > 0 else None
