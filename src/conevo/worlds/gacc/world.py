"""Gathering and collective construction: thirty robots gather objects and build with them in order.

=============  =========================================================================
name           ``gacc-v2``
source         Nitschke 2009, chapter 6, appendix D
environments   ``simple-1..10`` (one type of object, table 6.6), ``complex-1..9`` (build
               sequences of table 6.8; 10 obstacles in all but complex-1)
robots         30
epoch          3000 iterations
sensors        8 for objects and obstacles, 8 for robots, 8 for the home area, one of each
               for every octant; 3 for the demand for objects of type A, B, C
actions        detect A, B, C; move; grip A, B, C
controller     37-10-8 simple recurrent network (27 sensors, 10 context units) with bias
performance    ``delivered``, objects delivered in correct order; ``completed``, complex
               objects; ``delivered_share``, percent of all objects that are delivered
=============  =========================================================================

**Task.** Objects of type A, B and C lie about and are to be built into complex objects of ten parts
in the construction zone, in the middle of the home area. A robot detects objects with the sensor
setting of their type, grips them with the gripper setting of their type, carries them home, and
waits there for help: 2, 3, 4 robots must hold an object of type A, B, C to build it in. An ordered
complex object takes only the next type of its sequence, a disordered one any type that it lacks.

**The life of an object** (``life`` of a recorded epoch):

=========  ===============================  ====================================================
state      meaning                          what comes next
=========  ===============================  ====================================================
LYING      where it was                     GRIPPED, by one robot outside the home area
GRIPPED    held outside the home area       CARRIED, when its robot moves; or as CARRIED
CARRIED    goes where its robot goes        WAITING, in the home area; DROPPED, if let go
WAITING    one robot holds it at home       HELPED, another grips it; DROPPED, after 30 iterations
HELPED     several do, not yet enough       DELIVERED, enough do and it is needed next; DROPPED,
                                            it is not needed, or all have waited 30 iterations;
                                            WAITING, all but one have
DELIVERED  a part of a complex object       nothing
DROPPED    lies where a robot let it go     GRIPPED outside, WAITING or more in the home area
=========  ===============================  ====================================================

States are those at the end of an iteration: an object gripped and let go within one iteration has
not changed.

**One iteration.** Every robot senses the world as it was at the end of the previous iteration, and
chooses. Then all move and grip. Then a referee decides about objects held in the home area.

**In the home area** four situations of section 6.2.8 decide instead of the controller. (1) Another
robot holds an object: go to the closest such robot and grip it too. (2) The robot itself holds one:
wait. (3) An object lies there: go to the closest one and grip it. (4) At least two hold an object
that cannot be built in now: they let go. Otherwise, and everywhere outside, the controller decides.

Choices, all declared in ``GaccParams`` or here:

- Choice: an object can be gripped whether or not it has been detected; detection shows a robot
  where to go. "It must first be detected" (6.5.3) is ``needs_detection``: then one detection by any
  robot is enough. But eq. 6.8 pays only those who deliver, not who detects for them.
- Choice: in the home area a robot senses all of it (``home_sight``): with the sensors' own 0.05
  hardly any robot gets help within the 30 iterations of table 6.4.
- Choice: home area, grip distance and home sight have these sizes because with smaller ones random
  teams never deliver anything, so nothing can evolve (docs/results/gacc.md).
- Choice: outside the home area one robot carries an object alone and no other can grip it. If two
  grip it in the same iteration, the one with the lower number gets it. No robot grips across the
  border of the home area.
- Choice: gripping with another setting lets go of the held object; with the same, nothing happens.
- Choice: every robot waits its own 30 iterations (table 6.4), then lets go. It avoids that object
  ("other objects", 6.2.8) until it has left the home area.
- Choice: waiting counts as gripping. "Leave the home area and continue searching" (situation 1) is
  left to the controller.
- Choice: a robot without energy lets go, stays where it is as a body, and does nothing more.
- Choice: an obstacle blocks the view of other robots too, but not of the home area or the demand.
- Choice: if several complex objects need a type, the first of them gets it. Several objects that
  are ready in one iteration get their places in the order of their numbers.
- Choice: walls and obstacles are sensed at their closest points, with a negative reading. The bound
  of eq. 6.1 limits a reading, but does not change which thing is the closest.
- Choice: only the end of a step decides whether it is refused; obstacles are too wide to be jumped
  over.

**Places.** At first objects and robots are anywhere outside the home area. With ``segregation``
each type has a region, and with ``starts = "by_robot"`` each robot has one, too: three sectors
around the middle (``worlds.places.sectors``).

**Castes** (6.1.1) depend on how a robot spends its time: activating its detection sensors; gripping
or moving with an object (gatherer); from its arrival in the home area on, or from its grip there,
with an object that is then built in (constructor). Choice: a robot that mostly moves with empty
hands belongs to none of these, and is non-specialized. Choice: the other nine are the settings
among which a robot chooses, as both its sensors and its gripper have one for each type (6.2).

Version history:

- v1: first version.
- v2: sine, cosine and arc tangent of kernels are equal bit for bit on every device; scenarios are
  drawn from other random numbers, those of all keys at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt
from annotated_types import Ge, Gt, Le

from conevo.errors import UsageError
from conevo.kernels.steps import component_bounds
from conevo.parameters import parameters
from conevo.rng import fold_all
from conevo.worlds.disturbances import Disturbances, disturbed
from conevo.worlds.gacc.dynamics import FUNCTIONS, fail
from conevo.worlds.gacc.obstacles import are_clear, draw_obstacles
from conevo.worlds.gacc.plans import TYPES, BuildingPlan, plan
from conevo.worlds.gacc.state import GaccConstants, GaccScene, GaccTeam
from conevo.worlds.measures import Measure
from conevo.worlds.places import draw_places, sectors
from conevo.worlds.protocol import Scenarios, Simulation, kernel_params, names_of
from conevo.worlds.spaces import Bounds, Choices, n_signed, one_output_each

__all__ = ["GaccParams", "GaccScenarios", "GaccWorld"]

Positive = Annotated[float, Gt(0)]
NonNegative = Annotated[float, Ge(0)]
Range = Annotated[float, Gt(0), Le(0.5)]
Ints = npt.NDArray[np.intp]
Floats = npt.NDArray[np.float32]

SLACK = 1e-3  # added to the reach of a robot: more than float32 rounding errors


@parameters("world")
class GaccParams(Disturbances):
    """Parameters of the world; lengths in sides of the square, energy in units.

    Nitschke 2009, table 6.4, unless marked. Choice: tables 6.1 and 6.2 have lost the settings of
    detection sensors and grippers; all types have the same.
    """

    n_robots: Annotated[int, Ge(2), Le(64)] = 30
    """(robots) robots in a team."""
    iterations: Annotated[int, Ge(2), Le(1_000_000)] = 3000
    """(iterations) length of an epoch."""
    energy: Positive = 1000.0
    """(energy) of a robot at the start of an epoch."""
    home_side: Annotated[float, Gt(0), Le(0.8)] = 0.7  # Choice: see docs/results/gacc.md
    """(side) side of the home area, in the middle of the square."""
    zone_side: Annotated[float, Gt(0), Le(0.5)] = 0.06  # Choice
    """(side) side of the construction zone, in the middle of the home area."""
    home_range: Annotated[float, Gt(0), Le(1)] = 1.0  # Choice: sensed from everywhere
    """(side) distance from its centre at which the home area is sensed."""
    home_sight: Annotated[float, Gt(0), Le(1)] = 1.0  # Choice: at home, all of home is in sight
    """(side) distance at which a robot in the home area senses objects there, and robots that need
    help."""
    object_range: Range = 0.05
    """(side) range of the object and obstacle sensors."""
    object_accuracy: Annotated[float, Ge(0), Le(1)] = 1.0  # Choice
    """(probability) that an object or an obstacle in range is sensed."""
    object_cost: NonNegative = 0.02  # Choice
    """(energy) of an activation of these sensors."""
    robot_range: Range = 0.05
    """(side) range of the robot sensors."""
    robot_cost: NonNegative = 0.01
    """(energy) of the robot sensors, in every iteration."""
    grip_distance: Range = 0.05  # Choice: the detection range
    """(side) largest distance of an object that a robot grips."""
    grip_cost: NonNegative = 0.01  # Choice
    """(energy) of an activation of the gripper, waiting with an object included."""
    move_range: Annotated[float, Gt(0), Le(0.02)] = 0.01  # Choice: the rovers', table 5.4
    """(side) the largest step."""
    move_cost: NonNegative = 0.01
    """(energy) of a move, refused or not."""
    wait: Annotated[int, Ge(1), Le(1_000_000)] = 30
    """(iterations) time that a robot waits for help with an object."""
    needs_detection: bool = False  # Choice: undetected objects can be gripped
    """whether an object must have been detected before it can be gripped."""
    min_distance: Positive = 0.01  # Choice: the bound of eq. 6.1, read as a maximum
    """(side) lower bound of distances in eqs 6.1 to 6.3."""
    separation: NonNegative = 0.002  # Choice: "only one robot can occupy any position" (6.1.2)
    """(side) smallest distance between two robots."""
    obstacle_least: Annotated[float, Ge(0.02), Le(0.1)] = 0.02  # Choice: sides of an obstacle
    """(side) shortest side of an obstacle."""
    obstacle_most: Annotated[float, Ge(0.02), Le(0.1)] = 0.1  # Choice
    """(side) longest side of an obstacle."""
    obstacle_gap: Annotated[float, Gt(0), Le(0.05)] = 0.03  # Choice: around every obstacle
    """(side) smallest distance of an obstacle from walls, home area and other obstacles."""
    segregation: Annotated[float, Ge(0), Le(1)] = 0.0
    """(share) of the objects of each type that lie in that type's region; the others lie anywhere.
    0 draws types independently of place, 1 gives one type to a region."""
    starts: Literal["random", "by_robot"] = "random"
    """where robots start: anywhere outside the home area, or robot i in region i mod 3."""

    def __post_init__(self) -> None:
        for low, high in (
            ("zone_side", "home_side"),
            ("obstacle_least", "obstacle_most"),
        ):
            if getattr(self, high) < getattr(self, low):
                raise UsageError(
                    f"world.{high} ({getattr(self, high)}) must not be below {low} "
                    f"({getattr(self, low)})"
                )

    @property
    def home(self) -> float:
        """Half a side of the home area."""
        return self.home_side / 2

    def region_of_objects(self, types: npt.NDArray[np.int32]) -> Ints:
        """Return the region of each object [K]: that of its type, or -1 for anywhere."""
        counts = np.bincount(types, minlength=len(TYPES))
        number = np.arange(len(types)) - (np.cumsum(counts) - counts)[types]  # of its type
        in_region = (self.segregation * counts + 0.5).astype(np.intp)[types]
        return np.where(number < in_region, types, -1).astype(np.intp)

    @property
    def region_of_robots(self) -> Ints:
        """The region in which each robot starts [R], -1 for anywhere."""
        robots = np.arange(self.n_robots)
        return robots % len(TYPES) if self.starts == "by_robot" else np.full_like(robots, -1)


@dataclass(frozen=True, kw_only=True)
class GaccScenarios(Scenarios):
    """E scenarios of one environment; lengths in sides of the square.

    object_x, object_y [E, K] float32; object_type [E, K] int32 (0..2 for A..C, in this order);
    left, bottom, right, top [E, obstacles] float32; start_x, start_y [E, R] float32; plan [C, 10]
    int32, type of every part of every complex object.
    """

    object_x: npt.NDArray[np.float32]
    object_y: npt.NDArray[np.float32]
    object_type: npt.NDArray[np.int32]
    left: npt.NDArray[np.float32]
    bottom: npt.NDArray[np.float32]
    right: npt.NDArray[np.float32]
    top: npt.NDArray[np.float32]
    start_x: npt.NDArray[np.float32]
    start_y: npt.NDArray[np.float32]
    plan: npt.NDArray[np.int32]


@dataclass(frozen=True)
class GaccWorld:
    """One environment of the gathering and construction task."""

    environment: str
    params: GaccParams = field(default_factory=GaccParams)

    name: ClassVar[str] = "gacc-v2"
    inputs: ClassVar[tuple[str, ...]] = (
        *names_of(("objects", "robots", "home"), 8),
        *(f"demand {kind}" for kind in TYPES),
    )
    outputs: ClassVar[tuple[str, ...]] = (
        *(f"detect {kind}" for kind in TYPES),
        *("move: dx", "move: dy"),
        *(f"grip {kind}" for kind in TYPES),
    )
    input_bounds: ClassVar[Bounds] = (  # an obstacle is less than 0
        *((-1.0, 1.0),) * 8,
        *((0.0, 1.0),) * 19,
    )
    discrete_actions: ClassVar[Choices] = one_output_each(outputs, "move: dx", "move: dy")
    controller: ClassVar[dict[str, Any]] = {
        "n_hidden": 10,  # section 6.2.7
        "max_hidden": 20,  # Choice: twice the initial number
        "bias": True,  # section 6.2.7
    }
    actions: ClassVar[tuple[str, ...]] = (
        *(f"detect {kind}" for kind in TYPES),
        "move",
        *(f"grip {kind}" for kind in TYPES),
    )
    castes: ClassVar[tuple[str, ...]] = (
        *(f"{kind}-detector" for kind in TYPES),
        "non-specialized",
        *(f"{kind}-gatherer" for kind in TYPES),
        *(f"{kind}-constructor" for kind in TYPES),
    )
    settings: ClassVar[tuple[str, ...]] = tuple(c for c in castes if c != "non-specialized")
    performance: ClassVar[tuple[Measure, ...]] = (
        Measure("delivered", "objects", low=0.0),
        Measure("completed", "complex objects", low=0.0),
        Measure("delivered_share", "%", low=0.0, high=100.0),
    )
    heuristics: ClassVar[tuple[str, ...]] = (
        *(f"{kind}-detector" for kind in TYPES),
        *(f"{kind}-gatherer" for kind in TYPES),
        *(f"{kind}-constructor" for kind in TYPES),
        "non-specialized",
    )

    @property
    def optimum(self) -> float:
        """Number of all objects."""
        return float(self.plan.parts.size)

    @property
    def output_bounds(self) -> Bounds:
        """Preference for each action, and the components of a step, in sides of the square."""
        step = component_bounds(self.params.move_range)
        return (*((0.0, 1.0),) * 3, step, step, *((0.0, 1.0),) * 3)

    @property
    def n_robots(self) -> int:
        """Number of robots."""
        return self.params.n_robots

    @property
    def plan(self) -> BuildingPlan:
        """The building plan."""
        return plan(self.environment)

    def scenarios(self, keys: Sequence[int]) -> GaccScenarios:
        """Return one scenario per key: obstacles, objects and starts at random places.

        Raises:
            UsageError: no room for the obstacles, or for the robots.
        """
        p, plan = self.params, self.plan
        seed = np.array(keys, dtype=np.uint64)
        blocks = draw_obstacles(
            fold_all(seed, "gacc", "obstacles"),
            plan.n_obstacles,
            p.home,
            (p.obstacle_least, p.obstacle_most),
            p.obstacle_gap,
        ).astype(np.float32)
        edge = np.float32(p.home + 1e-6)  # more than float32 rounding errors
        types = plan.object_types

        def drawn(what: str, separation: float, region: npt.NDArray[np.intp]) -> Floats:
            """Return places of things outside the home area, each in its region, -1 anywhere."""

            def is_free(e: Ints, k: Ints, xy: Floats) -> npt.NDArray[np.bool_]:
                is_home = (np.abs(xy - np.float32(0.5)) <= edge).all(axis=-1)
                own = region[k][:, None]
                is_there = (own < 0) | (sectors(xy, len(TYPES)) == own)
                return is_there & ~is_home & are_clear(e, xy, blocks)

            return draw_places(fold_all(seed, "gacc", what), len(region), separation, is_free)

        objects = drawn("objects", 0.0, p.region_of_objects(types))
        starts = drawn("starts", p.separation, p.region_of_robots)
        left, bottom, right, top = (np.ascontiguousarray(blocks[:, :, k]) for k in range(4))
        return GaccScenarios(
            object_x=objects[:, :, 0],
            object_y=objects[:, :, 1],
            object_type=np.tile(types, (len(seed), 1)),
            left=left,
            bottom=bottom,
            right=right,
            top=top,
            start_x=starts[:, :, 0],
            start_y=starts[:, :, 1],
            plan=plan.parts,
            seed=seed,
        )

    def simulation(self) -> Simulation:
        """Return the Warp side of this world."""
        p, plan = self.params, self.plan
        c = len(plan.parts)
        sight = max(p.object_range, p.robot_range, p.move_range)
        return Simulation(
            state=GaccTeam,
            sizes={"objects": plan.parts.size, "complex_objects": c, "types": 3}
            | p.kept(self.n_robots, len(self.inputs)),
            scene=GaccScene,
            params_type=GaccConstants,
            params=kernel_params(
                GaccConstants,
                self.params,
                signed_inputs=n_signed(self),
                n_objects=plan.parts.size,
                n_complex=c,
                near_2=(max(p.robot_range, 2 * p.move_range + p.separation) + SLACK) ** 2,
                reach_2=max(p.object_range, p.grip_distance) ** 2,
                walls_2=(sight + SLACK) ** 2,
                ordered=sum(1 << k for k, ordered in enumerate(plan.is_ordered) if ordered),
            ),
            functions=disturbed(FUNCTIONS, (GaccTeam, GaccScene, GaccConstants), p, fail),
            lanes=96,  # Choice: as in the rover world, whose neurons and sensors are as numerous
            recorded=(
                *("x", "y", "energy", "fitness", "action", "held", "waited", "dropped"),
                *("situation", "object_x", "object_y", "life", "detected", "part", "demand"),
                "counts",
            ),
        )
