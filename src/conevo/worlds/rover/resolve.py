"""Results of a detection: the area that it covers, and rocks that two rovers detect together."""

import warp as wp

from conevo.kernels.actions import NONE
from conevo.kernels.geometry import COVER_CELLS, COVER_WORDS, cover_disc
from conevo.kernels.phases import Phase
from conevo.kernels.random import uniform
from conevo.kernels.sets import lowest, one, without_lowest
from conevo.worlds.rover.sense import ROWS, SUBS, share, take_off
from conevo.worlds.rover.state import (
    ACTIVATION,
    COVERING,
    DETECTING,
    N_SETTINGS,
    NO_PICK,
    PARTS,
    PRODUCT,
    ROCK_CELLS,
    UNIT,
    RoverConstants,
    RoverScene,
    RoverTeam,
    is_activation,
    n_parts,
    of_setting,
    rock_cell,
)

__all__ = ["CREDIT_TOTAL", "RESOLVE", "RESOLVE_ONE_ROCK", "forget"]

ORDER = wp.constant(64)  # counter for the order of taking rocks, above every rover's number
ROCK_BITS = wp.constant(wp.int64(20))
DRAWS = wp.constant(2.0**24)  # different numbers that ``uniform`` returns


@wp.func
def partner(rock_type: int, setting: int) -> int:
    """Return the setting that a second rover needs to detect such a rock with this one, or NONE."""
    if rock_type == 4:
        return setting
    if rock_type == setting or rock_type == setting + 1:
        return wp.where(rock_type < 2, rock_type, rock_type + 1) - setting
    return NONE


@wp.func
def enlist(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, t: int) -> None:
    """List rover ``i`` if it covers new cells, or if it may detect a rock with another one.

    Two rovers without a rock for their settings, or without common cells, need not try again until
    one of them has moved or the other has a new setting.
    """
    changed = team.changed[0]
    if (changed & team.company[i]) != wp.uint64(0):
        for k in range(N_SETTINGS):
            at = i * N_SETTINGS + k
            team.barren[at] = team.barren[at] & ~changed
    a = team.action[i]
    if not is_activation(a):
        return
    r = of_setting(p.ranges, a)
    if team.covered_range[i] < r:
        team.covered_range[i] = r
        team.covering[wp.atomic_add(team.n_listed, COVERING, 1)] = i
    fit = team.acting[1]  # settings next to each other
    if a == 1:
        fit = fit | team.acting[0] | team.acting[2]
    else:
        fit = fit | team.acting[a]
    mates = team.company[i] & fit & ~team.barren[i * N_SETTINGS + a]
    if mates != wp.uint64(0):
        mates = in_reach(team, p, i, a, r, mates)
        if mates != wp.uint64(0):
            team.mates[i] = mates
            team.hopeful[i] = wp.uint64(0)
            team.detecting[wp.atomic_add(team.n_listed, DETECTING, 1)] = i


@wp.func
def in_reach(
    team: RoverTeam, p: RoverConstants, i: int, a: int, r: float, others: wp.uint64
) -> wp.uint64:
    """Return the rovers whose detection overlaps rover ``i``'s; keep the cells, and the others."""
    x = team.x[i]
    y = team.y[i]
    left = float(2.0)
    right = float(-2.0)
    low = float(2.0)
    high = float(-2.0)
    mates = wp.uint64(0)
    rest = others
    while rest != wp.uint64(0):
        j = lowest(rest)
        rest = without_lowest(rest)
        dx = team.x[j] - x
        dy = team.y[j] - y
        b = team.action[j]
        s = of_setting(p.ranges, b)
        if dx * dx + dy * dy < (r + s) * (r + s):
            mates = mates | one(j)
            left = wp.min(left, team.x[j] - s)
            right = wp.max(right, team.x[j] + s)
            low = wp.min(low, team.y[j] - s)
            high = wp.max(high, team.y[j] + s)
    at = i * N_SETTINGS + a
    team.barren[at] = team.barren[at] | (others & ~mates)
    team.box[i] = (
        rock_cell(wp.max(left, x - r))
        | (rock_cell(wp.min(right, x + r)) << 8)
        | (rock_cell(wp.max(low, y - r)) << 16)
        | (rock_cell(wp.min(high, y + r)) << 24)
    )
    return mates


