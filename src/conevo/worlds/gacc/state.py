"""State of the gathering and construction world, and where things are in it, as Warp functions.

The rules and the choices stand on the card of ``worlds.gacc.world``.
"""

from typing import Annotated

import warp as wp

from conevo.kernels.actions import NONE
from conevo.kernels.arrays import named_arrays
from conevo.kernels.steps import is_taken

__all__ = [
    "CARRIED",
    "DELIVERED",
    "DROPPED",
    "GRIP",
    "GRIPPED",
    "HELPED",
    "LYING",
    "MOVE",
    "NONE",
    "N_ACTIONS",
    "N_CASTES",
    "UNDETECTED",
    "WAITING",
    "GaccConstants",
    "GaccScene",
    "GaccTeam",
    "is_blocked",
    "is_home",
    "is_inside",
    "is_known",
    "is_lying",
    "is_refused",
]

UNDETECTED = wp.constant(2**31 - 1)

# Actions: detect with setting A, B, C; move; grip with setting A, B, C.
MOVE = wp.constant(3)
GRIP = wp.constant(4)
N_ACTIONS = wp.constant(7)

# What a robot's time is counted as: its action, or gathering if it moves with an object; and
# constructing, from the arrival in the home area on, once the object is delivered.
N_CASTES = wp.constant(10)

# The life of an object.
LYING = wp.constant(0)
GRIPPED = wp.constant(1)
CARRIED = wp.constant(2)
WAITING = wp.constant(3)
HELPED = wp.constant(4)
DELIVERED = wp.constant(5)
DROPPED = wp.constant(6)


@wp.struct
class GaccConstants:
    """What the kernels need of ``GaccParams``, by its names; ``NAME_2`` is a square."""

    n_robots: int
    n_objects: int
    n_complex: int
    ordered: int  # bit c is set if complex object c takes its parts in order
    energy: float
    home: float  # half a side of the home area
    zone_side: float
    home_range_2: float
    home_sight_2: float
    object_range_2: float
    object_accuracy: float
    object_cost: float
    robot_range_2: float
    robot_cost: float
    grip_distance_2: float
    grip_cost: float
    move_range: float
    move_cost: float
    wait: int
    needs_detection: int
    min_distance_2: float
    separation_2: float


@wp.struct
class GaccScene:
    """A scenario, flat over the scenarios of a batch. K objects, R robots, obstacles."""

    object_x: wp.array[float]
    object_y: wp.array[float]
    object_type: wp.array[int]
    left: wp.array[float]
    bottom: wp.array[float]
    right: wp.array[float]
    top: wp.array[float]
    start_x: wp.array[float]
    start_y: wp.array[float]
    plan: wp.array2d[int]  # [C, M] types of the parts of every complex object, in order
    seed: wp.array[wp.uint64]


@named_arrays
class GaccTeam:
    """State of a team."""

    inputs: wp.array2d[float]
    outputs: wp.array2d[float]
    x: wp.array[float]
    y: wp.array[float]
    to_x: wp.array[float]
    to_y: wp.array[float]
    action: wp.array[int]  # executed in the previous iteration, NONE if it did nothing
    chosen: wp.array[int]
    target: wp.array[int]  # object it wants to grip
    held: wp.array[int]  # object it holds
    waited: wp.array[int]  # iterations in the home area with what it holds
    dropped: wp.array[int]  # object it let go of in the home area, until it leaves
    situation: wp.array[int]  # of section 6.2.8, 0 if the controller decided
    heuristic: wp.array[int]
    energy: wp.array[float]
    fitness: wp.array[float]
    counts: wp.array[int]
    switches: wp.array[int]
    object_x: Annotated[wp.array[float], "objects"]
    object_y: Annotated[wp.array[float], "objects"]
    life: Annotated[wp.array[int], "objects"]
    # iteration in which it was sensed first; "known at t" is detected < t
    detected: Annotated[wp.array[int], "objects"]
    part: Annotated[wp.array[int], "objects"]  # which part of what it has become: c * M + step
    holders: Annotated[wp.array[int], "objects"]  # how many robots hold it
    built: Annotated[wp.array[int], "complex_objects"]  # parts of each complex object
    missing: Annotated[wp.array[int], "complex_objects", "types"]  # parts that it lacks
    demand: Annotated[wp.array[float], "types"]
    performance: wp.array[float]  # delivered, completed, delivered_share


# --- places ---------------------------------------------------------------------------------------


@wp.func
def is_home(p: GaccConstants, x: float, y: float) -> bool:
    """Return whether a place is in the home area."""
    return wp.abs(x - 0.5) <= p.home and wp.abs(y - 0.5) <= p.home


@wp.func
def is_inside(scene: GaccScene, k: int, x: float, y: float) -> bool:
    """Return whether a place is in obstacle ``k``, its edge included."""
    return x >= scene.left[k] and x <= scene.right[k] and y >= scene.bottom[k] and y <= scene.top[k]


@wp.func
def is_refused(
    team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, x: float, y: float
) -> bool:
    """Return whether robot ``i`` may not move to a place: edge, obstacle or another robot."""
    if x < 0.0 or x >= 1.0 or y < 0.0 or y >= 1.0:
        return True
    k = int(0)
    while k < scene.left.shape[0]:
        if is_inside(scene, k, x, y):
            return True
        k += 1
    return is_taken(team.x, team.y, p.n_robots, i, x, y, p.separation_2)


@wp.func
def within(low: float, high: float, start: float, way: float) -> wp.vec2f:
    """Return which part of a way in one dimension, from 0 to 1, lies between two bounds.

    From the first number to the second; nothing if the second is smaller.
    """
    if way == 0.0:
        if start < low or start > high:
            return wp.vec2f(1.0, 0.0)
        return wp.vec2f(0.0, 1.0)
    a = (low - start) / way
    b = (high - start) / way
    return wp.vec2f(wp.max(wp.min(a, b), 0.0), wp.min(wp.max(a, b), 1.0))


@wp.func
def is_blocked(scene: GaccScene, x: float, y: float, dx: float, dy: float) -> bool:
    """Return whether an obstacle stands in the view from a place along a way."""
    k = int(0)
    while k < scene.left.shape[0]:
        across = within(scene.left[k], scene.right[k], x, dx)
        along = within(scene.bottom[k], scene.top[k], y, dy)
        if wp.max(across[0], along[0]) <= wp.min(across[1], along[1]):
            return True
        k += 1
    return False


# --- objects --------------------------------------------------------------------------------------


@wp.func
def is_lying(team: GaccTeam, k: int) -> bool:
    """Return whether object ``k`` lies somewhere and nobody holds it."""
    return team.life[k] == LYING or team.life[k] == DROPPED


@wp.func
def is_known(team: GaccTeam, p: GaccConstants, k: int, t: int) -> bool:
    """Return whether a robot may grip object ``k``: it has been detected (6.2.6, 6.5.3)."""
    return team.detected[k] < t or p.needs_detection == 0
