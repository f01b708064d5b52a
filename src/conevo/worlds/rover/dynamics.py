"""The dynamics of the multi-rover world: what a rover does in one iteration, as Warp functions.

State, reset, sense, act, commit, resolve, outcome; the rules and the choices stand on the card of
``worlds.rover.world``. Every function is called for one robot and writes only that robot's data.

Hot loops over a number known only at run time are written with ``while``: Warp keeps the iterator
of such a ``range`` in memory (the whole kernel was 1.2 to 1.3 times as fast without, on the CPU).
"""

from typing import Annotated

import warp as wp

from conevo.kernels.actions import NONE, begin_counting, count_action, heuristic_action
from conevo.kernels.arrays import named_arrays
from conevo.kernels.geometry import COVER_CELLS, COVER_WORDS, cover_disc, covered_by_any, octant
from conevo.kernels.outputs import highest
from conevo.kernels.random import uniform
from conevo.kernels.sensing import closest_in_octants, is_marked, mark
from conevo.kernels.steps import is_taken, random_step, steered_step
from conevo.worlds.rover import canals

__all__ = [
    "FUNCTIONS",
    "N_ACTIONS",
    "ROCK_CELLS",
    "RoverConstants",
    "RoverScene",
    "RoverTeam",
]

# --- state ----------------------------------------------------------------------------------------

N_ACTIONS = wp.constant(4)
MOVE = wp.constant(3)
ROCK_CELLS = wp.constant(40)  # grid over the rocks; 0.025 wide, so a disc needs few cells
CANAL_CELLS = wp.constant(canals.N_CELLS)
UNDETECTED = wp.constant(2**31 - 1)
HEURISTIC = wp.constant(2**20 - 4)  # counters above every rock's, for heuristic controllers

octants = wp.types.vector(length=8, dtype=float)


@wp.struct
class RoverConstants:
    """What the kernels need of ``RoverParams``, by its names; ``NAME_2`` is a square."""

    n_robots: int
    energy: float
    ranges: wp.vec3f
    accuracy: wp.vec3f
    cost: wp.vec3f
    rover_sensor_range_2: float
    rover_sensor_cost: float
    move_range: float
    move_cost: float
    report_cost: float
    min_distance_2: float
    separation_2: float
    fitness_is_product: int


@wp.struct
class RoverScene:
    """A scenario: rocks sorted by grid cell, canals, starts. Flat over the scenarios of a batch."""

    rock_x: wp.array[float]
    rock_y: wp.array[float]
    rock_value: wp.array[float]
    rock_type: wp.array[int]
    cell: wp.array[int]
    canal: wp.array2d[wp.uint8]  # [rows, columns], the same in all scenarios
    start_x: wp.array[float]
    start_y: wp.array[float]
    seed: wp.array[wp.uint64]


@named_arrays
class RoverTeam:
    """State of a team."""

    inputs: wp.array2d[float]
    outputs: wp.array2d[float]
    x: wp.array[float]
    y: wp.array[float]
    to_x: wp.array[float]
    to_y: wp.array[float]
    action: wp.array[int]  # executed in the previous iteration, NONE if it did nothing
    chosen: wp.array[int]
    setting: wp.array[int]
    heuristic: wp.array[int]
    energy: wp.array[float]
    # iteration of detection; "undetected at t" is detected >= t
    detected: Annotated[wp.array[int], "rocks"]
    cover: Annotated[wp.array[wp.uint64], "robots", "words"]
    covered: wp.array[int]
    covered_range: wp.array[float]  # largest disc already marked at the present place
    value: wp.array[float]
    fitness: wp.array[float]
    counts: wp.array[int]
    switches: wp.array[int]
    performance: wp.array[float]  # value, area


# --- reset ----------------------------------------------------------------------------------------


@wp.func
def reset(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int) -> None:
    """Put rover ``i`` at its start and clear its share of what is recorded."""
    team.x[i] = scene.start_x[i]
    team.y[i] = scene.start_y[i]
    team.setting[i] = 0
    team.energy[i] = p.energy
    team.covered[i] = 0
    team.covered_range[i] = 0.0
    team.value[i] = 0.0
    team.fitness[i] = 0.0
    begin_counting(team.action, team.switches, team.counts, i)
    for word in range(COVER_WORDS):
        team.cover[i * COVER_WORDS + word] = wp.uint64(0)
    for k in range(i, team.detected.shape[0], p.n_robots):
        team.detected[k] = UNDETECTED


# --- sense ----------------------------------------------------------------------------------------


@wp.func
def rock_cell(v: float) -> int:
    """Return the row or column of the rock grid that a coordinate lies in."""
    return wp.clamp(int(v * float(ROCK_CELLS)), 0, ROCK_CELLS - 1)


