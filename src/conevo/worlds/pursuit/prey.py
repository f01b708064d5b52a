"""Prey shaping: a prey learns to run fast and straight without collisions.

=============  =========================================================================
name           ``prey-v2``
source         Nitschke 2009, section 4.3
environments   ``shaping-1``: 2 to 6 obstacles; ``shaping-2``: 2 to 6 heuristic predators;
               ``shaping-3``: both; ``shaping-4..6``: the same with two prey
robots         one or two prey
epoch          1000 iterations of 0.1 s
sensors        8 infrared
actions        stop, forward, left, right, reverse (motor primitives)
controller     8-5-2 feed-forward network
performance    ``path`` in cm, see below; ``collided``, share of the prey that did
               (smaller is better)
=============  =========================================================================

**Fitness.** The length of a prey's path, more for a straight one: the sum over iterations of the
distance driven times 1 - sqrt(half the difference of its wheel commands). A prey whose own move is
refused has collided: its fitness is 0 and its epoch is over; it stays as a body.

The rules of motion, sensing and collisions are those of ``pursuit.world``; the predators are its
heuristic predators. ``conevo shape-prey`` runs experiments 1 to 6 in turn, each from the
populations of the previous one.

Choice: the move of a predator into a prey is refused like any other; it is not a collision of the
prey.

Version history:

- v1: first version.
- v2: sine, cosine and arc tangent of kernels are equal bit for bit on every device; scenarios are
  drawn from other random numbers, those of all keys at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

from annotated_types import Ge, Le

from conevo.errors import UsageError
from conevo.parameters import parameters
from conevo.worlds.measures import Measure
from conevo.worlds.protocol import Simulation, names_of
from conevo.worlds.pursuit.arena import ArenaParams, ArenaScenarios, draw_scenarios, simulate
from conevo.worlds.pursuit.commands import WHEEL_BOUNDS
from conevo.worlds.pursuit.dynamics import ACTIONS, PREY_FUNCTIONS
from conevo.worlds.pursuit.motion import PRIMITIVES
from conevo.worlds.spaces import Bounds, Choices

__all__ = ["PreyParams", "PreyWorld"]


@parameters("world")
class PreyParams(ArenaParams):
    """Parameters of the world, in addition to those of the arena."""

    least: Annotated[int, Ge(0), Le(6)] = 2
    """fewest obstacles, and fewest predators, of an epoch (section 4.3)."""
    most: Annotated[int, Ge(0), Le(6)] = 6
    """most obstacles, and most predators, of an epoch."""

    def __post_init__(self) -> None:
        if self.most < self.least:
            raise UsageError(f"world.most ({self.most}) must not be below least ({self.least})")


@dataclass(frozen=True)
class PreyWorld:
    """One shaping experiment."""

    environment: str
    params: PreyParams = field(default_factory=PreyParams)

    name: ClassVar[str] = "prey-v2"
    inputs: ClassVar[tuple[str, ...]] = names_of(("infrared",), 8)
    outputs: ClassVar[tuple[str, ...]] = ("left wheel", "right wheel")
    group: ClassVar[str] = "prey"
    input_bounds: ClassVar[Bounds] = ((0.0, 1.0),) * 8
    output_bounds: ClassVar[Bounds] = (WHEEL_BOUNDS, WHEEL_BOUNDS)
    discrete_actions: ClassVar[Choices] = PRIMITIVES
    controller: ClassVar[dict[str, Any]] = {
        "n_hidden": 5,  # section 4.1
        "max_hidden": 10,  # Choice: twice the initial number
        "recurrent": False,  # fig. 4.2
    }
    actions: ClassVar[tuple[str, ...]] = ACTIONS
    castes: ClassVar[tuple[str, ...]] = actions
    performance: ClassVar[tuple[Measure, ...]] = (
        Measure("path", "cm", low=0.0),
        Measure("collided", "share of the prey", larger_is_better=False, low=0.0, high=1.0),
    )
    heuristics: ClassVar[tuple[str, ...]] = ("heuristic", "random")

    @property
    def experiment(self) -> int:
        """Number of the shaping experiment, from 1."""
        return int(self.environment.rpartition("-")[2])

    @property
    def n_robots(self) -> int:
        """Number of prey."""
        return 1 + (self.experiment - 1) // 3

    @property
    def _predators(self) -> tuple[int, int]:
        return (0, 0) if self.experiment % 3 == 1 else (self.params.least, self.params.most)

    def scenarios(self, keys: Sequence[int]) -> ArenaScenarios:
        """Return one scenario per key: random numbers, places and headings."""
        has_obstacles = self.experiment % 3 != 2
        return draw_scenarios(
            keys,
            self.params.arena_cm,
            self.n_robots,
            self._predators,
            (self.params.least, self.params.most) if has_obstacles else (0, 0),
            n_sensors=8,
        )

    def simulation(self) -> Simulation:
        """Return the Warp side of this world."""
        return simulate(
            self,
            PREY_FUNCTIONS,
            bodies=self.n_robots + self._predators[1],
            team_is_prey=True,
            prey_mode=0,
            prey_hidden=0,
            capture_window=1,
            capture_share=0.0,
            capture_distance_cm=0.0,
            capture_predators=0,
        )
