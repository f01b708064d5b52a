"""Sensors of a robot of ``worlds.gacc.world``: objects and obstacles, robots, home area, demand.

Nitschke 2009, sections 6.2.1 to 6.2.4, eqs 6.2 to 6.7. The first three have eight octants each.
Readings are kept until something changes on which they depend.
"""

from typing import TYPE_CHECKING, Any

import warp as wp

from conevo.kernels.geometry import octant
from conevo.kernels.random import uniform
from conevo.kernels.sets import all_of, has, lowest, one, part_of, without_lowest
from conevo.worlds.gacc.state import (
    NONE,
    UNDETECTED,
    GaccConstants,
    GaccScene,
    GaccTeam,
    is_blocked,
    setting_of,
)

__all__ = ["sense"]

SENSING = wp.constant(16)  # first counter of random numbers: one for each thing

if TYPE_CHECKING:
    octants = Any  # a Warp type that only Warp can read
else:
    octants = wp.types.vector(length=8, dtype=float)


@wp.func
def all_eight(value: float) -> octants:
    """Return a value for each octant."""
    values = octants()
    k = int(0)
    while k < 8:
        values[k] = value
        k += 1
    return values


@wp.func
def value_of(values: octants, o: int) -> float:
    """Return the value of an octant (by selection: a variable index puts a vector into memory)."""
    value = values[0]
    k = int(1)
    while k < 8:
        value = wp.where(k == o, values[k], value)
        k += 1
    return value


@wp.func
def with_value(values: octants, o: int, value: float) -> octants:
    """Return the values of eight octants with a new one for octant ``o``."""
    changed = octants()
    k = int(0)
    while k < 8:
        changed[k] = wp.where(k == o, value, values[k])
        k += 1
    return changed


@wp.func
def nearness(p: GaccConstants, d2: float) -> float:
    """Return 1 within the smallest distance of eq. 6.1; beyond it, it falls with the square."""
    return p.min_distance_2 / wp.max(d2, p.min_distance_2)


@wp.func
def is_noticed(scene: GaccScene, p: GaccConstants, i: int, t: int, thing: int) -> bool:
    """Return whether robot ``i``'s detection sensors sense a thing in this iteration."""
    if p.object_accuracy >= 1.0:
        return True
    return uniform(scene.seed[0], t, SENSING + thing, i) < p.object_accuracy


@wp.func
def look(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int, setting: int) -> None:
    """Fill the eight object and obstacle sensors; note the objects that are found (eq. 6.2).

    Choice: an object reads (type + 1) / 3 d_min^2 / d^2, an obstacle or a wall - d_min^2 / d^2.
    """
    x = team.x[i]
    y = team.y[i]
    walls = team.walls[i]
    closest = all_eight(p.object_range_2)
    rest = team.things[i] & team.kinds[setting]
    while rest != wp.uint64(0):
        k = lowest(rest)
        dx = team.object_x[k] - x
        dy = team.object_y[k] - y
        d2 = dx * dx + dy * dy
        if d2 < p.object_range_2:
            o = octant(dx, dy)
            is_new = team.detected[k] == UNDETECTED
            if d2 < value_of(closest, o) or is_new:
                if is_noticed(scene, p, i, t, k) and not is_blocked(scene, walls, x, y, dx, dy):
                    if is_new:
                        team.detected[k] = t  # every robot that finds it now writes the same
                    if d2 < value_of(closest, o):
                        closest = with_value(closest, o, d2)
                        team.inputs[i, o] = float(setting + 1) / 3.0 * nearness(p, d2)
        rest = without_lowest(rest)
    while walls != wp.uint64(0):
        k = lowest(walls)
        dx = wp.clamp(x, scene.left[k], scene.right[k]) - x
        dy = wp.clamp(y, scene.bottom[k], scene.top[k]) - y
        d2 = dx * dx + dy * dy
        if d2 < p.object_range_2:
            o = octant(dx, dy)
            if d2 < value_of(closest, o):
                if is_noticed(scene, p, i, t, p.n_objects + k):
                    closest = with_value(closest, o, d2)
                    team.inputs[i, o] = -nearness(p, d2)
        walls = without_lowest(walls)
    side = int(0)
    while side < 4:
        dx = float(0.0)
        dy = float(0.0)
        if side == 0:
            dx = 1.0 - x
        elif side == 1:
            dy = 1.0 - y
        elif side == 2:
            dx = -x
        else:
            dy = -y
        d2 = dx * dx + dy * dy
        if d2 < p.object_range_2:
            if is_noticed(scene, p, i, t, p.n_objects + scene.left.shape[0] + side):
                o = octant(dx, dy)
                if d2 < value_of(closest, o):
                    closest = with_value(closest, o, d2)
                    team.inputs[i, o] = -nearness(p, d2)
        side += 1


