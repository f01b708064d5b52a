"""Activity of a robot: the shares of its actions over its life."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["shares"]


def shares(counts: npt.ArrayLike) -> npt.NDArray[np.floating[Any]]:
    """Return the share of each action [..., A] in all executed actions; zeros if there were none.

    Args:
        counts: [..., A] how often each action was executed.
    """
    executed = np.asarray(counts, dtype=np.float64)
    total = executed.sum(axis=-1, keepdims=True)
    share: npt.NDArray[np.floating[Any]] = np.zeros_like(executed)
    np.divide(executed, total, out=share, where=total > 0)
    return share
