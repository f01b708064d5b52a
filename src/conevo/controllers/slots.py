"""Common parts of controllers made of hidden neurons: numbered slots, and sums over them."""

from typing import Annotated, Any

import warp as wp
from annotated_types import Ge, Le

from conevo.errors import UsageError
from conevo.parameters import parameters

__all__ = ["Slots", "n_neurons", "n_sums", "sum_up"]


@wp.func
def n_neurons(
    weights: Any,
    memory: Any,
    shape: Any,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
) -> int:
    """Return the number of slots for neurons in a team."""
    return inputs.shape[0] * shape.n_slots


@wp.func
def n_sums(
    weights: Any,
    memory: Any,
    shape: Any,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
) -> int:
    """Return the number of outputs of a team."""
    return inputs.shape[0] * shape.n_outputs


@wp.func
def sum_up(
    weights: Any,
    memory: Any,
    shape: Any,
    inputs: wp.array2d[float],
    outputs: wp.array2d[float],
    heuristic: wp.array[int],
    q: int,
) -> None:
    """Sum up output ``q`` of the team from the activations of its robot's neurons."""
    i = q // shape.n_outputs
    o = q % shape.n_outputs
    if heuristic[i] >= 0:
        return
    total = float(0.0)
    slot = i * shape.n_slots
    last = slot + shape.n_slots
    while slot < last:
        if weights.filled[slot] != 0:
            total += weights.w_out[slot * shape.n_outputs + o] * memory.hidden[slot]
        slot += 1
    outputs[i, o] = total


@parameters("controller")
class Slots:
    """Numbers of hidden neurons.

    Raises:
        UsageError: fewer slots than neurons at the start.
    """

    n_hidden: Annotated[int, Ge(1), Le(16)] = 10
    """(neurons) hidden neurons at the start; only these feed back."""
    max_hidden: Annotated[int, Ge(1), Le(32)] = 20
    """(neurons) hidden neurons at most."""

    def __post_init__(self) -> None:
        if self.max_hidden < self.n_hidden:
            raise UsageError(
                f"controller.max_hidden ({self.max_hidden}) must not be below n_hidden "
                f"({self.n_hidden})"
            )
