"""Predators and prey as bodies: their state, what they see, and the controllers they can have.

Nitschke 2009, sections 4.1, 4.3, 4.6.6. What happens to them is ``worlds.pursuit.dynamics``.
"""

from typing import Annotated

import warp as wp

from conevo.kernels.arrays import named_arrays
from conevo.kernels.khepera import RADIUS, eight, see_disc, see_wall, steer, wrap
from conevo.kernels.outputs import sigmoid
from conevo.kernels.random import uniform
from conevo.kernels.trigonometry import arc_tangent

__all__ = [
    "N_OBSTACLES",
    "NONE",
    "PursuitConstants",
    "PursuitScene",
    "PursuitTeam",
    "command",
    "is_prey",
    "look",
    "wheel_speed",
]

# --- state ----------------------------------------------------------------------------------------

NONE = wp.constant(-1)
TURN_OFTEN = wp.constant(0.05)  # Choice: chance per iteration that a random walk turns
NETWORK = wp.constant(0)
HEURISTIC = wp.constant(1)
N_OBSTACLES = wp.constant(6)  # most obstacles of a scenario


@wp.struct
class PursuitConstants:
    """What the kernels need of the parameters of both worlds, by their names."""

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
    to_x: Annotated[wp.array[float], "bodies"]
    to_y: Annotated[wp.array[float], "bodies"]
    to_heading: Annotated[wp.array[float], "bodies"]
    left: Annotated[wp.array[float], "bodies"]  # wheel commands in [-1, 1]
    right: Annotated[wp.array[float], "bodies"]
    refused: Annotated[wp.array[int], "bodies"]  # by walls, obstacles and where others are
    collided: Annotated[wp.array[int], "bodies"]  # refused for any reason
    collisions: Annotated[wp.array[int], "bodies"]
    infrared: Annotated[wp.array[float], "bodies", "sensors"]
    wander: Annotated[wp.array[float], "bodies"]  # direction of a random walk
    known: Annotated[wp.array[int], "bodies"]  # whether there is a last known place of a prey
    known_x: Annotated[wp.array[float], "bodies"]
    known_y: Annotated[wp.array[float], "bodies"]
    moved: Annotated[wp.array[float], "prey", "window"]  # a ring
    commanded: Annotated[wp.array[float], "prey", "window"]
    captured: Annotated[wp.array[int], "prey"]
    captures: Annotated[wp.array[int], "prey"]
    first: Annotated[wp.array[int], "team"]  # iteration of the first capture, NONE before
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
    """Return how far body ``b``'s wheel rolls in an iteration at command 1."""
    return wp.where(is_prey(p, b), p.prey_speed_cm, p.max_speed_cm)


# --- what they see --------------------------------------------------------------------------------


@wp.func
def look(
    team: PursuitTeam,
    scene: PursuitScene,
    p: PursuitConstants,
    b: int,
    ahead: wp.vec2f,
    is_light: bool,
) -> eight:
    """Return the activations of body ``b``'s infrared or light sensors.

    Infrared sees walls, obstacles and bodies; light sees prey, over the heads of others. ``ahead``:
    cosine and sine of its heading.
    """
    x = team.x[b]
    y = team.y[b]
    c = ahead[0]
    s = ahead[1]
    seen = eight()
    limit = p.sensor_range_cm + 2.0 * RADIUS
    j = int(0)
    while j < scene.n_bodies[0]:
        if j != b and (not is_light or is_prey(p, j)):
            dx = team.x[j] - x
            dy = team.y[j] - y
            if dx * dx + dy * dy < limit * limit:
                seen = see_disc(
                    seen, c * dx + s * dy, c * dy - s * dx, RADIUS, p.cone, p.sensor_range_cm
                )
        j += 1
    if is_light:
        return seen
    j = int(0)
    while j < scene.n_obstacles[0]:
        dx = scene.obstacle_x[j] - x
        dy = scene.obstacle_y[j] - y
        if dx * dx + dy * dy < limit * limit:
            seen = see_disc(
                seen, c * dx + s * dy, c * dy - s * dx, RADIUS, p.cone, p.sensor_range_cm
            )
        j += 1
    near = p.sensor_range_cm + RADIUS
    if x < near:
        seen = see_wall(seen, x, -c, s, p.cone, p.sensor_range_cm)
    if p.arena_cm - x < near:
        seen = see_wall(seen, p.arena_cm - x, c, -s, p.cone, p.sensor_range_cm)
    if y < near:
        seen = see_wall(seen, y, -s, -c, p.cone, p.sensor_range_cm)
    if p.arena_cm - y < near:
        seen = see_wall(seen, p.arena_cm - y, s, c, p.cone, p.sensor_range_cm)
    return seen


