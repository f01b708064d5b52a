"""Multi-rover: twenty rovers search canals of red rocks that only two of them together can detect.

=============  =========================================================================
name           ``rover-v2``
source         Nitschke 2009, chapter 5
environments   ``simple-1..10``, ``complex-1..10``, ``extended-1..10`` (section 5.1, appendix C);
               ``apart-1..10``, which are conevo's own
robots         20 rovers, one lander that records what they report
epoch          2500 iterations
sensors        8 rover sensors, 8 red rock sensors, one of each for every octant
actions        detect with setting low, med or hi; move
controller     26-10-5 simple recurrent network (16 sensors, 10 context units)
performance    ``value`` of red rocks detected (of 5000); ``area`` covered (share of the square)
=============  =========================================================================

**Rocks.** Types A to E are worth 1, 2, 3, 4, 1. A rock is detected, once, if two different rovers
in range activate in the same iteration with the settings A low+low, B low+med, C med+hi, D hi+hi,
E any equal pair, and both succeed, each with the accuracy of its setting (table 5.1).

**One iteration.** Every rover senses, thinks and chooses; then all move; then all detect. A rover
senses the world as it was at the end of the previous iteration, so the order of rovers has no
effect. Refused moves (canal, edge, another rover) cost the same as others.

Choices, all declared in ``RoverParams`` or here, with their sensitivity on the page *Fidelity*:

- Rocks lie at the centres of a 200 x 200 lattice inside the canals (``rover.canals``). Each
  scenario draws the sites with a rock, its type, the rovers' starts and the lander. Types are drawn
  independently of place. With ``segregation`` each type has a region (``rover.sites``), and with
  ``starts = "by_robot"`` each rover has one, too.
- If more than two rovers succeed on one rock in one iteration, all that belong to a valid pair are
  credited; the team's value counts the rock once. So credit does not depend on the order of rovers.
- With ``rocks_per_activation`` 1, a rover that could detect several rocks, with any others, takes
  the one that comes first in an order drawn for the iteration, the same for all rovers; a rock is
  detected by those that take it. So two rovers that meet detect one rock at a time.
- The area of an activation is that of its whole disc, even beyond the edge of the square.
- A rover without energy stays where it is as a body that others sense, and does nothing more.
- The lander records a detection one iteration later (section 5.1), so those of the last iteration
  are not in ``value``.
- A rover that fails (``worlds.disturbances``) is one without energy.
- A rover that has not activated yet shows setting 1, or rovers would be invisible at the start.

Version history:

- v1: first version.
- v2: sine, cosine and arc tangent of kernels are equal bit for bit on every device; the shares of
  rocks in sensors and fitness are integers, in 2^-16 and 2^-32, so that any order gives the same
  sum; scenarios are drawn from other random numbers, those of all keys at once.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt
from annotated_types import Ge, Gt, Le

from conevo.kernels.geometry import COVER_WORDS
from conevo.kernels.steps import component_bounds
from conevo.parameters import parameters
from conevo.rng import fold_all, uniforms
from conevo.worlds.disturbances import Disturbances, disturbed
from conevo.worlds.measures import Measure
from conevo.worlds.places import draw_places
from conevo.worlds.protocol import Scenarios, Simulation, kernel_params, names_of
from conevo.worlds.rover import canals, rocks
from conevo.worlds.rover.act import fail
from conevo.worlds.rover.dynamics import (
    FITNESS,
    LISTS,
    SCRATCH,
    SURVEYED,
    RoverConstants,
    RoverScene,
    RoverTeam,
    functions,
)
from conevo.worlds.rover.sites import N_REGIONS, draw_rocks, rock_sites
from conevo.worlds.spaces import Bounds, Choices, n_signed, one_output_each

__all__ = ["RoverParams", "RoverScenarios", "RoverWorld"]

Positive = Annotated[float, Gt(0)]
NonNegative = Annotated[float, Ge(0)]
Share = Annotated[float, Ge(0), Le(1)]
Range = Annotated[float, Gt(0), Le(0.5)]


@parameters("world")
class RoverParams(Disturbances):
    """Parameters of the world; lengths in sides of the square, energy in units.

    Nitschke 2009, table 5.4, unless marked. Choice: the sensor settings (range, accuracy, cost) are
    lost from table 5.2; these keep its printed nominal range 0.05 for the middle one.
    """

    n_robots: Annotated[int, Ge(2), Le(64)] = 20
    """(rovers) rovers in a team."""
    iterations: Annotated[int, Ge(2), Le(1_000_000)] = 2500
    """(iterations) length of an epoch."""
    energy: Positive = 1000.0
    """(energy) of a rover at the start of an epoch."""
    low_range: Range = 0.07
    """(side) radius of a detection with setting low, unless ``range_is`` makes it an area."""
    med_range: Range = 0.05
    """(side) radius of a detection with setting med."""
    hi_range: Range = 0.03
    """(side) radius of a detection with setting hi."""
    low_accuracy: Share = 0.7
    """(probability) that a rover succeeds on a rock in range with setting low."""
    med_accuracy: Share = 0.8
    """(probability) that a rover succeeds on a rock in range with setting med."""
    hi_accuracy: Share = 0.9
    """(probability) that a rover succeeds on a rock in range with setting hi."""
    low_cost: NonNegative = 0.1
    """(energy) of a detection with setting low."""
    med_cost: NonNegative = 0.2
    """(energy) of a detection with setting med."""
    hi_cost: NonNegative = 0.3
    """(energy) of a detection with setting hi."""
    rover_sensor_range: Range = 0.02
    """(side) range of the rover sensors."""
    range_is: Literal["radius", "area"] = "radius"
    """meaning of these four ranges: the radius of a disc, or its share of the square's area."""
    rover_sensor_cost: NonNegative = 0.05
    """(energy) of the rover sensors, in every iteration."""
    move_range: Annotated[float, Gt(0), Le(0.02)] = 0.01
    """(side) the largest step."""
    move_cost: NonNegative = 0.01
    """(energy) of a move, refused or not."""
    report_cost: NonNegative = 0.05  # Choice: paid in an iteration in which the rover detects
    """(energy) of reporting, in an iteration with a detection."""
    min_distance: Positive = 0.01  # Choice: the bound of eq. 5.1, read as a maximum
    """(side) lower bound of distances in eqs 5.1 and 5.4."""
    separation: NonNegative = 0.002  # Choice: "only one rover can occupy any position" (5.1)
    """(side) smallest distance between two rovers."""
    fitness: Literal["cumulative", "activation", "product", "value"] = "cumulative"
    """credit of a rover: eq. 5.4 with the area that it has covered so far, or with the area of the
    activation; value times area; or value."""
    rocks_per_activation: Annotated[int, Ge(0), Le(1)] = 0
    """(rocks) that an activation can detect; 0 is all in range."""
    segregation: Share = 0.0  # Choice: 0, as "each possible x, y position" of a canal (5.1.4)
    """(share) of the rocks of each type A to D that lie in that type's region; the others, and
    those of type E, lie anywhere. 0 draws types independently of place, 1 gives one type to a
    region."""
    starts: Literal["random", "by_robot"] = "random"
    """where rovers start: anywhere, or rover i in region i mod 4."""

    @property
    def ranges(self) -> tuple[float, float, float]:
        """Radius of a detection with each setting."""
        return (
            self._radius(self.low_range),
            self._radius(self.med_range),
            self._radius(self.hi_range),
        )

    @property
    def areas(self) -> tuple[float, float, float]:
        """Area of a detection with each setting, as a share of the square's."""
        low, med, hi = (math.pi * radius**2 for radius in self.ranges)
        return low, med, hi

    @property
    def rover_sensor_radius(self) -> float:
        """Radius of the rover sensors."""
        return self._radius(self.rover_sensor_range)

    def _radius(self, of: float) -> float:
        return math.sqrt(of / math.pi) if self.range_is == "area" else of

    @property
    def accuracy(self) -> tuple[float, float, float]:
        """Probability that a rover succeeds with each setting."""
        return self.low_accuracy, self.med_accuracy, self.hi_accuracy

    @property
    def cost(self) -> tuple[float, float, float]:
        """Energy of a detection with each setting."""
        return self.low_cost, self.med_cost, self.hi_cost

    @property
    def fitness_reading(self) -> int:
        """The number of ``fitness`` for the kernels."""
        return FITNESS.index(self.fitness)


