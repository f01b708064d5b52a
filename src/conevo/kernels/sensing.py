"""Sensing by octants: which robot is the closest in each of the eight sectors around a robot."""

from typing import TYPE_CHECKING, Any

import warp as wp

from conevo.kernels.geometry import octant

__all__ = ["closest_in_octants", "eight_robots", "is_marked", "mark", "none_of_eight"]

if TYPE_CHECKING:
    eight_robots = Any  # a Warp type that only Warp can read
    eight_distances = Any
else:
    eight_robots = wp.types.vector(length=8, dtype=int)
    eight_distances = wp.types.vector(length=8, dtype=float)


@wp.func
def mark(robots: wp.uint64, j: int) -> wp.uint64:
    """Return the set of robots with robot ``j`` (of 64 at most) in it."""
    return robots | (wp.uint64(1) << wp.uint64(j))


@wp.func
def is_marked(robots: wp.uint64, j: int) -> bool:
    """Return whether robot ``j`` is in a set of robots."""
    return ((robots >> wp.uint64(j)) & wp.uint64(1)) != wp.uint64(0)


@wp.func
def none_of_eight() -> eight_robots:
    """Return no robot, -1, for every octant."""
    found = eight_robots()
    for o in range(8):
        found[o] = -1
    return found


@wp.func
def closest_in_octants(
    xs: wp.array[float],
    ys: wp.array[float],
    robots: wp.uint64,
    x: float,
    y: float,
    reach_2: float,
) -> eight_robots:
    """Return the closest robot of a set in each octant around a place, -1 where there is none.

    Args:
        xs: [R] first coordinates.
        ys: [R] second coordinates.
        robots: the set.
        x: first coordinate of the place.
        y: second coordinate.
        reach_2: the square of the distance that a robot must be closer than.
    """
    found = none_of_eight()
    closest = eight_distances()
    for o in range(8):
        closest[o] = reach_2
    rest = robots
    j = int(0)
    while rest != wp.uint64(0):
        if (rest & wp.uint64(1)) != wp.uint64(0):
            dx = xs[j] - x
            dy = ys[j] - y
            d2 = dx * dx + dy * dy
            if d2 < reach_2:
                o = octant(dx, dy)
                if d2 < closest[o]:
                    closest[o] = d2
                    found[o] = j
        rest = rest >> wp.uint64(1)
        j += 1
    return found
