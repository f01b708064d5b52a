"""The dynamics of predators and prey: what a Khepera does in one iteration, as Warp functions.

One set of rules serves two worlds: in ``pursuit.world`` the team are the predators, in
``pursuit.prey`` the prey. Bodies are numbered: first the team's robots, then the others (the prey,
or the heuristic predators), which robot ``i`` looks after in turn (``i + R``, ``i + 2 R``, ...).
Every function writes only data of the robot it is called for and of the bodies it owns. The
rules and the choices stand on the cards of the two worlds.
"""

import warp as wp

from conevo.kernels.actions import begin_counting, count_action
from conevo.kernels.khepera import RADIUS, drive
from conevo.kernels.trigonometry import cosine_sine
from conevo.worlds.pursuit.bodies import (
    NONE,
    PursuitConstants,
    PursuitScene,
    PursuitTeam,
    command,
    is_prey,
    look,
    wheel_speed,
)

__all__ = ["ACTIONS", "N_ACTIONS", "PREY_FUNCTIONS", "PURSUIT_FUNCTIONS"]

# Choice: motor outputs name no actions; for S a predator's wheel pair is one of five primitives.
ACTIONS = ("stop", "forward", "left", "right", "reverse")

STOP = wp.constant(0)
FORWARD = wp.constant(1)
LEFT = wp.constant(2)
RIGHT = wp.constant(3)
REVERSE = wp.constant(4)
N_ACTIONS = wp.constant(5)
STOP_BELOW = wp.constant(0.1)  # Choice: both wheels below a tenth of full speed


# --- reset ----------------------------------------------------------------------------------------


@wp.func
def reset(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, i: int) -> None:
    """Put robot ``i`` and the bodies it looks after at their places and clear their records."""
    b = int(i)
    while b < team.x.shape[0]:  # absent bodies too: nothing of another team is left in a record
        team.x[b] = scene.x[b]
        team.y[b] = scene.y[b]
        team.heading[b] = scene.heading[b]
        team.wander[b] = scene.heading[b]
        team.left[b] = 0.0
        team.right[b] = 0.0
        team.refused[b] = 0
        team.collided[b] = 0
        team.collisions[b] = 0
        team.known[b] = 0
        b += p.n_robots
    q = int(i)
    while q < team.captured.shape[0]:
        team.captured[q] = 0
        team.captures[q] = 0
        q += p.n_robots
    team.fitness[i] = 0.0
    begin_counting(team.action, team.switches, team.counts, i)
    if i == 0:
        team.first[0] = NONE


# --- sense ----------------------------------------------------------------------------------------


@wp.func
def sense(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, i: int, t: int) -> None:
    """Fill robot ``i``'s sensor inputs, and those of prey that are not the team."""
    ahead = cosine_sine(team.heading[i])
    seen = look(team, scene, p, i, ahead, False)
    for k in range(8):
        team.inputs[i, k] = seen[k]
        team.infrared[i * 8 + k] = seen[k]
    if p.team_is_prey == 0:
        light = look(team, scene, p, i, ahead, True)
        for k in range(8):
            team.inputs[i, 8 + k] = light[k]
    k = int(0)
    while k < scene.clamp.shape[1]:
        held = scene.clamp[i, k]
        if not wp.isnan(held):
            team.inputs[i, k] = held
        k += 1
    b = i + p.n_robots
    while b < scene.n_bodies[0]:
        if is_prey(p, b):
            seen = look(team, scene, p, b, cosine_sine(team.heading[b]), False)
            for k in range(8):
                team.infrared[b * 8 + k] = seen[k]
        b += p.n_robots


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
    """Return 1 if body ``b`` may not move to a place: wall, obstacle, or another body there now."""
    far = p.arena_cm - RADIUS
    if x < RADIUS or x > far or y < RADIUS or y > far:
        return 1
    j = int(0)
    while j < scene.n_bodies[0]:
        if j != b and overlaps(x, y, team.x[j], team.y[j]):
            return 1
        j += 1
    j = int(0)
    while j < scene.n_obstacles[0]:
        if overlaps(x, y, scene.obstacle_x[j], scene.obstacle_y[j]):
            return 1
        j += 1
    return 0


