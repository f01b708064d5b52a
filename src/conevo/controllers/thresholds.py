"""Division of labour by response thresholds: the task with the strongest response is done.

Bonabeau, Theraulaz and Deneubourg 1996, "Quantitative study of the fixed threshold model for the
regulation of division of labour in insect societies"; Nitschke 2009, section 2.2.2. Every output is
a task. A task has a stimulus s and a threshold theta, and the response to it is::

    P = s^n / (s^n + theta^n)                        n = steepness

Theraulaz, Bonabeau and Deneubourg 1998, "Response threshold reinforcement and division of labour in
insect societies": thresholds change while a robot works, within bounds::

    theta -= xi        of the task that it does
    theta += phi       of all others

A genotype is one task: the weights of the inputs in its stimulus, the stimulus without inputs and,
unless ``theta`` is given, its threshold at the start of an epoch.

Choice: a response is not drawn, as P is in the papers. A world takes the action with the highest
output, so the task with the highest response is done, the first one if several are equal. A
controller is a function of inputs and memory, and so it can be replayed and exported.
Choice: a continuous output, such as a step or a wheel, has the range that the response covers: its
sum is ``gain`` (2 P - 1), P = 1/2 is its middle.
Choice: a stimulus is a weighted sum of inputs, squashed between 0 and 1. Thresholds lie between
1/64 and 1, in proportion to the gene.
Choice: a task that has been lost (an empty slot) has no response, P = 0. A robot without any task
has outputs 0.
Choice: a robot counts as doing the task with its highest response, whether or not the world lets it
be done, since a controller sees inputs alone.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
import warp as wp
from annotated_types import Ge, Gt, Le

from conevo.controllers.protocol import Bools, Floats, Genome, Mind
from conevo.controllers.slots import n_sums
from conevo.kernels.arrays import named_arrays
from conevo.kernels.outputs import EXTREME, sigmoid, sigmoid_of
from conevo.kernels.phases import Phase
from conevo.parameters import WrongValue, parameters

__all__ = ["LEAST", "ResponseThresholds"]

LEAST = 1 / 64
"""The lowest threshold; the highest is 1."""
LOWEST = wp.constant(LEAST)


@wp.struct
class ThresholdShape:
    """Sizes and rates of a controller as the kernels need them; theta is 0 if it is evolved."""

    n_inputs: int
    n_outputs: int
    steepness: int
    is_one_input: int
    weight_scale: float
    gain: float
    theta: float
    xi: float
    phi: float


@named_arrays
class ThresholdWeights:
    """Stimuli and thresholds of a team's tasks; gain: of each robot, 0 without any task.

    Feeds: inputs, and the stimulus without inputs last.
    """

    w_in: Annotated[wp.array[float], "robots", "tasks", "feeds"]
    theta: Annotated[wp.array[float], "robots", "tasks"]
    filled: Annotated[wp.array[int], "robots", "tasks"]
    gain: wp.array[float]


@named_arrays
class ThresholdMemory:
    """Responses of a team's robots, and how far their thresholds have changed; 0 in empty slots."""

    response: Annotated[wp.array[float], "robots", "tasks"]
    change: Annotated[wp.array[float], "robots", "tasks"]


@wp.func
def load(
    weights: ThresholdWeights,
    shape: ThresholdShape,
    i: int,
    genes: wp.array2d[float],
    rows: wp.array3d[int],
    n: int,
) -> None:
    """Build robot ``i``'s controller from genotypes of tasks; see ``controllers.protocol.Mind``."""
    feeds = shape.n_inputs + 1
    weights.gain[i] = 0.0
    for k in range(shape.n_outputs):
        slot = i * shape.n_outputs + k
        row = rows[n, i, k]
        weights.filled[slot] = int(row >= 0)
        if row >= 0:
            weights.gain[i] = shape.gain
            strongest = int(0)
            for j in range(feeds):
                weights.w_in[slot * feeds + j] = shape.weight_scale * genes[row, j]
                if j < shape.n_inputs and wp.abs(genes[row, j]) > wp.abs(genes[row, strongest]):
                    strongest = j
            if shape.is_one_input != 0:
                for j in range(shape.n_inputs):
                    if j != strongest:
                        weights.w_in[slot * feeds + j] = 0.0
            weights.theta[slot] = shape.theta
            if shape.theta == 0.0:
                share = 0.5 * (genes[row, feeds] + 1.0)
                weights.theta[slot] = LOWEST + share * (1.0 - LOWEST)


