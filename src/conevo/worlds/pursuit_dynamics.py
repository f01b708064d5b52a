"""The dynamics of predators and prey: what a Khepera does in one iteration, as Warp functions.

One set of rules serves two worlds: in ``worlds.pursuit`` the team are the predators, in
``worlds.prey`` the prey. Bodies are numbered: first the team's robots, then the others (the prey,
or the heuristic predators), which robot ``i`` looks after in turn (``i + R``, ``i + 2 R``, ...).
Every function writes only data of the robot it is called for and of the bodies it looks after. The
rules and the choices stand on the cards of the two worlds.
"""

import warp as wp

from conevo.kernels.khepera import (
    RADIUS,
    drive,
    eight,
    see_disc,
    see_wall,
    steer,
    wrap,
)
from conevo.kernels.network import Networks, sigmoid
from conevo.kernels.random import uniform

__all__ = ["ACTIONS", "PREY_FUNCTIONS", "PURSUIT_FUNCTIONS", "Params", "Scene", "Team"]

# Choice: motor outputs name no actions; for S a predator's wheel pair is one of five primitives.
ACTIONS = ("stop", "forward", "left", "right", "reverse")

# --- state ----------------------------------------------------------------------------------------

NONE = wp.constant(-1)
STOP = wp.constant(0)
FORWARD = wp.constant(1)
LEFT = wp.constant(2)
RIGHT = wp.constant(3)
REVERSE = wp.constant(4)
N_ACTIONS = wp.constant(5)
STOP_BELOW = wp.constant(0.1)  # Choice: both wheels below a tenth of full speed
TURN_OFTEN = wp.constant(0.05)  # Choice: chance per iteration that a random walk turns
NETWORK = wp.constant(0)
HEURISTIC = wp.constant(1)
N_OBSTACLES = wp.constant(6)  # most obstacles of a scenario


@wp.struct
class Params:
    """Parameters of both worlds for the kernels; ``cone`` is the cosine and sine of its angle."""

    n_robots: int
    team_is_prey: int
    arena: float
    reach: float
    cone: wp.vec2f
    speed: float  # of a predator's wheel at command 1, cm per iteration
    prey_speed: float
    prey_mode: int  # how prey that are not the team are controlled
    prey_hidden: int
    window: int
    moved_share: float
    moved_least: float
    n_captors: int


@wp.struct
class Scene:
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


@wp.struct
class Team:
    """State of a team and its opponents, flat over a batch. B bodies, R robots, Q prey."""

    nets: Networks
    heuristic: wp.array[int]
    x: wp.array[float]
    y: wp.array[float]
    heading: wp.array[float]
    to_x: wp.array[float]
    to_y: wp.array[float]
    to_heading: wp.array[float]
    left: wp.array[float]  # wheel commands in [-1, 1]
    right: wp.array[float]
    refused: wp.array[int]  # by walls, obstacles and where others are
    collided: wp.array[int]  # refused for any reason
    collisions: wp.array[int]
    infrared: wp.array[float]  # [B, 8]
    wander: wp.array[float]  # direction of a random walk
    known: wp.array[int]  # whether there is a last known place of a prey
    known_x: wp.array[float]
    known_y: wp.array[float]
    moved: wp.array[float]  # [Q, window], a ring
    commanded: wp.array[float]
    captured: wp.array[int]
    captures: wp.array[int]
    first: wp.array[int]  # iteration of the first capture, NONE before
    action: wp.array[int]
    fitness: wp.array[float]
    counts: wp.array[int]  # [R, A]
    switches: wp.array[int]
    performance: wp.array[float]


@wp.func
def is_prey(p: Params, b: int) -> bool:
    """Return whether body ``b`` is a prey."""
    return (b < p.n_robots) == (p.team_is_prey != 0)


@wp.func
def wheel_speed(p: Params, b: int) -> float:
    """Return how far body ``b``'s wheel rolls in an iteration at command 1."""
    return wp.where(is_prey(p, b), p.prey_speed, p.speed)


# --- reset ----------------------------------------------------------------------------------------