@wp.func
def n_detecting(team: RoverTeam, scene: RoverScene, p: RoverConstants) -> int:
    """Return the number of items of ``detect``."""
    return (team.n_listed[COVERING] + team.n_listed[DETECTING]) * n_parts()


@wp.func
def detect(team: RoverTeam, scene: RoverScene, p: RoverConstants, q: int, t: int) -> None:
    """Do a part of a listed rover's coverage, or of its detection."""
    at = int(q)
    part = int(0)
    if n_parts() > 1:
        at = q // PARTS
        part = q % PARTS
    n = team.n_listed[COVERING]
    if at < n:
        i = team.covering[at]
        r = team.covered_range[i]
        grid = i * COVER_WORDS
        cells = cover_disc(team.cover, grid, team.x[i], team.y[i], r, part, n_parts())
        if cells > 0:
            wp.atomic_add(team.covered, i, cells)
    else:
        pair(team, scene, p, team.detecting[at - n], part, t)


@wp.func
def pair(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, part: int, t: int) -> None:
    """Find the rocks that rover ``i`` detects with a mate, and its gain.

    Both rovers of a pair find the detection independently; ``detected[k]`` becomes t for either
    order.
    """
    rows = int(1)
    subs = int(1)
    if n_parts() > 1:
        rows = ROWS
        subs = SUBS
    x = team.x[i]
    y = team.y[i]
    a = team.action[i]
    r = of_setting(p.ranges, a)
    box = team.box[i]
    first = box & 255
    last = (box >> 8) & 255
    row = int(((box >> 16) & 255) + part // subs)
    last_row = box >> 24
    while row <= last_row:
        k = int(scene.cell[row * ROCK_CELLS + first] + part % subs)
        end = scene.cell[row * ROCK_CELLS + last + 1]
        while k < end:
            dx = scene.rock_x[k] - x
            dy = scene.rock_y[k] - y
            d2 = dx * dx + dy * dy
            if d2 < r * r:
                need = partner(scene.rock_type[k], a)
                if need != NONE and team.detected[k] >= t:
                    fit = fitting(team, scene, p, team.mates[i], need, k)
                    if fit != wp.uint64(0):
                        if not succeed(scene, p, i, a, fit, need, k, t):
                            wp.atomic_or(team.hopeful, i, fit)
                        elif p.rocks_per_activation == 0:
                            gain(team, scene, p, i, k, d2, t)
                        else:
                            wp.atomic_or(team.hopeful, i, fit)
                            prefer(team, scene, i, k, t)
            k += subs
        row += rows


@wp.func
def fitting(
    team: RoverTeam, scene: RoverScene, p: RoverConstants, mates: wp.uint64, need: int, k: int
) -> wp.uint64:
    """Return the mates that have the needed setting and rock ``k`` in range."""
    r = of_setting(p.ranges, need)
    found = wp.uint64(0)
    rest = mates & team.acting[need]
    while rest != wp.uint64(0):
        j = lowest(rest)
        rest = without_lowest(rest)
        dx = scene.rock_x[k] - team.x[j]
        dy = scene.rock_y[k] - team.y[j]
        if dx * dx + dy * dy < r * r:
            found = found | one(j)
    return found


@wp.func
def succeed(
    scene: RoverScene,
    p: RoverConstants,
    i: int,
    a: int,
    mates: wp.uint64,
    need: int,
    k: int,
    t: int,
) -> bool:
    """Return whether both rover ``i`` and one of the mates succeed on rock ``k``."""
    if uniform(scene.seed[0], t, k, i) >= of_setting(p.accuracy, a):
        return False
    rest = mates
    while rest != wp.uint64(0):
        if uniform(scene.seed[0], t, k, lowest(rest)) < of_setting(p.accuracy, need):
            return True
        rest = without_lowest(rest)
    return False


@wp.func
def gain(
    team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, k: int, d2: float, t: int
) -> None:
    """Record that rover ``i`` detects rock ``k``; the first call takes the rock off all kept sums.

    Choice: the sum of value d_min^2 / d^2 over the rocks that a rover detects in an iteration is in
    integers, each rock cut to 2^-32.
    """
    value = scene.rock_value[k]
    wp.atomic_add(team.gain, i, int(value))
    near = share(p, value, d2) * UNIT * UNIT
    wp.atomic_add(team.gain_near, i, wp.int64(near))
    if wp.atomic_min(team.detected, k, t) > t:
        take_off(team, scene, p, i, k)


@wp.func
def n_crediting(team: RoverTeam, scene: RoverScene, p: RoverConstants) -> int:
    """Return the number of items of ``credit``."""
    return team.n_listed[DETECTING]


@wp.func
def credit(team: RoverTeam, scene: RoverScene, p: RoverConstants, q: int, t: int) -> None:
    """Credit a listed rover with its detections, and charge it for the report."""
    i = team.detecting[q]
    at = i * N_SETTINGS + team.action[i]
    team.barren[at] = team.barren[at] | (team.mates[i] & ~team.hopeful[i])
    if team.gain[i] > 0:
        area = float(team.covered[i]) / float(COVER_CELLS * COVER_CELLS)
        if p.fitness_reading == ACTIVATION:
            area = of_setting(p.areas, team.action[i])
        near = float(team.gain_near[i]) / (UNIT * UNIT * p.min_distance_2)
        team.value[i] = team.value[i] + float(team.gain[i])
        team.fitness[i] = team.fitness[i] + near * area
        team.energy[i] = team.energy[i] - p.report_cost
        team.gain[i] = 0
        team.gain_near[i] = wp.int64(0)


@wp.func
def forget(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, t: int) -> None:
    """Reset the rock that rover ``i`` takes."""
    team.pick[i] = NO_PICK


@wp.func
def prefer(team: RoverTeam, scene: RoverScene, i: int, k: int, t: int) -> None:
    """Make rover ``i`` take rock ``k``, which it can detect, if it comes before its other rocks.

    Choice: the order in which rocks are taken is drawn for each iteration, the same for all rovers.
    """
    rank = wp.int64(uniform(scene.seed[0], t, k, ORDER) * DRAWS)
    wp.atomic_min(team.pick, i, (rank << ROCK_BITS) | wp.int64(k))


@wp.func
def take(team: RoverTeam, scene: RoverScene, p: RoverConstants, q: int, t: int) -> None:
    """Detect the rock that a listed rover takes, if a fitting mate takes the same one."""
    i = team.detecting[q]
    pick = team.pick[i]
    if pick == NO_PICK:
        return
    k = int(pick & ((wp.int64(1) << ROCK_BITS) - wp.int64(1)))
    rest = team.mates[i] & team.acting[partner(scene.rock_type[k], team.action[i])]
    mates = int(0)
    while rest != wp.uint64(0):
        mates += int(team.pick[lowest(rest)] == pick)
        rest = without_lowest(rest)
    if mates > 0:
        dx = scene.rock_x[k] - team.x[i]
        dy = scene.rock_y[k] - team.y[i]
        gain(team, scene, p, i, k, dx * dx + dy * dy, t)


@wp.func
def credit_one(team: RoverTeam, scene: RoverScene, p: RoverConstants, q: int, t: int) -> None:
    """Credit a listed rover, and reset its choice of a rock."""
    credit(team, scene, p, q, t)
    team.pick[team.detecting[q]] = NO_PICK


@wp.func
def credit_total(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, t: int) -> None:
    """Make rover ``i``'s fitness the value that it has detected, or this times its area."""
    value = team.value[i]
    if p.fitness_reading == PRODUCT:
        value = value * float(team.covered[i]) / float(COVER_CELLS * COVER_CELLS)
    team.fitness[i] = value


CREDIT_TOTAL = Phase(credit_total)
RESOLVE = (Phase(enlist), Phase(detect, n_detecting), Phase(credit, n_crediting))
RESOLVE_ONE_ROCK = (
    Phase(enlist),
    Phase(detect, n_detecting),
    Phase(take, n_crediting),
    Phase(credit_one, n_crediting),
)
