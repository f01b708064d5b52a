"""The few operations that controllers are made of, which every file format has to write.

The equations of a controller (``export.networks``) are written once, in these operations. A format
implements them: numpy computes with them, a graph adds nodes, a source file adds lines.
"""

from __future__ import annotations

import operator
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from conevo.kernels.outputs import (
    LIMIT,
    P1,
    P3,
    P5,
    P7,
    P9,
    P11,
    P13,
    Q0,
    Q2,
    Q4,
    Q6,
    sigmoid_of,
)

__all__ = [
    "DENOMINATOR",
    "NUMERATOR",
    "OPERATORS",
    "Arithmetic",
    "Floats",
    "NumpyArithmetic",
    "sigmoid_limit",
]

Floats = npt.NDArray[np.float32]
OPERATORS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}

# The kernels' sigmoid(a) is 1/2 + 1/2 h p(h^2) / q(h^2), with h = a / 2 between -limit and limit.
sigmoid_limit = float(LIMIT)
NUMERATOR = tuple(map(float, (P1, P3, P5, P7, P9, P11, P13)))
"""Coefficients of p, that of the lowest power first."""
DENOMINATOR = tuple(map(float, (Q0, Q2, Q4, Q6)))
"""Coefficients of q, likewise."""


class Arithmetic(Protocol):
    """Operations on values of shape [R, columns], float32, each rounded once.

    ``name`` is the name of a result, which texts and graphs show. A number stands for a value of
    which all elements are equal.
    """

    def weight(self, name: str) -> Any:
        """Return weights [R, U] of the network."""

    def number(self, value: float) -> Any:
        """Return a number."""

    def join(self, name: str, first: Any, second: Any) -> Any:
        """Return the columns of both."""

    def columns(self, name: str, values: Any, first: int, last: int) -> Any:
        """Return the columns from ``first`` to before ``last``."""

    def weighted(self, name: str, weights: str, values: Any, start: Any) -> Any:
        """Return start + w_0 v_0 + w_1 v_1 + ..., [R, U], added from left to right.

        Args:
            name: of the result.
            weights: name of weights [R, J, U].
            values: [R, J].
            start: a number, or [R, U].
        """

    def sigmoid(self, name: str, values: Any) -> Any:
        """Return the kernels' sigmoid of every element."""

    def each(self, name: str, first: Any, sign: str, second: Any) -> Any:
        """Return the sum, difference, product or quotient (``OPERATORS``) of every element."""


class NumpyArithmetic:
    """Computes with numpy arrays.

    Args:
        weights: of the network.
    """

    def __init__(self, weights: dict[str, Floats]) -> None:
        self._weights = weights

    def weight(self, name: str) -> Floats:
        """Return weights."""
        return self._weights[name]

    def number(self, value: float) -> np.float32:
        """Return a number."""
        return np.float32(value)

    def join(self, name: str, first: Floats, second: Floats) -> Floats:
        """Return the columns of both."""
        return np.concatenate([first, second], axis=1)

    def columns(self, name: str, values: Floats, first: int, last: int) -> Floats:
        """Return some columns."""
        return values[:, first:last].copy()

    def weighted(self, name: str, weights: str, values: Floats, start: Any) -> Floats:
        """Return the sum, one product after another."""
        w = self._weights[weights]
        total: Floats = start + w[:, 0] * values[:, :1]
        for j in range(1, w.shape[1]):
            total += w[:, j] * values[:, j, None]
        return total

    def sigmoid(self, name: str, values: Floats) -> Floats:
        """Return the sigmoid."""
        return sigmoid_of(values)

    def each(self, name: str, first: Floats, sign: str, second: Floats) -> Floats:
        """Return the sum, difference, product or quotient."""
        result: Floats = OPERATORS[sign](first, second)
        return result