@wp.func
def clear(memory: ThresholdMemory, shape: ThresholdShape, i: int) -> None:
    """Reset robot ``i``'s thresholds to those of its genotypes."""
    for k in range(shape.n_outputs):
        memory.response[i * shape.n_outputs + k] = 0.0
        memory.change[i * shape.n_outputs + k] = 0.0


@wp.func
def respond(
    weights: ThresholdWeights,
    memory: ThresholdMemory,
    shape: ThresholdShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
    q: int,
) -> None:
    """Compute the response to task ``q`` of the team, and its output."""
    i = q // shape.n_outputs
    if heuristic[i] >= 0:
        return
    response = float(0.0)
    if weights.filled[q] != 0:
        at = q * (shape.n_inputs + 1)
        drive = weights.w_in[at + shape.n_inputs]
        j = int(0)
        while j < shape.n_inputs:
            drive += weights.w_in[at + j] * inputs[i, j]
            j += 1
        stimulus = sigmoid(drive)
        theta = weights.theta[q] + memory.change[q]
        above = float(stimulus)
        below = float(theta)
        j = int(1)
        while j < shape.steepness:
            above *= stimulus
            below *= theta
            j += 1
        response = above / (above + below)
    memory.response[q] = response
    outputs[i, q % shape.n_outputs] = weights.gain[i] * (2.0 * response - 1.0)


@wp.func
def reinforce(
    weights: ThresholdWeights,
    memory: ThresholdMemory,
    shape: ThresholdShape,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
    q: int,
) -> None:
    """Change the thresholds of robot ``q``: the task that it does becomes easier, others harder."""
    if heuristic[q] >= 0:
        return
    first = q * shape.n_outputs
    done = int(0)
    k = int(1)
    while k < shape.n_outputs:
        if memory.response[first + k] > memory.response[first + done]:
            done = k
        k += 1
    k = int(0)
    while k < shape.n_outputs:
        if weights.filled[first + k] != 0:
            start = weights.theta[first + k]
            step = wp.where(k == done, -shape.xi, shape.phi)
            theta = wp.clamp(start + memory.change[first + k] + step, LOWEST, 1.0)
            memory.change[first + k] = theta - start
        k += 1


