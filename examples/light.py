"""Light: three robots walk toward a light.

=============  ==========================================================
name           ``light-v1``
source         made up, the smallest possible world
environments   ``dark-1`` (the light stands anywhere)
robots         3
epoch          100 iterations
sensors        x and y of the light, seen from the robot
actions        rest; move
controller     6-4-4 simple recurrent network (2 sensors, 4 context units)
performance    ``nearness`` to the light at the end, mean over the team
=============  ==========================================================

Version history: v1, the first version.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt
import warp as wp
from annotated_types import Ge, Gt, Le

from conevo.kernels.actions import begin_counting, count_action, heuristic_action
from conevo.kernels.outputs import highest
from conevo.kernels.random import uniform
from conevo.kernels.steps import steered_step
from conevo.parameters import parameters
from conevo.playback.drawn import Area, Drawn
from conevo.rng import stream
from conevo.worlds.protocol import Scenarios, Simulation, kernel_params
from conevo.worlds.registry import WorldEntry


@parameters("world")
class LightParams:
    """Parameters of the world; lengths in sides of the square."""

    n_robots: Annotated[int, Ge(2), Le(64)] = 3
    """(robots) robots in a team."""
    iterations: Annotated[int, Ge(2)] = 100
    """(iterations) length of an epoch."""
    step: Annotated[float, Gt(0), Le(0.1)] = 0.01
    """(side) the largest step."""


@wp.struct
class Params:
    """The fields of ``LightParams`` that the kernels need, under the same names."""

    step: float


@wp.struct
class Scene:
    """A scenario: places (x, y) of the R robots and of the light, and the seed of the rest."""

    places: wp.array[float]
    seed: wp.array[wp.uint64]


@wp.struct
class Team:
    """State of a team: R elements each, counts and performance as the world's names say.

    inputs [R, 2], outputs [R, 4]: what a robot's controller reads and writes.
    """

    inputs: wp.array2d[float]
    outputs: wp.array2d[float]
    x: wp.array[float]
    y: wp.array[float]
    chosen: wp.array[int]
    action: wp.array[int]  # executed in the previous iteration, -1 before the first
    heuristic: wp.array[int]
    fitness: wp.array[float]
    counts: wp.array[int]
    switches: wp.array[int]
    performance: wp.array[float]


@wp.func
def light(team: Team, scene: Scene, i: int) -> wp.vec2f:
    """Return the vector from robot ``i`` to the light."""
    last = scene.places.shape[0] - 1
    return wp.vec2f(scene.places[last - 1] - team.x[i], scene.places[last] - team.y[i])


@wp.func
def reset(team: Team, scene: Scene, p: Params, i: int) -> None:
    """Put robot ``i`` at its start."""
    team.x[i] = scene.places[2 * i]
    team.y[i] = scene.places[2 * i + 1]
    begin_counting(team.action, team.switches, team.counts, i)


@wp.func
def sense(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Fill robot ``i``'s sensor inputs."""
    way = light(team, scene, i)
    team.inputs[i, 0] = way[0]
    team.inputs[i, 1] = way[1]


@wp.func
def act(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Choose robot ``i``'s action; the heuristic idler mostly rests."""
    if team.heuristic[i] == 0:
        team.chosen[i] = heuristic_action(uniform(scene.seed[0], t, 0, i), 0, 1, 2)
    else:
        team.chosen[i] = highest(team.outputs, i, 2)


@wp.func
def commit(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Execute robot ``i``'s action, and count it."""
    a = team.chosen[i]
    if a == 1:
        step = steered_step(team.outputs[i, 2], team.outputs[i, 3], p.step)
        team.x[i] = wp.clamp(team.x[i] + step[0], 0.0, 1.0)
        team.y[i] = wp.clamp(team.y[i] + step[1], 0.0, 1.0)
    count_action(team.action, team.switches, team.counts, i, a, a)


@wp.func
def resolve(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Score robot ``i``: one minus its distance from the light."""
    team.fitness[i] = 1.0 - wp.length(light(team, scene, i))


@wp.func
def outcome(team: Team, scene: Scene, p: Params, t_end: int) -> None:
    """Write the team's task performance."""
    team.performance[0] = 0.0
    n = team.fitness.shape[0]
    for i in range(n):
        team.performance[0] = team.performance[0] + team.fitness[i] / float(n)


@dataclass(frozen=True, kw_only=True)
class LightScenarios(Scenarios):
    """E scenarios: places [E, R + 1, 2] float32, the light's last."""

    places: npt.NDArray[np.float32]


@dataclass(frozen=True)
class LightWorld:
    """One environment of the light task."""

    environment: str
    params: LightParams

    name: ClassVar[str] = "light-v1"
    inputs: ClassVar[tuple[str, ...]] = ("light x", "light y")
    outputs: ClassVar[tuple[str, ...]] = ("rest", "move", "dx", "dy")
    controller: ClassVar[dict[str, Any]] = {"n_hidden": 4, "max_hidden": 8}
    actions: ClassVar[tuple[str, ...]] = ("rest", "move")
    castes: ClassVar[tuple[str, ...]] = actions
    performance: ClassVar[tuple[str, ...]] = ("nearness",)
    heuristics: ClassVar[tuple[str, ...]] = ("idler",)
    drawn: ClassVar[Drawn] = Drawn(areas=(Area("light", "places[-1, 0]", "places[-1, 1]", 0.02),))

    @property
    def n_robots(self) -> int:
        """Number of robots."""
        return self.params.n_robots

    def scenarios(self, keys: Sequence[int]) -> LightScenarios:
        """Return one scenario per key."""
        shape = (self.n_robots + 1, 2)
        places = np.array([stream(key, self.name).random(shape, np.float32) for key in keys])
        return LightScenarios(places=places, seed=np.array(keys, np.uint64))

    def simulation(self) -> Simulation:
        """Return the Warp side of this world."""
        return Simulation(
            state=Team,
            scene=Scene,
            params_type=Params,
            params=kernel_params(Params, self.params),
            functions={f.key: f for f in (reset, sense, act, commit, resolve, outcome)},
            recorded=("x", "y", "action", "fitness"),
        )


ENTRY = WorldEntry(
    name="light-v1",
    title="Light",
    summary="3 robots walk toward a light",
    source="made up",
    environments=("dark-1",),
    params_name="LightParams",
    world_name="LightWorld",
)
