"""The stored numbers of a trajectory: small codes, each for a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["Channel"]

Codes = npt.NDArray[np.unsignedinteger[Any]]


@dataclass(frozen=True)
class Channel:
    """An array of numbers: value = low + step * code.

    Attributes:
        codes: [...] uint8, uint16 or uint32; time, if it has one, comes first.
        low: value of code 0.
        step: between two neighbouring codes; 1 for whole numbers.
    """

    codes: Codes
    low: float
    step: float

    @staticmethod
    def of(values: npt.ArrayLike, bits: int = 16) -> Channel:
        """Return a channel for values: whole numbers exactly, others with 8 or 16 ``bits``.

        The step of others is a ``2**bits - 1``-th of the distance from the least value to the
        largest, so errors are at most half a step.

        Raises:
            ValueError: not finite, or whole numbers further apart than 2**32.
        """
        array = np.asarray(values)
        if array.dtype.kind in "biu":
            whole = array.astype(np.int64)
            low = int(whole.min()) if whole.size else 0
            most = int(whole.max()) - low if whole.size else 0
            kind = np.min_scalar_type(most)
            if kind.itemsize > 4:
                raise ValueError("whole numbers further apart than 2**32 cannot be kept")
            return Channel(np.asarray(whole - low, kind), low, 1)
        numbers = array.astype(np.float64)
        if not np.isfinite(numbers).all():
            raise ValueError("only finite numbers can be kept")
        least = float(numbers.min()) if numbers.size else 0.0
        most = 2**bits - 1
        step = (float(numbers.max()) - least) / most if numbers.size else 0.0
        scaled = np.rint((numbers - least) / (step or 1.0))
        return Channel(np.asarray(scaled, np.uint8 if bits == 8 else np.uint16), least, step)

    @property
    def values(self) -> npt.NDArray[Any]:
        """The values [...]: int64 if they are whole numbers, else float64."""
        if self.step == 1 and float(self.low).is_integer():
            return np.asarray(self.codes.astype(np.int64) + int(self.low))
        return np.asarray(self.low + self.step * self.codes.astype(np.float64))