@wp.func
def act(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, i: int, t: int) -> None:
    """Set the wheels of robot ``i`` and of the bodies it looks after; propose where they will be.

    A prey of the team that has collided does nothing more in its epoch (section 4.3).
    """
    b = int(i)
    while b < scene.n_bodies[0]:
        wheels = wp.vec2f(0.0, 0.0)
        if p.team_is_prey == 0 or b >= p.n_robots or team.collisions[b] == 0:
            wheels = command(team, scene, p, b, t)
        team.left[b] = wheels[0]
        team.right[b] = wheels[1]
        v = wheel_speed(p, b)
        to = drive(team.x[b], team.y[b], team.heading[b], v * wheels[0], v * wheels[1])
        team.to_x[b] = to[0]
        team.to_y[b] = to[1]
        team.to_heading[b] = to[2]
        team.refused[b] = is_refused(team, scene, p, b, to[0], to[1])
        b += p.n_robots


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
def commit(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, i: int, t: int) -> None:
    """Move robot ``i`` and the bodies it looks after, unless refused; count the robot's action.

    Choice: of two bodies that would overlap where both want to go, neither moves, so that no order
    of bodies matters. Refused: the whole old pose is kept (Evorobot's rule).
    """
    b = int(i)
    while b < scene.n_bodies[0]:
        is_out = team.refused[b]
        j = int(0)
        while j < scene.n_bodies[0]:
            if j != b and is_out == 0 and team.refused[j] == 0:
                if overlaps(team.to_x[b], team.to_y[b], team.to_x[j], team.to_y[j]):
                    is_out = 1
            j += 1
        team.collided[b] = is_out
        was_out = team.collisions[b]
        team.collisions[b] = was_out + is_out
        if is_out == 0:
            team.x[b] = team.to_x[b]
            team.y[b] = team.to_y[b]
            team.heading[b] = team.to_heading[b]
        if b >= p.n_robots and is_prey(p, b):
            d = 0.5 * wp.abs(team.left[b] + team.right[b]) * p.prey_speed_cm
            at = (b - p.n_robots) * p.capture_window + t % p.capture_window
            team.commanded[at] = d
            team.moved[at] = wp.where(is_out == 0, d, 0.0)
        if b == i:
            a = primitive(team.left[b], team.right[b])
            if p.team_is_prey != 0 and was_out != 0:
                a = NONE
            count_action(team.action, team.switches, team.counts, i, a, a)
        b += p.n_robots


# --- resolve --------------------------------------------------------------------------------------


@wp.func
def is_captured(team: PursuitTeam, p: PursuitConstants, q: int, t: int) -> bool:
    """Return whether prey ``q`` is captured in this iteration: immobilized, with predators near."""
    if t + 1 < p.capture_window:
        return False
    moved = float(0.0)
    commanded = float(0.0)
    k = int(0)
    while k < p.capture_window:
        moved += team.moved[q * p.capture_window + k]
        commanded += team.commanded[q * p.capture_window + k]
        k += 1
    if moved >= p.capture_share * commanded and moved >= p.capture_distance_cm:
        return False
    limit = p.sensor_range_cm + 2.0 * RADIUS
    near = int(0)
    j = int(0)
    while j < p.n_robots:
        dx = team.x[j] - team.x[p.n_robots + q]
        dy = team.y[j] - team.y[p.n_robots + q]
        near += int(dx * dx + dy * dy <= limit * limit)
        j += 1
    return near >= p.capture_predators


@wp.func
def resolve_capture(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, i: int, t: int
) -> None:
    """Credit predator ``i`` if any prey is captured, as all predators are (section 4.4).

    Each predator finds it out by itself, so nobody writes another's data.
    """
    held = int(0)
    q = int(0)
    while q < team.captured.shape[0]:
        now = int(is_captured(team, p, q, t))
        held = wp.max(held, now)
        if q % p.n_robots == i:
            if now > team.captured[q]:
                team.captures[q] = team.captures[q] + 1
            team.captured[q] = now
        q += 1
    team.fitness[i] = team.fitness[i] + float(held)
    if i == 0 and held != 0 and team.first[0] == NONE:
        team.first[0] = t


@wp.func
def resolve_escape(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, i: int, t: int
) -> None:
    """Credit prey ``i`` with the way it has come, the straighter the more; nothing once collided.

    Section 4.3: "how far and fast the prey could move in a straight line without colliding".
    Choice: distance times 1 - sqrt(difference of the wheels), Floreano and Mondada's form of it.
    """
    if team.collisions[i] != 0:
        team.fitness[i] = 0.0
        return
    d = 0.5 * wp.abs(team.left[i] + team.right[i]) * p.prey_speed_cm
    bend = 0.5 * wp.abs(team.right[i] - team.left[i])
    team.fitness[i] = team.fitness[i] + d * (1.0 - wp.sqrt(bend))


# --- outcome --------------------------------------------------------------------------------------


@wp.func
def outcome_capture(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, t_end: int
) -> None:
    """Write capture time, iteration of the first capture, captures, and the team's collisions."""
    captures = int(0)
    for q in range(team.captured.shape[0]):
        captures += team.captures[q]
    collisions = int(0)
    for i in range(p.n_robots):
        collisions += team.collisions[i]
    team.performance[0] = team.fitness[0]
    team.performance[1] = float(wp.where(team.first[0] == NONE, t_end, team.first[0]))
    team.performance[2] = float(captures)
    team.performance[3] = float(collisions)


@wp.func
def outcome_escape(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, t_end: int) -> None:
    """Write the prey's mean path, and the share of them that collided."""
    path = float(0.0)
    collided = int(0)
    for i in range(p.n_robots):
        path += team.fitness[i]
        collided += wp.min(team.collisions[i], 1)
    team.performance[0] = path / float(p.n_robots)
    team.performance[1] = float(collided) / float(p.n_robots)


_PHASES = {"reset": reset, "sense": sense, "act": act, "commit": commit}
PURSUIT_FUNCTIONS = _PHASES | {"resolve": resolve_capture, "outcome": outcome_capture}
PREY_FUNCTIONS = _PHASES | {"resolve": resolve_escape, "outcome": outcome_escape}