@wp.func
def look_around(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int) -> None:
    """Fill the eight robot sensors: the load of the closest robot (eq. 6.3), 0 without one.

    Robots that are no longer in reach are removed from the set of those near.
    """
    near = team.near[i]
    if (near & team.carriers[0]) == wp.uint64(0):
        return
    x = team.x[i]
    y = team.y[i]
    closest = all_eight(p.robot_range_2)
    rest = near
    while rest != wp.uint64(0):
        j = lowest(rest)
        dx = team.x[j] - x
        dy = team.y[j] - y
        d2 = dx * dx + dy * dy
        if d2 < p.robot_range_2:
            o = octant(dx, dy)
            if d2 < value_of(closest, o):
                if not is_blocked(scene, team.walls[i], x, y, dx, dy):
                    closest = with_value(closest, o, d2)
                    reading = float(0.0)
                    if team.held[j] >= 0:
                        kind = scene.object_type[team.held[j]]
                        reading = float(kind + 1) / 3.0 * nearness(p, d2)
                    team.inputs[i, 8 + o] = reading
        elif d2 >= p.near_2:
            near = near & ~one(j)
        rest = without_lowest(rest)
    team.near[i] = near


@wp.func
def look_home(team: GaccTeam, p: GaccConstants, i: int) -> None:
    """Fill the eight home sensors.

    Choice: the home area reads h / d in its octant, at most 1, with h half its side and d the
    distance to its centre: "inversely proportional to the distance" (6.2.4).
    """
    dx = 0.5 - team.x[i]
    dy = 0.5 - team.y[i]
    d2 = dx * dx + dy * dy
    if d2 < p.home_range_2:
        team.inputs[i, 16 + octant(dx, dy)] = p.home / wp.max(wp.sqrt(d2), p.home)


@wp.func
def silence(team: GaccTeam, i: int, first: int) -> None:
    """Set eight of robot ``i``'s sensors, from number ``first`` on, to 0."""
    o = int(0)
    while o < 8:
        team.inputs[i, first + o] = 0.0
        o += 1


@wp.func
def sense_again(team: GaccTeam, scene: GaccScene, p: GaccConstants, i: int, t: int) -> None:
    """Fill those of robot ``i``'s 27 sensor inputs that may have changed."""
    if team.energy[i] <= 0.0:
        return
    setting = setting_of(team.action[i])
    if team.view[i] != setting or p.object_accuracy < 1.0:
        team.view[i] = setting
        silence(team, i, 0)
        if setting != NONE:
            look(team, scene, p, i, t, setting)
    if has(team.stirred[0], i):
        silence(team, i, 8)
        look_around(team, scene, p, i)
    if has(team.moved[0], i):
        silence(team, i, 16)
        look_home(team, p, i)
    if team.has_news[0] != 0:
        for kind in range(3):
            team.inputs[i, 24 + kind] = team.demand[kind]


@wp.func
def sense(team: GaccTeam, scene: GaccScene, p: GaccConstants, q: int, t: int) -> None:
    """Update the sensors of those robots of part ``q`` for which something may have changed."""
    robots = team.stirred[0] | team.turned[0]
    if team.has_news[0] != 0:
        robots = all_of(p.n_robots)
    robots = part_of(robots, q)
    while robots != wp.uint64(0):
        sense_again(team, scene, p, lowest(robots), t)
        robots = without_lowest(robots)