@wp.func
def sense(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, t: int) -> None:
    """Fill rover ``i``'s 16 sensor inputs (eqs 5.2, 5.3), each mapped monotonically into [0, 1].

    Choice: a rover sensor reads setting d_min^2 / (3 d^2); a rock sensor z / (1 + z) with z the
    sum of value d_min^2 / d^2 over the undetected rocks in its octant; d is at least d_min.
    """
    if team.energy[i] <= 0.0:
        return
    x = team.x[i]
    y = team.y[i]
    for k in range(16):
        team.inputs[i, k] = 0.0
    near = wp.uint64(0)
    j = int(0)
    while j < p.n_robots:
        dx = team.x[j] - x
        dy = team.y[j] - y
        if dx * dx + dy * dy < p.rover_sensor_range_2 and j != i:
            near = mark(near, j)
        j += 1
    if near != wp.uint64(0):
        closest = closest_in_octants(team.x, team.y, near, x, y, p.rover_sensor_range_2)
        for o in range(8):
            j = closest[o]
            if j >= 0:
                dx = team.x[j] - x
                dy = team.y[j] - y
                d2 = wp.max(dx * dx + dy * dy, p.min_distance_2)
                setting = float(team.setting[j] + 1)
                team.inputs[i, o] = setting * p.min_distance_2 / (3.0 * d2)
    a = team.action[i]
    if a != NONE and a < MOVE:
        r = p.ranges[a]
        z = octants()
        first = rock_cell(x - r)
        last = rock_cell(x + r)
        row = int(rock_cell(y - r))
        last_row = rock_cell(y + r)
        while row <= last_row:
            k = int(scene.cell[row * ROCK_CELLS + first])
            end = scene.cell[row * ROCK_CELLS + last + 1]
            while k < end:
                dx = scene.rock_x[k] - x
                dy = scene.rock_y[k] - y
                d2 = dx * dx + dy * dy
                if d2 < r * r:
                    if team.detected[k] >= t:
                        o = octant(dx, dy)
                        z[o] = z[o] + (
                            scene.rock_value[k] * p.min_distance_2 / wp.max(d2, p.min_distance_2)
                        )
                k += 1
            row += 1
        for o in range(8):
            team.inputs[i, 8 + o] = z[o] / (1.0 + z[o])


# --- act ------------------------------------------------------------------------------------------


@wp.func
def is_refused(
    team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, x: float, y: float
) -> bool:
    """Return whether rover ``i`` may not move to a place: edge, canal, or another rover there."""
    if x < 0.0 or x >= 1.0 or y < 0.0 or y >= 1.0:
        return True
    n = float(CANAL_CELLS)
    if scene.canal[int(y * n), int(x * n)] != wp.uint8(0):
        return True
    return is_taken(team.x, team.y, p.n_robots, i, x, y, p.separation_2)


@wp.func
def act(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, t: int) -> None:
    """Choose rover ``i``'s action from its outputs (section 5.2) and propose where it will be.

    A heuristic rover draws its action from table 5.3 and, if it moves, a random direction.
    """
    team.to_x[i] = team.x[i]
    team.to_y[i] = team.y[i]
    if team.energy[i] <= 0.0:
        team.chosen[i] = NONE
        return
    a = int(MOVE)
    step = wp.vec2f(0.0, 0.0)
    h = team.heuristic[i]
    if h >= 0:
        own = wp.where(h < 3, h, NONE)
        a = heuristic_action(uniform(scene.seed[0], t, HEURISTIC, i), own, MOVE, N_ACTIONS)
        step = random_step(uniform(scene.seed[0], t, HEURISTIC + 1, i), p.move_range)
    else:
        a = wp.min(highest(team.outputs, i, 5), MOVE)  # outputs 3 and 4: move
        if a == MOVE:
            step = steered_step(team.outputs[i, 3], team.outputs[i, 4], p.move_range)
    team.chosen[i] = a
    if a == MOVE:
        x = team.x[i] + step[0]
        y = team.y[i] + step[1]
        if not is_refused(team, scene, p, i, x, y):
            team.to_x[i] = x
            team.to_y[i] = y


@wp.func
def commit(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, t: int) -> None:
    """Make rover ``i``'s proposal its state, count the action and pay for it.

    Choice: of two rovers that propose the same place, the one with the lower number gets it.
    """
    a = team.chosen[i]
    count_action(team.action, team.switches, team.counts, i, a, a)
    if a == NONE:
        return
    x = team.to_x[i]
    y = team.to_y[i]
    if a == MOVE:
        if x != team.x[i] or y != team.y[i]:
            if not is_taken(team.to_x, team.to_y, i, i, x, y, p.separation_2):
                team.x[i] = x
                team.y[i] = y
                team.covered_range[i] = 0.0
        team.energy[i] = team.energy[i] - p.rover_sensor_cost - p.move_cost
    else:
        team.setting[i] = a
        team.energy[i] = team.energy[i] - p.rover_sensor_cost - p.cost[a]


