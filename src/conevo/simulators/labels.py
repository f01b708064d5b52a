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
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError, unknown_name
from conevo.outside import source_of

__all__ = ["OwnLabels", "labels_in"]


@dataclass(frozen=True)
class OwnLabels:
    """A user's function that labels actions.

    Attributes:
        address: "FILE.py:FUNCTION".
        digest: of the file's text and its imports, with the name of the function.
        function: the function.
        names: of its labels.
    """

    address: str
    digest: str
    function: Any
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
        found = np.asarray(self.function(*flat))
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
    file, _, name = address.rpartition(":")
    if not file.endswith(".py") or not name:
        raise unknown_name("labels", address, ["actions"], "(and not FILE.py:FUNCTION)")
    source = source_of(Path(file), "labels", digest.partition("-")[0])
    functions = [key for key, one in vars(source.module).items() if hasattr(one, "names")]
    function = getattr(source.module, name, None)
    if function is None:
        raise unknown_name("function", name, functions, f"in {file}")
    names: Any = getattr(function, "names", None)
    if not callable(function):
        raise UsageError(f"{address} must be a function, not {type(function).__name__}")
    if not (isinstance(names, tuple) and names and all(isinstance(one, str) for one in names)):
        raise UsageError(
            f"{address} needs the names of its labels: {name}.names = ('near', 'far'), a tuple"
        )
    whole = f"{source.files[0]}:{name}"
    return OwnLabels(whole, f"{source.digest}-{name}", function, names)
