"""Sensors of predators and prey (Nitschke 2009, section 4.1), updated where views have changed.

On one lane an item is a body, whose eight sensors are computed at once. With several lanes an item
is a single sensor. The nearest thing in a cone is a minimum, so the order does not matter.
"""

from typing import Any

import warp as wp

from conevo.kernels.khepera import N_SENSORS, RADIUS, activation, disc_gap, wall_gap
from conevo.kernels.phases import Phase, n_lanes
from conevo.worlds.pursuit.bodies import (
    OBSTACLES,
    PursuitConstants,
    PursuitScene,
    PursuitTeam,
    first_of,
    is_prey,
    place_of,
)

__all__ = ["SENSE", "bodies"]


@wp.func
def bodies(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants) -> int:
    """Return the number of bodies."""
    return scene.n_bodies[0]


@wp.func
def survey(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, t: int) -> None:
    """Find the discs around body ``b``, and whether any of them, or the body itself, has moved."""
    x = team.x[b]
    y = team.y[b]
    near = int(0)
    close = int(0)
    moved = int(0)
    j = int(0)
    while j < scene.n_bodies[0]:
        dx = team.x[j] - x
        dy = team.y[j] - y
        d = dx * dx + dy * dy
        near = near | (int(d <= p.sight_cm_2) << j)
        close = close | (int(d <= p.touch_cm_2) << j)
        moved = moved | (team.has_moved[j] << j)
        j += 1
    others = ~(1 << b)
    before = team.near[b]
    looks = int(((near | before | ~others) & moved) != 0)
    if team.has_moved[b] != 0:
        j = int(0)
        while j < scene.n_obstacles[0]:
            dx = scene.obstacle_x[j] - x
            dy = scene.obstacle_y[j] - y
            d = dx * dx + dy * dy
            near = near | (int(d <= p.sight_cm_2) << (j + OBSTACLES))
            close = close | (int(d <= p.touch_cm_2) << (j + OBSTACLES))
            j += 1
    else:
        fixed = -(1 << OBSTACLES)
        near = near | (before & fixed)
        close = close | (team.close[b] & fixed)
    team.near[b] = near & others
    team.close[b] = close & others
    team.looks[b] = looks


def sight_of(width: int) -> Any:
    """Return the function for ``width`` of a body's sensors, from number ``first`` on."""
    gaps = wp.types.vector(length=width, dtype=float)

    @wp.func
    def sight(
        team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, first: int
    ) -> None:
        x = team.x[b]
        y = team.y[b]
        c = team.ahead_x[b]
        s = team.ahead_y[b]
        reach = p.sensor_range_cm
        infrared = gaps(reach)
        light = gaps(reach)
        discs = team.near[b]
        while discs != 0:
            j = first_of(discs)
            discs = discs & (discs - 1)
            at = place_of(team, scene, j)
            dx = at[0] - x
            dy = at[1] - y
            forth = c * dx + s * dy
            aside = c * dy - s * dx
            seen = gaps(reach)
            for k in range(width):
                seen[k] = disc_gap(first + k, forth, aside, RADIUS, p.cone, reach)
            infrared = wp.min(infrared, seen)
            if j < OBSTACLES and is_prey(p, j):
                light = wp.min(light, seen)
        wall = int(0)
        while wall < 4:
            h = wp.where(wall < 2, x, y)
            nx = wp.where(wall < 2, -c, -s)
            ny = wp.where(wall < 2, s, -c)
            if wall & 1 != 0:
                h = p.arena_cm - h
                nx = -nx
                ny = -ny
            if h < reach + RADIUS:
                for k in range(width):
                    gap = wall_gap(first + k, h, nx, ny, p.cone, reach)
                    infrared[k] = wp.min(infrared[k], gap)
            wall += 1
        if b < p.n_robots:
            for k in range(width):
                team.inputs[b, first + k] = activation(infrared[k], reach)
            if p.team_is_prey == 0:
                for k in range(width):
                    team.inputs[b, N_SENSORS + first + k] = activation(light[k], reach)
            if team.held[b] != 0:
                for k in range(width):
                    hold(team, scene, b, first + k)
        if is_prey(p, b):
            for k in range(width):
                team.infrared[b * N_SENSORS + first + k] = activation(infrared[k], reach)

    return sight


@wp.func
def hold(team: PursuitTeam, scene: PursuitScene, b: int, k: int) -> None:
    """Hold those of robot ``b``'s inputs that come from sensors ``k`` at their values."""
    while k < scene.clamp.shape[1]:
        if (team.held[b] >> k) & 1 != 0:
            team.inputs[b, k] = scene.clamp[b, k]
        k += N_SENSORS


look_with_all = sight_of(int(N_SENSORS))
look_with_one = sight_of(1)


@wp.func
def glances(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants) -> int:
    """Return the number of items of ``look``."""
    return scene.n_bodies[0] * wp.where(n_lanes() == 1, 1, N_SENSORS)


@wp.func
def look(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, q: int, t: int) -> None:
    """Fill the sensor inputs of a robot, or of a prey that is not the team; or one of each kind.

    Infrared senses walls, obstacles and bodies; light senses prey, also behind other bodies.
    """
    b = q
    if n_lanes() > 1:
        b = q // N_SENSORS
    if team.looks[b] == 0 or (b >= p.n_robots and not is_prey(p, b)):
        return
    if n_lanes() == 1:
        look_with_all(team, scene, p, b, 0)
    else:
        look_with_one(team, scene, p, b, q - b * N_SENSORS)


SENSE = (Phase(survey, bodies), Phase(look, glances))
