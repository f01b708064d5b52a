"""The walled arena of predators and prey: its parameters, and scenarios drawn at random.

Nitschke 2009, sections 4.1 to 4.3, table 4.1. Shared by ``pursuit.world`` and ``pursuit.prey``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt
from annotated_types import Ge, Gt, Le

from conevo.errors import UsageError
from conevo.kernels.khepera import RADIUS
from conevo.parameters import parameters
from conevo.rng import fold_all, numbers, uniforms
from conevo.worlds.disturbances import Disturbances, disturbed
from conevo.worlds.places import NoRoom, draw_places, sectors
from conevo.worlds.protocol import Scenarios, Simulation, World, kernel_params
from conevo.worlds.pursuit.bodies import (
    N_OBSTACLES,
    SLOTS,
    PursuitConstants,
    PursuitScene,
    PursuitTeam,
)
from conevo.worlds.pursuit.dynamics import fail, stand
from conevo.worlds.spaces import n_signed

__all__ = ["ArenaParams", "ArenaScenarios", "draw_scenarios", "simulate"]

RECORDED = ("x", "y", "heading", "left", "right", "collided", "action", "fitness")


@parameters("world")
class ArenaParams(Disturbances):
    """Parameters of both worlds; lengths in cm, one iteration is 0.1 s.

    Nitschke 2009, table 4.1, unless marked.
    """

    iterations: Annotated[int, Ge(2), Le(1_000_000)] = 1000
    """(0.1 s) length of an epoch (table 4.3)."""
    arena_cm: Annotated[float, Ge(60), Le(5000)] = 100.0
    """(cm) side of the arena. Choice: a tenth of the printed 1000, in which robots of this speed do
    not meet (docs/results/arena.md)."""
    sensor_range_cm: Annotated[float, Gt(0), Le(200)] = 22.0
    """(cm) range of an infrared or light sensor, from its place on the rim."""
    sensor_angle_deg: Annotated[float, Gt(0), Le(89)] = 30.0
    """(degrees) half angle of a sensor's cone. Choice: 30, so that the sensors ahead overlap and a
    gap remains behind the shoulders, as on the real robot."""
    max_speed_cm: Annotated[float, Gt(0), Le(5)] = 0.8
    """(cm per iteration) speed of a predator at full command. Choice: 0.8, the 8 cm/s of Khepera
    simulators. At 5 (0.5 m/s, the robot's own limit) bodies still cannot jump past one another."""
    prey_speed: Annotated[float, Gt(0), Le(1.2)] = 1.2
    """(predators' speed) speed of a prey at full command (section 4.1)."""

    @property
    def prey_speed_cm(self) -> float:
        """Speed of a prey at full command, cm per iteration."""
        return self.max_speed_cm * self.prey_speed

    @property
    def sight_cm(self) -> float:
        """Distance between centres up to which a body may be seen."""
        return self.sensor_range_cm + 2 * float(RADIUS)

    @property
    def touch_cm(self) -> float:
        """Distance up to which two bodies, or their moves, may meet, and a little more."""
        return 2 * (float(RADIUS) + max(self.max_speed_cm, self.prey_speed_cm)) + 0.1

    @property
    def cone(self) -> tuple[float, float]:
        """Cosine and sine of the half angle of a sensor's cone."""
        angle = math.radians(self.sensor_angle_deg)
        return math.cos(angle), math.sin(angle)


@dataclass(frozen=True, kw_only=True)
class ArenaScenarios(Scenarios):
    """E scenarios: places in cm, headings in [-pi, pi). The team's R robots come first.

    x, y, heading [E, B] float32; n_bodies [E] int32, the bodies beyond are absent; obstacle_x,
    obstacle_y [E, 6] float32; n_obstacles [E] int32; prey_in [Q * H, 8], prey_out [Q * H, 2]
    float32, weights of the prey's networks; clamp [R, S] float32, sensor inputs held at a value,
    NaN where free.
    """

    unseen: ClassVar[tuple[str, ...]] = ("seed", "clamp", "prey_in", "prey_out")
    x: npt.NDArray[np.float32]
    y: npt.NDArray[np.float32]
    heading: npt.NDArray[np.float32]
    n_bodies: npt.NDArray[np.int32]
    obstacle_x: npt.NDArray[np.float32]
    obstacle_y: npt.NDArray[np.float32]
    n_obstacles: npt.NDArray[np.int32]
    prey_in: npt.NDArray[np.float32]
    prey_out: npt.NDArray[np.float32]
    clamp: npt.NDArray[np.float32]


def draw_scenarios(
    keys: Sequence[int],
    arena_cm: float,
    robots: int,
    others: tuple[int, int],
    obstacles: tuple[int, int],
    *,
    n_sensors: int,
    by_robot: bool = False,
    prey: tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]] | None = None,
) -> ArenaScenarios:
    """Return one scenario per key: numbers of bodies, places and headings, all at random.

    Args:
        keys: of the scenarios.
        arena_cm: side of the arena.
        robots: R, robots of the team.
        others: smallest and largest number of other bodies.
        obstacles: smallest and largest number of obstacles.
        n_sensors: S.
        by_robot: whether robot i starts in sector i of R around the middle of the arena.
        prey: weights of the prey's networks, [Q * H, 8] and [Q * H, 2].

    Raises:
        UsageError: no room for this number of bodies.
    """
    most = robots + others[1]
    seed = np.array(keys, dtype=np.uint64)
    n_bodies = robots + _between(fold_all(seed, "arena", "bodies"), others)
    n_obstacles = _between(fold_all(seed, "arena", "obstacles"), obstacles)
    is_there = np.concatenate(
        [np.arange(most) < n_bodies[:, None], np.arange(int(N_OBSTACLES)) < n_obstacles[:, None]],
        axis=1,
    )
    in_sectors = robots if by_robot else 0
    places = _places(fold_all(seed, "arena", "places"), arena_cm, is_there, in_sectors)
    turned = uniforms(fold_all(seed, "arena", "headings")[:, None], 0, np.arange(most), 0)
    nobody = np.zeros((0, 8), dtype=np.float32), np.zeros((0, 2), dtype=np.float32)
    prey_in, prey_out = prey or nobody
    return ArenaScenarios(
        x=places[:, :most, 0],
        y=places[:, :most, 1],
        heading=np.float32(2 * math.pi) * turned - np.float32(math.pi),
        n_bodies=n_bodies,
        obstacle_x=places[:, most:, 0],
        obstacle_y=places[:, most:, 1],
        n_obstacles=n_obstacles,
        prey_in=prey_in,
        prey_out=prey_out,
        clamp=np.full((robots, n_sensors), np.nan, dtype=np.float32),
        seed=seed,
    )


