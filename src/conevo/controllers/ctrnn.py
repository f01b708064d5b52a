"""A continuous-time recurrent network: each hidden neuron has its own time constant.

Beer 1995, "On the dynamics of small continuous-time recurrent neural networks", eq. 1, with one
Euler step per iteration::

    y += (dt / tau) (-y + bias + w_in . inputs + w_rec . sigmoid(y))

A genotype is one hidden neuron: its input weights, its recurrent weights, its bias, its time
constant, then its output weights. Outputs are weighted sums of the activations sigmoid(y).

Choice: recurrent connections lead from slots k < n_hidden only, as the context of the simple
recurrent network does, so that all genotypes of a world have the same length.
Choice: time constants lie between 1 and ``slowest`` iterations, in proportion to the gene.
"""

from typing import Annotated, ClassVar

import numpy as np
import warp as wp
from annotated_types import Ge, Gt, Le

from conevo.controllers.protocol import Bools, Floats, Genome, Mind
from conevo.controllers.slots import Slots, n_neurons, n_sums, sum_up
from conevo.kernels.arrays import named_arrays
from conevo.kernels.outputs import sigmoid, sigmoid_of
from conevo.kernels.phases import Phase
from conevo.parameters import parameters

__all__ = ["Ctrnn"]


@wp.struct
class CtrnnShape:
    """Sizes of a network as the kernels need them."""

    n_inputs: int
    n_context: int
    n_outputs: int
    n_slots: int
    weight_scale: float
    slowest: float


@named_arrays
class CtrnnWeights:
    """Weights of a team's networks.

    Feeds: inputs, then context. bias and rate: the neuron's bias, and the portion of the distance
    to its new state that it covers in an iteration.
    """

    w_in: Annotated[wp.array[float], "robots", "slots", "feeds"]
    w_out: Annotated[wp.array[float], "robots", "slots", "outputs"]
    bias: Annotated[wp.array[float], "robots", "slots"]
    rate: Annotated[wp.array[float], "robots", "slots"]
    filled: Annotated[wp.array[int], "robots", "slots"]


@named_arrays
class CtrnnMemory:
    """Activations and states of a team's neurons, 0 in empty slots."""

    hidden: Annotated[wp.array[float], "robots", "slots"]
    state: Annotated[wp.array[float], "robots", "slots"]


@wp.func
def load(
    weights: CtrnnWeights,
    shape: CtrnnShape,
    i: int,
    genes: wp.array2d[float],
    rows: wp.array3d[int],
    n: int,
) -> None:
    """Build robot ``i``'s network from neuron genotypes; see ``controllers.protocol.Mind``."""
    seen = shape.n_inputs + shape.n_context
    for k in range(shape.n_slots):
        slot = i * shape.n_slots + k
        row = rows[n, i, k]
        weights.filled[slot] = int(row >= 0)
        if row >= 0:
            for j in range(seen):
                weights.w_in[slot * seen + j] = shape.weight_scale * genes[row, j]
            weights.bias[slot] = shape.weight_scale * genes[row, seen]
            share = 0.5 * (genes[row, seen + 1] + 1.0)
            weights.rate[slot] = 1.0 / (1.0 + share * (shape.slowest - 1.0))
            for o in range(shape.n_outputs):
                weight = shape.weight_scale * genes[row, seen + 2 + o]
                weights.w_out[slot * shape.n_outputs + o] = weight


@wp.func
def clear(memory: CtrnnMemory, shape: CtrnnShape, i: int) -> None:
    """Reset robot ``i``'s memory: states 0, no activations yet."""
    for k in range(shape.n_slots):
        memory.hidden[i * shape.n_slots + k] = 0.0
        memory.state[i * shape.n_slots + k] = 0.0


