"""Actions of rovers: each chooses one and proposes a place, then all proposals are settled."""

import warp as wp

from conevo.kernels.actions import NONE, count_action, heuristic_action
from conevo.kernels.disturbances import fails
from conevo.kernels.outputs import highest
from conevo.kernels.random import uniform
from conevo.kernels.sets import all_below, lowest, one, without_lowest
from conevo.kernels.steps import random_step, steered_step
from conevo.worlds.rover.state import (
    CANAL_CELLS,
    MOVE,
    N_ACTIONS,
    N_SETTINGS,
    SCANNING,
    RoverConstants,
    RoverScene,
    RoverTeam,
    of_setting,
)

__all__ = ["act", "commit", "fail"]

HEURISTIC = wp.constant(2**20 - 4)  # counters above every rock's, for heuristic controllers


@wp.func
def act(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, t: int) -> None:
    """Choose rover ``i``'s action from its outputs (section 5.2) and propose its next place.

    A heuristic rover draws its action from table 5.3 and, if it moves, a random direction.
    """
    if i == 0:
        team.n_listed[SCANNING] = 0
        team.changed[0] = wp.uint64(0)
        for k in range(N_SETTINGS):
            team.acting[k] = wp.uint64(0)
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
        if a == MOVE:
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
def is_refused(
    team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, x: float, y: float
) -> bool:
    """Return whether rover ``i`` may not move to a place: edge, canal or another rover."""
    if x < 0.0 or x >= 1.0 or y < 0.0 or y >= 1.0:
        return True
    n = float(CANAL_CELLS)
    if scene.canal[int(y * n), int(x * n)] != wp.uint8(0):
        return True
    return is_taken_by(team.x, team.y, team.crowd[i], x, y, p.separation_2)


@wp.func
def is_taken_by(
    xs: wp.array[float],
    ys: wp.array[float],
    robots: wp.uint64,
    x: float,
    y: float,
    separation_2: float,
) -> bool:
    """Return whether one of a set of robots is too close to a place."""
    close = int(0)
    rest = robots
    while rest != wp.uint64(0):
        j = lowest(rest)
        rest = without_lowest(rest)
        dx = xs[j] - x
        dy = ys[j] - y
        close += int(dx * dx + dy * dy < separation_2)
    return close > 0


@wp.func
def commit(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, t: int) -> None:
    """Make rover ``i``'s proposal its state, count the action and pay for it.

    Choice: of two rovers that propose the same place, the one with the lower number gets it.
    """
    a = team.chosen[i]
    count_action(team.action, team.switches, team.counts, i, a, a)
    if a == MOVE:
        x = team.to_x[i]
        y = team.to_y[i]
        if x != team.x[i] or y != team.y[i]:
            lower = team.crowd[i] & all_below(i)
            if not is_taken_by(team.to_x, team.to_y, lower, x, y, p.separation_2):
                team.x[i] = x
                team.y[i] = y
                team.covered_range[i] = 0.0
                team.looked[i] = 0
                for k in range(N_SETTINGS):
                    team.barren[i * N_SETTINGS + k] = wp.uint64(0)
                wp.atomic_or(team.changed, 0, one(i))
        team.energy[i] = team.energy[i] - p.rover_sensor_cost - p.move_cost
    elif a != NONE:
        if team.setting[i] != a:
            team.setting[i] = a
            wp.atomic_or(team.changed, 0, one(i))
        wp.atomic_or(team.acting, a, one(i))
        team.energy[i] = team.energy[i] - p.rover_sensor_cost - of_setting(p.cost, a)


@wp.func
def fail(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, t: int) -> None:
    """If rover ``i`` fails, set its energy to 0."""
    if fails(scene.seed[0], p, i, t):
        team.energy[i] = wp.min(team.energy[i], 0.0)