# --- resolve --------------------------------------------------------------------------------------


@wp.func
def partner(rock_type: int, setting: int) -> int:
    """Return the setting a second rover needs to detect such a rock with this one, or NONE."""
    if rock_type == 4:
        return setting
    if rock_type == setting or rock_type == setting + 1:
        return wp.where(rock_type < 2, rock_type, rock_type + 1) - setting
    return NONE


@wp.func
def resolve(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, t: int) -> None:
    """Mark what rover ``i``'s activation covers and credit the rocks it detects with another.

    Both rovers of a pair find the detection by themselves, so nobody writes another's data;
    ``detected[k] = t`` is written by both with the same value.
    """
    a = team.action[i]
    if a == NONE or a == MOVE:
        return
    x = team.x[i]
    y = team.y[i]
    r = p.ranges[a]
    if team.covered_range[i] < r:
        fresh = cover_disc(team.cover, i * COVER_WORDS, x, y, r)
        team.covered[i] = team.covered[i] + fresh
        team.covered_range[i] = r
    mates = wp.uint64(0)
    j = int(0)
    while j < p.n_robots:
        b = team.action[j]
        if j != i and b != NONE and b != MOVE and wp.abs(b - a) <= 1:
            dx = team.x[j] - x
            dy = team.y[j] - y
            reach = r + p.ranges[b]
            if dx * dx + dy * dy < reach * reach:
                mates = mark(mates, j)
        j += 1
    if mates == wp.uint64(0):
        return
    gained = float(0.0)
    nearness = float(0.0)
    first = rock_cell(x - r)
    last = rock_cell(x + r)
    row = int(rock_cell(y - r))
    last_row = rock_cell(y + r)
    while row <= last_row:
        k = int(scene.cell[row * ROCK_CELLS + first])
        end = scene.cell[row * ROCK_CELLS + last + 1]
        while k < end:
            dx = scene.rock_x[k] - x
            dy = scene.rock_y[k] - y
            d2 = dx * dx + dy * dy
            if d2 < r * r:
                need = partner(scene.rock_type[k], a)
                if need != NONE and team.detected[k] >= t:
                    if uniform(scene.seed[0], t, k, i) < p.accuracy[a]:
                        if is_paired(team, scene, p, mates, need, k, t):
                            team.detected[k] = t
                            gained = gained + scene.rock_value[k]
                            nearness = nearness + scene.rock_value[k] / wp.max(d2, p.min_distance_2)
            k += 1
        row += 1
    if gained > 0.0:
        area = float(team.covered[i]) / float(COVER_CELLS * COVER_CELLS)
        team.value[i] = team.value[i] + gained
        team.fitness[i] = team.fitness[i] + nearness * area
        team.energy[i] = team.energy[i] - p.report_cost


@wp.func
def is_paired(
    team: RoverTeam,
    scene: RoverScene,
    p: RoverConstants,
    mates: wp.uint64,
    need: int,
    k: int,
    t: int,
) -> bool:
    """Return whether one of the mates has the needed setting and succeeds on rock ``k``."""
    r = p.ranges[need]
    j = int(0)
    while j < p.n_robots:
        if is_marked(mates, j) and team.action[j] == need:
            dx = scene.rock_x[k] - team.x[j]
            dy = scene.rock_y[k] - team.y[j]
            if dx * dx + dy * dy < r * r:
                if uniform(scene.seed[0], t, k, j) < p.accuracy[need]:
                    return True
        j += 1
    return False


# --- outcome --------------------------------------------------------------------------------------


@wp.func
def outcome(team: RoverTeam, scene: RoverScene, p: RoverConstants, t_end: int) -> None:
    """Write the team's task performance: value the lander has recorded, share of area covered."""
    value = float(0.0)
    for k in range(team.detected.shape[0]):
        if team.detected[k] < t_end - 1:
            value = value + scene.rock_value[k]
    cells = float(COVER_CELLS * COVER_CELLS)
    team.performance[0] = value
    team.performance[1] = float(covered_by_any(team.cover, p.n_robots)) / cells
    if p.fitness_is_product != 0:
        for i in range(p.n_robots):
            team.fitness[i] = team.value[i] * float(team.covered[i]) / cells


FUNCTIONS = {
    "reset": reset,
    "sense": sense,
    "act": act,
    "commit": commit,
    "resolve": resolve,
    "outcome": outcome,
}
