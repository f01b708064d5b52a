"""The behaviours of each robot in all epochs: their shares, S and the label.

Nitschke 2009, sections 3.2.1 and 4.6.4: the specialization metric with behaviours for actions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.specialization import degree, label, shares
from conevo.specialization.individual import NON_SPECIALIZED

__all__ = ["Lifetime", "lifetimes"]


@dataclass(frozen=True)
class Lifetime:
    """One robot over all its epochs.

    Attributes:
        shares: of each behaviour, and of "none", in the windows that count.
        windows: how many of them.
        switches: how often the next one held another behaviour.
        specialization: S = switches / possible ones.
        label: the behaviour it is specialized to, or "non-specialized".
    """

    shares: dict[str, float]
    windows: int
    switches: int
    specialization: float
    label: str


def lifetimes(executed: Sequence[npt.NDArray[Any]], behaviours: Sequence[str]) -> list[Lifetime]:
    """Return each robot's shares, S and label.

    Choice: windows that count without a behaviour are "none", which is also switched to and from;
    whoever does nothing else most of the time is non-specialized ("perhaps none of the identified
    behaviors", 4.6.4).

    Args:
        executed: of each robot, the index of its behaviour in each window, -1 for none of them.
        behaviours: their names.
    """
    names = (*behaviours, "none")
    lives = []
    for own in executed:
        found = np.where(own < 0, len(behaviours), own)
        counts = np.bincount(found, minlength=len(names))
        switches = int((found[1:] != found[:-1]).sum())
        s = float(degree(switches, counts))
        name = label(s, counts, names)
        lives.append(
            Lifetime(
                shares=dict(zip(names, shares(counts).tolist(), strict=True)),
                windows=len(own),
                switches=switches,
                specialization=s,
                label=NON_SPECIALIZED if name == "none" else name,
            )
        )
    return lives