@wp.func
def reset(team: Team, scene: Scene, p: Params, i: int) -> None:
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
    team.action[i] = NONE
    team.fitness[i] = 0.0
    team.switches[i] = 0
    for a in range(N_ACTIONS):
        team.counts[i * N_ACTIONS + a] = 0
    if i == 0:
        team.first[0] = NONE


# --- sense ----------------------------------------------------------------------------------------


@wp.func
def look(team: Team, scene: Scene, p: Params, b: int, is_light: bool) -> eight:
    """Return the activations of body ``b``'s infrared or light sensors.

    Infrared sees walls, obstacles and bodies; light sees prey, over the heads of others.
    """
    x = team.x[b]
    y = team.y[b]
    c = wp.cos(team.heading[b])
    s = wp.sin(team.heading[b])
    seen = eight()
    limit = p.reach + 2.0 * RADIUS
    j = int(0)
    while j < scene.n_bodies[0]:
        if j != b and (not is_light or is_prey(p, j)):
            dx = team.x[j] - x
            dy = team.y[j] - y
            if dx * dx + dy * dy < limit * limit:
                seen = see_disc(seen, c * dx + s * dy, c * dy - s * dx, RADIUS, p.cone, p.reach)
        j += 1
    if is_light:
        return seen
    j = int(0)
    while j < scene.n_obstacles[0]:
        dx = scene.obstacle_x[j] - x
        dy = scene.obstacle_y[j] - y
        if dx * dx + dy * dy < limit * limit:
            seen = see_disc(seen, c * dx + s * dy, c * dy - s * dx, RADIUS, p.cone, p.reach)
        j += 1
    near = p.reach + RADIUS
    if x < near:
        seen = see_wall(seen, x, -c, s, p.cone, p.reach)
    if p.arena - x < near:
        seen = see_wall(seen, p.arena - x, c, -s, p.cone, p.reach)
    if y < near:
        seen = see_wall(seen, y, -s, -c, p.cone, p.reach)
    if p.arena - y < near:
        seen = see_wall(seen, p.arena - y, s, c, p.cone, p.reach)
    return seen


