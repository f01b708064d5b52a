"""A gated recurrent unit network: hidden neurons that learn what to keep and what to forget.

Cho et al. 2014, "Learning phrase representations using RNN encoder-decoder", section 2.3::

    r = sigmoid(W_r x + U_r h + b_r)                 reset gate
    z = sigmoid(W_z x + U_z h + b_z)                 update gate
    c = tanh(W_c x + U_c (r * h) + b_c)              candidate
    h = z h + (1 - z) c

A genotype is one hidden neuron: weights of inputs, recurrent weights and bias of its reset gate, of
its update gate and of its candidate, then its output weights. Outputs are weighted sums of h.

Choice: recurrent connections lead from slots k < n_hidden only, as the context of the simple
recurrent network does, so that all genotypes of a world have the same length.
"""

from typing import Annotated, ClassVar

import numpy as np
import warp as wp
from annotated_types import Gt, Le

from conevo.controllers.protocol import Bools, Floats, Genome, Mind
from conevo.controllers.slots import Slots, n_neurons, n_sums, sum_up
from conevo.kernels.arrays import named_arrays
from conevo.kernels.outputs import sigmoid, sigmoid_of
from conevo.kernels.phases import Phase
from conevo.parameters import parameters

__all__ = ["Gru"]

RESET = wp.constant(0)
UPDATE = wp.constant(1)
CANDIDATE = wp.constant(2)


@wp.struct
class GruShape:
    """Sizes of a network as the kernels need them."""

    n_inputs: int
    n_context: int
    n_outputs: int
    n_slots: int
    weight_scale: float


@named_arrays
class GruWeights:
    """Weights of a team's networks.

    Gates: reset gate, update gate and candidate. Feeds: inputs, context, and the bias last.
    """

    w_in: Annotated[wp.array[float], "robots", "slots", "gates", "feeds"]
    w_out: Annotated[wp.array[float], "robots", "slots", "outputs"]
    filled: Annotated[wp.array[int], "robots", "slots"]


@named_arrays
class GruMemory:
    """Activations of a team's neurons, and three arrays to compute them; 0 in empty slots."""

    hidden: Annotated[wp.array[float], "robots", "slots"]
    reset: Annotated[wp.array[float], "robots", "slots"]
    update: Annotated[wp.array[float], "robots", "slots"]
    candidate: Annotated[wp.array[float], "robots", "slots"]


@wp.func
def load(
    weights: GruWeights,
    shape: GruShape,
    i: int,
    genes: wp.array2d[float],
    rows: wp.array3d[int],
    n: int,
) -> None:
    """Build robot ``i``'s network from neuron genotypes; see ``controllers.protocol.Mind``."""
    size = 3 * (shape.n_inputs + shape.n_context + 1)
    for k in range(shape.n_slots):
        slot = i * shape.n_slots + k
        row = rows[n, i, k]
        weights.filled[slot] = int(row >= 0)
        if row >= 0:
            for j in range(size):
                weights.w_in[slot * size + j] = shape.weight_scale * genes[row, j]
            for o in range(shape.n_outputs):
                weight = shape.weight_scale * genes[row, size + o]
                weights.w_out[slot * shape.n_outputs + o] = weight


@wp.func
def clear(memory: GruMemory, shape: GruShape, i: int) -> None:
    """Reset robot ``i``'s memory."""
    for k in range(shape.n_slots):
        memory.hidden[i * shape.n_slots + k] = 0.0
        memory.reset[i * shape.n_slots + k] = 0.0


@wp.func
def drive(
    weights: GruWeights, shape: GruShape, inputs: wp.array2d[float], i: int, slot: int, gate: int
) -> float:
    """Return bias and weighted inputs of one gate of a neuron."""
    seen = shape.n_inputs + shape.n_context
    at = (slot * 3 + gate) * (seen + 1)
    total = weights.w_in[at + seen]
    j = int(0)
    while j < shape.n_inputs:
        total += weights.w_in[at + j] * inputs[i, j]
        j += 1
    return total


@wp.func
def recurrent(shape: GruShape, slot: int, gate: int) -> int:
    """Return the index of the first recurrent weight of a gate of a neuron."""
    return (slot * 3 + gate) * (shape.n_inputs + shape.n_context + 1) + shape.n_inputs


