"""Labels of actions by a user's function, in place of the task's own.

A file has a function with the names of its labels::

    def zone(observation, action):
        return (observation[:, 0] > 0).astype(int)

    zone.names = ("left", "right")

It gets the observations [K, S] and actions of K robots, [K, A] or, where actions have numbers, [K],
and returns the index of a name for each. Where a robot has fewer than others, the rest is 0. A
robot that spends most of its life with a label belongs to the caste of this name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError
from conevo.simulators.functions import OwnFunction, function_in

__all__ = ["ACTIONS", "OwnLabels", "labels_in"]

ACTIONS = "actions"  # the labels that a task has itself


@dataclass(frozen=True)
class OwnLabels(OwnFunction):
    """A user's function that labels actions.

    Attributes:
        names: of its labels.
    """

    names: tuple[str, ...]

    def of(self, observation: npt.NDArray[Any], action: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
        """Return the label [B, R] of each robot's action.

        Args:
            observation: [B, R, S].
            action: [B, R, A], or [B, R].

        Raises:
            UsageError: the function does not return labels.
        """
        b, r = observation.shape[:2]
        flat = observation.reshape(b * r, -1), action.reshape(b * r, *action.shape[2:])
        found = np.asarray(self.call(*flat))
        if found.shape != (b * r,) or found.dtype.kind not in "iu":
            raise UsageError(
                f"{self.address} must return {b * r} whole numbers, one for each robot, not "
                f"{found.dtype} {list(found.shape)}"
            )
        if found.size and not 0 <= found.min() <= found.max() < len(self.names):
            raise UsageError(
                f"{self.address} returns {found.min()} to {found.max()}, but it has "
                f"{len(self.names)} names"
            )
        return found.astype(np.int64).reshape(b, r)


def labels_in(address: str, digest: str = "") -> OwnLabels:
    """Return the function at "FILE.py:FUNCTION".

    Args:
        address: of the function.
        digest: that it must have; any if empty.

    Raises:
        UsageError: the file cannot be run or has changed, or it has no such function with names.
    """
    found = function_in(address, "labels", ACTIONS, digest, mark="names")
    names: Any = getattr(found.function, "names", None)
    if not (isinstance(names, tuple) and names and all(isinstance(one, str) for one in names)):
        name = address.rpartition(":")[2]
        raise UsageError(
            f"{address} needs the names of its labels: {name}.names = ('near', 'far'), a tuple"
        )
    return OwnLabels(found.address, found.digest, found.function, names)
