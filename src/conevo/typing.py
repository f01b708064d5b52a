"""Names of types that many modules use; numpy is not loaded for them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

__all__ = ["Floats", "Record"]

Floats: TypeAlias = "npt.NDArray[np.float64]"
"""An array of numbers in double precision."""

Record: TypeAlias = dict[str, Any]
"""Plain data by name: a line or a file of JSON, a row of a table."""