@wp.func
def open_gates(
    weights: GruWeights,
    memory: GruMemory,
    shape: GruShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
    q: int,
) -> None:
    """Compute the reset and the update gate of neuron ``q`` of the team."""
    i = q // shape.n_slots
    if heuristic[i] >= 0 or weights.filled[q] == 0:
        return
    first = i * shape.n_slots
    reset = drive(weights, shape, inputs, i, q, RESET)
    update = drive(weights, shape, inputs, i, q, UPDATE)
    at = recurrent(shape, q, RESET)
    also = recurrent(shape, q, UPDATE)
    j = int(0)
    while j < shape.n_context:
        reset += weights.w_in[at + j] * memory.hidden[first + j]
        update += weights.w_in[also + j] * memory.hidden[first + j]
        j += 1
    memory.reset[q] = sigmoid(reset)
    memory.update[q] = sigmoid(update)


@wp.func
def propose(
    weights: GruWeights,
    memory: GruMemory,
    shape: GruShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
    q: int,
) -> None:
    """Compute the candidate activation of neuron ``q``, from all reset gates of its robot."""
    i = q // shape.n_slots
    if heuristic[i] >= 0 or weights.filled[q] == 0:
        return
    first = i * shape.n_slots
    total = drive(weights, shape, inputs, i, q, CANDIDATE)
    at = recurrent(shape, q, CANDIDATE)
    j = int(0)
    while j < shape.n_context:
        kept = memory.reset[first + j] * memory.hidden[first + j]
        total += weights.w_in[at + j] * kept
        j += 1
    memory.candidate[q] = 2.0 * sigmoid(2.0 * total) - 1.0


@wp.func
def activate(
    weights: GruWeights,
    memory: GruMemory,
    shape: GruShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
    q: int,
) -> None:
    """Move neuron ``q``'s activation to its candidate, as far as its update gate is open."""
    if heuristic[q // shape.n_slots] < 0 and weights.filled[q] != 0:
        z = memory.update[q]
        memory.hidden[q] = z * memory.hidden[q] + (1.0 - z) * memory.candidate[q]


@parameters("controller")
class Gru(Slots):
    """Settings of a gated recurrent unit network; see the module."""

    weight_scale: Annotated[float, Gt(0), Le(1000)] = 10.0
    """connection weight, or bias, of gene 1."""

    name: ClassVar[str] = "gru"
    max_outputs: ClassVar[int] = 64
    n_memory: ClassVar[int] = 1

    def genome(self, n_inputs: int, n_outputs: int) -> Genome:
        """Return the parts of a network: hidden neurons."""
        n_genes = 3 * (n_inputs + self.n_hidden + 1) + n_outputs
        return Genome(self.n_hidden, self.max_hidden, n_genes)

    def mind(self, n_inputs: int, n_outputs: int) -> Mind:
        """Return the Warp side."""
        shape = GruShape()
        shape.n_inputs, shape.n_context, shape.n_outputs = n_inputs, self.n_hidden, n_outputs
        shape.n_slots, shape.weight_scale = self.max_hidden, self.weight_scale
        feeds = n_inputs + self.n_hidden + 1
        return Mind(
            weights=GruWeights,
            memory=GruMemory,
            shape=shape,
            shape_type=GruShape,
            sizes={"slots": self.max_hidden, "gates": 3, "feeds": feeds, "outputs": n_outputs},
            load=load,
            clear=clear,
            think=(
                Phase(open_gates, n_neurons, "q"),
                Phase(propose, n_neurons, "q"),
                Phase(activate, n_neurons, "q"),
                Phase(sum_up, n_sums, "q"),
            ),
            probe="hidden",
        )

    def forward(
        self, genes: Floats, active: Bools, memory: Floats, inputs: Floats, n_outputs: int
    ) -> tuple[Floats, Floats]:
        """Run robots' networks once; see ``controllers.protocol.Controller``."""
        f, hidden = np.float32, memory[:, :, 0]
        weights = f(self.weight_scale) * genes
        context = hidden[:, : self.n_hidden]
        seen = inputs.shape[1] + self.n_hidden

        def summed(gate: int, context: Floats) -> Floats:
            at = gate * (seen + 1)
            total = weights[:, :, at + seen]
            for j, values in enumerate(np.concatenate([inputs, context], axis=1).T):
                total = total + weights[:, :, at + j] * values[:, None]
            return total

        reset, update = (np.where(active, sigmoid_of(summed(g, context)), f(0)) for g in (0, 1))
        total = summed(2, reset[:, : self.n_hidden] * context)
        candidate = f(2) * sigmoid_of(f(2) * total) - f(1)
        hidden = np.where(active, update * hidden + (f(1) - update) * candidate, f(0))
        outputs = np.zeros((len(inputs), n_outputs), np.float32)
        for k in range(active.shape[1]):
            more = outputs + weights[:, k, 3 * (seen + 1) :] * hidden[:, k, None]
            outputs = np.where(active[:, k, None], more, outputs)
        return outputs, hidden[:, :, None]
