"""One iteration of ``worlds.gacc.world``: actions of a robot, and their effects on objects.

Reset, commit, outcome, and the list of all phases. The card of ``worlds.gacc.world`` lists rules
and choices. Every function writes only data of its robot and of an object that only this robot
holds. Words that robots share are changed by atomic operations.
"""

import warp as wp

from conevo.kernels.actions import begin_counting, count_action
from conevo.kernels.disturbances import fails
from conevo.kernels.phases import Phase
from conevo.kernels.sets import all_below, all_of, one
from conevo.worlds.gacc.act import act
from conevo.worlds.gacc.resolve import RESOLVE
from conevo.worlds.gacc.senses import sense
from conevo.worlds.gacc.state import (
    CARRIED,
    GATHER,
    GRIP,
    LYING,
    MOVE,
    NONE,
    STALE,
    UNDETECTED,
    GaccConstants,
    GaccScene,
    GaccTeam,
    hold,
    is_home,
    is_within,
    object_parts,
    release,
    robot_parts,
    setting_of,
    spoil,
)
from conevo.worlds.gacc.survey import spread, survey, survey_parts

__all__ = ["FUNCTIONS", "fail"]


# --- reset ----------------------------------------------------------------------------------------


@wp.func
def sort_objects(team: GaccTeam, scene: GaccScene, p: GaccConstants) -> None:
    """Mark all objects as lying, and list those in the home area and those of each type."""
    for kind in range(3):
        team.kinds[kind] = wp.uint64(0)
    team.lying[0] = all_of(p.n_objects)
    team.lying_home[0] = wp.uint64(0)
    for k in range(p.n_objects):
        kind = scene.object_type[k]
        team.kinds[kind] = team.kinds[kind] | one(k)
        if is_home(p, scene.object_x[k], scene.object_y[k]):
            team.lying_home[0] = team.lying_home[0] | one(k)


@wp.func
def reset(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int) -> None:
    """Put robot ``i`` at its start and clear its share of the recorded arrays."""
    team.x[i] = scene.start_x[i]
    team.y[i] = scene.start_y[i]
    team.target[i] = NONE
    team.held[i] = NONE
    team.waited[i] = 0
    team.dropped[i] = NONE
    team.situation[i] = 0
    team.view[i] = STALE
    team.near[i] = wp.uint64(0)
    team.things[i] = wp.uint64(0)
    team.walls[i] = wp.uint64(0)
    team.energy[i] = p.energy
    team.fitness[i] = 0.0
    begin_counting(team.action, team.switches, team.counts, i)
    for k in range(i, p.n_objects, p.n_robots):
        team.object_x[k] = scene.object_x[k]
        team.object_y[k] = scene.object_y[k]
        team.life[k] = LYING
        team.detected[k] = UNDETECTED
        team.part[k] = NONE
        team.holders[k] = wp.uint64(0)
    if i == 0:
        sort_objects(team, scene, p)
        team.carriers[0] = wp.uint64(0)
        team.waiting[0] = wp.uint64(0)
        team.taken[0] = wp.uint64(0)
        team.shared[0] = wp.uint64(0)
        team.moved[0] = all_of(p.n_robots)
        team.stirred[0] = all_of(p.n_robots)
        team.turned[0] = wp.uint64(0)
        team.changed[0] = wp.uint64(0)
        team.has_news[0] = 1
        for c in range(p.n_complex):
            team.built[c] = 0
            for kind in range(3):
                team.missing[3 * c + kind] = 0
            for step in range(scene.plan.shape[1]):
                at = 3 * c + scene.plan[c, step]
                team.missing[at] = team.missing[at] + 1
        for kind in range(3):
            team.demand[kind] = 0.0


# --- commit ---------------------------------------------------------------------------------------


@wp.func
def is_first(team: GaccTeam, i: int, k: int) -> bool:
    """Return whether no robot with a lower number grips the same object."""
    j = int(0)
    while j < i:
        if team.target[j] == k:
            return False
        j += 1
    return True


@wp.func
def move(team: GaccTeam, p: GaccConstants, i: int) -> None:
    """Move robot ``i`` and the object that it holds to its proposed place.

    Choice: of two robots that propose the same place, the one with the lower number gets it.
    """
    x = team.to_x[i]
    y = team.to_y[i]
    if x == team.x[i] and y == team.y[i]:
        return
    if is_within(team.to_x, team.to_y, team.near[i] & all_below(i), x, y, p.separation_2):
        return
    team.x[i] = x
    team.y[i] = y
    wp.atomic_or(team.moved, 0, one(i))
    wp.atomic_or(team.stirred, 0, one(i) | team.near[i])
    team.near[i] = wp.uint64(0)
    team.things[i] = wp.uint64(0)
    team.walls[i] = wp.uint64(0)
    spoil(team, i)
    if not is_home(p, x, y):
        team.dropped[i] = NONE
    k = team.held[i]
    if k >= 0:  # outside the home area, where no other robot holds it
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
                release(team, i)
        elif k >= 0:
            if is_home(p, team.x[i], team.y[i]) or is_first(team, i, k):
                hold(team, i, k)
    team.energy[i] = team.energy[i] - cost
    if team.energy[i] <= 0.0:
        team.waited[i] = 0
        if team.held[i] >= 0:
            release(team, i)
    setting = setting_of(a)
    if setting != team.view[i] or (setting != NONE and p.object_accuracy < 1.0):
        wp.atomic_or(team.turned, 0, one(i))
    count_action(team.action, team.switches, team.counts, i, a, column)


@wp.func
def fail(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int) -> None:
    """If robot ``i`` fails, set its energy to 0 and release its object."""
    if team.energy[i] > 0.0 and fails(scene.seed[0], p, i, t):
        team.energy[i] = 0.0
        team.waited[i] = 0
        if team.held[i] >= 0:
            release(team, i)


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
    "sense": (
        Phase(survey, survey_parts),
        Phase(spread, object_parts),
        Phase(sense, robot_parts),
    ),
    "act": act,
    "commit": commit,
    "resolve": RESOLVE,
    "outcome": outcome,
}
