"""What a robot of ``worlds.gacc.world`` does in one iteration, and what becomes of objects.

Reset, act, commit, resolve, outcome; rules and choices stand on the card of ``worlds.gacc.world``.
Every function writes only data of the robot it is called for and of the object that only this robot
holds; but ``resolve`` is one referee, robot 0, since objects compete for places in a plan.
"""

import warp as wp

from conevo.kernels.actions import PREFERENCE, begin_counting, count_action, heuristic_action
from conevo.kernels.outputs import highest
from conevo.kernels.random import uniform
from conevo.kernels.steps import is_taken, random_step, steered_step
from conevo.worlds.gacc.senses import sense
from conevo.worlds.gacc.state import (
    CARRIED,
    DELIVERED,
    DROPPED,
    GRIP,
    GRIPPED,
    HELPED,
    LYING,
    MOVE,
    N_ACTIONS,
    N_CASTES,
    NONE,
    UNDETECTED,
    WAITING,
    GaccConstants,
    GaccScene,
    GaccTeam,
    is_home,
    is_known,
    is_lying,
    is_refused,
)

__all__ = ["FUNCTIONS"]

GATHER = wp.constant(4)  # columns of counts: gather A, B, C
CONSTRUCT = wp.constant(7)  # construct A, B, C
CONSTRUCTORS = wp.constant(6)  # heuristic controllers: detectors, gatherers, these, non-specialized
NON_SPECIALIZED = wp.constant(9)


# --- reset ----------------------------------------------------------------------------------------


@wp.func
def reset(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int) -> None:
    """Put robot ``i`` at its start and clear its share of what is recorded."""
    team.x[i] = scene.start_x[i]
    team.y[i] = scene.start_y[i]
    team.target[i] = NONE
    team.held[i] = NONE
    team.waited[i] = 0
    team.dropped[i] = NONE
    team.situation[i] = 0
    team.energy[i] = p.energy
    team.fitness[i] = 0.0
    begin_counting(team.action, team.switches, team.counts, i)
    for k in range(i, p.n_objects, p.n_robots):
        team.object_x[k] = scene.object_x[k]
        team.object_y[k] = scene.object_y[k]
        team.life[k] = LYING
        team.detected[k] = UNDETECTED
        team.part[k] = NONE
        team.holders[k] = 0
    if i == 0:
        for c in range(p.n_complex):
            team.built[c] = 0
            for kind in range(3):
                team.missing[3 * c + kind] = 0
            for step in range(scene.plan.shape[1]):
                at = 3 * c + scene.plan[c, step]
                team.missing[at] = team.missing[at] + 1
        for kind in range(3):
            team.demand[kind] = 0.0


# --- act ------------------------------------------------------------------------------------------


@wp.func
def fetch(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, k: int) -> None:
    """Choose to grip object ``k``, or to go straight to it if it is out of reach."""
    dx = team.object_x[k] - team.x[i]
    dy = team.object_y[k] - team.y[i]
    d2 = dx * dx + dy * dy
    if d2 <= p.grip_distance_2:
        team.chosen[i] = GRIP + scene.object_type[k]
        team.target[i] = k
    else:
        team.chosen[i] = MOVE
        propose(team, scene, p, i, straight_step(p, dx, dy))


@wp.func
def straight_step(p: GaccConstants, dx: float, dy: float) -> wp.vec2f:
    """Return the longest step towards a place that lies so far away, not beyond it."""
    d = wp.sqrt(dx * dx + dy * dy)
    step = wp.min(p.move_range, d) / d
    return wp.vec2f(step * dx, step * dy)


@wp.func
def propose(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, step: wp.vec2f) -> None:
    """Propose a step for robot ``i``, unless the place is refused."""
    x = team.x[i] + step[0]
    y = team.y[i] + step[1]
    if not is_refused(team, scene, p, i, x, y):
        team.to_x[i] = x
        team.to_y[i] = y


