"""Linear: a controller without hidden neurons. Every output is a weighted sum of the inputs.

A genotype is a whole controller: the weights of the first output, those of the second, and so on. A
weight is ``weight_scale`` times its gene. It remembers nothing that it uses; what recordings show
of it is the sigmoid of its first output.

It is used once it is in the package, as ``src/conevo/controllers/linear.py`` with an entry in the
registry; CONTRIBUTING.md has the recipe.
"""

from typing import Annotated, ClassVar

import numpy as np
import warp as wp
from annotated_types import Gt, Le

from conevo.controllers.protocol import Bools, Floats, Genome, Mind
from conevo.kernels.arrays import named_arrays
from conevo.kernels.outputs import sigmoid, sigmoid_of
from conevo.parameters import parameters

__all__ = ["Linear"]


@wp.struct
class LinearShape:
    """Sizes of a controller as the kernels need them."""

    n_inputs: int
    n_outputs: int
    weight_scale: float


@named_arrays
class LinearWeights:
    """Weights of a team's controllers; filled: 0 for a robot without one, else 1."""

    w: Annotated[wp.array[float], "robots", "outputs", "inputs"]
    filled: wp.array[int]


@named_arrays
class LinearMemory:
    """Outputs of a team's controllers for recordings, 0 for a robot without one."""

    shown: Annotated[wp.array[float], "robots", "parts"]


@wp.func
def load(
    weights: LinearWeights,
    shape: LinearShape,
    i: int,
    genes: wp.array2d[float],
    rows: wp.array3d[int],
    n: int,
) -> None:
    """Build robot ``i``'s controller from a genotype; see ``controllers.protocol.Mind``."""
    size = shape.n_inputs * shape.n_outputs
    row = rows[n, i, 0]
    weights.filled[i] = wp.where(row < 0, 0, 1)
    for k in range(size):
        w = float(0.0)
        if row >= 0:
            w = shape.weight_scale * genes[row, k]
        weights.w[i * size + k] = w


@wp.func
def clear(memory: LinearMemory, shape: LinearShape, i: int) -> None:
    """Clear robot ``i``'s memory."""
    memory.shown[i] = 0.0


@wp.func
def think(
    weights: LinearWeights,
    memory: LinearMemory,
    shape: LinearShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    i: int,
) -> None:
    """Fill robot ``i``'s outputs with the weighted sums of its inputs."""
    for o in range(shape.n_outputs):
        total = float(0.0)
        for j in range(shape.n_inputs):
            total += weights.w[(i * shape.n_outputs + o) * shape.n_inputs + j] * inputs[i, j]
        outputs[i, o] = total
    memory.shown[i] = float(weights.filled[i]) * sigmoid(outputs[i, 0])


@parameters("controller")
class Linear:
    """Settings of a linear controller; see the module."""

    weight_scale: Annotated[float, Gt(0), Le(1000)] = 10.0
    """weight of gene 1."""

    name: ClassVar[str] = "linear"
    max_outputs: ClassVar[int] = 64  # arbitrary
    n_memory: ClassVar[int] = 1

    def genome(self, n_inputs: int, n_outputs: int) -> Genome:
        """Return the parts of a controller: one, the whole network."""
        return Genome(n_parts=1, max_parts=1, n_genes=n_inputs * n_outputs)

    def mind(self, n_inputs: int, n_outputs: int) -> Mind:
        """Return the Warp side."""
        shape = LinearShape()
        shape.n_inputs = n_inputs
        shape.n_outputs = n_outputs
        shape.weight_scale = self.weight_scale
        return Mind(
            weights=LinearWeights,
            memory=LinearMemory,
            shape=shape,
            shape_type=LinearShape,
            sizes={"outputs": n_outputs, "inputs": n_inputs, "parts": 1},
            load=load,
            clear=clear,
            think=think,
            probe="shown",
        )

    def forward(
        self, genes: Floats, active: Bools, memory: Floats, inputs: Floats, n_outputs: int
    ) -> tuple[Floats, Floats]:
        """Run robots' controllers once; see ``controllers.protocol.Controller``."""
        r, s = inputs.shape
        weights = np.float32(self.weight_scale) * genes.reshape(r, n_outputs, s)
        outputs = np.zeros((r, n_outputs), np.float32)
        for j in range(s):
            outputs = outputs + weights[:, :, j] * inputs[:, j, None]
        outputs = np.where(active, outputs, np.float32(0))
        return outputs, (active * sigmoid_of(outputs[:, :1]))[:, :, None]
