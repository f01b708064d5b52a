"""Pursuit-evasion: Khepera predators capture faster prey.

=============  =========================================================================
name           ``pursuit-v2``
source         Nitschke 2009, chapter 4, appendix B
environments   ``team-1..10`` (table 4.2): 2, 3, 4, 5, 6 predators and one prey, then two
robots         2 to 6 predators; the prey are opponents with their own controllers
epoch          1000 iterations of 0.1 s
sensors        8 infrared (everything), 8 light (prey only)
actions        stop, forward, left, right, reverse: motor primitives, see below
controller     22-6-2 simple recurrent network (16 sensors, 6 context units)
performance    ``capture_time`` in iterations; ``first_capture``, its iteration (or the
               epoch's length; smaller is better); ``captures``, how often; ``collisions`` of
               the predators, refused moves (smaller is better)
=============  =========================================================================

**Capture.** A prey is captured in an iteration if it is immobilized and at least two predators are
within light range of it. It is immobilized if, over the last ten iterations, it moved less than a
tenth of the distance that its wheels commanded, or less than 0.2 cm. The fitness of every predator
is the number of iterations in which a prey is captured (section 4.4).

**One iteration.** Every body senses the world as it was at the end of the previous iteration,
thinks and sets its wheels. Then all move along exact arcs. A move into a wall, an obstacle or
another body is refused: the old pose is kept.

Choices, all declared in ``PursuitParams``, ``ArenaParams`` or here:

- Choice: with two prey, capture time counts iterations in which at least one is captured.
- Choice: "moved" and "commanded" are lengths of paths, not distances between places: a prey that
  runs in a tight circle is not immobilized, but a prey whose moves are all refused is. Captures are
  possible only after a whole window.
- Choice: within light range means that the gap between the rims is at most the range, in whichever
  direction the predator looks.
- Choice: MO-0 is the left wheel, MO-1 the right.

Version history:

- v1: first version.
- v2: sine, cosine and arc tangent of kernels are equal bit for bit on every device; the path
  lengths of a prey are summed up in integers; scenarios are drawn from other random numbers, those
  of all keys at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt
from annotated_types import Ge, Le

from conevo.errors import UsageError, unknown_name
from conevo.parameters import parameters
from conevo.terms import counted
from conevo.worlds.measures import Measure
from conevo.worlds.protocol import Simulation, names_of
from conevo.worlds.pursuit import prey_sets
from conevo.worlds.pursuit.arena import ArenaParams, ArenaScenarios, draw_scenarios, simulate
from conevo.worlds.pursuit.commands import WHEEL_BOUNDS
from conevo.worlds.pursuit.dynamics import ACTIONS, PURSUIT_FUNCTIONS
from conevo.worlds.pursuit.motion import PRIMITIVES
from conevo.worlds.spaces import Bounds, Choices

__all__ = ["PursuitParams", "PursuitWorld"]

PREY_MODES = {"shaped": 0, "heuristic": 1, "random": 2}  # a file's prey are controlled as shaped


@parameters("world")
class PursuitParams(ArenaParams):
    """Parameters of the world, in addition to those of the arena."""

    prey: str = "shaped"
    """controllers of the prey: "shaped" (the shipped, evolved ones), "heuristic", "random", or a
    file made by ``conevo shape-prey``."""
    prey_digest: str = ""
    """digest of a prey file; a run fills it in and checks it."""
    n_obstacles: Annotated[int, Ge(0), Le(6)] = 0
    """(obstacles) cylinders in the arena. The thesis has them only when prey are shaped."""
    starts: Literal["random", "by_robot"] = "random"
    """where predators start: anywhere, or each in its own sector around the middle of the arena,
    all of the same area; prey start anywhere."""
    capture_window: Annotated[int, Ge(1), Le(1000)] = 10
    """(iterations) time over which a captured prey has hardly moved. Choice: 10, one second."""
    capture_share: Annotated[float, Ge(0), Le(1)] = 0.1
    """it moved less than this share of the distance that its wheels commanded. Choice: a tenth."""
    capture_distance_cm: Annotated[float, Ge(0), Le(100)] = 0.2
    """(cm) or it moved less than this. Choice: 0.2."""
    capture_predators: Annotated[int, Ge(1), Le(6)] = 2
    """(predators) that must be within light range (section 4.1: two)."""

    def __post_init__(self) -> None:
        if self.prey in PREY_MODES:
            if self.prey_digest:
                raise UsageError(f"world.prey_digest belongs to a prey file, not to {self.prey!r}")
            return
        path = Path(self.prey)
        if not self.prey or (not path.exists() and path.name == self.prey and not path.suffix):
            raise unknown_name("prey", self.prey, PREY_MODES, "(and no such file)")
        found = prey_sets.load(path).digest
        if self.prey_digest not in ("", found):
            raise UsageError(
                f"prey file {self.prey!r} has changed: its digest is {found}, not "
                f"{self.prey_digest}"
            )
        object.__setattr__(self, "prey", str(path.resolve()))
        object.__setattr__(self, "prey_digest", found)


@dataclass(frozen=True)
class PursuitWorld:
    """One team type of the pursuit-evasion task."""

    environment: str
    params: PursuitParams = field(default_factory=PursuitParams)

    name: ClassVar[str] = "pursuit-v2"
    inputs: ClassVar[tuple[str, ...]] = names_of(("infrared", "light"), 8)
    outputs: ClassVar[tuple[str, ...]] = ("left wheel", "right wheel")
    group: ClassVar[str] = "predator"
    input_bounds: ClassVar[Bounds] = ((0.0, 1.0),) * 16
    output_bounds: ClassVar[Bounds] = (WHEEL_BOUNDS, WHEEL_BOUNDS)
    discrete_actions: ClassVar[Choices] = PRIMITIVES
    controller: ClassVar[dict[str, Any]] = {
        "n_hidden": 6,  # section 4.1
        "max_hidden": 12,  # Choice: twice the initial number
    }
    actions: ClassVar[tuple[str, ...]] = ACTIONS
    castes: ClassVar[tuple[str, ...]] = actions
    performance: ClassVar[tuple[Measure, ...]] = (
        Measure("capture_time", "iterations", low=0.0),
        Measure("first_capture", "iteration", larger_is_better=False, low=0.0),
        Measure("captures", "captures", low=0.0),
        Measure("collisions", "refused moves", larger_is_better=False, low=0.0),
    )
    heuristics: ClassVar[tuple[str, ...]] = ("heuristic",)

    def __post_init__(self) -> None:
        if self.params.capture_predators > self.n_robots:
            raise UsageError(
                f"world.capture_predators ({self.params.capture_predators}) must not be above the "
                f"{counted(self.n_robots, 'predator')} of {self.environment}"
            )

    @property
    def team_type(self) -> int:
        """Number of the team type, from 1 (table 4.2)."""
        return int(self.environment.rpartition("-")[2])

    @property
    def optimum(self) -> float:
        """Capture time if a prey is held from the first iteration on."""
        return float(self.params.iterations)

    @property
    def n_robots(self) -> int:
        """Number of predators."""
        return 2 + (self.team_type - 1) % 5

    @property
    def n_prey(self) -> int:
        """Number of prey."""
        return 1 + (self.team_type - 1) // 5

    def scenarios(self, keys: Sequence[int]) -> ArenaScenarios:
        """Return one scenario per key: random places and headings."""
        obstacles = self.params.n_obstacles
        return draw_scenarios(
            keys,
            self.params.arena_cm,
            self.n_robots,
            (self.n_prey, self.n_prey),
            (obstacles, obstacles),
            n_sensors=16,
            by_robot=self.params.starts == "by_robot",
            prey=self._prey_weights(),
        )

    def simulation(self) -> Simulation:
        """Return the Warp side of this world."""
        return simulate(
            self,
            PURSUIT_FUNCTIONS,
            bodies=self.n_robots + self.n_prey,
            team_is_prey=False,
            prey_mode=PREY_MODES.get(self.params.prey, 0),
            prey_hidden=len(self._prey_weights()[0]) // self.n_prey,
        )

    def _prey_weights(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Return the weights of the prey's networks, without hidden units if they have none."""
        if PREY_MODES.get(self.params.prey, 0) != 0:
            return np.zeros((0, 8), dtype=np.float32), np.zeros((0, 2), dtype=np.float32)
        found = prey_sets.load(None if self.params.prey == "shaped" else self.params.prey)
        return found.weights(self.n_prey, prey_sets.WEIGHT_SCALE)
