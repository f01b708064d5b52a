"""Poles: a cart balances two poles of different lengths.

=============  =====================================================================
name           ``poles-v1``
source         Wieland 1991; Gomez 2003, appendix; Gomez, Schmidhuber and Miikkulainen
               2008, section 4: the benchmark "double pole balancing"
environments   ``full-1`` (all of the state is seen), ``partial-1`` (no velocities), both from one
               start; ``full-2`` and ``partial-2`` (a start of its own in each scenario)
robots         1
epoch          1000 iterations of 0.02 s
sensors        positions of cart, long and short pole; their velocities; a constant 1
actions        left; right
controller     11-4-1 simple recurrent network (7 sensors, 4 context units); ``partial``: 8-4-1
performance    ``balanced``: iterations until a pole falls or the cart leaves the track
=============  =====================================================================

The task is solved by whoever balances for 100,000 iterations
(``--set world.iterations=100000``). A robot that has lost rests until the epoch ends.

Choice: sensors are positions over their limits, and velocities over 2 (m/s or rad/s). The force is
10 N times the output, squashed to [-1, 1].

Version history: v1, the first version.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt
import warp as wp
from annotated_types import Ge, Le

from conevo.kernels.actions import NONE, begin_counting, count_action
from conevo.kernels.arrays import named_arrays
from conevo.kernels.outputs import sigmoid
from conevo.kernels.random import uniform
from conevo.kernels.trigonometry import cosine_sine
from conevo.parameters import parameters
from conevo.playback.drawn import Drawn, Objects
from conevo.rng import stream
from conevo.worlds.measures import Measure
from conevo.worlds.protocol import Scenarios, Simulation, kernel_params
from conevo.worlds.registry import WorldEntry

GRAVITY = wp.constant(9.8)  # m/s^2
CART = wp.constant(1.0)  # kg
TRACK = wp.constant(2.4)  # m, to either end
FALLEN = wp.constant(math.radians(36.0))
LONG, SHORT = wp.constant(0.5), wp.constant(0.05)  # m, half the lengths of the poles
HEAVY, LIGHT = wp.constant(0.1), wp.constant(0.01)  # kg, their masses
RAIL = wp.constant(0.0005)  # friction of the cart
HINGE = wp.constant(0.000002)  # friction of a pole
STRONGEST = wp.constant(10.0)  # N
STEP = wp.constant(0.01)  # s, two in an iteration
FASTEST = wp.constant(2.0)  # m/s or rad/s, velocity of which the sensor has the value 1
PAST = wp.constant(100)  # iterations whose movements the fitness "damped" considers

vec6 = wp.types.vector(length=6, dtype=float)


@parameters("world")
class PolesParams:
    """Parameters of the world."""

    iterations: Annotated[int, Ge(2), Le(1_000_000)] = 1000
    """(iterations) length of an epoch."""
    velocities: bool = True
    """whether the robot sees the velocities of cart and poles."""
    tilt: Annotated[float, Ge(0), Le(36)] = 4.5
    """(degrees) angle of the long pole at the start, while the short one is upright."""
    tilt_range: Annotated[float, Ge(0), Le(36)] = 0.0
    """(degrees) both poles' angles at the start are drawn from this much to either side."""
    fitness: Literal["steps", "damped"] = "steps"
    """"steps": iterations balanced. "damped": 0.1 t / 1000, and 0.9 times 0.75 over the sum of the
    last 100 iterations' |x| + |x'| + |angle| + |angle'| of cart and long pole, if there are as many
    (Gruau, Whitley and Pyeatt 1996), against controllers that balance by shaking."""


@wp.struct
class Params:
    """The parameters that the kernels need; angles in rad."""

    velocities: int
    is_damped: int
    tilt: float
    tilt_range: float


@wp.struct
class Scene:
    """A scenario: a number in [-1, 1] for the start of each pole, and the seed of the rest."""

    start: wp.array[float]
    seed: wp.array[wp.uint64]


@named_arrays
class Team:
    """State of a team of one robot: m, m/s, rad, rad/s, N.

    is_lost: whether it has failed. moved: movements of the last iterations, in turn.
    tip_x, tip_y: ends of the poles, for the drawing.
    """

    inputs: wp.array2d[float]
    outputs: wp.array2d[float]
    x: wp.array[float]
    y: wp.array[float]
    speed: wp.array[float]
    angle_1: wp.array[float]
    spin_1: wp.array[float]
    angle_2: wp.array[float]
    spin_2: wp.array[float]
    force: wp.array[float]
    is_lost: wp.array[int]
    balanced: wp.array[int]
    moved: Annotated[wp.array[float], "robots", "past"]
    tip_x: Annotated[wp.array[float], "robots", "poles"]
    tip_y: Annotated[wp.array[float], "robots", "poles"]
    chosen: wp.array[int]
    action: wp.array[int]
    heuristic: wp.array[int]
    fitness: wp.array[float]
    counts: wp.array[int]
    switches: wp.array[int]
    performance: wp.array[float]


