"""State of the gathering and construction world, and Warp functions for places and objects.

The card of ``worlds.gacc.world`` lists the rules and the choices.
"""

from typing import Annotated

import warp as wp

from conevo.kernels.actions import NONE
from conevo.kernels.arrays import named_arrays
from conevo.kernels.sets import lowest, one, parts, without_lowest

__all__ = [
    "CARRIED",
    "CONSTRUCT",
    "DELIVERED",
    "DROPPED",
    "GATHER",
    "GRIP",
    "GRIPPED",
    "HELPED",
    "LYING",
    "MOVE",
    "NONE",
    "N_ACTIONS",
    "N_CASTES",
    "STALE",
    "UNDETECTED",
    "WAITING",
    "GaccConstants",
    "GaccScene",
    "GaccTeam",
    "hold",
    "is_blocked",
    "is_home",
    "is_inside",
    "is_known",
    "is_refused",
    "is_within",
    "object_parts",
    "release",
    "robot_parts",
    "setting_of",
    "spoil",
]

UNDETECTED = wp.constant(2**31 - 1)

# Actions: detect with setting A, B, C; move; grip with setting A, B, C.
MOVE = wp.constant(3)
GRIP = wp.constant(4)
N_ACTIONS = wp.constant(7)

# A robot's time counts as its action, or as gathering if it moves with an object. Once an object is
# delivered, the time since its arrival in the home area counts as constructing.
N_CASTES = wp.constant(10)

GATHER = wp.constant(4)  # gather A, B, C
CONSTRUCT = wp.constant(7)  # construct A, B, C

# The life of an object.
LYING = wp.constant(0)
GRIPPED = wp.constant(1)
CARRIED = wp.constant(2)
WAITING = wp.constant(3)
HELPED = wp.constant(4)
DELIVERED = wp.constant(5)
DROPPED = wp.constant(6)

STALE = wp.constant(-2)  # a view in which something has changed


@wp.struct
class GaccConstants:
    """The fields of ``GaccParams`` for the kernels; ``NAME_2`` is a square."""

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
    near_2: float  # distance within which other robots matter to a robot
    reach_2: float  # the same for objects
    walls_2: float  # the same for obstacles
    sensor_noise: float
    signed_inputs: int  # number of the first inputs, which have a range of [-1, 1]
    action_noise: float
    failure: float
    failure_at: int


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
    """State of a team. Sets of robots, objects and obstacles are words, with 64 members at most."""

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
    waited: wp.array[int]  # iterations in the home area with its object
    dropped: wp.array[int]  # object it let go of in the home area, until it leaves
    situation: wp.array[int]  # of section 6.2.8, 0 if the controller decided
    heuristic: wp.array[int]
    energy: wp.array[float]
    fitness: wp.array[float]
    counts: wp.array[int]
    switches: wp.array[int]
    view: wp.array[
        int
    ]  # setting whose readings object sensors show, NONE if they are off, or STALE
    near: wp.array[wp.uint64]  # robots in reach, and some that have been since it came here
    things: wp.array[wp.uint64]  # objects that lie in reach
    walls: wp.array[wp.uint64]  # obstacles in reach
    object_x: Annotated[wp.array[float], "objects"]
    object_y: Annotated[wp.array[float], "objects"]
    life: Annotated[wp.array[int], "objects"]
    # iteration in which it was sensed first; "known at t" is detected < t
    detected: Annotated[wp.array[int], "objects"]
    part: Annotated[wp.array[int], "objects"]  # part of a complex object: c * M + step
    holders: Annotated[wp.array[wp.uint64], "objects"]  # valid during the referee's phases
    built: Annotated[wp.array[int], "complex_objects"]  # parts of each complex object
    missing: Annotated[wp.array[int], "complex_objects", "types"]  # parts that it lacks
    demand: Annotated[wp.array[float], "types"]
    kinds: Annotated[wp.array[wp.uint64], "types"]  # objects of each type
    carriers: Annotated[wp.array[wp.uint64], "team"]  # robots that hold something
    waiting: Annotated[wp.array[wp.uint64], "team"]  # those of them in the home area
    taken: Annotated[wp.array[wp.uint64], "team"]  # objects that are held
    shared: Annotated[wp.array[wp.uint64], "team"]  # held by several, as valid as ``holders``
    lying: Annotated[wp.array[wp.uint64], "team"]  # objects that no robot holds
    lying_home: Annotated[wp.array[wp.uint64], "team"]  # those of them in the home area
    kept_inputs: Annotated[wp.array[float], "kept_inputs"]  # without noise
    kept_heuristic: Annotated[wp.array[int], "kept_robots"]  # while outputs are random
    # Changes since robots sensed last:
    moved: Annotated[wp.array[wp.uint64], "team"]  # robots that have moved
    stirred: Annotated[wp.array[wp.uint64], "team"]  # those, and robots near which one has
    # moved, gripped or let go
    turned: Annotated[wp.array[wp.uint64], "team"]  # robots whose view has changed
    changed: Annotated[wp.array[wp.uint64], "team"]  # objects now lying, or no longer
    has_news: Annotated[wp.array[int], "team"]  # of the demand
    performance: wp.array[float]  # delivered, completed, delivered_share


