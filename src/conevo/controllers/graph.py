"""A network of any topology, built from its nodes: the controller that NEAT evolves.

Stanley and Miikkulainen 2002, "Evolving neural networks through augmenting topologies". A genotype
is one node: the weights of its connections from every input, from a bias of 1 and from every node,
then its place in the order of evaluation. A gene of exactly 0 is not a connection. The first slots
are the output nodes, the others hidden nodes.

Nodes are evaluated in order: hidden nodes by their place, lowest first, ties by slot, then output
nodes. A connection from an earlier node has its activation of this iteration, and a connection from
a later node, or from the node itself, that of the previous iteration. So a network without
connections against the order is feed-forward, and any other is recurrent; its method decides.

Choice: activations are those of the plain sigmoid, like those of the other controllers. The slope
of 4.9 in the source is part of ``weight_scale``.
Choice: signals pass all nodes in one iteration, so that depth does not delay a robot's reactions.
Choice: networks start without hidden nodes, as those of NEAT do.

A kernel sees padded lists: the nodes of a robot in order, and their connections in use.
"""

from typing import Annotated, ClassVar

import numpy as np
import warp as wp
from annotated_types import Ge, Gt, Le

from conevo.controllers.protocol import Bools, Floats, Genome, Mind
from conevo.kernels.arrays import named_arrays
from conevo.kernels.outputs import sigmoid, sigmoid_of
from conevo.parameters import parameters

__all__ = ["Graph"]


@wp.struct
class GraphShape:
    """Sizes of a network as the kernels need them. A slot has room for one node."""

    n_inputs: int
    n_outputs: int
    n_slots: int
    n_links: int
    weight_scale: float


@named_arrays
class GraphWeights:
    """Nodes and connections of a team's networks.

    order: the slots of the nodes in the order of evaluation, the first n_nodes. bias, split, end:
    of each node in order; its connections from inputs end before split, those from nodes before
    end. source: an input, or the slot of a node.
    """

    n_nodes: wp.array[int]
    order: Annotated[wp.array[int], "robots", "slots"]
    bias: Annotated[wp.array[float], "robots", "slots"]
    split: Annotated[wp.array[int], "robots", "slots"]
    end: Annotated[wp.array[int], "robots", "slots"]
    source: Annotated[wp.array[int], "robots", "links"]
    weight: Annotated[wp.array[float], "robots", "links"]


@named_arrays
class GraphMemory:
    """Activations of a team's nodes, 0 in empty slots."""

    hidden: Annotated[wp.array[float], "robots", "slots"]


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
    place = shape.n_inputs + 1 + shape.n_slots
    first = i * shape.n_slots
    nodes = int(0)
    for slot in range(shape.n_outputs, shape.n_slots):
        row = rows[n, i, slot]
        if row >= 0:
            k = int(nodes)
            while k > 0:
                before = weights.order[first + k - 1]
                if genes[row, place] >= genes[rows[n, i, before], place]:
                    break
                weights.order[first + k] = before
                k -= 1
            weights.order[first + k] = slot
            nodes += 1
    for slot in range(shape.n_outputs):
        if rows[n, i, slot] >= 0:
            weights.order[first + nodes] = slot
            nodes += 1
    weights.n_nodes[i] = nodes
    at = i * shape.n_links
    for k in range(nodes):
        row = rows[n, i, weights.order[first + k]]
        weights.bias[first + k] = shape.weight_scale * genes[row, shape.n_inputs]
        for j in range(shape.n_inputs):
            if genes[row, j] != 0.0:
                weights.source[at] = j
                weights.weight[at] = shape.weight_scale * genes[row, j]
                at += 1
        weights.split[first + k] = at
        for j in range(shape.n_slots):
            if rows[n, i, j] >= 0 and genes[row, shape.n_inputs + 1 + j] != 0.0:
                weights.source[at] = j
                weights.weight[at] = shape.weight_scale * genes[row, shape.n_inputs + 1 + j]
                at += 1
        weights.end[first + k] = at


@wp.func
def clear(memory: GraphMemory, shape: GraphShape, i: int) -> None:
    """Reset robot ``i``'s memory."""
    for slot in range(shape.n_slots):
        memory.hidden[i * shape.n_slots + slot] = 0.0


@wp.func
def think(
    weights: GraphWeights,
    memory: GraphMemory,
    shape: GraphShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    i: int,
) -> None:
    """Run robot ``i``'s network once; an output is the weighted sum of its node, 0 without one.

    Activations are overwritten in place: those of nodes not reached yet are of the last iteration.
    """
    o = int(0)
    while o < shape.n_outputs:  # not range: see worlds.rover.dynamics
        outputs[i, o] = 0.0
        o += 1
    first = i * shape.n_slots
    last = first + weights.n_nodes[i]
    at = int(i * shape.n_links)
    k = int(first)
    while k < last:
        total = float(weights.bias[k])
        split = weights.split[k]
        end = weights.end[k]
        while at < split:
            total += weights.weight[at] * inputs[i, weights.source[at]]
            at += 1
        while at < end:
            total += weights.weight[at] * memory.hidden[first + weights.source[at]]
            at += 1
        slot = weights.order[k]
        memory.hidden[first + slot] = sigmoid(total)
        if slot < shape.n_outputs:
            outputs[i, slot] = total
        k += 1


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
        shape.n_links = n_slots * (n_inputs + n_slots)
        shape.weight_scale = self.weight_scale
        return Mind(
            weights=GraphWeights,
            memory=GraphMemory,
            shape=shape,
            shape_type=GraphShape,
            sizes={"slots": n_slots, "links": shape.n_links},
            load=load,
            clear=clear,
            think=think,
            probe="hidden",
        )

    def forward(
        self, genes: Floats, active: Bools, memory: Floats, inputs: Floats, n_outputs: int
    ) -> tuple[Floats, Floats]:
        """Run robots' networks once; see ``controllers.protocol.Controller``."""
        robots, (n_robots, n_slots), n = np.arange(len(genes)), active.shape, inputs.shape[1]
        is_output = np.arange(n_slots) < n_outputs
        key = np.where(is_output, np.float32(2), genes[:, :, -1])  # after all places, by slot
        order = np.argsort(np.where(active, key, np.float32(3)), axis=1, kind="stable")
        exists = genes[:, :, : n + 1 + n_slots] != 0
        exists[:, :, n + 1 :] &= active[:, None]
        weights = np.float32(self.weight_scale) * genes
        hidden = np.where(active, memory[:, :, 0], np.float32(0))
        outputs = np.zeros((n_robots, n_outputs), np.float32)
        for k in range(n_slots):
            slot = order[:, k]
            used, own, there = active[robots, slot], weights[robots, slot], exists[robots, slot]
            total = own[:, n]
            for j in np.flatnonzero(there.any(axis=0)):
                if j == n:  # the bias, which comes first
                    continue
                signal = inputs[:, j] if j < n else hidden[:, j - n - 1]
                total = np.where(there[:, j], total + own[:, j] * signal, total)
            hidden[robots[used], slot[used]] = sigmoid_of(total)[used]
            is_shown = used & (slot < n_outputs)
            outputs[robots[is_shown], slot[is_shown]] = total[is_shown]
        return outputs, hidden[:, :, None]
