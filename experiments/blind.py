"""Blind rovers: a controller without sensing, to measure the value that blind teams reach.

In every iteration a blind rover draws one of its actions by their shares. If it moves, it continues
straight ahead or, once in ``stretch`` moves, turns to a new direction. The heuristic rovers of
table 5.3 are the same with a stretch of 1. A genotype is one kind of rover, and a team may have
several kinds. It is a controller like those of the package, so that blind and seeing teams are
played by the same kernels.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np
import numpy.typing as npt
import warp as wp

from conevo.controllers.protocol import Bools, Floats, Genome, Mind
from conevo.kernels.arrays import named_arrays
from conevo.kernels.random import uniform
from conevo.parameters import parameters

__all__ = ["N_GENES", "Blind", "kind"]

N_ACTIONS = wp.constant(4)  # low, med, hi, move
N_GENES = wp.constant(6)  # shares of the actions, 1 / stretch, which random numbers
FAR = wp.constant(8.0)  # an output sum whose sigmoid is close to 1


def kind(shares: Sequence[float], stretch: float, draw: int = 0) -> npt.NDArray[np.float32]:
    """Return the genes [G] of a kind of rover, in [-1, 1].

    Args:
        shares: of low, med, hi and move; any sum.
        stretch: moves in one direction, on average.
        draw: number of its random sequence, 0 to 999.
    """
    parts = np.array([*(np.array(shares) / sum(shares)), 1 / stretch, draw / 1000])
    return (2 * parts - 1).astype(np.float32)


@wp.struct
class BlindShape:
    """The number of outputs of the world, since a struct must have a field."""

    n_outputs: int


@named_arrays
class BlindWeights:
    """Genes of a team's rovers, as shares in [0, 1]."""

    share: Annotated[wp.array[float], "robots", "genes"]


@named_arrays
class BlindMemory:
    """Iterations lived, and the direction last taken: two output sums."""

    age: Annotated[wp.array[float], "robots", "parts"]
    ahead: Annotated[wp.array[float], "robots", "axes"]


@wp.func
def load(
    weights: BlindWeights,
    shape: BlindShape,
    i: int,
    genes: wp.array2d[float],
    rows: wp.array3d[int],
    n: int,
) -> None:
    """Build robot ``i``'s controller of a genotype; see ``controllers.protocol.Mind``."""
    row = rows[n, i, 0]
    for k in range(N_GENES):
        share = float(0.0)
        if row >= 0:
            share = (genes[row, k] + 1.0) * 0.5
        weights.share[i * N_GENES + k] = share


@wp.func
def clear(memory: BlindMemory, shape: BlindShape, i: int) -> None:
    """Reset robot ``i``'s memory."""
    memory.age[i] = 0.0
    memory.ahead[2 * i] = 0.0
    memory.ahead[2 * i + 1] = 0.0


@wp.func
def think(
    weights: BlindWeights,
    memory: BlindMemory,
    shape: BlindShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    i: int,
) -> None:
    """Fill robot ``i``'s outputs with an action drawn by the shares, and a direction."""
    own = i * N_GENES
    seed = wp.uint64(int(weights.share[own + 5] * 1000.0 + 0.5))
    t = int(memory.age[i])
    memory.age[i] = float(t + 1)
    u = uniform(seed, t, 0, i)
    chosen = int(0)
    below = float(weights.share[own])
    while chosen < N_ACTIONS - 1 and u >= below:
        chosen += 1
        below += weights.share[own + chosen]
    for o in range(shape.n_outputs):
        outputs[i, o] = -2.0 * FAR
    if chosen < N_ACTIONS - 1:
        outputs[i, chosen] = FAR
    else:
        has_turned = memory.ahead[2 * i] != 0.0
        if not has_turned or uniform(seed, t, 1, i) < weights.share[own + 4]:
            memory.ahead[2 * i] = FAR * (2.0 * uniform(seed, t, 2, i) - 1.0)
            memory.ahead[2 * i + 1] = FAR * (2.0 * uniform(seed, t, 3, i) - 1.0)
        outputs[i, 3] = memory.ahead[2 * i]
        outputs[i, 4] = memory.ahead[2 * i + 1]


@parameters("controller")
class Blind:
    """A blind rover; see the module."""

    name: ClassVar[str] = "blind"
    max_outputs: ClassVar[int] = 5
    n_memory: ClassVar[int] = 1

    def genome(self, n_inputs: int, n_outputs: int) -> Genome:
        """Return the parts of a controller: one, the whole controller."""
        return Genome(n_parts=1, max_parts=1, n_genes=int(N_GENES))

    def mind(self, n_inputs: int, n_outputs: int) -> Mind:
        """Return the Warp side."""
        shape = BlindShape()
        shape.n_outputs = n_outputs
        return Mind(
            weights=BlindWeights,
            memory=BlindMemory,
            shape=shape,
            shape_type=BlindShape,
            sizes={"genes": int(N_GENES), "axes": 2, "parts": 1},
            load=load,
            clear=clear,
            think=think,
            probe="age",
        )

    def forward(
        self, genes: Floats, active: Bools, memory: Floats, inputs: Floats, n_outputs: int
    ) -> tuple[Floats, Floats]:
        """Refuse: blind rovers are played by the kernels only."""
        raise NotImplementedError