# --- sets that lanes share ------------------------------------------------------------------------


@wp.func
def robot_parts(team: GaccTeam, scene: GaccScene, p: GaccConstants) -> int:
    """Return the number of parts into which lanes cut a set of robots."""
    return parts(p.n_robots)


@wp.func
def object_parts(team: GaccTeam, scene: GaccScene, p: GaccConstants) -> int:
    """Return the number of parts into which lanes cut a set of objects."""
    return parts(p.n_objects)


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
def is_within(
    xs: wp.array[float], ys: wp.array[float], robots: wp.uint64, x: float, y: float, d_2: float
) -> bool:
    """Return whether a robot of a set is closer to a place than a distance, given as its square."""
    rest = robots
    while rest != wp.uint64(0):
        j = lowest(rest)
        dx = xs[j] - x
        dy = ys[j] - y
        if dx * dx + dy * dy < d_2:
            return True
        rest = without_lowest(rest)
    return False


@wp.func
def is_refused(
    team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, x: float, y: float
) -> bool:
    """Return whether robot ``i`` may not move to a place: edge, obstacle or another robot."""
    if x < 0.0 or x >= 1.0 or y < 0.0 or y >= 1.0:
        return True
    rest = team.walls[i]
    while rest != wp.uint64(0):
        if is_inside(scene, lowest(rest), x, y):
            return True
        rest = without_lowest(rest)
    return is_within(team.x, team.y, team.near[i], x, y, p.separation_2)


@wp.func
def within(low: float, high: float, start: float, way: float) -> wp.vec2f:
    """Return the part of a path in one dimension, from 0 to 1, that lies between two bounds.

    It extends from the first number to the second, and is empty if the second is smaller.
    """
    if way == 0.0:
        if start < low or start > high:
            return wp.vec2f(1.0, 0.0)
        return wp.vec2f(0.0, 1.0)
    a = (low - start) / way
    b = (high - start) / way
    return wp.vec2f(wp.max(wp.min(a, b), 0.0), wp.min(wp.max(a, b), 1.0))


@wp.func
def is_blocked(
    scene: GaccScene, walls: wp.uint64, x: float, y: float, dx: float, dy: float
) -> bool:
    """Return whether an obstacle of a set blocks the view from a place along a path."""
    rest = walls
    while rest != wp.uint64(0):
        k = lowest(rest)
        across = within(scene.left[k], scene.right[k], x, dx)
        along = within(scene.bottom[k], scene.top[k], y, dy)
        if wp.max(across[0], along[0]) <= wp.min(across[1], along[1]):
            return True
        rest = without_lowest(rest)
    return False


# --- objects --------------------------------------------------------------------------------------


@wp.func
def setting_of(action: int) -> int:
    """Return the setting of the object sensors that an action activates, or NONE."""
    return wp.where(action < MOVE, action, NONE)


@wp.func
def spoil(team: GaccTeam, i: int) -> None:
    """Mark robot ``i``'s view of objects and obstacles as outdated."""
    if team.view[i] != NONE:
        team.view[i] = STALE


@wp.func
def is_known(team: GaccTeam, p: GaccConstants, k: int, t: int) -> bool:
    """Return whether a robot may grip object ``k``: it has been detected (6.2.6, 6.5.3)."""
    return team.detected[k] < t or p.needs_detection == 0


@wp.func
def hold(team: GaccTeam, i: int, k: int) -> None:
    """Close robot ``i``'s gripper on object ``k``."""
    team.held[i] = k
    wp.atomic_or(team.carriers, 0, one(i))
    wp.atomic_or(team.stirred, 0, team.near[i])


@wp.func
def release(team: GaccTeam, i: int) -> None:
    """Open the gripper of robot ``i``, which holds an object."""
    team.held[i] = NONE
    wp.atomic_and(team.carriers, 0, ~one(i))
    wp.atomic_or(team.stirred, 0, team.near[i])
