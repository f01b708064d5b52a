"""From the outputs of controllers to the actions of a task, and the labels of actions.

An output is any real number. In a task with continuous actions it is squashed to the range of its
axis; in a task with discrete actions a robot takes the action with the highest output.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from conevo.kernels.outputs import sigmoid_of

__all__ = ["Actions", "Continuous", "Discrete"]

Floats = npt.NDArray[np.float32]
REST = np.float32(0.1)  # Choice: less than a tenth of the range of every axis is rest


class Actions(Protocol):
    """The actions of a task with R robots.

    Attributes:
        outputs: O names, of a controller's outputs.
        names: labels of actions, unless the user has others.
    """

    @property
    def outputs(self) -> tuple[str, ...]:
        """O names, of a controller's outputs."""

    @property
    def names(self) -> tuple[str, ...]:
        """The labels of actions."""

    def of(self, outputs: Floats) -> npt.NDArray[Any]:
        """Return the actions of robots, given their outputs [B, R, O]."""

    def nothing(self, n: int) -> npt.NDArray[Any]:
        """Return the actions of n teams whose robots do nothing."""

    def drawn(self, uniforms: Floats) -> npt.NDArray[Any]:
        """Return actions of equal chances, given numbers in [0, 1) [B, R, O]."""

    def label(self, actions: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
        """Return the index [B, R] in ``names`` of each action."""


@dataclass(frozen=True, eq=False)
class Continuous:
    """Actions [B, R, O] of O axes.

    A label is the axis with the largest share of its range, with its direction, or rest.

    Args:
        low, high: ends of the axes [R, O]; an axis that a robot lacks is 0 to 0.
        outputs: O names, of the axes.
        directions: names of the positive and the negative direction, if there is one, of the axes
            that count for labels, which are the first ones; others, such as messages, do not count.
    """

    low: Floats
    high: Floats
    outputs: tuple[str, ...]
    directions: tuple[tuple[str, ...], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The labels of actions."""
        return ("rest", *(name for axis in self.directions for name in axis))

    def of(self, outputs: Floats) -> Floats:
        """Return the actions of robots, given their outputs [B, R, O]."""
        return self.drawn(sigmoid_of(outputs))

    def nothing(self, n: int) -> Floats:
        """Return the actions of n teams whose robots do nothing: 0, or what is next to it."""
        zero = np.zeros((n, *self.low.shape), np.float32)
        return np.clip(zero, self.low, self.high)

    def drawn(self, uniforms: Floats) -> Floats:
        """Return actions at these shares [B, R, O] of the way from low to high."""
        return np.clip(self.low + (self.high - self.low) * uniforms, self.low, self.high)

    def label(self, actions: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
        """Return the index [B, R] in ``names`` of each action."""
        k = len(self.directions)
        reach = np.maximum(np.abs(self.low), np.abs(self.high))[:, :k]
        share = actions[:, :, :k] / np.where(reach > 0, reach, np.float32(1))
        size = np.abs(share)
        axis = size.argmax(axis=2)[:, :, None]
        largest = np.take_along_axis(share, axis, axis=2)
        first = np.cumsum([1, *map(len, self.directions)])  # label of each axis
        label = np.where(np.abs(largest) < REST, 0, first[axis] + (largest < 0))
        return label[:, :, 0].astype(np.int64)


@dataclass(frozen=True, eq=False)
class Discrete:
    """Actions [B, R] by number; 0 stands for nothing.

    Args:
        outputs: O names, of the actions.
        sizes: number of actions of each robot [R]; the first ones are its own.
    """

    outputs: tuple[str, ...]
    sizes: npt.NDArray[np.int64]

    @property
    def names(self) -> tuple[str, ...]:
        """The labels of actions: the actions."""
        return self.outputs

    def of(self, outputs: Floats) -> npt.NDArray[np.int64]:
        """Return the action of each robot [B, R]: its highest output, the first of equal ones."""
        own = np.arange(len(self.outputs)) < self.sizes[:, None]
        chosen: npt.NDArray[np.int64] = np.where(own, outputs, -np.inf).argmax(axis=2)
        return chosen

    def nothing(self, n: int) -> npt.NDArray[np.int64]:
        """Return action 0 for the robots of n teams."""
        return np.zeros((n, len(self.sizes)), np.int64)

    def drawn(self, uniforms: Floats) -> npt.NDArray[np.int64]:
        """Return actions of equal chances, given numbers in [0, 1) [B, R, O]."""
        return (uniforms[:, :, 0].astype(np.float64) * self.sizes).astype(np.int64)

    def label(self, actions: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
        """Return the actions."""
        return actions.astype(np.int64)
