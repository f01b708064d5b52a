"""Wheel commands of predators and prey: networks, heuristics, the random walk.

Nitschke 2009, sections 4.1, 4.3, 4.6.6.
"""

import warp as wp

from conevo.kernels.khepera import N_SENSORS, RADIUS, steer, steer_to, wrap
from conevo.kernels.outputs import sigmoid
from conevo.kernels.phases import Phase, n_lanes
from conevo.kernels.random import uniform
from conevo.worlds.pursuit.bodies import (
    NONE,
    SLOTS,
    PursuitConstants,
    PursuitScene,
    PursuitTeam,
    first_of,
    is_prey,
    wheel_speed,
)

__all__ = ["FIRE", "WHEEL_BOUNDS", "command", "set_up_prey"]

TURN_OFTEN = wp.constant(0.05)  # Choice: chance per iteration that a random walk turns
WHEEL_BOUNDS = (-1.0, 1.0)  # of a wheel command
NETWORK = wp.constant(0)
HEURISTIC = wp.constant(1)
slots_vector = wp.types.vector(length=int(SLOTS), dtype=float)


# --- networks of prey -----------------------------------------------------------------------------


@wp.func
def has_network(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants) -> bool:
    """Return whether the prey are opponents with networks."""
    return p.team_is_prey == 0 and p.prey_mode == NETWORK


@wp.func
def set_up_prey(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, q: int, t: int
) -> None:
    """Lay out the weights of prey ``q``'s network: neurons next to each other, empty slots 0."""
    slots = team.prey_hidden.shape[0] // team.captured.shape[0]
    k = int(0)
    while k < slots:
        is_filled = k < p.prey_hidden
        row = q * p.prey_hidden + k
        for j in range(N_SENSORS):
            w = float(0.0)
            if is_filled:
                w = scene.prey_in[row, j]
            team.prey_in[(q * N_SENSORS + j) * slots + k] = w
        for o in range(2):
            w = float(0.0)
            if is_filled:
                w = scene.prey_out[row, o]
            team.prey_out[(q * 2 + o) * slots + k] = w
        k += 1


@wp.func
def neurons(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants) -> int:
    """Return the number of items of ``fire``: a neuron each, or, on one lane, some of a prey's."""
    if not has_network(team, scene, p):
        return 0
    return team.prey_hidden.shape[0] // wp.where(n_lanes() == 1, SLOTS, 1)


@wp.func
def fire(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, q: int, t: int) -> None:
    """Compute hidden neurons of a prey that is not the team (fig. 4.2) if its view has changed."""
    slots = team.prey_hidden.shape[0] // team.captured.shape[0]
    at = q * wp.where(n_lanes() == 1, SLOTS, 1)
    prey = at // slots
    if team.looks[p.n_robots + prey] == 0:
        return
    seen = (p.n_robots + prey) * N_SENSORS
    w = prey * (N_SENSORS - 1) * slots + at
    if n_lanes() == 1:
        h = slots_vector()
        for j in range(N_SENSORS):
            v = team.infrared[seen + j]
            for k in range(SLOTS):
                h[k] = h[k] + team.prey_in[w + k] * v
            w += slots
        for k in range(SLOTS):
            team.prey_hidden[at + k] = sigmoid(h[k])
    else:
        total = float(0.0)
        for j in range(N_SENSORS):
            total += team.prey_in[w] * team.infrared[seen + j]
            w += slots
        team.prey_hidden[at] = sigmoid(total)


FIRE = Phase(fire, neurons)


@wp.func
def as_network(team: PursuitTeam, p: PursuitConstants, b: int) -> wp.vec2f:
    """Return wheel commands of a prey that is not the team, from its hidden neurons."""
    if team.looks[b] == 0:  # its view has not changed
        return wp.vec2f(team.left[b], team.right[b])
    q = b - p.n_robots
    slots = team.prey_hidden.shape[0] // team.captured.shape[0]
    left = float(0.0)
    right = float(0.0)
    k = int(0)
    while k < p.prey_hidden:
        h = team.prey_hidden[q * slots + k]
        left += team.prey_out[q * 2 * slots + k] * h
        right += team.prey_out[(q * 2 + 1) * slots + k] * h
        k += 1
    return wheels_of(left, right)