@wp.func
def step(
    weights: CtrnnWeights,
    memory: CtrnnMemory,
    shape: CtrnnShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
    q: int,
) -> None:
    """Take one Euler step of neuron ``q`` of the team."""
    i = q // shape.n_slots
    if heuristic[i] >= 0 or weights.filled[q] == 0:
        return
    first = i * shape.n_slots
    at = q * (shape.n_inputs + shape.n_context)
    drive = weights.bias[q]
    j = int(0)
    while j < shape.n_inputs:
        drive += weights.w_in[at + j] * inputs[i, j]
        j += 1
    at += shape.n_inputs
    j = int(0)
    while j < shape.n_context:
        drive += weights.w_in[at + j] * memory.hidden[first + j]
        j += 1
    memory.state[q] = memory.state[q] + weights.rate[q] * (drive - memory.state[q])


@wp.func
def activate(
    weights: CtrnnWeights,
    memory: CtrnnMemory,
    shape: CtrnnShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
    q: int,
) -> None:
    """Update the activation of neuron ``q``, after all neurons have read the previous ones."""
    if heuristic[q // shape.n_slots] < 0 and weights.filled[q] != 0:
        memory.hidden[q] = sigmoid(memory.state[q])


@parameters("controller")
class Ctrnn(Slots):
    """Settings of a continuous-time recurrent network; see the module."""

    weight_scale: Annotated[float, Gt(0), Le(1000)] = 10.0
    """connection weight, or bias, of gene 1."""
    slowest: Annotated[float, Ge(1), Le(10_000)] = 20.0
    """(iterations) the largest time constant."""

    name: ClassVar[str] = "ctrnn"
    max_outputs: ClassVar[int] = 64
    n_memory: ClassVar[int] = 2

    def genome(self, n_inputs: int, n_outputs: int) -> Genome:
        """Return the parts of a network: hidden neurons."""
        return Genome(self.n_hidden, self.max_hidden, n_inputs + self.n_hidden + 2 + n_outputs)

    def mind(self, n_inputs: int, n_outputs: int) -> Mind:
        """Return the Warp side."""
        shape = CtrnnShape()
        shape.n_inputs, shape.n_context, shape.n_outputs = n_inputs, self.n_hidden, n_outputs
        shape.n_slots, shape.weight_scale = self.max_hidden, self.weight_scale
        shape.slowest = self.slowest
        feeds = n_inputs + self.n_hidden
        return Mind(
            weights=CtrnnWeights,
            memory=CtrnnMemory,
            shape=shape,
            shape_type=CtrnnShape,
            sizes={"slots": self.max_hidden, "feeds": feeds, "outputs": n_outputs},
            load=load,
            clear=clear,
            think=(
                Phase(step, n_neurons, "q"),
                Phase(activate, n_neurons, "q"),
                Phase(sum_up, n_sums, "q"),
            ),
            probe="hidden",
        )

    def forward(
        self, genes: Floats, active: Bools, memory: Floats, inputs: Floats, n_outputs: int
    ) -> tuple[Floats, Floats]:
        """Run robots' networks once; see ``controllers.protocol.Controller``."""
        f, scale = np.float32, np.float32(self.weight_scale)
        hidden, state = memory[:, :, 0], memory[:, :, 1]
        seen = np.concatenate([inputs, hidden[:, : self.n_hidden]], axis=1)
        n = seen.shape[1]
        drive = scale * genes[:, :, n]
        for j in range(n):
            drive = drive + scale * genes[:, :, j] * seen[:, j, None]
        share = f(0.5) * (genes[:, :, n + 1] + f(1))
        rate = f(1) / (f(1) + share * (f(self.slowest) - f(1)))
        state = np.where(active, state + rate * (drive - state), f(0))
        hidden = np.where(active, sigmoid_of(state), f(0))
        outputs = np.zeros((len(inputs), n_outputs), np.float32)
        for k in range(active.shape[1]):
            weights = scale * genes[:, k, n + 2 :]
            summed = outputs + weights * hidden[:, k, None]
            outputs = np.where(active[:, k, None], summed, outputs)
        return outputs, np.stack([hidden, state], axis=2)