@wp.func
def closest_carrier(team: GaccTeam, p: GaccConstants, i: int) -> int:
    """Return the closest robot in the home area that needs help, or NONE (situation 1)."""
    best = float(p.home_sight_2)
    found = int(NONE)
    j = int(0)
    while j < p.n_robots:
        k = team.held[j]
        if k >= 0 and k != team.dropped[i] and j != i:
            dx = team.x[j] - team.x[i]
            dy = team.y[j] - team.y[i]
            d2 = dx * dx + dy * dy
            if d2 < best and is_home(p, team.x[j], team.y[j]):
                best = d2
                found = j
        j += 1
    return found


@wp.func
def closest_at_home(team: GaccTeam, p: GaccConstants, i: int, t: int) -> int:
    """Return the closest known object that lies in the home area, or NONE (situation 3)."""
    best = float(p.home_sight_2)
    found = int(NONE)
    k = int(0)
    while k < p.n_objects:
        if is_lying(team, k) and k != team.dropped[i]:
            dx = team.object_x[k] - team.x[i]
            dy = team.object_y[k] - team.y[i]
            d2 = dx * dx + dy * dy
            if d2 < best and is_known(team, p, k, t):
                if is_home(p, team.object_x[k], team.object_y[k]):
                    best = d2
                    found = k
        k += 1
    return found


@wp.func
def takes_over(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int) -> int:
    """Return which situation of 6.2.8 decides for robot ``i``, after it has decided; 0 if none."""
    if not is_home(p, team.x[i], team.y[i]):
        return 0
    k = team.held[i]
    if k >= 0:
        team.chosen[i] = GRIP + scene.object_type[k]
        return 2
    j = closest_carrier(team, p, i)
    if j >= 0:
        fetch(team, scene, p, i, team.held[j])
        return 1
    k = closest_at_home(team, p, i, t)
    if k >= 0:
        fetch(team, scene, p, i, k)
        return 3
    return 0


@wp.func
def within_grip(
    team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int, kind: int
) -> int:
    """Return the closest object of a type that robot ``i`` can grip outside home, or NONE."""
    found = int(NONE)
    if is_home(p, team.x[i], team.y[i]):
        return found
    best = float(p.grip_distance_2)
    k = int(0)
    while k < p.n_objects:
        if scene.object_type[k] == kind and is_lying(team, k):
            dx = team.object_x[k] - team.x[i]
            dy = team.object_y[k] - team.y[i]
            d2 = dx * dx + dy * dy
            if d2 < best or (d2 == best and found == NONE):
                if is_known(team, p, k, t) and not is_home(p, team.object_x[k], team.object_y[k]):
                    best = d2
                    found = k
        k += 1
    return found


@wp.func
def act(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int) -> None:
    """Choose robot ``i``'s action (6.2.7, 6.2.8) and propose where it will be, or what it grips."""
    team.to_x[i] = team.x[i]
    team.to_y[i] = team.y[i]
    team.target[i] = NONE
    team.situation[i] = 0
    team.chosen[i] = NONE
    if team.energy[i] <= 0.0:
        return
    team.situation[i] = takes_over(team, scene, p, i, t)
    if team.situation[i] != 0:
        return
    if team.heuristic[i] >= 0:
        follow_preferences(team, scene, p, i, t)
    else:
        output = highest(team.outputs, i, 8)
        team.chosen[i] = wp.where(output <= MOVE, output, output - 1)  # outputs 3 and 4: move
        if team.chosen[i] == MOVE:
            step = steered_step(team.outputs[i, 3], team.outputs[i, 4], p.move_range)
            propose(team, scene, p, i, step)
    a = team.chosen[i]
    if a >= GRIP and team.held[i] == NONE:
        team.target[i] = within_grip(team, scene, p, i, t, a - GRIP)


