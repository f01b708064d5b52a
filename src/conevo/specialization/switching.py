"""The index from which the degree of specialization S was derived.

Gautrais, Theraulaz, Deneubourg and Anderson 2002; Nitschke 2009, sections 2.3 and 3.2.1.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["switching_index"]


def switching_index(specialization: npt.ArrayLike, n_actions: int) -> float | None:
    """Return how much less often than by chance robots switch, mean over the robots.

    1 if they never switch, 0 if they switch as often as with random actions, and -1 / (A - 1) if
    they always switch. With two tasks it is 1 - 2 S, from -1 to 1, as in Gautrais et al. 2002; the
    thesis uses only S. Choice: with A equally likely actions, chance is (A - 1) / A. None for one
    action.

    Args:
        specialization: [R] degree of specialization S, switches over possible switches.
        n_actions: A.
    """
    if n_actions < 2:
        return None
    switched = float(np.asarray(specialization, dtype=np.float64).mean())
    return 1 - switched * n_actions / (n_actions - 1)
