"""Motion of predators and prey: from wheel commands to places, and reasons to refuse a move."""

import warp as wp

from conevo.kernels.actions import count_action
from conevo.kernels.khepera import RADIUS, drive
from conevo.kernels.outputs import EXTREME
from conevo.kernels.phases import Phase
from conevo.kernels.trigonometry import cosine_sine
from conevo.worlds.pursuit.bodies import (
    NONE,
    OBSTACLES,
    PursuitConstants,
    PursuitScene,
    PursuitTeam,
    first_of,
    is_prey,
    place_of,
    wheel_speed,
)
from conevo.worlds.pursuit.commands import FIRE, command
from conevo.worlds.pursuit.senses import bodies

__all__ = ["ACT", "ACTIONS", "COMMIT", "N_ACTIONS", "PRIMITIVES"]

# Choice: motor outputs are not actions; for S a predator's wheel pair is one of five primitives.
# Each with outputs that give it at full speed, of the left and of the right wheel.
PRIMITIVES = {
    "stop": (0.0, 0.0),
    "forward": (EXTREME, EXTREME),
    "left": (-EXTREME, EXTREME),
    "right": (EXTREME, -EXTREME),
    "reverse": (-EXTREME, -EXTREME),
}
ACTIONS = tuple(PRIMITIVES)

STOP = wp.constant(0)
FORWARD = wp.constant(1)
LEFT = wp.constant(2)
RIGHT = wp.constant(3)
REVERSE = wp.constant(4)
N_ACTIONS = wp.constant(5)
STOP_BELOW = wp.constant(0.1)  # Choice: both wheels below a tenth of full speed
WAY_UNITS = wp.constant(262144.0)  # in a cm: sums are exact, and 1000 x 6 cm fit into an int32


# --- act ------------------------------------------------------------------------------------------


@wp.func
def overlaps(ax: float, ay: float, bx: float, by: float) -> bool:
    """Return whether two bodies (or a body and an obstacle) at these places overlap."""
    dx = bx - ax
    dy = by - ay
    return dx * dx + dy * dy < 4.0 * RADIUS * RADIUS


@wp.func
def is_refused(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, x: float, y: float
) -> int:
    """Return 1 if body ``b`` may not move to a place: wall, obstacle or another body's place."""
    far = p.arena_cm - RADIUS
    if x < RADIUS or x > far or y < RADIUS or y > far:
        return 1
    discs = team.close[b]
    while discs != 0:
        at = place_of(team, scene, first_of(discs))
        if overlaps(x, y, at[0], at[1]):
            return 1
        discs = discs & (discs - 1)
    return 0


@wp.func
def set_wheels(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, t: int) -> None:
    """Set the wheels of body ``b``.

    A prey of the team that has collided does nothing for the rest of its epoch (section 4.3).
    """
    wheels = wp.vec2f(0.0, 0.0)
    if p.team_is_prey == 0 or b >= p.n_robots or team.collisions[b] == 0:
        wheels = command(team, scene, p, b, t)
    team.left[b] = wheels[0]
    team.right[b] = wheels[1]


@wp.func
def act(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, t: int) -> None:
    """Propose the next place of body ``b``, and check whether it may be there."""
    v = wheel_speed(p, b)
    ahead = wp.vec2f(team.ahead_x[b], team.ahead_y[b])
    to = drive(team.x[b], team.y[b], team.heading[b], ahead, v * team.left[b], v * team.right[b])
    team.to_x[b] = to[0]
    team.to_y[b] = to[1]
    team.to_heading[b] = to[2]
    team.refused[b] = is_refused(team, scene, p, b, to[0], to[1])


# --- commit ---------------------------------------------------------------------------------------


@wp.func
def primitive(left: float, right: float) -> int:
    """Return the motor primitive of a pair of wheel commands."""
    f = left + right
    w = right - left
    if wp.max(wp.abs(left), wp.abs(right)) < STOP_BELOW:
        return STOP
    if wp.abs(w) > wp.abs(f):
        return wp.where(w > 0.0, LEFT, RIGHT)
    return wp.where(f > 0.0, FORWARD, REVERSE)


@wp.func
def commit(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, t: int) -> None:
    """Move body ``b`` unless that is refused; count a robot's action, sum up a prey's path.

    Choice: if two bodies would overlap at their proposed places, neither moves, so that the order
    of bodies does not matter. After a refusal the whole old pose is kept (Evorobot's rule).
    """
    is_out = team.refused[b]
    others = team.close[b] & ((1 << OBSTACLES) - 1)
    while others != 0 and is_out == 0:
        j = first_of(others)
        others = others & (others - 1)
        if team.refused[j] == 0:
            if overlaps(team.to_x[b], team.to_y[b], team.to_x[j], team.to_y[j]):
                is_out = 1
    team.collided[b] = is_out
    was_out = team.collisions[b]
    team.collisions[b] = was_out + is_out
    moved = int(0)
    if is_out == 0:
        heading = team.to_heading[b]
        if heading != team.heading[b]:
            moved = 1
            ahead = cosine_sine(heading)
            team.heading[b] = heading
            team.ahead_x[b] = ahead[0]
            team.ahead_y[b] = ahead[1]
        if team.to_x[b] != team.x[b] or team.to_y[b] != team.y[b]:
            moved = 1
            team.x[b] = team.to_x[b]
            team.y[b] = team.to_y[b]
    team.has_moved[b] = moved
    if b < p.n_robots:
        a = primitive(team.left[b], team.right[b])
        if p.team_is_prey != 0 and was_out != 0:
            a = NONE
        count_action(team.action, team.switches, team.counts, b, a, a)
    elif is_prey(p, b):
        add_way(team, p, b, is_out, t)


@wp.func
def add_way(team: PursuitTeam, p: PursuitConstants, b: int, is_out: int, t: int) -> None:
    """Add an iteration's commanded and driven distance of prey ``b`` to the sums of the window."""
    q = b - p.n_robots
    way = int(0.5 * wp.abs(team.left[b] + team.right[b]) * p.prey_speed_cm * WAY_UNITS + 0.5)
    moved = wp.where(is_out == 0, way, 0)
    at = q * p.capture_window + t % p.capture_window
    team.commanded_sum[q] = team.commanded_sum[q] + (way - team.commanded[at])
    team.moved_sum[q] = team.moved_sum[q] + (moved - team.moved[at])
    team.commanded[at] = way
    team.moved[at] = moved


ACT = (FIRE, Phase(set_wheels, bodies), Phase(act, bodies))
COMMIT = (Phase(commit, bodies),)