# --- what controls them ---------------------------------------------------------------------------


@wp.func
def walk_randomly(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, t: int
) -> wp.vec2f:
    """Return wheel commands of a random walk: straight on, now and then another way.

    Choice: it turns with chance 0.05 in an iteration, and whenever its last move was refused.
    """
    if team.collided[b] != 0 or uniform(scene.seed[0], t, 1, b) < TURN_OFTEN:
        team.wander[b] = 6.2831853 * uniform(scene.seed[0], t, 2, b) - 3.1415927
    return steer(wrap(team.wander[b] - team.heading[b]), wheel_speed(p, b))


@wp.func
def pursue(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, t: int) -> wp.vec2f:
    """Return wheel commands of the heuristic predator (sections 4.3, 4.6.6).

    Straight at the closest prey in light range; else to where it was seen last; else a random walk.
    Choice: it turns on the spot as fast as needed, knows prey all around it, and gives up a place
    once it is within a robot's diameter of it.
    """
    x = team.x[b]
    y = team.y[b]
    limit = p.sensor_range_cm + 2.0 * RADIUS
    closest = limit * limit
    j = int(0)
    while j < scene.n_bodies[0]:
        if is_prey(p, j):
            dx = team.x[j] - x
            dy = team.y[j] - y
            if dx * dx + dy * dy <= closest:
                closest = dx * dx + dy * dy
                team.known[b] = 1
                team.known_x[b] = team.x[j]
                team.known_y[b] = team.y[j]
        j += 1
    dx = team.known_x[b] - x
    dy = team.known_y[b] - y
    if closest == limit * limit and dx * dx + dy * dy < 4.0 * RADIUS * RADIUS:
        team.known[b] = 0  # it is not here any more
    if team.known[b] == 0:
        return walk_randomly(team, scene, p, b, t)
    return steer(wrap(arc_tangent(dy, dx) - team.heading[b]), p.max_speed_cm)


@wp.func
def avoid(team: PursuitTeam, p: PursuitConstants, b: int) -> wp.vec2f:
    """Return wheel commands of the heuristic prey: ahead, and away from the nearer side.

    Choice: the thesis has no heuristic prey; this one turns by the difference between its three
    sensors on either side, and on the spot where both sides are as near.
    """
    k = b * 8
    left = wp.max(wp.max(team.infrared[k], team.infrared[k + 1]), team.infrared[k + 2])
    right = wp.max(wp.max(team.infrared[k + 7], team.infrared[k + 6]), team.infrared[k + 5])
    w = right - left
    if wp.max(team.infrared[k], team.infrared[k + 7]) > 0.7 and wp.abs(w) < 0.05:
        w = 1.0
    w = wp.clamp(w, -1.0, 1.0)
    f = 1.0 - wp.abs(w)
    return wp.vec2f(f - w, f + w)


@wp.func
def think_as_prey(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int) -> wp.vec2f:
    """Return wheel commands of a prey that is not the team: its feed-forward network (fig. 4.2)."""
    left = float(0.0)
    right = float(0.0)
    row = int((b - p.n_robots) * p.prey_hidden)
    end = row + p.prey_hidden
    while row < end:
        h = float(0.0)
        for k in range(8):
            h += scene.prey_in[row, k] * team.infrared[b * 8 + k]
        h = sigmoid(h)
        left += scene.prey_out[row, 0] * h
        right += scene.prey_out[row, 1] * h
        row += 1
    return wp.vec2f(2.0 * sigmoid(left) - 1.0, 2.0 * sigmoid(right) - 1.0)


@wp.func
def command(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, t: int
) -> wp.vec2f:
    """Return the wheel commands, left and right, that body ``b``'s controller gives."""
    h = int(NONE)
    if b < p.n_robots:
        h = team.heuristic[b]
        if h == NONE:
            left = 2.0 * sigmoid(team.outputs[b, 0]) - 1.0
            return wp.vec2f(left, 2.0 * sigmoid(team.outputs[b, 1]) - 1.0)
        if p.team_is_prey != 0:
            h += 1
    elif is_prey(p, b):
        h = p.prey_mode
    if is_prey(p, b):
        if h == NETWORK:
            return think_as_prey(team, scene, p, b)
        if h == HEURISTIC:
            return avoid(team, p, b)
        return walk_randomly(team, scene, p, b, t)
    return pursue(team, scene, p, b, t)
