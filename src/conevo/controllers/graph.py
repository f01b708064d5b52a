"""A network of any topology, built from its nodes: the controller that NEAT evolves.

Stanley and Miikkulainen 2002, "Evolving neural networks through augmenting topologies". A genotype
is one node: the weights of its connections from every input, from a bias of 1 and from every node,
then its place in the order of nodes. A gene of exactly 0 is not a connection. The first slots are
the output nodes, the others hidden nodes.

A connection from a node with a lower place has its activation of this iteration, any other that of
the previous iteration; output nodes come after all hidden nodes. So a network with connections to
higher places only is feed-forward, and any other is recurrent; its method decides. If all hidden
nodes have the same place, their connections are the context of a simple recurrent network.

Choice: activations are those of the plain sigmoid, like those of the other controllers. The slope
of 4.9 in the source is part of ``weight_scale``.
Choice: signals pass all nodes in one iteration, so that depth does not delay a robot's reactions.
Choice: networks start without hidden nodes, as those of NEAT do.

A kernel sees nodes by level, the longest path to them from nodes without a lower source, ``WIDE``
nodes at a time, padded with weights of 0. A level is computed at once.
"""

from typing import Annotated, Any, ClassVar

import numpy as np
import warp as wp
from annotated_types import Ge, Gt, Le

from conevo.controllers.protocol import Bools, Floats, Genome, Mind
from conevo.kernels.arrays import named_arrays
from conevo.kernels.outputs import sigmoid, sigmoid_of
from conevo.parameters import parameters

__all__ = ["Graph"]

WIDE = wp.constant(16)
node_vector = wp.types.vector(length=16, dtype=float)


@wp.struct
class GraphShape:
    """Sizes of a network as the kernels need them. A slot has room for one node."""

    n_inputs: int
    n_outputs: int
    n_slots: int
    n_chunks: int
    weight_scale: float


@named_arrays
class GraphWeights:
    """Nodes and connections of a team's networks.

    Positions are nodes by level, then by slot, the first n_nodes; a chunk is 16 of them. slot, end:
    of each position its slot, and the end of its level in its chunk. feeds: whether its node has a
    connection to a higher place. late: slots of the n_late nodes with a connection to the same or a
    lower place. bias, w_in, w_late, w_now: weights of a chunk from the bias, an input, such a slot,
    a position.
    """

    n_nodes: wp.array[int]
    n_late: wp.array[int]
    level: Annotated[wp.array[int], "robots", "slots"]
    slot: Annotated[wp.array[int], "robots", "positions"]
    end: Annotated[wp.array[int], "robots", "positions"]
    feeds: Annotated[wp.array[int], "robots", "positions"]
    late: Annotated[wp.array[int], "robots", "slots"]
    bias: Annotated[wp.array[node_vector], "robots", "chunks"]
    w_in: Annotated[wp.array[node_vector], "robots", "chunks", "inputs"]
    w_late: Annotated[wp.array[node_vector], "robots", "chunks", "slots"]
    w_now: Annotated[wp.array[node_vector], "robots", "chunks", "positions"]


@named_arrays
class GraphMemory:
    """Activations of a team's nodes, 0 in empty slots; coming: by position, in this iteration."""

    hidden: Annotated[wp.array[float], "robots", "slots"]
    coming: Annotated[wp.array[float], "robots", "positions"]


@wp.func
def place_of(shape: GraphShape, genes: wp.array2d[float], row: int, slot: int) -> float:
    """Return a node's place; that of output nodes is above all others."""
    if slot < shape.n_outputs:
        return 2.0
    return genes[row, shape.n_inputs + 1 + shape.n_slots]


@wp.func
def weight_of(
    shape: GraphShape,
    i: int,
    genes: wp.array2d[float],
    rows: wp.array3d[int],
    n: int,
    source: int,
    target: int,
    is_now: bool,
) -> float:
    """Return the weight of a connection of this iteration, or of the previous one; 0 without."""
    before = rows[n, i, source]
    row = rows[n, i, target]
    if before < 0 or row < 0:
        return 0.0
    is_lower = place_of(shape, genes, before, source) < place_of(shape, genes, row, target)
    if is_lower != is_now:
        return 0.0
    return shape.weight_scale * genes[row, shape.n_inputs + 1 + source]