def _between(keys: npt.NDArray[np.uint64], bounds: tuple[int, int]) -> npt.NDArray[np.int32]:
    """Return a number from the least to the most, all equally likely, for each key."""
    least, most = bounds
    half = np.uint64(32)  # bits of a number, and the product's other half
    return least + ((numbers(keys, 0, 0, 0) >> half) * np.uint64(most - least + 1) >> half).astype(
        np.int32
    )


def _places(
    keys: npt.NDArray[np.uint64], arena_cm: float, is_there: npt.NDArray[np.bool_], in_sectors: int
) -> npt.NDArray[np.float32]:
    """Draw places [E, bodies and obstacles, 2], a little away from walls and from each other.

    The first ``in_sectors`` are each in a separate sector, and absent bodies at 0.
    """

    def is_free(
        _: npt.NDArray[np.intp], body: npt.NDArray[np.intp], xy: npt.NDArray[np.float32]
    ) -> npt.NDArray[np.bool_]:
        return (body >= in_sectors)[:, None] | (sectors(xy, in_sectors) == body[:, None])

    margin = 0.01  # more than float32 rounding errors in the largest arena
    edge = float(RADIUS) + margin
    side = max(arena_cm - 2 * edge, margin)
    n = is_there.shape[1]
    separation = (2 * float(RADIUS) + margin) / side
    try:
        places = draw_places(keys, n, separation, is_free if in_sectors else None, is_there)
    except NoRoom as error:
        most = is_there.sum(axis=1).max()
        raise UsageError(f"an arena of {arena_cm:g} cm has no room for {most} bodies") from error
    return np.where(is_there[:, :, None], edge + side * places, 0).astype(np.float32)


def simulate(
    world: World, functions: dict[str, Any], *, bodies: int, team_is_prey: bool, **given: Any
) -> Simulation:
    """Return the Warp side of a world of predators and prey.

    Args:
        world: the world.
        functions: its phases.
        bodies: the most in a scenario.
        team_is_prey: whether the robots of the team are prey.
        given: fields of ``bodies.Params`` that its parameters do not have.
    """
    robots = world.n_robots
    given |= {"team_is_prey": team_is_prey, "signed_inputs": n_signed(world)}
    p = kernel_params(PursuitConstants, world.params, world, **given)
    prey = 1 if team_is_prey else bodies - robots
    slots = max(1, -(-p.prey_hidden // int(SLOTS))) * int(SLOTS)
    sizes = {"bodies": bodies, "sensors": 8, "wheels": 2, "prey": prey, "slots": slots}
    sizes["window"] = p.capture_window
    sizes["failing"] = robots if world.params.failure > 0 else 1
    sizes |= world.params.kept(robots, len(world.inputs))
    return Simulation(
        state=PursuitTeam,
        sizes=sizes,
        scene=PursuitScene,
        params_type=PursuitConstants,
        params=p,
        functions=disturbed(
            functions, (PursuitTeam, PursuitScene, PursuitConstants), world.params, fail, stand
        ),
        recorded=RECORDED if team_is_prey else (*RECORDED, "captured"),
    )
