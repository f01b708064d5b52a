"""Data of the kernels of the multi-rover world: constants, a scenario, a team's state."""

from typing import Annotated

import warp as wp

from conevo.kernels.actions import NONE
from conevo.kernels.arrays import named_arrays
from conevo.kernels.phases import n_lanes
from conevo.worlds.rover import canals

__all__ = [
    "ACTIVATION",
    "CANAL_CELLS",
    "COVERING",
    "DETECTING",
    "FITNESS",
    "LISTS",
    "MOVE",
    "NO_PICK",
    "N_ACTIONS",
    "N_SETTINGS",
    "OLD",
    "PARTS",
    "PRODUCT",
    "ROCK_CELLS",
    "SCANNING",
    "SURVEYED",
    "UNIT",
    "RoverConstants",
    "RoverScene",
    "RoverTeam",
    "is_activation",
    "n_parts",
    "of_setting",
    "rock_cell",
]

N_ACTIONS = wp.constant(4)
N_SETTINGS = wp.constant(3)
MOVE = wp.constant(3)
ROCK_CELLS = wp.constant(40)  # grid over the rocks; 0.025 wide, so a disc needs few cells
CANAL_CELLS = wp.constant(canals.N_CELLS)
OLD = wp.constant(-2)  # the readings of rock sensors are outdated
UNIT = wp.constant(2.0**16)  # sums of sensors are integers in 1 / UNIT: at most 5000 * UNIT

# The lists of an iteration: rovers that scan rocks, cover cells, may detect with another one.
LISTS = wp.constant(3)
SCANNING = wp.constant(0)
COVERING = wp.constant(1)
DETECTING = wp.constant(2)

# The values of ``RoverParams.fitness`` and their numbers.
FITNESS = ("cumulative", "activation", "product", "value")
ACTIVATION = wp.constant(1)
PRODUCT = wp.constant(2)

NO_PICK = wp.constant(wp.int64(2**62))

# Iterations between two surveys of each rover's company, those that may be near until the next one.
SURVEYED = wp.constant(4)
PARTS = wp.constant(32)  # of a scan for several lanes: 8 rows x 4 rocks, or 32 rows of cells


@wp.struct
class RoverConstants:
    """The fields of ``RoverParams`` for the kernels; ``NAME_2`` is a square.

    crowd_2, company_2: squared distance within which another rover may be sensed or be in the way,
    and within which its detection may overlap, before the next survey.
    """

    n_robots: int
    energy: float
    ranges: wp.vec3f
    accuracy: wp.vec3f
    cost: wp.vec3f
    rover_sensor_radius_2: float
    rover_sensor_cost: float
    move_range: float
    move_cost: float
    report_cost: float
    min_distance_2: float
    separation_2: float
    crowd_2: float
    company_2: float
    areas: wp.vec3f
    fitness_reading: int
    rocks_per_activation: int
    sensor_noise: float
    signed_inputs: int  # number of the first inputs, which have a range of [-1, 1]
    action_noise: float
    failure: float
    failure_at: int


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
    """State of a team. Sets of robots are words, a bit for each."""

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
    kept_inputs: Annotated[wp.array[float], "kept_inputs"]  # without noise
    kept_heuristic: Annotated[wp.array[int], "kept_robots"]  # while outputs are random
    # Kept from one iteration to the next.
    changed: Annotated[wp.array[wp.uint64], "team"]  # rovers that moved or have a new setting
    acting: Annotated[wp.array[wp.uint64], "settings"]  # rovers that activate with each setting
    crowd: wp.array[wp.uint64]  # rovers that may be sensed, or be in the way
    company: wp.array[wp.uint64]  # rovers whose detection may overlap
    # for each setting of this rover the rovers that, unless changed, detect nothing with it here
    barren: Annotated[wp.array[wp.uint64], "robots", "settings"]
    mates: wp.array[wp.uint64]  # rovers whose detection overlaps, with a setting that may fit
    hopeful: wp.array[wp.uint64]  # mates with whom a rock is left
    box: wp.array[int]  # first and last column and row of cells that a mate and this rover reach
    sees_rovers: wp.array[int]  # whether a rover sensor is not 0
    looked: wp.array[int]  # settings with which ``rocks`` was summed up at this place, a bit each
    rocks: Annotated[wp.array[int], "robots", "settings", "octants"]  # in 1 / UNIT
    shown: wp.array[int]  # setting whose ``rocks`` the rock sensors read, NONE for 0, or OLD
    closest: Annotated[wp.array[float], "robots", "octants"]  # squared distance of a rover
    # Sums of an iteration or of the outcome, in integers.
    gain: wp.array[int]
    gain_near: wp.array[wp.int64]  # in 1 / UNIT^2
    # the rock that a rover takes, behind its rank, if it may detect one only
    pick: Annotated[wp.array[wp.int64], "picks"]
    total: Annotated[wp.array[int], "measures"]
    # Lists of the iteration, and their lengths.
    n_listed: Annotated[wp.array[int], "lists"]
    scanning: wp.array[int]
    covering: wp.array[int]
    detecting: wp.array[int]


@wp.func
def n_parts() -> int:
    """Return the number of items of one scan: 1 for a single lane."""
    return wp.where(n_lanes() == 1, 1, PARTS)


@wp.func
def rock_cell(v: float) -> int:
    """Return the row or column of the rock grid that a coordinate lies in."""
    return wp.clamp(int(v * float(ROCK_CELLS)), 0, ROCK_CELLS - 1)


@wp.func
def is_activation(a: int) -> bool:
    """Return whether an action is a detection with one of the three settings."""
    return a != NONE and a != MOVE


@wp.func
def of_setting(of: wp.vec3f, a: int) -> float:
    """Return one of three numbers, without the array in memory that ``of[a]`` needs."""
    return wp.where(a == 0, of[0], wp.where(a == 1, of[1], of[2]))