@wp.func
def follow_preferences(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int) -> None:
    """Choose heuristic robot ``i``'s action as table 6.3 prefers; constructors stay at home."""
    h = team.heuristic[i]
    u = uniform(scene.seed[0], t, 0, i)
    step = random_step(uniform(scene.seed[0], t, 1, i), p.move_range)
    at_home = is_home(p, team.x[i], team.y[i])
    is_constructor = h >= CONSTRUCTORS and h < NON_SPECIALIZED
    own = wp.where(h < 3, h, GRIP + h % 3)
    if h == NON_SPECIALIZED:
        own = NONE
    elif is_constructor and not at_home:
        own = MOVE
        if u < PREFERENCE:
            step = straight_step(p, 0.5 - team.x[i], 0.5 - team.y[i])
    team.chosen[i] = heuristic_action(u, own, MOVE, N_ACTIONS)
    if team.chosen[i] == MOVE:
        to = wp.vec2f(team.x[i] + step[0], team.y[i] + step[1])
        if not (at_home and is_constructor) or is_home(p, to[0], to[1]):
            propose(team, scene, p, i, step)


# --- commit ---------------------------------------------------------------------------------------


@wp.func
def is_first(team: GaccTeam, i: int, k: int) -> bool:
    """Return whether no robot with a lower number grips at the same object."""
    j = int(0)
    while j < i:
        if team.target[j] == k:
            return False
        j += 1
    return True


@wp.func
def move(team: GaccTeam, p: GaccConstants, i: int) -> None:
    """Move robot ``i`` and what it holds to where it proposes.

    Choice: of two robots that propose the same place, the one with the lower number gets it.
    """
    x = team.to_x[i]
    y = team.to_y[i]
    if x == team.x[i] and y == team.y[i]:
        return
    if is_taken(team.to_x, team.to_y, i, i, x, y, p.separation_2):
        return
    team.x[i] = x
    team.y[i] = y
    k = team.held[i]
    if k >= 0:  # outside the home area, where nobody else holds it
        team.object_x[k] = x
        team.object_y[k] = y
        team.life[k] = CARRIED


@wp.func
def commit(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int) -> None:
    """Carry out robot ``i``'s action, count it and pay for it."""
    a = team.chosen[i]
    if a == NONE:
        team.action[i] = NONE
        return
    held = team.held[i]
    column = int(a)
    cost = p.robot_cost
    if a < MOVE:
        cost += p.object_cost
    elif a == MOVE:
        cost += p.move_cost
        if held >= 0:
            column = GATHER + scene.object_type[held]
        move(team, p, i)
    else:
        cost += p.grip_cost
        k = team.target[i]
        if team.situation[i] == 2:
            team.waited[i] = team.waited[i] + 1
        elif held >= 0:
            if scene.object_type[held] != a - GRIP:
                team.held[i] = NONE
        elif k >= 0:
            if is_home(p, team.x[i], team.y[i]) or is_first(team, i, k):
                team.held[i] = k
    team.energy[i] = team.energy[i] - cost
    if team.energy[i] <= 0.0:
        team.held[i] = NONE
        team.waited[i] = 0
    if not is_home(p, team.x[i], team.y[i]):
        team.dropped[i] = NONE
    count_action(team.action, team.switches, team.counts, i, a, column)


# --- resolve --------------------------------------------------------------------------------------


@wp.func
def place_for(team: GaccTeam, scene: GaccScene, p: GaccConstants, kind: int) -> int:
    """Return the first complex object that needs a part of this type now, or NONE."""
    parts = scene.plan.shape[1]
    for c in range(p.n_complex):
        if team.built[c] < parts:
            if ((p.ordered >> c) & 1) != 0:
                if scene.plan[c, team.built[c]] == kind:
                    return c
            elif team.missing[3 * c + kind] > 0:
                return c
    return NONE


@wp.func
def let_go(team: GaccTeam, i: int) -> None:
    """Open robot ``i``'s gripper in the home area; it keeps off the object until it has left."""
    team.dropped[i] = team.held[i]
    team.held[i] = NONE
    team.waited[i] = 0


