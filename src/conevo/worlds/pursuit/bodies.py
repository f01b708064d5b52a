"""Predators and prey as bodies: their state, scenarios and constants for the kernels.

Bodies are numbered: first the team's robots, then the others (the prey, or the heuristic
predators). A body and an obstacle are discs; disc ``j`` is body ``j`` below 16, and obstacle
``j - 16`` from 16 on, so that a set of discs is an integer.
"""

from typing import Annotated

import warp as wp

from conevo.kernels.arrays import named_arrays

__all__ = [
    "N_OBSTACLES",
    "NONE",
    "OBSTACLES",
    "SLOTS",
    "PursuitConstants",
    "PursuitScene",
    "PursuitTeam",
    "first_of",
    "is_prey",
    "place_of",
    "wheel_speed",
]

NONE = wp.constant(-1)
OBSTACLES = wp.constant(16)  # number of the first obstacle's disc: no world has more bodies
N_OBSTACLES = wp.constant(6)  # most obstacles of a scenario
SLOTS = wp.constant(16)  # hidden neurons of a prey that are computed at once on one lane


@wp.struct
class PursuitConstants:
    """The parameters of both worlds for the kernels."""

    n_robots: int
    team_is_prey: int
    arena_cm: float
    sensor_range_cm: float
    cone: wp.vec2f
    max_speed_cm: float  # of a predator's wheel at command 1, cm per iteration
    prey_speed_cm: float
    prey_mode: int  # how prey that are not the team are controlled
    prey_hidden: int
    capture_window: int
    capture_share: float
    capture_distance_cm: float
    capture_predators: int
    sight_cm_2: float  # of the squared distance at which a body may be seen at all
    touch_cm_2: float  # of the squared distance at which two bodies may meet in one iteration
    sensor_noise: float
    signed_inputs: int  # number of the first inputs, which have a range of [-1, 1]
    action_noise: float
    failure: float
    failure_at: int


@wp.struct
class PursuitScene:
    """A scenario: places, and the networks of the prey. Flat over the scenarios of a batch."""

    x: wp.array[float]
    y: wp.array[float]
    heading: wp.array[float]
    n_bodies: wp.array[int]
    obstacle_x: wp.array[float]
    obstacle_y: wp.array[float]
    n_obstacles: wp.array[int]
    prey_in: wp.array2d[float]  # [Q * H, 8], the same in all scenarios, as the next two
    prey_out: wp.array2d[float]  # [Q * H, 2]
    clamp: wp.array2d[float]  # [R, S], sensor inputs held at a value, NaN where free
    seed: wp.array[wp.uint64]


@named_arrays
class PursuitTeam:
    """State of a team and its opponents."""

    inputs: wp.array2d[float]
    outputs: wp.array2d[float]
    heuristic: wp.array[int]
    x: Annotated[wp.array[float], "bodies"]
    y: Annotated[wp.array[float], "bodies"]
    heading: Annotated[wp.array[float], "bodies"]
    ahead_x: Annotated[wp.array[float], "bodies"]  # cosine of the heading
    ahead_y: Annotated[wp.array[float], "bodies"]  # and sine
    to_x: Annotated[wp.array[float], "bodies"]
    to_y: Annotated[wp.array[float], "bodies"]
    to_heading: Annotated[wp.array[float], "bodies"]
    left: Annotated[wp.array[float], "bodies"]  # wheel commands in [-1, 1]
    right: Annotated[wp.array[float], "bodies"]
    refused: Annotated[wp.array[int], "bodies"]  # by walls, obstacles and where others are
    collided: Annotated[wp.array[int], "bodies"]  # refused for any reason
    collisions: Annotated[wp.array[int], "bodies"]
    has_moved: Annotated[wp.array[int], "bodies"]  # in the previous iteration
    near: Annotated[wp.array[int], "bodies"]  # discs that may be seen
    close: Annotated[wp.array[int], "bodies"]  # discs that may be met in this iteration
    looks: Annotated[wp.array[int], "bodies"]  # whether anything that it may see has changed
    infrared: Annotated[wp.array[float], "bodies", "sensors"]  # of prey
    held: wp.array[int]  # sensor inputs held at a value
    wander: Annotated[wp.array[float], "bodies"]  # direction of a random walk
    known: Annotated[wp.array[int], "bodies"]  # whether there is a last known place of a prey
    known_x: Annotated[wp.array[float], "bodies"]
    known_y: Annotated[wp.array[float], "bodies"]
    prey_in: Annotated[wp.array[float], "prey", "sensors", "slots"]  # networks of the prey
    prey_out: Annotated[wp.array[float], "prey", "wheels", "slots"]
    prey_hidden: Annotated[wp.array[float], "prey", "slots"]
    moved: Annotated[wp.array[int], "prey", "window"]  # path lengths in 2**-18 cm, a ring
    commanded: Annotated[wp.array[int], "prey", "window"]
    moved_sum: Annotated[wp.array[int], "prey"]  # of the ring
    commanded_sum: Annotated[wp.array[int], "prey"]
    captured: Annotated[wp.array[int], "prey"]
    captures: Annotated[wp.array[int], "prey"]
    first: Annotated[wp.array[int], "team"]  # iteration of the first capture, NONE before
    kept_inputs: Annotated[wp.array[float], "kept_inputs"]  # without noise
    kept_heuristic: Annotated[wp.array[int], "kept_robots"]  # while outputs are random
    failed: Annotated[wp.array[int], "failing"]  # robots that no longer do anything
    action: wp.array[int]
    fitness: wp.array[float]
    counts: wp.array[int]
    switches: wp.array[int]
    performance: wp.array[float]


@wp.func
def is_prey(p: PursuitConstants, b: int) -> bool:
    """Return whether body ``b`` is a prey."""
    return (b < p.n_robots) == (p.team_is_prey != 0)


@wp.func
def wheel_speed(p: PursuitConstants, b: int) -> float:
    """Return the distance that body ``b``'s wheel rolls in an iteration at command 1."""
    return wp.where(is_prey(p, b), p.prey_speed_cm, p.max_speed_cm)


@wp.func
def first_of(discs: int) -> int:
    """Return the lowest number in a set of discs that is not empty."""
    return wp.bit_count((discs & -discs) - 1)


@wp.func
def place_of(team: PursuitTeam, scene: PursuitScene, j: int) -> wp.vec2f:
    """Return the place of disc ``j``."""
    if j < OBSTACLES:
        return wp.vec2f(team.x[j], team.y[j])
    return wp.vec2f(scene.obstacle_x[j - OBSTACLES], scene.obstacle_y[j - OBSTACLES])
