"""Sensors of rovers: the closest rover and the red rocks in each octant.

Only changes are computed: a rover's sums over rocks, one for each setting, are kept until it moves,
and a detected rock is taken off them.
"""

import warp as wp

from conevo.kernels.actions import NONE
from conevo.kernels.geometry import octant
from conevo.kernels.phases import Phase, n_lanes
from conevo.kernels.sets import lowest, one, without_lowest
from conevo.worlds.rover.state import (
    COVERING,
    DETECTING,
    N_SETTINGS,
    OLD,
    PARTS,
    ROCK_CELLS,
    SCANNING,
    SURVEYED,
    UNIT,
    RoverConstants,
    RoverScene,
    RoverTeam,
    is_activation,
    n_parts,
    of_setting,
    rock_cell,
)

__all__ = ["ROWS", "SENSE", "SUBS", "share", "take_off"]

N_SENSORS = wp.constant(8)  # of each kind, one for every octant
SUBS = wp.constant(4)  # rocks of a row that lanes process in parallel
ROWS = wp.constant(int(PARTS) // 4)


@wp.func
def look(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, t: int) -> None:
    """Fill rover ``i``'s rover sensors (eq. 5.3), and list it if it must scan the rocks.

    Choice: a rover sensor reads setting d_min^2 / (3 d^2); d is at least d_min.
    """
    if i == 0:
        team.n_listed[COVERING] = 0
        team.n_listed[DETECTING] = 0
    if t % SURVEYED == 0:
        survey(team, p, i)
    if team.energy[i] <= 0.0:
        return
    if (team.changed[0] & (team.crowd[i] | one(i))) != wp.uint64(0):
        see_rovers(team, p, i)
    a = team.action[i]
    if not is_activation(a):
        if team.shown[i] != NONE:
            for o in range(N_SENSORS):
                team.inputs[i, N_SENSORS + o] = 0.0
            team.shown[i] = NONE
    elif ((team.looked[i] >> a) & 1) == 0:
        for o in range(N_SENSORS):
            team.rocks[row_of(i, a) + o] = 0
        team.looked[i] = team.looked[i] | (1 << a)
        team.scanning[wp.atomic_add(team.n_listed, SCANNING, 1)] = i
    elif team.shown[i] != a:
        for o in range(N_SENSORS):
            show(team, i, a, o)
        team.shown[i] = a


@wp.func
def survey(team: RoverTeam, p: RoverConstants, i: int) -> None:
    """Find the rovers that may come near rover ``i`` before the next survey."""
    x = team.x[i]
    y = team.y[i]
    crowd = wp.uint64(0)
    company = wp.uint64(0)
    j = int(0)
    while j < p.n_robots:
        dx = team.x[j] - x
        dy = team.y[j] - y
        d2 = dx * dx + dy * dy
        crowd = crowd | wp.where(d2 < p.crowd_2, one(j), wp.uint64(0))
        company = company | wp.where(d2 < p.company_2, one(j), wp.uint64(0))
        j += 1
    own = one(i)
    team.crowd[i] = crowd & ~own
    team.company[i] = company & ~own
    for a in range(N_SETTINGS):
        at = i * N_SETTINGS + a
        team.barren[at] = team.barren[at] & company


@wp.func
def see_rovers(team: RoverTeam, p: RoverConstants, i: int) -> None:
    """Fill rover ``i``'s rover sensors."""
    x = team.x[i]
    y = team.y[i]
    near = wp.uint64(0)
    rest = team.crowd[i]
    while rest != wp.uint64(0):
        j = lowest(rest)
        rest = without_lowest(rest)
        dx = team.x[j] - x
        dy = team.y[j] - y
        if dx * dx + dy * dy < p.rover_sensor_radius_2:
            near = near | one(j)
    if near == wp.uint64(0) and team.sees_rovers[i] == 0:
        return
    team.sees_rovers[i] = int(near != wp.uint64(0))
    for o in range(N_SENSORS):
        team.inputs[i, o] = 0.0
        team.closest[i * N_SENSORS + o] = p.rover_sensor_radius_2
    while near != wp.uint64(0):
        j = lowest(near)
        near = without_lowest(near)
        dx = team.x[j] - x
        dy = team.y[j] - y
        d2 = dx * dx + dy * dy
        o = octant(dx, dy)
        if d2 < team.closest[i * N_SENSORS + o]:
            team.closest[i * N_SENSORS + o] = d2
            z = share(p, float(team.setting[j] + 1), d2)
            team.inputs[i, o] = z / 3.0


@wp.func
def n_scanning(team: RoverTeam, scene: RoverScene, p: RoverConstants) -> int:
    """Return the number of items of ``scan``."""
    return team.n_listed[SCANNING] * n_parts()


@wp.func
def scan(team: RoverTeam, scene: RoverScene, p: RoverConstants, q: int, t: int) -> None:
    """Add up the readings of a listed rover's rock sensors, or one of ``PARTS`` of them (eq. 5.2).

    Choice: a rock adds value d_min^2 / d^2, rounded to 2^-16, so that rocks may be added up in any
    order; d is at least d_min.
    """
    rows = int(1)
    subs = int(1)
    part = int(0)
    at = q
    if n_parts() > 1:
        rows = ROWS
        subs = SUBS
        part = q % PARTS
        at = q // PARTS
    i = team.scanning[at]
    x = team.x[i]
    y = team.y[i]
    a = team.action[i]
    r = of_setting(p.ranges, a)
    first = rock_cell(x - r)
    last = rock_cell(x + r)
    row = int(rock_cell(y - r) + part // subs)
    last_row = rock_cell(y + r)
    while row <= last_row:
        k = int(scene.cell[row * ROCK_CELLS + first] + part % subs)
        end = scene.cell[row * ROCK_CELLS + last + 1]
        while k < end:
            dx = scene.rock_x[k] - x
            dy = scene.rock_y[k] - y
            d2 = dx * dx + dy * dy
            if d2 < r * r:
                if team.detected[k] >= t:
                    z = in_units(share(p, scene.rock_value[k], d2))
                    wp.atomic_add(team.rocks, row_of(i, a) + octant(dx, dy), z)
            k += subs
        row += rows


@wp.func
def share(p: RoverConstants, value: float, d2: float) -> float:
    """Return a rock's value over its squared distance (eq. 5.1), times d_min^2."""
    return value * p.min_distance_2 / wp.max(d2, p.min_distance_2)


@wp.func
def in_units(z: float) -> int:
    """Return a rock's share of a sensor in 1 / UNIT."""
    return int(z * UNIT + 0.5)


@wp.func
def n_reading(team: RoverTeam, scene: RoverScene, p: RoverConstants) -> int:
    """Return the number of items of ``read``."""
    return team.n_listed[SCANNING] * wp.where(n_lanes() == 1, 1, N_SENSORS)


@wp.func
def read(team: RoverTeam, scene: RoverScene, p: RoverConstants, q: int, t: int) -> None:
    """Fill one rock sensor of a rover that has scanned; a single lane fills all at once."""
    if n_lanes() == 1:
        i = team.scanning[q]
        for o in range(N_SENSORS):
            show(team, i, team.action[i], o)
        team.shown[i] = team.action[i]
    else:
        i = team.scanning[q // N_SENSORS]
        show(team, i, team.action[i], q % N_SENSORS)
        team.shown[i] = team.action[i]


@wp.func
def row_of(i: int, a: int) -> int:
    """Return the index in ``rocks`` of rover ``i``'s first sum with a setting."""
    return (i * N_SETTINGS + a) * N_SENSORS


@wp.func
def show(team: RoverTeam, i: int, a: int, o: int) -> None:
    """Set rover ``i``'s rock sensor of an octant from the kept sum of a setting.

    Choice: it reads z / (1 + z), with z the sum over the undetected rocks in its octant.
    """
    z = float(team.rocks[row_of(i, a) + o]) / UNIT
    team.inputs[i, N_SENSORS + o] = z / (1.0 + z)


@wp.func
def take_off(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, k: int) -> None:
    """Take rock ``k``, which rover ``i`` has detected, off the kept sums."""
    rest = team.company[i] | one(i)
    while rest != wp.uint64(0):
        j = lowest(rest)
        rest = without_lowest(rest)
        dx = scene.rock_x[k] - team.x[j]
        dy = scene.rock_y[k] - team.y[j]
        d2 = dx * dx + dy * dy
        z = in_units(share(p, scene.rock_value[k], d2))
        for a in range(N_SETTINGS):
            r = of_setting(p.ranges, a)
            if ((team.looked[j] >> a) & 1) != 0 and d2 < r * r:
                wp.atomic_add(team.rocks, row_of(j, a) + octant(dx, dy), -z)
                if team.shown[j] == a:
                    team.shown[j] = OLD


SENSE = (Phase(look), Phase(scan, n_scanning), Phase(read, n_reading))