@wp.func
def build(team: GaccTeam, scene: GaccScene, p: GaccConstants, k: int, c: int) -> None:
    """Make object ``k`` the next part of complex object ``c`` and credit all that hold it."""
    kind = scene.object_type[k]
    parts = scene.plan.shape[1]
    step = team.built[c]
    team.part[k] = c * parts + step
    team.built[c] = step + 1
    team.missing[3 * c + kind] = team.missing[3 * c + kind] - 1
    team.life[k] = DELIVERED
    team.holders[k] = 0
    team.object_x[k] = 0.5 + p.zone_side * ((float(step) + 0.5) / float(parts) - 0.5)
    team.object_y[k] = 0.5 + p.zone_side * ((float(c) + 0.5) / float(p.n_complex) - 0.5)
    for j in range(p.n_robots):
        if team.held[j] == k:
            spent = team.waited[j] + 1
            row = j * N_CASTES
            team.counts[row + GATHER + kind] = team.counts[row + GATHER + kind] - spent
            team.counts[row + CONSTRUCT + kind] = team.counts[row + CONSTRUCT + kind] + spent
            team.fitness[j] = team.fitness[j] + 1.0
            team.held[j] = NONE
            team.waited[j] = 0


@wp.func
def signal(team: GaccTeam, scene: GaccScene, p: GaccConstants) -> None:
    """Set the demand for each type (6.2.3): how soon it is needed, over how many are missing.

    Choice: a complex object of two parts or more asks for a type with 1 / steps until its next use,
    if it has an order, else with 1; the team hears the strongest, divided as in eqs 6.4 to 6.6.
    """
    parts = scene.plan.shape[1]
    for kind in range(3):
        strongest = float(0.0)
        missing = int(0)
        for c in range(p.n_complex):
            missing += team.missing[3 * c + kind]
            if team.built[c] >= 2 and team.missing[3 * c + kind] > 0:
                steps = int(1)
                if ((p.ordered >> c) & 1) != 0:
                    while scene.plan[c, wp.min(team.built[c] + steps, parts) - 1] != kind:
                        steps += 1
                strongest = wp.max(strongest, 1.0 / float(steps))
        team.demand[kind] = 0.0
        if missing > 0:
            team.demand[kind] = strongest / float(missing)


@wp.func
def resolve(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int) -> None:
    """Referee: build or refuse what is held in the home area, end waits, name objects' lives."""
    if i != 0:
        return
    for k in range(p.n_objects):
        team.holders[k] = 0
    for j in range(p.n_robots):
        k = team.held[j]
        if k >= 0:
            team.holders[k] = team.holders[k] + 1
    has_built = int(0)
    for k in range(p.n_objects):
        n = team.holders[k]
        if n > 0:
            if is_home(p, team.object_x[k], team.object_y[k]):
                kind = scene.object_type[k]
                c = place_for(team, scene, p, kind)
                if c >= 0 and n >= 2 + kind:
                    build(team, scene, p, k, c)
                    has_built = 1
                elif c < 0 and n >= 2:
                    for j in range(p.n_robots):
                        if team.held[j] == k:
                            let_go(team, j)
                            team.situation[j] = 4
                    team.holders[k] = 0
    for j in range(p.n_robots):
        k = team.held[j]
        if k >= 0 and team.waited[j] >= p.wait:
            let_go(team, j)
            team.holders[k] = team.holders[k] - 1
    for k in range(p.n_objects):
        life = team.life[k]
        n = team.holders[k]
        if life != DELIVERED:
            if n == 0:
                if life >= GRIPPED and life <= HELPED:
                    team.life[k] = DROPPED
            elif is_home(p, team.object_x[k], team.object_y[k]):
                team.life[k] = wp.where(n == 1, WAITING, HELPED)
            elif life != CARRIED:
                team.life[k] = GRIPPED
    if has_built != 0:
        signal(team, scene, p)


# --- outcome --------------------------------------------------------------------------------------


@wp.func
def outcome(team: GaccTeam, scene: GaccScene, p: GaccConstants, t_end: int) -> None:
    """Write objects delivered in correct order, complex objects completed, percent of optimum."""
    delivered = int(0)
    completed = int(0)
    for c in range(p.n_complex):
        delivered += team.built[c]
        completed += int(team.built[c] == scene.plan.shape[1])
    team.performance[0] = float(delivered)
    team.performance[1] = float(completed)
    team.performance[2] = 100.0 * float(delivered) / float(p.n_objects)


FUNCTIONS = {
    "reset": reset,
    "sense": sense,
    "act": act,
    "commit": commit,
    "resolve": resolve,
    "outcome": outcome,
}