@wp.func
def load(
    weights: GraphWeights,
    shape: GraphShape,
    i: int,
    genes: wp.array2d[float],
    rows: wp.array3d[int],
    n: int,
) -> None:
    """Build robot ``i``'s network from node genotypes; see ``controllers.protocol.Mind``."""
    first = i * shape.n_slots
    at = i * shape.n_chunks * WIDE
    for slot in range(shape.n_slots):
        weights.level[first + slot] = 0
    changes = int(1)
    while changes > 0:
        changes = int(0)
        for target in range(shape.n_slots):
            level = int(weights.level[first + target])
            for source in range(shape.n_slots):
                if weight_of(shape, i, genes, rows, n, source, target, True) != 0.0:
                    level = wp.max(level, weights.level[first + source] + 1)
            if level != weights.level[first + target]:
                weights.level[first + target] = level
                changes += 1
    nodes = int(0)
    for level in range(shape.n_slots):
        begin = int(nodes)
        for slot in range(shape.n_slots):
            if rows[n, i, slot] >= 0 and weights.level[first + slot] == level:
                weights.slot[at + nodes] = slot
                nodes += 1
        for k in range(begin, nodes):
            weights.end[at + k] = wp.min(nodes, (k // WIDE + 1) * WIDE)
    weights.n_nodes[i] = nodes
    late = int(0)
    for source in range(shape.n_slots):
        count = int(0)
        for target in range(shape.n_slots):
            if weight_of(shape, i, genes, rows, n, source, target, False) != 0.0:
                count += 1
        if count > 0:
            weights.late[first + late] = source
            late += 1
    weights.n_late[i] = late
    for k in range(nodes):
        weights.feeds[at + k] = 0
    for chunk in range((nodes + WIDE - 1) // WIDE):
        c = i * shape.n_chunks + chunk
        n_here = wp.min(nodes - chunk * WIDE, WIDE)
        bias = node_vector()
        for k in range(n_here):
            row = rows[n, i, weights.slot[at + chunk * WIDE + k]]
            bias[k] = shape.weight_scale * genes[row, shape.n_inputs]
        weights.bias[c] = bias
        for j in range(shape.n_inputs):
            w = node_vector()
            for k in range(n_here):
                row = rows[n, i, weights.slot[at + chunk * WIDE + k]]
                w[k] = shape.weight_scale * genes[row, j]
            weights.w_in[c * shape.n_inputs + j] = w
        for m in range(late):
            w = node_vector()
            source = weights.late[first + m]
            for k in range(n_here):
                target = weights.slot[at + chunk * WIDE + k]
                w[k] = weight_of(shape, i, genes, rows, n, source, target, False)
            weights.w_late[c * shape.n_slots + m] = w
        for p in range(nodes):
            w = node_vector()
            source = weights.slot[at + p]
            for k in range(n_here):
                target = weights.slot[at + chunk * WIDE + k]
                w[k] = weight_of(shape, i, genes, rows, n, source, target, True)
                if w[k] != 0.0:
                    weights.feeds[at + p] = 1
            weights.w_now[c * shape.n_chunks * WIDE + p] = w


@wp.func
def clear(memory: GraphMemory, shape: GraphShape, i: int) -> None:
    """Reset robot ``i``'s memory."""
    for slot in range(shape.n_slots):
        memory.hidden[i * shape.n_slots + slot] = 0.0
    for k in range(shape.n_chunks * WIDE):
        memory.coming[i * shape.n_chunks * WIDE + k] = 0.0


@wp.func
def think(
    weights: GraphWeights,
    memory: GraphMemory,
    shape: GraphShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    i: int,
) -> None:
    """Run robot ``i``'s network once; an output is the weighted sum of its node, 0 without one."""
    o = int(0)
    while o < shape.n_outputs:  # not range: see worlds.rover.dynamics
        outputs[i, o] = 0.0
        o += 1
    first = i * shape.n_slots
    at = i * shape.n_chunks * WIDE
    nodes = weights.n_nodes[i]
    begin = int(0)
    while begin < nodes:
        c = i * shape.n_chunks + begin // WIDE
        total = weights.bias[c]
        j = int(0)
        while j < shape.n_inputs:
            total += weights.w_in[c * shape.n_inputs + j] * inputs[i, j]
            j += 1
        m = int(0)
        while m < weights.n_late[i]:
            total += (
                weights.w_late[c * shape.n_slots + m]
                * memory.hidden[first + weights.late[first + m]]
            )
            m += 1
        now = c * shape.n_chunks * WIDE
        p = int(0)
        while p < begin:
            if weights.feeds[at + p] != 0:
                total += weights.w_now[now + p] * memory.coming[at + p]
            p += 1
        last = wp.min(begin + WIDE, nodes)
        while p < last:
            h = total
            k = int(0)
            while k < WIDE:  # all of them: compilers turn this loop into vector instructions
                h[k] = sigmoid(h[k])
                k += 1
            end = weights.end[at + p]
            q = int(p)
            while q < end:
                memory.coming[at + q] = h[q - begin]
                slot = weights.slot[at + q]
                if slot < shape.n_outputs:
                    outputs[i, slot] = total[q - begin]
                q += 1
            q = p
            while q < end:
                if weights.feeds[at + q] != 0:
                    total += weights.w_now[now + q] * memory.coming[at + q]
                q += 1
            p = end
        begin += WIDE
    # Written only now: every chunk must read the activations of the previous iteration.
    p = int(0)
    while p < nodes:
        memory.hidden[first + weights.slot[at + p]] = memory.coming[at + p]
        p += 1


@parameters("controller")
class Graph:
    """Settings of a network of any topology; see the module."""

    max_hidden: Annotated[int, Ge(0), Le(32)] = 20
    """(neurons) hidden nodes at most."""
    weight_scale: Annotated[float, Gt(0), Le(1000)] = 10.0
    """connection weight, or bias, of gene 1."""

    name: ClassVar[str] = "graph"
    max_outputs: ClassVar[int] = 64
    n_memory: ClassVar[int] = 1

    def genome(self, n_inputs: int, n_outputs: int) -> Genome:
        """Return the parts of a network: output nodes at the start, and hidden nodes."""
        n_slots = n_outputs + self.max_hidden
        return Genome(n_outputs, n_slots, n_inputs + 1 + n_slots + 1)

    def mind(self, n_inputs: int, n_outputs: int) -> Mind:
        """Return the Warp side."""
        shape = GraphShape()
        shape.n_inputs, shape.n_outputs = n_inputs, n_outputs
        shape.n_slots = n_slots = n_outputs + self.max_hidden
        shape.n_chunks = chunks = -(-n_slots // int(WIDE))
        shape.weight_scale = self.weight_scale
        sizes = {"slots": n_slots, "chunks": chunks, "positions": chunks * int(WIDE)}
        return Mind(
            weights=GraphWeights,
            memory=GraphMemory,
            shape=shape,
            shape_type=GraphShape,
            sizes=sizes | {"inputs": n_inputs},
            load=load,
            clear=clear,
            think=think,
            probe="hidden",
        )

    def forward(
        self, genes: Floats, active: Bools, memory: Floats, inputs: Floats, n_outputs: int
    ) -> tuple[Floats, Floats]:
        """Run robots' networks once; see ``controllers.protocol.Controller``."""
        (n_robots, n_slots), n = active.shape, inputs.shape[1]
        robots = np.arange(n_robots)
        weights = np.float32(self.weight_scale) * genes
        slots = np.arange(n_slots)
        place = np.where(slots < n_outputs, np.float32(2), genes[:, :, -1])
        between = weights[:, :, n + 1 : n + 1 + n_slots]  # [R, target, source]
        between = np.where(active[:, None] & active[:, :, None], between, np.float32(0))
        is_lower = place[:, None] < place[:, :, None]
        now, late = np.where(is_lower, between, 0), np.where(is_lower, 0, between)
        level: Any = np.zeros((n_robots, n_slots), np.int64)
        for _ in slots:
            level = np.where(now != 0, level[:, None] + 1, 0).max(axis=2, initial=0)
        order = np.argsort(np.where(active, level, n_slots), axis=1, kind="stable")
        at = robots[:, None], order
        now, late, weights, level = now[at], late[at], weights[at], level[at]
        now = np.take_along_axis(now, order[:, None], axis=2)  # [R, position, position]
        total = weights[:, :, n]
        for j in range(n):
            total = total + weights[:, :, j] * inputs[:, j, None]
        for j in range(n_slots):
            does = (late[:, :, j] != 0).any(axis=1)[:, None]
            total = np.where(does, total + late[:, :, j] * memory[:, j, 0, None], total)
        chunk = slots // int(WIDE)
        used = active[at]
        for k in range(n_slots):
            feeds = (now[:, :, k] != 0).any(axis=1)[:, None]
            does = feeds & ((chunk > chunk[k]) | (level > level[:, k, None]))
            fed = total + now[:, :, k] * sigmoid_of(total[:, k])[:, None]
            total = np.where(does, fed, total)
        hidden = np.zeros(active.shape, np.float32)
        hidden[at] = np.where(used, sigmoid_of(total), np.float32(0))
        sums = np.zeros(active.shape, np.float32)
        sums[at] = np.where(used, total, np.float32(0))
        return sums[:, :n_outputs], hidden[:, :, None]
