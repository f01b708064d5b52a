"""A simple recurrent (Elman) network built from neuron genotypes: the thesis' controller.

Nitschke 2009, sections 3.1, 4.1, 5.2 and 6.2.7. One hidden layer of sigmoid units sees the inputs
and the hidden layer's own activations of the previous iteration. A genotype is one hidden neuron:
its input weights (inputs, then context) followed by its output weights. A connection weight is
``weight_scale`` times its gene.

Choice: the context keeps the *initial* number of hidden units. Hidden neurons are in numbered
slots. Slot k < n_hidden feeds context input k, an empty slot feeds 0, and slots from n_hidden on
feed no context. So all genotypes of a world have the same length, and recombination between
populations is always defined (the thesis fixes the inputs while the hidden layer changes).

The shape is data (``Shape``), so one compiled kernel serves every size of network in a world.
Hidden slots are computed ``WIDE`` at a time.
"""

from typing import Annotated, ClassVar

import numpy as np
import warp as wp
from annotated_types import Gt, Le

from conevo.controllers.protocol import Bools, Floats, Genome, Mind
from conevo.controllers.slots import Slots
from conevo.kernels.arrays import named_arrays
from conevo.kernels.outputs import sigmoid, sigmoid_of
from conevo.kernels.phases import Phase
from conevo.parameters import parameters

__all__ = ["Srn"]

WIDE = wp.constant(16)
OUT = wp.constant(8)
wide_vector = wp.types.vector(length=16, dtype=float)
out_vector = wp.types.vector(length=8, dtype=float)


@wp.struct
class SrnShape:
    """Sizes of a network as the kernels need them."""

    n_sensors: int
    n_context: int
    n_inputs: int
    n_outputs: int
    n_slots: int
    n_chunks: int
    weight_scale: float
    bias: float


@named_arrays
class SrnWeights:
    """Weights of a team's networks (or, flat, of a batch of teams).

    A chunk is 16 slots. Feeds: inputs, then context. filled: 1 where a slot contains a neuron.
    n_used: one above the last filled slot. neurons: the filled slots of all robots, the first
    n_neurons.
    """

    w_in: Annotated[wp.array[wide_vector], "robots", "chunks", "feeds"]
    w_out: Annotated[wp.array[out_vector], "robots", "slots"]
    filled: Annotated[wp.array[wide_vector], "robots", "chunks"]
    n_used: wp.array[int]
    neurons: Annotated[wp.array[int], "robots", "slots"]
    n_neurons: Annotated[wp.array[int], "team"]


@named_arrays
class SrnMemory:
    """Activations of a team's hidden neurons, 0 in empty slots, and their next activations."""

    hidden: Annotated[wp.array[float], "robots", "slots"]
    coming: Annotated[wp.array[float], "robots", "slots"]


@wp.func
def load(
    weights: SrnWeights,
    shape: SrnShape,
    i: int,
    genes: wp.array2d[float],
    rows: wp.array3d[int],
    n: int,
) -> None:
    """Build robot ``i``'s network from neuron genotypes; see ``controllers.protocol.Mind``."""
    used = int(0)
    for chunk in range(shape.n_chunks):
        filled = wide_vector()
        for k in range(WIDE):
            slot = chunk * WIDE + k
            row = int(-1)
            if slot < shape.n_slots:
                row = rows[n, i, slot]
            out = out_vector()
            if row >= 0:
                used = slot + 1
                filled[k] = 1.0
                for o in range(shape.n_outputs):
                    out[o] = shape.weight_scale * genes[row, shape.n_inputs + o]
            weights.w_out[(i * shape.n_chunks + chunk) * WIDE + k] = out
        weights.filled[i * shape.n_chunks + chunk] = filled
        for j in range(shape.n_inputs):
            w = wide_vector()
            for k in range(WIDE):
                slot = chunk * WIDE + k
                if filled[k] > 0.0:
                    w[k] = shape.weight_scale * genes[rows[n, i, slot], j]
            weights.w_in[(i * shape.n_chunks + chunk) * shape.n_inputs + j] = w
    weights.n_used[i] = used