@wp.func
def wheels_of(left: float, right: float) -> wp.vec2f:
    """Return the wheel commands that two output sums stand for."""
    return wp.vec2f(2.0 * sigmoid(left) - 1.0, 2.0 * sigmoid(right) - 1.0)


# --- heuristics -----------------------------------------------------------------------------------


@wp.func
def walk_randomly(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, t: int
) -> wp.vec2f:
    """Return wheel commands of a random walk: straight ahead, with a turn now and then.

    Choice: it turns with chance 0.05 in an iteration, and whenever its last move was refused.
    """
    if team.collided[b] != 0 or uniform(scene.seed[0], t, 1, b) < TURN_OFTEN:
        team.wander[b] = 6.2831853 * uniform(scene.seed[0], t, 2, b) - 3.1415927
    return steer(wrap(team.wander[b] - team.heading[b]), wheel_speed(p, b))


@wp.func
def pursue(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, t: int) -> wp.vec2f:
    """Return wheel commands of the heuristic predator (sections 4.3, 4.6.6).

    Straight at the closest prey in light range; else to its last known place; else a random walk.
    Choice: it turns on the spot as fast as needed, senses prey all around it, and gives up a place
    once it is within a robot's diameter of it.
    """
    x = team.x[b]
    y = team.y[b]
    prey = team.near[b] & all_prey(scene, p)
    if prey != 0:
        closest = p.sight_cm_2
        while prey != 0:
            j = first_of(prey)
            prey = prey & (prey - 1)
            dx = team.x[j] - x
            dy = team.y[j] - y
            d = dx * dx + dy * dy
            if d <= closest:
                closest = d
                team.known[b] = 1
                team.known_x[b] = team.x[j]
                team.known_y[b] = team.y[j]
    elif team.known[b] != 0:
        dx = team.known_x[b] - x
        dy = team.known_y[b] - y
        if dx * dx + dy * dy < 4.0 * RADIUS * RADIUS:
            team.known[b] = 0  # it is no longer here
    if team.known[b] == 0:
        return walk_randomly(team, scene, p, b, t)
    ahead = wp.vec2f(team.ahead_x[b], team.ahead_y[b])
    return steer_to(team.known_x[b] - x, team.known_y[b] - y, ahead, p.max_speed_cm)


@wp.func
def all_prey(scene: PursuitScene, p: PursuitConstants) -> int:
    """Return the set of prey among the bodies."""
    robots = (1 << p.n_robots) - 1
    return wp.where(p.team_is_prey != 0, robots, ((1 << scene.n_bodies[0]) - 1) & ~robots)


@wp.func
def avoid(team: PursuitTeam, p: PursuitConstants, b: int) -> wp.vec2f:
    """Return wheel commands of the heuristic prey: ahead, and away from the nearer side.

    Choice: the thesis has no heuristic prey; this one turns by the difference between its three
    sensors on either side, and on the spot if both sides are equally near.
    """
    k = b * N_SENSORS
    left = wp.max(wp.max(team.infrared[k], team.infrared[k + 1]), team.infrared[k + 2])
    right = wp.max(wp.max(team.infrared[k + 7], team.infrared[k + 6]), team.infrared[k + 5])
    w = right - left
    if wp.max(team.infrared[k], team.infrared[k + 7]) > 0.7 and wp.abs(w) < 0.05:
        w = 1.0
    w = wp.clamp(w, -1.0, 1.0)
    f = 1.0 - wp.abs(w)
    return wp.vec2f(f - w, f + w)


# --- all of them ----------------------------------------------------------------------------------


@wp.func
def command(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, t: int
) -> wp.vec2f:
    """Return the wheel commands, left and right, of body ``b``'s controller."""
    h = int(NONE)
    if b < p.n_robots:
        h = team.heuristic[b]
        if h == NONE:
            return wheels_of(team.outputs[b, 0], team.outputs[b, 1])
        if p.team_is_prey != 0:
            h += 1
    elif is_prey(p, b):
        h = p.prey_mode
    if is_prey(p, b):
        if h == NETWORK:
            return as_network(team, p, b)
        if h == HEURISTIC:
            return avoid(team, p, b)
        return walk_randomly(team, scene, p, b, t)
    return pursue(team, scene, p, b, t)
