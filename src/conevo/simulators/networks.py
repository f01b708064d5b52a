"""The controllers of many robots at once, outside Warp.

Choice: numpy, not the matrix products of torch or jax. A product adds in an order that depends on
the sizes of its matrices, so a team would act differently among others than alone. Here every sum
has the order of ``Controller.forward``, and the outputs are equal to its own bit for bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.controllers.protocol import Controller
from conevo.controllers.srn import Srn
from conevo.kernels.outputs import sigmoid_of

__all__ = ["Networks"]

Floats = npt.NDArray[np.float32]
BLOCK = 2048  # robots at once: their sums stay in the cache


class Networks:
    """The controllers of B teams of R robots, with their memory.

    Args:
        controller: their kind.
        genes: pool of genotypes [K, G].
        teams: pool rows of the parts [B, R, U], -1 for an empty slot.
        n_outputs: O.
    """

    def __init__(
        self,
        controller: Controller,
        genes: Floats,
        teams: npt.NDArray[np.int32],
        n_outputs: int,
    ) -> None:
        b, r, u = teams.shape
        self._shape, self._n_outputs = (b, r), n_outputs
        robots = teams.reshape(b * r, u)
        kind: Any = _Elman if isinstance(controller, Srn) else _Any
        self._blocks = [
            kind(controller, genes, robots[first : first + BLOCK], n_outputs)
            for first in range(0, b * r, BLOCK)
        ]

    def think(self, inputs: Floats) -> Floats:
        """Return the outputs [B, R, O] of all robots, given their inputs [B, R, S]."""
        rows = inputs.reshape(-1, inputs.shape[2])
        with np.errstate(invalid="ignore", over="ignore"):  # tasks may observe what is not finite
            parts = [
                block.think(rows[k * BLOCK : (k + 1) * BLOCK])
                for k, block in enumerate(self._blocks)
            ]
        outputs: Floats = np.concatenate(parts).reshape(*self._shape, self._n_outputs)
        return outputs

    @property
    def hidden(self) -> Floats:
        """The activation of each part [B, R, U], 0 in empty slots."""
        parts = [block.hidden for block in self._blocks]
        found: Floats = np.concatenate(parts).reshape(*self._shape, -1)
        return found


class _Any:
    """Robots with any controller."""

    def __init__(
        self, controller: Controller, genes: Floats, robots: npt.NDArray[np.int32], n_outputs: int
    ) -> None:
        self._controller, self._n_outputs = controller, n_outputs
        self._weights, self._active = genes[robots], robots >= 0
        self._memory = np.zeros((*robots.shape, controller.n_memory), np.float32)

    def think(self, inputs: Floats) -> Floats:
        outputs, self._memory = self._controller.forward(
            self._weights, self._active, self._memory, inputs, self._n_outputs
        )
        return outputs

    @property
    def hidden(self) -> Floats:
        return self._memory[:, :, 0]


class _Elman:
    """Robots with simple recurrent networks: as ``Srn.forward``, with robots as last dimension.

    Choice: a copy of few lines, since it is five times as fast (benchmarks/README.md): weights of
    neighbouring robots lie next to each other, and the slots that no robot fills are left out.
    """

    def __init__(
        self, controller: Srn, genes: Floats, robots: npt.NDArray[np.int32], n_outputs: int
    ) -> None:
        n, self._n_slots = robots.shape
        filled = np.flatnonzero((robots >= 0).any(axis=0))
        self._used = used = int(filled[-1]) + 1 if filled.size else 0
        self._n_context, self._bias = controller.n_context, np.float32(controller.bias)
        active = robots[:, :used] >= 0
        weights = np.float32(controller.weight_scale) * genes[robots[:, :used]]
        weights = np.where(active[:, :, None], weights, np.float32(0))
        n_feeds = weights.shape[2] - n_outputs
        self._w_in = np.ascontiguousarray(weights[:, :, :n_feeds].transpose(2, 1, 0))  # [I, U, n]
        self._w_out = np.ascontiguousarray(weights[:, :, n_feeds:].transpose(1, 2, 0))  # [U, O, n]
        self._active = np.ascontiguousarray(active.T).astype(np.float32)  # [U, n]
        self._feeds = np.zeros((n_feeds, n), np.float32)
        self._sums, self._term = np.empty((2, used, n), np.float32)
        self._out, self._out_term = np.empty((2, n_outputs, n), np.float32)
        self._hidden = np.zeros((used, n), np.float32)

    def think(self, inputs: Floats) -> Floats:
        feeds, sums, term = self._feeds, self._sums, self._term
        n_inputs = len(feeds) - self._n_context
        feeds[:n_inputs] = inputs.T
        sums[:] = self._bias
        for weights, feed in zip(self._w_in, feeds, strict=True):
            np.multiply(weights, feed, out=term)
            np.add(sums, term, out=sums)
        self._hidden = hidden = sigmoid_of(sums) * self._active
        remembered = min(self._n_context, self._used)
        feeds[n_inputs : n_inputs + remembered] = hidden[:remembered]
        out, out_term = self._out, self._out_term
        out[:] = self._bias
        for weights, one in zip(self._w_out, hidden, strict=True):
            np.multiply(weights, one, out=out_term)
            np.add(out, out_term, out=out)
        return out.T

    @property
    def hidden(self) -> Floats:
        whole = np.zeros((self._hidden.shape[1], self._n_slots), np.float32)
        whole[:, : self._used] = self._hidden.T
        return whole
