"""Actions of a robot of ``worlds.gacc.world``: detect, move or grip (6.2.7, 6.2.8)."""

import warp as wp

from conevo.kernels.actions import PREFERENCE, heuristic_action
from conevo.kernels.outputs import highest
from conevo.kernels.random import uniform
from conevo.kernels.sets import lowest, one, without_lowest
from conevo.kernels.steps import random_step, steered_step
from conevo.worlds.gacc.state import (
    GRIP,
    MOVE,
    N_ACTIONS,
    NONE,
    GaccConstants,
    GaccScene,
    GaccTeam,
    is_home,
    is_known,
    is_refused,
)

__all__ = ["act"]

CONSTRUCTORS = wp.constant(6)  # heuristic controllers: detectors, gatherers, these, non-specialized
NON_SPECIALIZED = wp.constant(9)


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
    """Return the longest step towards a place at this distance, but not beyond it."""
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
    rest = team.waiting[0] & ~one(i)
    while rest != wp.uint64(0):
        j = lowest(rest)
        dx = team.x[j] - team.x[i]
        dy = team.y[j] - team.y[i]
        d2 = dx * dx + dy * dy
        if d2 < best and team.held[j] != team.dropped[i]:
            best = d2
            found = j
        rest = without_lowest(rest)
    return found


@wp.func
def closest_at_home(team: GaccTeam, p: GaccConstants, i: int, t: int) -> int:
    """Return the closest known object that lies in the home area, or NONE (situation 3)."""
    best = float(p.home_sight_2)
    found = int(NONE)
    rest = team.lying_home[0]
    while rest != wp.uint64(0):
        k = lowest(rest)
        dx = team.object_x[k] - team.x[i]
        dy = team.object_y[k] - team.y[i]
        d2 = dx * dx + dy * dy
        if d2 < best and k != team.dropped[i] and is_known(team, p, k, t):
            best = d2
            found = k
        rest = without_lowest(rest)
    return found


@wp.func
def takes_over(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int) -> int:
    """Apply the situation of 6.2.8 that decides for robot ``i``, if any; return it, or 0."""
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
def within_grip(team: GaccTeam, p: GaccConstants, i: int, t: int, kind: int) -> int:
    """Return the closest object of a type that robot ``i`` can grip outside home, or NONE."""
    found = int(NONE)
    rest = team.things[i] & team.kinds[kind] & ~team.lying_home[0]
    if rest == wp.uint64(0) or is_home(p, team.x[i], team.y[i]):
        return found
    best = float(p.grip_distance_2)
    while rest != wp.uint64(0):
        k = lowest(rest)
        dx = team.object_x[k] - team.x[i]
        dy = team.object_y[k] - team.y[i]
        d2 = dx * dx + dy * dy
        if d2 < best or (d2 == best and found == NONE):
            if is_known(team, p, k, t):
                best = d2
                found = k
        rest = without_lowest(rest)
    return found


@wp.func
def act(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int) -> None:
    """Choose robot ``i``'s action (6.2.7, 6.2.8); propose its next place, or an object to grip."""
    if i == 0:  # all changes have been sensed
        team.moved[0] = wp.uint64(0)
        team.stirred[0] = wp.uint64(0)
        team.turned[0] = wp.uint64(0)
        team.changed[0] = wp.uint64(0)
        team.has_news[0] = 0
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
        team.target[i] = within_grip(team, p, i, t, a - GRIP)


@wp.func
def follow_preferences(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int) -> None:
    """Choose heuristic robot ``i``'s action by table 6.3; constructors stay at home."""
    h = team.heuristic[i]
    u = uniform(scene.seed[0], t, 0, i)
    at_home = is_home(p, team.x[i], team.y[i])
    is_constructor = h >= CONSTRUCTORS and h < NON_SPECIALIZED
    own = wp.where(h < 3, h, GRIP + h % 3)
    if h == NON_SPECIALIZED:
        own = NONE
    elif is_constructor and not at_home:
        own = MOVE
    team.chosen[i] = heuristic_action(u, own, MOVE, N_ACTIONS)
    if team.chosen[i] == MOVE:
        step = wp.vec2f()
        if is_constructor and not at_home and u < PREFERENCE:
            step = straight_step(p, 0.5 - team.x[i], 0.5 - team.y[i])
        else:
            step = random_step(uniform(scene.seed[0], t, 1, i), p.move_range)
        to = wp.vec2f(team.x[i] + step[0], team.y[i] + step[1])
        if not (at_home and is_constructor) or is_home(p, to[0], to[1]):
            propose(team, scene, p, i, step)