@parameters("controller")
class ResponseThresholds:
    """Settings of response thresholds; see the module.

    Raises:
        UsageError: a threshold between 0 and the lowest one.
    """

    stimulus: Literal["sum", "input"] = "sum"
    """stimulus of a task: the weighted "sum" of all inputs, or the one "input" that has the weight
    of largest size."""
    theta: Annotated[float, Ge(0), Le(1)] = 0.0
    """threshold of every task at the start of an epoch, 1/64 to 1; 0: each task has one of its own,
    which is evolved."""
    xi: Annotated[float, Ge(0), Le(1)] = 0.0
    """(per iteration) fall of the threshold of the task that a robot does; with ``phi``, thresholds
    are learned in each epoch."""
    phi: Annotated[float, Ge(0), Le(1)] = 0.0
    """(per iteration) rise of the thresholds of all other tasks."""
    steepness: Annotated[int, Ge(1), Le(4)] = 2
    """n, exponent of stimulus and threshold in a response (n = 2 in the papers)."""
    gain: Annotated[float, Gt(0), Le(EXTREME)] = 5.0
    """the output at a response of 1. Choice: 5, so that a continuous output covers 98.7 % of its
    range."""
    weight_scale: Annotated[float, Gt(0), Le(1000)] = 10.0
    """weight of an input, or stimulus without inputs, of gene 1."""

    name: ClassVar[str] = "thresholds"
    max_outputs: ClassVar[int] = 64
    n_memory: ClassVar[int] = 2

    def __post_init__(self) -> None:
        """Refuse a threshold that no gene can have."""
        if 0 < self.theta < LEAST:
            raise WrongValue(
                "theta", f"controller.theta = {self.theta}", "must be 0, or from 1/64 to 1"
            )

    @property
    def is_learning(self) -> bool:
        """Whether thresholds change during an epoch."""
        return self.xi > 0 or self.phi > 0

    def genome(self, n_inputs: int, n_outputs: int) -> Genome:
        """Return the parts of a controller: tasks, one for each output."""
        return Genome(n_outputs, n_outputs, n_inputs + 1 + (self.theta == 0))

    def mind(self, n_inputs: int, n_outputs: int) -> Mind:
        """Return the Warp side."""
        shape = ThresholdShape()
        shape.n_inputs, shape.n_outputs, shape.steepness = n_inputs, n_outputs, self.steepness
        shape.is_one_input = int(self.stimulus == "input")
        shape.weight_scale, shape.gain, shape.theta = self.weight_scale, self.gain, self.theta
        shape.xi, shape.phi = self.xi, self.phi
        return Mind(
            weights=ThresholdWeights,
            memory=ThresholdMemory,
            shape=shape,
            shape_type=ThresholdShape,
            sizes={"tasks": n_outputs, "feeds": n_inputs + 1},
            load=load,
            clear=clear,
            think=(Phase(respond, n_sums, "q"), Phase(reinforce, takes="q")),
            probe="response",
        )

    def tasks(self, genes: Floats, n_inputs: int) -> tuple[Floats, Floats, Floats]:
        """Return the tasks that genotypes describe, as ``load`` does.

        Args:
            genes: [R, U, G] float32.
            n_inputs: S.

        Returns:
            Weights of inputs [R, U, S], stimuli without inputs [R, U], thresholds [R, U].
        """
        f, scale = np.float32, np.float32(self.weight_scale)
        weights: Floats = scale * genes[:, :, :n_inputs]
        if self.stimulus == "input":
            strongest = np.abs(genes[:, :, :n_inputs]).argmax(axis=2)
            weights = np.where(strongest[..., None] == np.arange(n_inputs), weights, f(0))
        theta = np.full(genes.shape[:2], f(self.theta))
        if self.theta == 0:
            share = f(0.5) * (genes[:, :, n_inputs + 1] + f(1))
            theta = f(LEAST) + share * f(1 - LEAST)
        return weights, scale * genes[:, :, n_inputs], theta

    def forward(
        self, genes: Floats, active: Bools, memory: Floats, inputs: Floats, n_outputs: int
    ) -> tuple[Floats, Floats]:
        """Run robots' controllers once; see ``controllers.protocol.Controller``."""
        f = np.float32
        weights, drive, start = self.tasks(genes, inputs.shape[1])
        for j in range(inputs.shape[1]):
            drive = drive + weights[:, :, j] * inputs[:, j, None]
        stimulus, theta = sigmoid_of(drive), start + memory[:, :, 1]
        above, below = stimulus, theta
        for _ in range(self.steepness - 1):
            above, below = above * stimulus, below * theta
        response = np.where(active, above / (above + below), f(0))
        gain = np.where(active.any(axis=1, keepdims=True), f(self.gain), f(0))
        outputs = gain * (f(2) * response - f(1))
        is_done = np.arange(n_outputs) == response.argmax(axis=1, keepdims=True)
        step = np.where(is_done, f(-self.xi), f(self.phi))
        change = (theta + step).clip(f(LEAST), f(1)) - start
        return outputs, np.stack([response, np.where(active, change, f(0))], axis=2)