@dataclass(frozen=True, kw_only=True)
class RoverScenarios(Scenarios):
    """Scenarios of one environment: E of them, K rocks each, sorted by grid cell.

    rock_x, rock_y, rock_value [E, K] float32; rock_type [E, K] int32 (0..4 for A..E);
    cell [E, cells + 1] int32, first rock of each grid cell; canal [rows, columns] uint8;
    start_x, start_y [E, R] float32; lander [E, 2] float32.
    """

    unseen: ClassVar[tuple[str, ...]] = ("seed", "cell")
    rock_x: npt.NDArray[np.float32]
    rock_y: npt.NDArray[np.float32]
    rock_value: npt.NDArray[np.float32]
    rock_type: npt.NDArray[np.int32]
    cell: npt.NDArray[np.int32]
    canal: npt.NDArray[np.uint8]
    start_x: npt.NDArray[np.float32]
    start_y: npt.NDArray[np.float32]
    lander: npt.NDArray[np.float32]


@dataclass(frozen=True)
class RoverWorld:
    """One environment of the multi-rover task."""

    environment: str
    params: RoverParams = field(default_factory=RoverParams)

    name: ClassVar[str] = "rover-v2"
    inputs: ClassVar[tuple[str, ...]] = names_of(("rovers", "red rocks"), 8)
    outputs: ClassVar[tuple[str, ...]] = ("low", "med", "hi", "move: dx", "move: dy")
    group: ClassVar[str] = "rover"
    input_bounds: ClassVar[Bounds] = ((0.0, 1.0),) * 16
    discrete_actions: ClassVar[Choices] = one_output_each(outputs, "move: dx", "move: dy")
    controller: ClassVar[dict[str, Any]] = {
        "n_hidden": 10,  # section 5.2
        "max_hidden": 20,  # Choice: twice the initial number
    }
    actions: ClassVar[tuple[str, ...]] = ("low", "med", "hi", "move")
    castes: ClassVar[tuple[str, ...]] = actions
    settings: ClassVar[tuple[str, ...]] = ("low", "med", "hi")
    performance: ClassVar[tuple[Measure, ...]] = (
        Measure("value", "points", low=0.0),
        Measure("area", "share of the square", low=0.0, high=1.0),
    )
    heuristics: ClassVar[tuple[str, ...]] = ("low", "med", "hi", "non-specialized")

    @property
    def optimum(self) -> float:
        """Value of all red rocks."""
        counts = rocks.mix(self.environment)
        return float(sum(n * value for n, value in zip(counts, rocks.VALUES, strict=True)))

    @property
    def output_bounds(self) -> Bounds:
        """Preference for each setting, and the components of a step, in sides of the square."""
        step = component_bounds(self.params.move_range)
        return (*((0.0, 1.0),) * 3, step, step)

    @property
    def n_robots(self) -> int:
        """Number of rovers."""
        return self.params.n_robots

    def scenarios(self, keys: Sequence[int]) -> RoverScenarios:
        """Return one scenario per key: rock sites and types, starts outside canals, lander."""
        seed = np.array(keys, dtype=np.uint64)
        places = rock_sites(rocks.layout(self.environment))
        mask = places.mask

        def is_free(
            _: npt.NDArray[np.intp], robot: npt.NDArray[np.intp], xy: npt.NDArray[np.float32]
        ) -> npt.NDArray[np.bool_]:
            column, row = np.moveaxis((xy * np.float32(canals.N_CELLS)).astype(np.intp), -1, 0)
            free = ~mask[row, column]
            if self.params.starts == "by_robot":
                free &= places.region(xy) == robot[:, None] % N_REGIONS
            return free

        starts = draw_places(
            fold_all(seed, "rover", "starts"), self.n_robots, self.params.separation, is_free
        )
        site, kind, cell = draw_rocks(
            fold_all(seed, "rover", "rocks"),
            places,
            rocks.mix(self.environment),
            self.params.segregation,
        )
        return RoverScenarios(
            rock_x=places.x[site],
            rock_y=places.y[site],
            rock_value=np.array(rocks.VALUES, dtype=np.float32)[kind],
            rock_type=kind,
            cell=cell,
            canal=mask.astype(np.uint8),
            start_x=starts[:, :, 0],
            start_y=starts[:, :, 1],
            lander=uniforms(fold_all(seed, "rover", "lander")[:, None], 0, 0, np.arange(2)),
            seed=seed,
        )

    def simulation(self) -> Simulation:
        """Return the Warp side of this world."""
        n_rocks = sum(rocks.mix(self.environment))
        return Simulation(
            state=RoverTeam,
            sizes={
                "rocks": n_rocks,
                "words": int(COVER_WORDS),
                "octants": 8,
                "lists": LISTS,
                "settings": 3,
                "picks": self.n_robots if self.params.rocks_per_activation else 1,
            }
            | self.params.kept(self.n_robots, len(self.inputs)),
            scene=RoverScene,
            params_type=RoverConstants,
            params=kernel_params(RoverConstants, self.params, **self._derived()),
            functions=disturbed(
                functions(self.params.rocks_per_activation, self.params.fitness),
                (RoverTeam, RoverScene, RoverConstants),
                self.params,
                fail,
            ),
            recorded=("x", "y", "action", "setting", "energy", "covered", "value", "fitness"),
            recorded_at_end=("detected",),
            lanes=96,  # Choice: the best of a prototype on an H100; most phases have 20 x 8 items
            scratch=SCRATCH,
        )

    def _derived(self) -> dict[str, float]:
        """Return constants of the kernels that follow from the parameters.

        Among them are the squared distances of rovers that may meet before the next survey.
        """
        p = self.params
        steps = 2 * int(SURVEYED) * p.move_range
        reaches = {
            "crowd_2": max(p.rover_sensor_radius, p.separation),
            "company_2": 2 * max(p.ranges),
        }
        squares = {name: (1.001 * (reach + steps)) ** 2 for name, reach in reaches.items()}
        return squares | {"signed_inputs": n_signed(self)}
