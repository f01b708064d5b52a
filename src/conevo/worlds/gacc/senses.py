"""What a robot of ``worlds.gacc.world`` senses: objects and obstacles, robots, home area, demand.

Nitschke 2009, sections 6.2.1 to 6.2.4, eqs 6.2 to 6.7. Eight octants each for the first three.
"""

from typing import TYPE_CHECKING, Any

import warp as wp

from conevo.kernels.geometry import octant
from conevo.kernels.random import uniform
from conevo.kernels.sensing import closest_in_octants, mark
from conevo.worlds.gacc.state import (
    MOVE,
    UNDETECTED,
    GaccConstants,
    GaccScene,
    GaccTeam,
    is_blocked,
    is_lying,
)

__all__ = ["sense"]

SENSING = wp.constant(16)  # counters of random numbers, from here on one for each thing

if TYPE_CHECKING:
    octants = Any  # a Warp type that only Warp can read
else:
    octants = wp.types.vector(length=8, dtype=float)


@wp.func
def nearness(p: GaccConstants, d2: float) -> float:
    """Return 1 within the least distance of eq. 6.1, from there on falling with the square."""
    return p.min_distance_2 / wp.max(d2, p.min_distance_2)


@wp.func
def is_noticed(scene: GaccScene, p: GaccConstants, i: int, t: int, thing: int) -> bool:
    """Return whether robot ``i``'s detection sensors succeed on a thing in this iteration."""
    if p.object_accuracy >= 1.0:
        return True
    return uniform(scene.seed[0], t, SENSING + thing, i) < p.object_accuracy


@wp.func
def look(
    team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int, setting: int
) -> octants:
    """Return the eight object and obstacle sensors; note the objects that are found (eq. 6.2).

    Choice: an object reads (type + 1) / 3 d_min^2 / d^2, an obstacle or a wall - d_min^2 / d^2.
    """
    x = team.x[i]
    y = team.y[i]
    closest = octants()
    reading = octants()
    for o in range(8):
        closest[o] = p.object_range_2
    k = int(0)
    while k < p.n_objects:
        dx = team.object_x[k] - x
        dy = team.object_y[k] - y
        d2 = dx * dx + dy * dy
        if d2 < p.object_range_2 and scene.object_type[k] == setting:
            if is_lying(team, k):
                if is_noticed(scene, p, i, t, k) and not is_blocked(scene, x, y, dx, dy):
                    if team.detected[k] == UNDETECTED:
                        team.detected[k] = t  # the same from every robot that finds it now
                    o = octant(dx, dy)
                    if d2 < closest[o]:
                        closest[o] = d2
                        reading[o] = float(setting + 1) / 3.0 * nearness(p, d2)
        k += 1
    n = scene.left.shape[0]
    k = int(0)
    while k < n + 4:
        dx = float(0.0)
        dy = float(0.0)
        if k < n:
            dx = wp.clamp(x, scene.left[k], scene.right[k]) - x
            dy = wp.clamp(y, scene.bottom[k], scene.top[k]) - y
        elif k == n:
            dx = 1.0 - x
        elif k == n + 1:
            dy = 1.0 - y
        elif k == n + 2:
            dx = -x
        else:
            dy = -y
        d2 = dx * dx + dy * dy
        if d2 < p.object_range_2:
            if is_noticed(scene, p, i, t, p.n_objects + k):
                o = octant(dx, dy)
                if d2 < closest[o]:
                    closest[o] = d2
                    reading[o] = -nearness(p, d2)
        k += 1
    return reading


@wp.func
def look_around(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int) -> octants:
    """Return the eight robot sensors: what the closest robot carries (eq. 6.3), 0 if nothing."""
    x = team.x[i]
    y = team.y[i]
    seen = wp.uint64(0)
    j = int(0)
    while j < p.n_robots:
        dx = team.x[j] - x
        dy = team.y[j] - y
        if dx * dx + dy * dy < p.robot_range_2 and j != i:
            if not is_blocked(scene, x, y, dx, dy):
                seen = mark(seen, j)
        j += 1
    closest = closest_in_octants(team.x, team.y, seen, x, y, p.robot_range_2)
    reading = octants()
    for o in range(8):
        j = closest[o]
        if j >= 0:
            k = team.held[j]
            if k >= 0:
                dx = team.x[j] - x
                dy = team.y[j] - y
                near = nearness(p, dx * dx + dy * dy)
                reading[o] = float(scene.object_type[k] + 1) / 3.0 * near
    return reading


@wp.func
def sense(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int) -> None:
    """Fill robot ``i``'s 27 sensor inputs.

    Choice: the home area reads h / d in its octant, at most 1, with h half its side and d the
    distance to its centre: "inversely proportional to the distance" (6.2.4).
    """
    if team.energy[i] <= 0.0:
        return
    x = team.x[i]
    y = team.y[i]
    things = octants()
    a = team.action[i]
    if a >= 0 and a < MOVE:
        things = look(team, scene, p, i, t, a)
    near = int(0)
    j = int(0)
    while j < p.n_robots:
        dx = team.x[j] - x
        dy = team.y[j] - y
        near += int(dx * dx + dy * dy < p.robot_range_2)
        j += 1
    robots = octants()
    if near > 1:
        robots = look_around(team, scene, p, i)
    home = octants()
    dx = 0.5 - x
    dy = 0.5 - y
    d2 = dx * dx + dy * dy
    if d2 < p.home_range_2:
        home[octant(dx, dy)] = p.home / wp.max(wp.sqrt(d2), p.home)
    for o in range(8):
        team.inputs[i, o] = things[o]
        team.inputs[i, 8 + o] = robots[o]
        team.inputs[i, 16 + o] = home[o]
    for kind in range(3):
        team.inputs[i, 24 + kind] = team.demand[kind]