@wp.func
def sense(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Fill robot ``i``'s sensor inputs, and those of prey that are not the team."""
    n_sensors = scene.clamp.shape[1]
    base = i * (team.nets.inputs.shape[0] // p.n_robots)
    seen = look(team, scene, p, i, False)
    for k in range(8):
        team.nets.inputs[base + k] = seen[k]
        team.infrared[i * 8 + k] = seen[k]
    if p.team_is_prey == 0:
        light = look(team, scene, p, i, True)
        for k in range(8):
            team.nets.inputs[base + 8 + k] = light[k]
    k = int(0)
    while k < n_sensors:
        held = scene.clamp[i, k]
        if not wp.isnan(held):
            team.nets.inputs[base + k] = held
        k += 1
    b = i + p.n_robots
    while b < scene.n_bodies[0]:
        if is_prey(p, b):
            seen = look(team, scene, p, b, False)
            for k in range(8):
                team.infrared[b * 8 + k] = seen[k]
        b += p.n_robots


# --- act ------------------------------------------------------------------------------------------


@wp.func
def walk_randomly(team: Team, scene: Scene, p: Params, b: int, t: int) -> wp.vec2f:
    """Return wheel commands of a random walk: straight on, now and then another way.

    Choice: it turns with chance 0.05 in an iteration, and whenever its last move was refused.
    """
    if team.collided[b] != 0 or uniform(scene.seed[0], t, 1, b) < TURN_OFTEN:
        team.wander[b] = 6.2831853 * uniform(scene.seed[0], t, 2, b) - 3.1415927
    return steer(wrap(team.wander[b] - team.heading[b]), wheel_speed(p, b))


@wp.func
def pursue(team: Team, scene: Scene, p: Params, b: int, t: int) -> wp.vec2f:
    """Return wheel commands of the heuristic predator (sections 4.3, 4.6.6).

    Straight at the closest prey in light range; else to where it was seen last; else a random walk.
    Choice: it turns on the spot as fast as needed, knows prey all around it, and gives up a place
    once it is within a robot's diameter of it.
    """
    x = team.x[b]
    y = team.y[b]
    limit = p.reach + 2.0 * RADIUS
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
    return steer(wrap(wp.atan2(dy, dx) - team.heading[b]), p.speed)


@wp.func
def avoid(team: Team, p: Params, b: int) -> wp.vec2f:
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
def think_as_prey(team: Team, scene: Scene, p: Params, b: int) -> wp.vec2f:
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
def command(team: Team, scene: Scene, p: Params, b: int, t: int) -> wp.vec2f:
    """Return the wheel commands, left and right, that body ``b``'s controller gives."""
    h = int(NONE)
    if b < p.n_robots:
        h = team.heuristic[b]
        if h == NONE:
            sums = team.nets.sums[b]
            return wp.vec2f(2.0 * sigmoid(sums[0]) - 1.0, 2.0 * sigmoid(sums[1]) - 1.0)
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


@wp.func
def overlaps(ax: float, ay: float, bx: float, by: float) -> bool:
    """Return whether two bodies (or a body and an obstacle) at these places overlap."""
    dx = bx - ax
    dy = by - ay
    return dx * dx + dy * dy < 4.0 * RADIUS * RADIUS


@wp.func
def is_refused(team: Team, scene: Scene, p: Params, b: int, x: float, y: float) -> int:
    """Return 1 if body ``b`` may not move to a place: wall, obstacle, or another body there now."""
    far = p.arena - RADIUS
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
def act(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
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
def commit(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
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
            d = 0.5 * wp.abs(team.left[b] + team.right[b]) * p.prey_speed
            at = (b - p.n_robots) * p.window + t % p.window
            team.commanded[at] = d
            team.moved[at] = wp.where(is_out == 0, d, 0.0)
        if b == i:
            a = primitive(team.left[b], team.right[b])
            previous = team.action[i]
            if p.team_is_prey != 0 and was_out != 0:
                a = NONE
            else:
                team.counts[i * N_ACTIONS + a] = team.counts[i * N_ACTIONS + a] + 1
                if previous != NONE and previous != a:
                    team.switches[i] = team.switches[i] + 1
            team.action[i] = a
        b += p.n_robots


# --- resolve --------------------------------------------------------------------------------------


@wp.func
def is_captured(team: Team, p: Params, q: int, t: int) -> bool:
    """Return whether prey ``q`` is captured in this iteration: immobilized, with predators near."""
    if t + 1 < p.window:
        return False
    moved = float(0.0)
    commanded = float(0.0)
    k = int(0)
    while k < p.window:
        moved += team.moved[q * p.window + k]
        commanded += team.commanded[q * p.window + k]
        k += 1
    if moved >= p.moved_share * commanded and moved >= p.moved_least:
        return False
    limit = p.reach + 2.0 * RADIUS
    near = int(0)
    j = int(0)
    while j < p.n_robots:
        dx = team.x[j] - team.x[p.n_robots + q]
        dy = team.y[j] - team.y[p.n_robots + q]
        near += int(dx * dx + dy * dy <= limit * limit)
        j += 1
    return near >= p.n_captors


@wp.func
def resolve_capture(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
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
def resolve_escape(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Credit prey ``i`` with the way it has come, the straighter the more; nothing once collided.

    Section 4.3: "how far and fast the prey could move in a straight line without colliding".
    Choice: distance times 1 - sqrt(difference of the wheels), Floreano and Mondada's form of it.
    """
    if team.collisions[i] != 0:
        team.fitness[i] = 0.0
        return
    d = 0.5 * wp.abs(team.left[i] + team.right[i]) * p.prey_speed
    bend = 0.5 * wp.abs(team.right[i] - team.left[i])
    team.fitness[i] = team.fitness[i] + d * (1.0 - wp.sqrt(bend))


# --- outcome --------------------------------------------------------------------------------------


@wp.func
def outcome_capture(team: Team, scene: Scene, p: Params, t_end: int) -> None:
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
def outcome_escape(team: Team, scene: Scene, p: Params, t_end: int) -> None:
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
