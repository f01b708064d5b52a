"""The things in reach of a robot of ``worlds.gacc.world``, kept until it moves.

Searches look only at the few things in reach, not at all: for the closest object, for obstacles in
the view, for taken places. Robots, objects and obstacles in reach are sets. These may contain more
than a search needs; since it compares distances, results do not depend on how far reach is.
"""

import warp as wp

from conevo.kernels.phases import n_lanes
from conevo.kernels.sets import has, lowest, one, part_of, without_lowest
from conevo.worlds.gacc.state import GaccConstants, GaccScene, GaccTeam, spoil

__all__ = ["spread", "survey", "survey_parts"]

PARTS = wp.constant(4)  # of a robot's survey, where a block has many lanes


@wp.func
def survey_parts(team: GaccTeam, scene: GaccScene, p: GaccConstants) -> int:
    """Return the number of parts into which the survey is cut: 1 for a single lane."""
    return wp.where(n_lanes() == 1, 1, PARTS * p.n_robots)


@wp.func
def survey(team: GaccTeam, scene: GaccScene, p: GaccConstants, q: int, t: int) -> None:
    """Do part ``q`` of the search for things in reach of the robots that have moved."""
    first = int(0)
    step = int(1)
    robots = team.moved[0]
    if n_lanes() > 1:
        first = q % PARTS
        step = PARTS
        robots = robots & one(q // PARTS)
    while robots != wp.uint64(0):
        i = lowest(robots)
        meet(team, p, i, first, step)
        wp.atomic_or(team.things, i, lying_in_reach(team, p, i, first, step))
        wp.atomic_or(team.walls, i, walls_in_reach(team, scene, p, i, first, step))
        robots = without_lowest(robots)


@wp.func
def meet(team: GaccTeam, p: GaccConstants, i: int, first: int, step: int) -> None:
    """Add each robot in reach to robot ``i``'s set, and robot ``i`` to its set."""
    x = team.x[i]
    y = team.y[i]
    found = wp.uint64(0)
    j = first
    while j < p.n_robots:
        dx = team.x[j] - x
        dy = team.y[j] - y
        found = found | (wp.uint64(dx * dx + dy * dy < p.near_2) << wp.uint64(j))
        j += step
    found = found & ~one(i)
    wp.atomic_or(team.near, i, found)
    wp.atomic_or(team.stirred, 0, found)
    while found != wp.uint64(0):
        wp.atomic_or(team.near, lowest(found), one(i))
        found = without_lowest(found)


@wp.func
def lying_in_reach(team: GaccTeam, p: GaccConstants, i: int, first: int, step: int) -> wp.uint64:
    """Return which of every ``step``-th object, from ``first`` on, lie in reach of robot ``i``."""
    x = team.x[i]
    y = team.y[i]
    found = wp.uint64(0)
    k = first
    while k < p.n_objects:
        dx = team.object_x[k] - x
        dy = team.object_y[k] - y
        found = found | (wp.uint64(dx * dx + dy * dy <= p.reach_2) << wp.uint64(k))
        k += step
    return found & team.lying[0]


@wp.func
def walls_in_reach(
    team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, first: int, step: int
) -> wp.uint64:
    """Return which of every ``step``-th obstacle are in reach of robot ``i``."""
    x = team.x[i]
    y = team.y[i]
    found = wp.uint64(0)
    k = first
    while k < scene.left.shape[0]:
        dx = wp.clamp(x, scene.left[k], scene.right[k]) - x
        dy = wp.clamp(y, scene.bottom[k], scene.top[k]) - y
        found = found | (wp.uint64(dx * dx + dy * dy < p.walls_2) << wp.uint64(k))
        k += step
    return found


@wp.func
def spread(team: GaccTeam, scene: GaccScene, p: GaccConstants, q: int, t: int) -> None:
    """Update robots in reach of those objects of part ``q`` that now lie there, or no longer."""
    objects = part_of(team.changed[0], q)
    while objects != wp.uint64(0):
        k = lowest(objects)
        lies = has(team.lying[0], k)
        before = wp.uint64(0)
        now = wp.uint64(0)
        i = int(0)
        while i < p.n_robots:
            dx = team.object_x[k] - team.x[i]
            dy = team.object_y[k] - team.y[i]
            is_near = lies and dx * dx + dy * dy <= p.reach_2
            now = now | (wp.uint64(is_near) << wp.uint64(i))
            before = before | (((team.things[i] >> wp.uint64(k)) & wp.uint64(1)) << wp.uint64(i))
            i += 1
        told = before ^ now
        wp.atomic_or(team.turned, 0, told)
        while told != wp.uint64(0):
            i = lowest(told)
            spoil(team, i)
            if lies:
                wp.atomic_or(team.things, i, one(k))
            else:
                wp.atomic_and(team.things, i, ~one(k))
            told = without_lowest(told)
        objects = without_lowest(objects)
