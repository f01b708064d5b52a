"""What is in reach of a robot of ``worlds.gacc.world``, kept until it moves.

A robot asks only the few things in reach what it would have to ask all: which object is the
closest, what stands in the view, which place is taken. Robots, objects and obstacles in reach are
sets. They may hold more than what a question is about, which is decided by the distance, so nothing
depends on how far reach is.
"""

import warp as wp

from conevo.kernels.phases import n_lanes
from conevo.kernels.sets import has, lowest, one, without_lowest
from conevo.worlds.gacc.state import GaccConstants, GaccScene, GaccTeam

__all__ = ["notice_changes", "survey", "survey_parts"]

PARTS = wp.constant(4)  # of a robot's survey, where a block has many lanes


@wp.func
def survey_parts(team: GaccTeam, scene: GaccScene, p: GaccConstants) -> int:
    """Return into how many parts the survey is cut: one lane takes it as a whole."""
    return wp.where(n_lanes() == 1, 1, PARTS * p.n_robots)


@wp.func
def survey(team: GaccTeam, scene: GaccScene, p: GaccConstants, q: int, t: int) -> None:
    """Do part ``q`` of finding what is in reach of the robots that have moved."""
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
    """Note in robot ``i``'s set each robot in reach, and in that one's set robot ``i``."""
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
    while found != wp.uint64(0):
        wp.atomic_or(team.near, lowest(found), one(i))
        found = without_lowest(found)


@wp.func
def lying_in_reach(team: GaccTeam, p: GaccConstants, i: int, first: int, step: int) -> wp.uint64:
    """Return which objects lie in reach of robot ``i``, of every ``step``-th from ``first`` on."""
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
    """Return which obstacles are in reach of robot ``i``, of every ``step``-th."""
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
def notice_changes(team: GaccTeam, p: GaccConstants, i: int) -> bool:
    """Return whether an object in reach of robot ``i`` lies there now, or does no more; note it."""
    things = team.things[i]
    rest = team.changed[0]
    while rest != wp.uint64(0):
        k = lowest(rest)
        dx = team.object_x[k] - team.x[i]
        dy = team.object_y[k] - team.y[i]
        things = things & ~one(k)
        if has(team.lying[0], k) and dx * dx + dy * dy <= p.reach_2:
            things = things | one(k)
        rest = without_lowest(rest)
    if things == team.things[i]:
        return False
    team.things[i] = things
    return True