@wp.func
def clear(memory: SrnMemory, shape: SrnShape, i: int) -> None:
    """Reset robot ``i``'s memory."""
    slots = shape.n_chunks * WIDE
    for k in range(slots):
        memory.hidden[i * slots + k] = 0.0
        memory.coming[i * slots + k] = 0.0


@wp.func
def think(
    weights: SrnWeights,
    memory: SrnMemory,
    shape: SrnShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    i: int,
) -> None:
    """Run robot ``i``'s network once: inputs to output sums, hidden activations to next context.

    An output is the weighted sum of its unit. The highest sum is the highest activation, even where
    several activations round to exactly 1. An empty slot neither contributes to an output nor feeds
    the context.
    """
    hidden = i * shape.n_chunks * WIDE
    used = weights.n_used[i]
    first = wide_vector()
    out = out_vector()
    k = int(0)
    while k < OUT:
        out[k] = shape.bias
        k += 1
    for chunk in range((used + WIDE - 1) // WIDE):
        c = i * shape.n_chunks + chunk
        h = wide_vector()
        k = int(0)
        while k < WIDE:
            h[k] = shape.bias
            k += 1
        w = c * shape.n_inputs
        j = int(0)
        while j < shape.n_sensors:  # not range: see worlds.rover.dynamics
            h += weights.w_in[w + j] * inputs[i, j]
            j += 1
        w += shape.n_sensors
        j = int(0)
        while j < shape.n_context:
            h += weights.w_in[w + j] * memory.hidden[hidden + j]
            j += 1
        k = int(0)
        while k < WIDE:
            h[k] = sigmoid(h[k])
            k += 1
        h = wp.cw_mul(h, weights.filled[c])
        k = int(0)
        while k < wp.min(used - chunk * WIDE, WIDE):
            out += weights.w_out[c * WIDE + k] * h[k]
            k += 1
        if chunk == 0:
            first = h
        else:
            k = int(0)
            while k < WIDE:
                memory.hidden[hidden + chunk * WIDE + k] = h[k]
                k += 1
    # Written only now: every chunk must read the context of the previous iteration.
    k = int(0)
    while k < WIDE:
        memory.hidden[hidden + k] = first[k]
        k += 1
    o = int(0)
    while o < shape.n_outputs:
        outputs[i, o] = out[o]
        o += 1


@wp.func
def join(weights: SrnWeights, shape: SrnShape, robots: int) -> None:
    """List the neurons of all robots."""
    n = int(0)
    for slot in range(robots * shape.n_chunks * WIDE):
        if weights.filled[slot // WIDE][slot % WIDE] > 0.0:
            weights.neurons[n] = slot
            n += 1
    weights.n_neurons[0] = n


FLOAT_AT = "return ((const float*)rows.data)[at];"


@wp.func_native(FLOAT_AT)
def in_at(rows: wp.array[wide_vector], at: int) -> float:  # type: ignore[empty-body]
    """Return one weight of many vectors."""


@wp.func_native(FLOAT_AT)
def out_at(rows: wp.array[out_vector], at: int) -> float:  # type: ignore[empty-body]
    """Return one weight of many vectors."""


@wp.func
def n_neurons(
    weights: SrnWeights,
    memory: SrnMemory,
    shape: SrnShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
) -> int:
    """Return the number of hidden neurons in a team."""
    return weights.n_neurons[0]


@wp.func
def think_neuron(
    weights: SrnWeights,
    memory: SrnMemory,
    shape: SrnShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
    q: int,
) -> None:
    """Compute the next activation of neuron ``q`` of the team, as ``think`` does."""
    slot = weights.neurons[q]
    chunk = slot // WIDE
    i = chunk // shape.n_chunks
    if heuristic[i] >= 0:
        return
    at = chunk * shape.n_inputs * WIDE + slot % WIDE
    h = float(shape.bias)
    j = int(0)
    while j < shape.n_sensors:
        h += in_at(weights.w_in, at) * inputs[i, j]
        at += WIDE
        j += 1
    j = int(0)
    while j < shape.n_context:
        h += in_at(weights.w_in, at) * memory.hidden[i * shape.n_chunks * WIDE + j]
        at += WIDE
        j += 1
    memory.coming[slot] = sigmoid(h)


@wp.func
def n_sums(
    weights: SrnWeights,
    memory: SrnMemory,
    shape: SrnShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
) -> int:
    """Return the number of output units for which a team has room."""
    return inputs.shape[0] * OUT


@wp.func
def think_sum(
    weights: SrnWeights,
    memory: SrnMemory,
    shape: SrnShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
    q: int,
) -> None:
    """Compute output ``q`` of the team, as ``think`` does; copy next activations to the context.

    An output reads the next activations but no context, so both can be done in one phase.
    """
    i = q // OUT
    o = q % OUT
    if heuristic[i] >= 0:
        return
    first = i * shape.n_chunks * WIDE
    k = int(o)
    while k < shape.n_chunks * WIDE:
        memory.hidden[first + k] = memory.coming[first + k]
        k += OUT
    if o >= shape.n_outputs:
        return
    out = float(shape.bias)
    used = weights.n_used[i]
    k = int(0)
    while k < used:
        out += out_at(weights.w_out, (first + k) * OUT + o) * memory.coming[first + k]
        k += 1
    outputs[i, o] = out


@parameters("controller")
class Srn(Slots):
    """Settings of a simple recurrent network; see the module."""

    recurrent: bool = True
    """whether it has context inputs; without them it is feed-forward."""
    bias: bool = False
    """whether hidden and output units have a bias of 1, which is not evolved."""
    weight_scale: Annotated[float, Gt(0), Le(1000)] = 10.0
    """connection weight of gene 1 (tables 4.3, 5.5, 6.5: weights in [-10, 10])."""

    name: ClassVar[str] = "srn"
    max_outputs: ClassVar[int] = 8
    n_memory: ClassVar[int] = 1

    @property
    def n_context(self) -> int:
        """Number of context inputs: the initial number of hidden units, 0 if feed-forward."""
        return self.n_hidden if self.recurrent else 0

    def genome(self, n_inputs: int, n_outputs: int) -> Genome:
        """Return the parts of a network: hidden neurons."""
        return Genome(self.n_hidden, self.max_hidden, n_inputs + self.n_context + n_outputs)

    def mind(self, n_inputs: int, n_outputs: int) -> Mind:
        """Return the Warp side."""
        shape = SrnShape()
        shape.n_sensors = n_inputs
        shape.n_context = self.n_context
        shape.n_inputs = n_inputs + self.n_context
        shape.n_outputs = n_outputs
        shape.n_slots = self.max_hidden
        shape.n_chunks = chunks = -(-self.max_hidden // int(WIDE))
        shape.weight_scale = self.weight_scale
        shape.bias = float(self.bias)
        return Mind(
            weights=SrnWeights,
            memory=SrnMemory,
            shape=shape,
            shape_type=SrnShape,
            sizes={"chunks": chunks, "slots": chunks * int(WIDE), "feeds": shape.n_inputs},
            load=load,
            clear=clear,
            think=think,
            probe="hidden",
            shared=(Phase(think_neuron, n_neurons, "q"), Phase(think_sum, n_sums, "q")),
            join=join,
        )

    def forward(
        self, genes: Floats, active: Bools, memory: Floats, inputs: Floats, n_outputs: int
    ) -> tuple[Floats, Floats]:
        """Run robots' networks once; see ``controllers.protocol.Controller``."""
        weights = np.float32(self.weight_scale) * genes
        context = memory[:, : self.n_context, 0]
        seen = np.concatenate([inputs, context], axis=1)
        hidden = np.full(active.shape, np.float32(self.bias))
        for j in range(seen.shape[1]):
            hidden = hidden + weights[:, :, j] * seen[:, j, None]
        hidden = sigmoid_of(hidden) * active
        outputs = np.full((len(inputs), n_outputs), np.float32(self.bias))
        for k in range(active.shape[1]):
            filled = outputs + weights[:, k, seen.shape[1] :] * hidden[:, k, None]
            outputs = np.where(active[:, k, None], filled, outputs)
        return outputs, hidden[:, :, None]
