"""The dynamics of the multi-rover world: start and end of an epoch, and the list of its phases.

The phases are in ``sense``, ``act`` and ``resolve``. The card of ``worlds.rover.world`` lists the
rules and the choices. Sums over rocks and cells are integers, so neither lanes nor their order
change a bit.

Hot loops over a number known only at run time are written with ``while``: Warp keeps the iterator
of such a ``range`` in memory (the whole kernel was 1.2 to 1.3 times as fast without, on the CPU).
"""

from typing import Any

import warp as wp

from conevo.kernels.actions import NONE, begin_counting
from conevo.kernels.geometry import COVER_CELLS, COVER_WORDS, covered_by_any
from conevo.kernels.phases import Phase, n_lanes
from conevo.worlds.rover.act import act, commit
from conevo.worlds.rover.resolve import CREDIT_TOTAL, RESOLVE, RESOLVE_ONE_ROCK, forget
from conevo.worlds.rover.sense import SENSE
from conevo.worlds.rover.state import (
    FITNESS,
    LISTS,
    N_ACTIONS,
    N_SETTINGS,
    ROCK_CELLS,
    SURVEYED,
    RoverConstants,
    RoverScene,
    RoverTeam,
)

__all__ = [
    "FITNESS",
    "LISTS",
    "N_ACTIONS",
    "ROCK_CELLS",
    "SCRATCH",
    "SURVEYED",
    "RoverConstants",
    "RoverScene",
    "RoverTeam",
    "functions",
]

UNDETECTED = wp.constant(2**31 - 1)
OF_TOTALS = ("product", "value")  # readings of fitness that are not sums over iterations
SCRATCH = ("scanning", "covering", "detecting")


@wp.func
def begin(team: RoverTeam, scene: RoverScene, p: RoverConstants, i: int, t: int) -> None:
    """Put rover ``i`` at its start and clear its share of the recorded and kept arrays."""
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
    for k in range(N_SETTINGS):
        team.barren[i * N_SETTINGS + k] = wp.uint64(0)
    team.sees_rovers[i] = 0
    team.looked[i] = 0
    team.shown[i] = NONE
    team.gain[i] = 0
    team.gain_near[i] = wp.int64(0)
    if i == 0:
        team.changed[0] = ~wp.uint64(0)
        for k in range(LISTS):
            team.n_listed[k] = 0


@wp.func
def all_lanes(team: RoverTeam, scene: RoverScene, p: RoverConstants) -> int:
    """Return an item for each lane."""
    return n_lanes()


@wp.func
def hide_rocks(team: RoverTeam, scene: RoverScene, p: RoverConstants, q: int, t: int) -> None:
    """Mark a lane's share of the rocks as undetected."""
    k = int(q)
    while k < team.detected.shape[0]:
        team.detected[k] = UNDETECTED
        k += n_lanes()


@wp.func
def clear_total(team: RoverTeam, scene: RoverScene, p: RoverConstants, q: int, t: int) -> None:
    """Set the sums of the team's task performance to 0."""
    team.total[0] = 0
    team.total[1] = 0


@wp.func
def add_up(team: RoverTeam, scene: RoverScene, p: RoverConstants, q: int, t_end: int) -> None:
    """Add a lane's share of the rocks that the lander has recorded, and of the area covered."""
    value = int(0)
    k = int(q)
    while k < team.detected.shape[0]:
        if team.detected[k] < t_end - 1:
            value += int(scene.rock_value[k])
        k += n_lanes()
    wp.atomic_add(team.total, 0, value)
    cells = int(0)
    word = int(q)
    while word < COVER_WORDS:
        cells += covered_by_any(team.cover, p.n_robots, word)
        word += n_lanes()
    wp.atomic_add(team.total, 1, cells)


@wp.func
def report(team: RoverTeam, scene: RoverScene, p: RoverConstants, q: int, t_end: int) -> None:
    """Write the team's task performance: value recorded by the lander, share of area covered."""
    cells = float(COVER_CELLS * COVER_CELLS)
    team.performance[0] = float(team.total[0])
    team.performance[1] = float(team.total[1]) / cells


FUNCTIONS: dict[str, Any] = {
    "reset": (Phase(begin), Phase(hide_rocks, all_lanes)),
    "sense": SENSE,
    "act": act,
    "commit": commit,
    "resolve": RESOLVE,
    "outcome": (Phase(clear_total, 1), Phase(add_up, all_lanes), Phase(report, 1)),
}


def functions(rocks_per_activation: int, fitness: str) -> dict[str, Any]:
    """Return the phases of an epoch for these two parameters of the world."""
    found = dict(FUNCTIONS)
    if rocks_per_activation:
        found["reset"] = (*FUNCTIONS["reset"], Phase(forget))
        found["resolve"] = RESOLVE_ONE_ROCK
    if fitness in OF_TOTALS:
        found["resolve"] = (*found["resolve"], CREDIT_TOTAL)
    return found
