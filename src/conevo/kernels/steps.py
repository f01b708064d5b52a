"""Steps in the plane: where a robot wants to go, and whether another robot is already there."""

import warp as wp

from conevo.kernels.outputs import sigmoid
from conevo.kernels.trigonometry import cosine_sine

__all__ = ["component_bounds", "is_taken", "random_step", "steered_step"]


@wp.func
def random_step(u: float, length: float) -> wp.vec2f:
    """Return a step of this length in the direction 2 pi ``u``."""
    ahead = cosine_sine(u * 6.2831853)
    return wp.vec2f(length * ahead[0], length * ahead[1])


@wp.func
def steered_step(sum_x: float, sum_y: float, length: float) -> wp.vec2f:
    """Return the step that two output sums stand for, at most ``length`` long.

    "Normalized and scaled" (Nitschke 2009, 5.2) so that both at an extreme make the longest step.
    """
    most = length * 1.4142135
    return wp.vec2f(most * (sigmoid(sum_x) - 0.5), most * (sigmoid(sum_y) - 0.5))


def component_bounds(length: float) -> tuple[float, float]:
    """Return the least and the largest component of a ``steered_step``."""
    most = length * 1.4142135 * 0.5
    return -most, most


@wp.func
def is_taken(
    xs: wp.array[float],
    ys: wp.array[float],
    n: int,
    i: int,
    x: float,
    y: float,
    separation_2: float,
) -> bool:
    """Return whether one of the first ``n`` robots, other than ``i``, is too close to a place.

    Args:
        xs: [R] first coordinates.
        ys: [R] second coordinates.
        n: number of robots to look at: all, or ``i`` for those with a lower number.
        i: the robot that wants to go there.
        x: first coordinate of the place.
        y: second coordinate.
        separation_2: the square of the smallest distance allowed.
    """
    close = int(0)
    j = int(0)
    while j < n:
        dx = xs[j] - x
        dy = ys[j] - y
        close += int(dx * dx + dy * dy < separation_2 and j != i)
        j += 1
    return close > 0