@wp.func
def pull(angle: float, spin: float, half: float, mass: float) -> wp.vec2f:
    """Return a pole's effective force on the cart, and its effective mass."""
    turn = cosine_sine(angle)
    hinge = HINGE * spin / (mass * half)
    force = mass * half * spin * spin * turn[1]
    force += 0.75 * mass * turn[0] * (hinge - GRAVITY * turn[1])
    return wp.vec2f(force, mass * (1.0 - 0.75 * turn[0] * turn[0]))


@wp.func
def swing(angle: float, spin: float, half: float, mass: float, acceleration: float) -> float:
    """Return a pole's angular acceleration, given the cart's acceleration."""
    turn = cosine_sine(angle)
    hinge = HINGE * spin / (mass * half)
    return -0.75 / half * (acceleration * turn[0] - GRAVITY * turn[1] + hinge)


@wp.func
def rates(s: vec6, force: float) -> vec6:
    """Return the derivatives of x, x', angle 1, angle 1', angle 2 and angle 2' (Wieland 1991)."""
    first = pull(s[2], s[3], LONG, HEAVY)
    second = pull(s[4], s[5], SHORT, LIGHT)
    rail = RAIL * wp.where(s[1] > 0.0, 1.0, wp.where(s[1] < 0.0, -1.0, 0.0))
    acceleration = (force - rail + first[0] + second[0]) / (CART + first[1] + second[1])
    return vec6(
        s[1],
        acceleration,
        s[3],
        swing(s[2], s[3], LONG, HEAVY, acceleration),
        s[5],
        swing(s[4], s[5], SHORT, LIGHT, acceleration),
    )


