"""The controller inside a kernel: a simple recurrent network with slots for hidden neurons.

Nitschke 2009, sections 3.1 and 5.2. The shape is data (``Shape``), so one compiled kernel serves
every size of controller a world can have. Hidden slots are computed ``WIDE`` at a time. The sigmoid
is the rational approximation of tanh, of degree 13 over 6, whose coefficients Eigen publishes.
"""

import warp as wp

__all__ = [
    "OUT",
    "WIDE",
    "Networks",
    "Shape",
    "first_input",
    "highest",
    "load",
    "out_vector",
    "sigmoid",
    "think",
    "wide_vector",
]

WIDE = wp.constant(16)
OUT = wp.constant(8)
wide_vector = wp.types.vector(length=16, dtype=float)
out_vector = wp.types.vector(length=8, dtype=float)


@wp.struct
class Shape:
    """Sizes of a controller (``controllers.ControllerSpec``) as the kernels need them."""

    n_sensors: int
    n_context: int
    n_inputs: int
    n_outputs: int
    n_slots: int
    n_chunks: int
    weight_scale: float
    bias: float


@wp.struct
class Networks:
    """Weights and activations of a team's networks (or, flat, of a batch of teams).

    w_in [R, chunks, inputs] of 16 slots; w_out [R, slots] of 8 outputs; filled [R, chunks] of 16
    slots, 1 where a slot holds a neuron; n_used [R], one above the last filled slot;
    inputs [R, inputs] (sensors, then context); sums [R] of 8: the output units' weighted sums.

    An output is ``sigmoid`` of its sum. The highest output is that of the highest sum, which is
    exact even where several outputs are 1 to the last bit.
    """

    w_in: wp.array[wide_vector]
    w_out: wp.array[out_vector]
    filled: wp.array[wide_vector]
    n_used: wp.array[int]
    inputs: wp.array[float]
    sums: wp.array[out_vector]


@wp.func
def load(
    nets: Networks, shape: Shape, i: int, genes: wp.array2d[float], slots: wp.array3d[int], n: int
) -> None:
    """Build robot ``i``'s network from neuron genotypes and clear its memory.

    Args:
        nets: networks of one team, to be filled.
        shape: sizes of a controller.
        i: the robot.
        genes: pool of neuron genotypes [K, G]: input weights, then output weights.
        slots: row of the pool for each slot [N, R, U], -1 for an empty slot.
        n: the team.
    """
    used = int(0)
    for chunk in range(shape.n_chunks):
        filled = wide_vector()
        for k in range(WIDE):
            slot = chunk * WIDE + k
            row = int(-1)
            if slot < shape.n_slots:
                row = slots[n, i, slot]
            out = out_vector()
            if row >= 0:
                used = slot + 1
                filled[k] = 1.0
                for o in range(shape.n_outputs):
                    out[o] = shape.weight_scale * genes[row, shape.n_inputs + o]
            nets.w_out[(i * shape.n_chunks + chunk) * WIDE + k] = out
        nets.filled[i * shape.n_chunks + chunk] = filled
        for j in range(shape.n_inputs):
            w = wide_vector()
            for k in range(WIDE):
                slot = chunk * WIDE + k
                if filled[k] > 0.0:
                    w[k] = shape.weight_scale * genes[slots[n, i, slot], j]
            nets.w_in[(i * shape.n_chunks + chunk) * shape.n_inputs + j] = w
    nets.n_used[i] = used
    for j in range(shape.n_inputs):
        nets.inputs[i * shape.n_inputs + j] = 0.0
    nets.sums[i] = out_vector()


@wp.func
def first_input(nets: Networks, i: int) -> int:
    """Return where robot ``i``'s inputs begin: its sensors, then its context."""
    return i * (nets.inputs.shape[0] // nets.n_used.shape[0])


@wp.func
def highest(nets: Networks, i: int, n: int) -> int:
    """Return the number of robot ``i``'s highest output of the first ``n``, the first of equals."""
    sums = nets.sums[i]
    best = int(0)
    for k in range(1, n):
        if sums[k] > sums[best]:
            best = k
    return best


@wp.func
def sigmoid(a: float) -> float:
    """Return the logistic function by a rational approximation, error below 1e-6, branch-free.

    The same operations on every target, unlike a library's exp.
    """
    h = wp.clamp(a * 0.5, -7.9, 7.9)
    q = h * h
    p = h * (
        4.89352455891786e-03
        + q
        * (
            6.37261928875436e-04
            + q
            * (
                1.48572235717979e-05
                + q
                * (
                    5.12229709037114e-08
                    + q
                    * (
                        -8.60467152213735e-11
                        + q * (2.00018790482477e-13 + q * -2.76076847742355e-16)
                    )
                )
            )
        )
    )
    d = 4.89352518554385e-03 + q * (
        2.26843463243900e-03 + q * (1.18534705686654e-04 + q * 1.19825839466702e-06)
    )
    return 0.5 + 0.5 * (p / d)


@wp.func
def think(nets: Networks, shape: Shape, i: int) -> None:
    """Run robot ``i``'s network once: inputs to output sums, hidden activations to next context.

    An empty slot neither contributes to an output nor feeds the context.
    """
    inputs = i * shape.n_inputs
    used = nets.n_used[i]
    first = wide_vector()
    out = out_vector()
    for k in range(OUT):
        out[k] = shape.bias
    for chunk in range((used + WIDE - 1) // WIDE):
        c = i * shape.n_chunks + chunk
        h = wide_vector()
        for k in range(WIDE):
            h[k] = shape.bias
        j = int(0)
        while j < shape.n_inputs:  # not range: see worlds.rover_dynamics
            h += nets.w_in[c * shape.n_inputs + j] * nets.inputs[inputs + j]
            j += 1
        for k in range(WIDE):
            h[k] = sigmoid(h[k])
        h = wp.cw_mul(h, nets.filled[c])
        k = int(0)
        while k < wp.min(used - chunk * WIDE, WIDE):
            out += nets.w_out[c * WIDE + k] * h[k]
            k += 1
        if chunk == 0:
            first = h
    # Written only now: every chunk must read the context of the previous iteration.
    for k in range(shape.n_context):
        nets.inputs[inputs + shape.n_sensors + k] = first[k]
    nets.sums[i] = out
