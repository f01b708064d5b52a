"""How specialized one robot is, and to which action; the castes of a team.

Nitschke 2009, section 3.2, after Gautrais et al. 2002.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.specialization.activity import shares
from conevo.terms import NON_SPECIALIZED

__all__ = [
    "NON_SPECIALIZED",
    "castes",
    "degree",
    "independent_degree",
    "label",
    "relative_degree",
]


def degree(switches: npt.ArrayLike, counts: npt.ArrayLike) -> npt.NDArray[np.floating[Any]]:
    """Return the degree of specialization S = A / N in [0, 1], [...]; 0 is a perfect specialist.

    Nitschke 2009, eq. 3.4: A is how often the robot changed from one action to another, N how often
    it could have done so: one less than the number of executed actions. More switching raises S.
    Choice: iterations without an action do not count, and S is 0 if fewer than two actions were
    executed.

    Args:
        switches: [...] A.
        counts: [..., A] how often each action was executed.
    """
    possible = np.asarray(counts).sum(axis=-1, dtype=np.float64) - 1
    changed = np.asarray(switches, dtype=np.float64)
    s: npt.NDArray[np.floating[Any]] = np.zeros_like(possible)
    np.divide(changed, possible, out=s, where=possible > 0)
    return s


def independent_degree(counts: npt.ArrayLike) -> npt.NDArray[np.floating[Any]]:
    """Return the S that independent draws from a robot's own shares would give, [...].

    1 - sum of the squared shares: each of the N possible switches is made if two draws differ. From
    0 (one action only) to 1 - 1 / A (all equally often). This is the null of S: with the same
    shares, S is higher for actions in turn and lower for actions in blocks. 0 if no action was
    executed.

    Args:
        counts: [..., A] how often each action was executed.
    """
    share = shares(counts)
    squared = (share**2).sum(axis=-1)
    drawn: npt.NDArray[np.floating[Any]] = np.where(squared > 0, 1 - squared, 0.0)
    return drawn


def relative_degree(
    specialization: npt.ArrayLike, independent: npt.ArrayLike
) -> npt.NDArray[np.floating[Any]]:
    """Return S over the S of independent draws, [...].

    0 = always the same action, 1 = switches as often as independent draws from the same shares do,
    up to 9/4 (a, b, a) = in turn. Choice: 0 where S is 0, also for one action only, where
    independent draws would not switch either.

    Args:
        specialization: [...] S.
        independent: [...] ``independent_degree`` of the same actions.
    """
    s, drawn = np.asarray(specialization, float), np.asarray(independent, float)
    relative: npt.NDArray[np.floating[Any]] = np.zeros_like(s)
    np.divide(s, drawn, out=relative, where=(s > 0) & (drawn > 0))
    return relative


def label(
    specialization: float, counts: npt.ArrayLike, names: Sequence[str], threshold: float = 0.5
) -> str:
    """Return the caste of a robot, or "non-specialized".

    Nitschke 2009, 3.2.3: a robot is specialized if S < 0.5, to the action that it executed most;
    ties go to the first. Choice: a robot that executed no action is not specialized.

    Args:
        specialization: S.
        counts: [A] how often each action was executed.
        names: A names, of the actions or of the castes that do them.
        threshold: a robot is not specialized if its S is this or more.
    """
    executed = np.asarray(counts)
    if executed.sum() == 0 or not specialization < threshold:
        return NON_SPECIALIZED
    return names[int(executed.argmax())]


def castes(labels: Iterable[str]) -> dict[str, int]:
    """Return the number of robots per caste, the largest first, ties by name.

    A caste consists of the robots of a team that are specialized to the same action (Nitschke 2009,
    3.2.3). The non-specialized are counted, too, as in the thesis' tables.
    """
    found = Counter(labels)
    return dict(sorted(found.items(), key=lambda caste: (-caste[1], caste[0])))