@wp.func
def after(s: vec6, force: float) -> vec6:
    """Return the state one step later: the classical Runge-Kutta method of fourth order."""
    k1 = rates(s, force)
    k2 = rates(s + k1 * (0.5 * STEP), force)
    k3 = rates(s + k2 * (0.5 * STEP), force)
    k4 = rates(s + k3 * STEP, force)
    return s + (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (STEP / 6.0)


@wp.func
def point(team: Team, i: int) -> None:
    """Store where the ends of the poles are."""
    long = cosine_sine(team.angle_1[i])
    short = cosine_sine(team.angle_2[i])
    team.tip_x[2 * i] = team.x[i] + 2.0 * LONG * long[1]
    team.tip_y[2 * i] = 2.0 * LONG * long[0]
    team.tip_x[2 * i + 1] = team.x[i] + 2.0 * SHORT * short[1]
    team.tip_y[2 * i + 1] = 2.0 * SHORT * short[0]


@wp.func
def reset(team: Team, scene: Scene, p: Params, i: int) -> None:
    """Put the cart in the middle, with the long pole tilted."""
    team.x[i] = 0.0
    team.y[i] = 0.0
    team.speed[i] = 0.0
    team.angle_1[i] = p.tilt + p.tilt_range * scene.start[0]
    team.spin_1[i] = 0.0
    team.angle_2[i] = p.tilt_range * scene.start[1]
    team.spin_2[i] = 0.0
    team.is_lost[i] = 0
    team.balanced[i] = 0
    for k in range(PAST):
        team.moved[i * PAST + k] = 0.0
    team.fitness[i] = 0.0
    point(team, i)
    begin_counting(team.action, team.switches, team.counts, i)


@wp.func
def sense(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Fill the robot's sensor inputs."""
    team.inputs[i, 0] = team.x[i] / TRACK
    team.inputs[i, 1] = team.angle_1[i] / FALLEN
    team.inputs[i, 2] = team.angle_2[i] / FALLEN
    team.inputs[i, 3] = 1.0
    if p.velocities == 1:
        team.inputs[i, 4] = team.speed[i] / FASTEST
        team.inputs[i, 5] = team.spin_1[i] / FASTEST
        team.inputs[i, 6] = team.spin_2[i] / FASTEST


@wp.func
def act(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Choose the force; the heuristic shaker pushes with all its force, at random."""
    force = STRONGEST * (2.0 * sigmoid(team.outputs[i, 0]) - 1.0)
    if team.heuristic[i] == 0:
        force = STRONGEST * wp.where(uniform(scene.seed[0], t, 0, i) < 0.5, -1.0, 1.0)
    team.force[i] = force
    team.chosen[i] = int(force >= 0.0)


@wp.func
def commit(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Push the cart for two steps, if it has not lost yet, and count the action."""
    if team.is_lost[i] == 1:
        count_action(team.action, team.switches, team.counts, i, NONE, NONE)
        return
    s = vec6(
        team.x[i], team.speed[i], team.angle_1[i], team.spin_1[i], team.angle_2[i], team.spin_2[i]
    )
    s = after(after(s, team.force[i]), team.force[i])
    team.x[i] = s[0]
    team.speed[i] = s[1]
    team.angle_1[i] = s[2]
    team.spin_1[i] = s[3]
    team.angle_2[i] = s[4]
    team.spin_2[i] = s[5]
    point(team, i)
    has_fallen = wp.abs(s[2]) > FALLEN or wp.abs(s[4]) > FALLEN
    team.is_lost[i] = int(wp.abs(s[0]) > TRACK or has_fallen)
    movement = wp.abs(s[0]) + wp.abs(s[1]) + wp.abs(s[2]) + wp.abs(s[3])
    team.moved[i * PAST + t % PAST] = movement
    team.balanced[i] = team.balanced[i] + 1 - team.is_lost[i]
    a = team.chosen[i]
    count_action(team.action, team.switches, team.counts, i, a, a)


@wp.func
def resolve(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Score the robot."""
    n = float(team.balanced[i])
    if p.is_damped == 0:
        team.fitness[i] = n
    elif team.is_lost[i] == 0 or t == team.balanced[i]:
        total = float(0.0)
        for k in range(PAST):
            total += team.moved[i * PAST + k]
        calm = wp.where(team.balanced[i] >= PAST, 0.75 / wp.max(total, 1.0e-6), 0.0)
        team.fitness[i] = 0.1 * n / 1000.0 + 0.9 * calm


@wp.func
def outcome(team: Team, scene: Scene, p: Params, t_end: int) -> None:
    """Write the team's task performance."""
    team.performance[0] = float(team.balanced[0])


@dataclass(frozen=True, kw_only=True)
class PolesScenarios(Scenarios):
    """E scenarios: start [E, 2] float32, in [-1, 1]."""

    start: npt.NDArray[np.float32]


@dataclass(frozen=True)
class PolesWorld:
    """One environment of the task."""

    environment: str
    params: PolesParams

    name: ClassVar[str] = "poles-v1"
    outputs: ClassVar[tuple[str, ...]] = ("force",)
    controller: ClassVar[dict[str, Any]] = {"n_hidden": 4, "max_hidden": 8}
    actions: ClassVar[tuple[str, ...]] = ("left", "right")
    castes: ClassVar[tuple[str, ...]] = actions
    performance: ClassVar[tuple[Measure, ...]] = (Measure("balanced", "iterations", low=0.0),)
    heuristics: ClassVar[tuple[str, ...]] = ("shaker",)
    drawn: ClassVar[Drawn] = Drawn(
        objects=(Objects("pole", "tip_x", "tip_y", 0.04),),
        unit="m",
        seconds=0.02,
        bounds=(-2.6, -0.6, 2.6, 1.4),
        radius=0.1,
    )
    n_robots: ClassVar[int] = 1

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the sensors."""
        seen = ("cart", "long pole", "short pole", "one")
        moving = ("cart speed", "long pole speed", "short pole speed")
        return seen + moving if self.params.velocities else seen

    @property
    def optimum(self) -> int:
        """The largest number of iterations balanced."""
        return self.params.iterations

    def scenarios(self, keys: Sequence[int]) -> PolesScenarios:
        """Return one scenario per key."""
        start = [stream(key, self.name).uniform(-1, 1, 2) for key in keys]
        return PolesScenarios(start=np.array(start, np.float32), seed=np.array(keys, np.uint64))

    def simulation(self) -> Simulation:
        """Return the Warp side of this world."""
        p = self.params
        return Simulation(
            state=Team,
            scene=Scene,
            params_type=Params,
            params=kernel_params(
                Params,
                p,
                is_damped=p.fitness == "damped",
                tilt=math.radians(p.tilt),
                tilt_range=math.radians(p.tilt_range),
            ),
            functions={f.key: f for f in (reset, sense, act, commit, resolve, outcome)},
            sizes={"past": int(PAST), "poles": 2},
            recorded=(
                *("x", "y", "speed", "angle_1", "spin_1", "angle_2", "spin_2", "force"),
                *("tip_x", "tip_y", "action", "fitness"),
            ),
        )


ENTRY = WorldEntry(
    name="poles-v1",
    title="Double pole balancing",
    summary="a cart balances two poles, with or without sight of their velocities",
    source="Wieland 1991; Gomez, Schmidhuber and Miikkulainen 2008",
    environments=("full-1", "full-2", "partial-1", "partial-2"),
    defaults={
        "full-2": {"tilt": 0.0, "tilt_range": 4.5},
        "partial-1": {"velocities": False},
        "partial-2": {"velocities": False, "tilt": 0.0, "tilt_range": 4.5},
    },
    params_name="PolesParams",
    world_name="PolesWorld",
)
