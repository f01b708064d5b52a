"""Ball: four robots push a ball to a goal. One robot alone cannot move it.

=============  =================================================================
name           ``ball-v1``
source         made up, the smallest world with shared state
environments   ``near-1`` (the goal is near the ball), ``far-1``
robots         4
epoch          200 iterations
sensors        x and y of the ball, then of the goal, seen from the robot
actions        rest; push
controller     8-4-4 simple recurrent network (4 sensors, 4 context units)
performance    ``gain``: how much closer to the goal the ball is at the end
=============  =================================================================

A robot that pushes makes a step, and pushes the ball by it if the ball is within reach. The ball
moves by the mean of all pushes if two robots or more push it.

``settle`` moves the ball: once for the team, after all robots have moved and before they are
scored. No robot could do that in a phase of its own, since others read where the ball is.

Version history:

- v1: first version.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt
import warp as wp
from annotated_types import Ge, Gt, Le

from conevo.kernels.actions import begin_counting, count_action, heuristic_action
from conevo.kernels.arrays import named_arrays
from conevo.kernels.outputs import highest
from conevo.kernels.random import uniform
from conevo.kernels.steps import steered_step
from conevo.parameters import parameters
from conevo.playback.drawn import Area, Drawn, Objects, Signal
from conevo.rng import stream
from conevo.worlds.protocol import Scenarios, Simulation, kernel_params
from conevo.worlds.registry import WorldEntry


@parameters("world")
class BallParams:
    """Parameters of the world; lengths in sides of the square."""

    n_robots: Annotated[int, Ge(2), Le(64)] = 4
    """(robots) robots in a team."""
    iterations: Annotated[int, Ge(2), Le(100_000)] = 200
    """(iterations) length of an epoch."""
    step: Annotated[float, Gt(0), Le(0.1)] = 0.01
    """(side) the largest step."""
    reach: Annotated[float, Gt(0), Le(0.5)] = 0.1
    """(side) how near the ball a robot must be to push it."""


@wp.struct
class Params:
    """The fields of ``BallParams`` that the kernels need, under the same names."""

    step: float
    reach: float


@wp.struct
class Scene:
    """A scenario: places (x, y) of R robots, ball and goal, and the seed of the rest."""

    places: wp.array[float]
    seed: wp.array[wp.uint64]


@named_arrays
class Team:
    """State of a team; the ball has one x and one y."""

    inputs: wp.array2d[float]
    outputs: wp.array2d[float]
    x: wp.array[float]
    y: wp.array[float]
    push_x: wp.array[float]  # the push on the ball, 0 without one
    push_y: wp.array[float]
    pushes: wp.array[int]
    ball: Annotated[wp.array[float], "xy"]
    chosen: wp.array[int]
    action: wp.array[int]
    heuristic: wp.array[int]
    fitness: wp.array[float]
    counts: wp.array[int]
    switches: wp.array[int]
    performance: wp.array[float]


@wp.func
def to_ball(team: Team, i: int) -> wp.vec2f:
    """Return the path from robot ``i`` to the ball."""
    return wp.vec2f(team.ball[0] - team.x[i], team.ball[1] - team.y[i])


@wp.func
def from_goal(scene: Scene, x: float, y: float) -> float:
    """Return the distance of a place from the goal."""
    last = scene.places.shape[0] - 1
    return wp.length(wp.vec2f(x - scene.places[last - 1], y - scene.places[last]))


@wp.func
def reset(team: Team, scene: Scene, p: Params, i: int) -> None:
    """Put robot ``i`` at its start; robot 0 also places the ball, which no robot reads yet."""
    team.x[i] = scene.places[2 * i]
    team.y[i] = scene.places[2 * i + 1]
    if i == 0:
        first = scene.places.shape[0] - 4
        team.ball[0] = scene.places[first]
        team.ball[1] = scene.places[first + 1]
    team.fitness[i] = 0.0
    begin_counting(team.action, team.switches, team.counts, i)


@wp.func
def sense(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Fill robot ``i``'s sensor inputs."""
    ball = to_ball(team, i)
    last = scene.places.shape[0] - 1
    team.inputs[i, 0] = ball[0]
    team.inputs[i, 1] = ball[1]
    team.inputs[i, 2] = scene.places[last - 1] - team.x[i]
    team.inputs[i, 3] = scene.places[last] - team.y[i]


@wp.func
def act(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Choose robot ``i``'s action; the heuristic pusher mostly pushes."""
    if team.heuristic[i] == 0:
        team.chosen[i] = heuristic_action(uniform(scene.seed[0], t, 0, i), 1, 0, 2)
    else:
        team.chosen[i] = highest(team.outputs, i, 2)


@wp.func
def commit(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Move robot ``i``, store its push on the ball, and count its action."""
    a = team.chosen[i]
    team.pushes[i] = 0
    if a == 1:
        step = steered_step(team.outputs[i, 2], team.outputs[i, 3], p.step)
        if wp.length(to_ball(team, i)) <= p.reach:
            team.pushes[i] = 1
            team.push_x[i] = step[0]
            team.push_y[i] = step[1]
        team.x[i] = wp.clamp(team.x[i] + step[0], 0.0, 1.0)
        team.y[i] = wp.clamp(team.y[i] + step[1], 0.0, 1.0)
    count_action(team.action, team.switches, team.counts, i, a, a)


@wp.func
def settle(team: Team, scene: Scene, p: Params, t: int) -> None:
    """Move the ball by the mean of all pushes, if there are two or more."""
    n = int(0)
    push = wp.vec2f(0.0, 0.0)
    for i in range(team.x.shape[0]):
        if team.pushes[i] == 1:
            n += 1
            push += wp.vec2f(team.push_x[i], team.push_y[i])
    if n >= 2:
        team.ball[0] = wp.clamp(team.ball[0] + push[0] / float(n), 0.0, 1.0)
        team.ball[1] = wp.clamp(team.ball[1] + push[1] / float(n), 0.0, 1.0)


@wp.func
def resolve(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Score robot ``i``: how close the ball is to the goal, and a little for touching it."""
    far = from_goal(scene, team.ball[0], team.ball[1])
    near = wp.max(0.0, 1.0 - wp.length(to_ball(team, i)))
    team.fitness[i] = 1.0 - far + 0.1 * near


@wp.func
def outcome(team: Team, scene: Scene, p: Params, t_end: int) -> None:
    """Write how much closer to the goal the ball is than it was."""
    first = scene.places.shape[0] - 4
    before = from_goal(scene, scene.places[first], scene.places[first + 1])
    team.performance[0] = before - from_goal(scene, team.ball[0], team.ball[1])


@dataclass(frozen=True, kw_only=True)
class BallScenarios(Scenarios):
    """E scenarios: places [E, R + 2, 2] float32 of the robots, the ball and the goal."""

    places: npt.NDArray[np.float32]


@dataclass(frozen=True)
class BallWorld:
    """One environment of the ball task."""

    environment: str
    params: BallParams

    name: ClassVar[str] = "ball-v1"
    inputs: ClassVar[tuple[str, ...]] = ("ball x", "ball y", "goal x", "goal y")
    outputs: ClassVar[tuple[str, ...]] = ("rest", "push", "dx", "dy")
    controller: ClassVar[dict[str, Any]] = {"n_hidden": 4, "max_hidden": 8}
    actions: ClassVar[tuple[str, ...]] = ("rest", "push")
    castes: ClassVar[tuple[str, ...]] = actions
    performance: ClassVar[tuple[str, ...]] = ("gain",)
    heuristics: ClassVar[tuple[str, ...]] = ("pusher",)
    drawn: ClassVar[Drawn] = Drawn(
        objects=(Objects("ball", "ball[0]", "ball[1]", size=0.02),),
        areas=(Area("goal", "places[-1, 0]", "places[-1, 1]", radius=0.03),),
        signals=(Signal("begins to push", "action"),),
        colours={"rest": "#9a9aa5", "push": "#d55e00"},
    )

    @property
    def n_robots(self) -> int:
        """Number of robots."""
        return self.params.n_robots

    def scenarios(self, keys: Sequence[int]) -> BallScenarios:
        """Return one scenario per key."""
        places = np.array([self._draw(key) for key in keys])
        return BallScenarios(places=places, seed=np.array(keys, np.uint64))

    def _draw(self, key: int) -> npt.NDArray[np.float32]:
        """Draw the robots around the ball, and the goal at the distance of the environment."""
        rng = stream(key, self.name)
        ball = rng.uniform(0.3, 0.7, 2)
        robots = ball + rng.uniform(-0.15, 0.15, (self.n_robots, 2))
        turn, far = rng.uniform(0, 2 * np.pi), 0.1 if self.environment == "near-1" else 0.25
        goal = ball + far * np.array([np.cos(turn), np.sin(turn)])
        return np.concatenate([robots, [ball, goal]]).astype(np.float32)

    def simulation(self) -> Simulation:
        """Return the Warp side of this world."""
        phases = (reset, sense, act, commit, settle, resolve, outcome)
        return Simulation(
            state=Team,
            sizes={"xy": 2},
            scene=Scene,
            params_type=Params,
            params=kernel_params(Params, self.params),
            functions={f.key: f for f in phases},
            recorded=("x", "y", "ball", "action", "fitness"),
        )


ENTRY = WorldEntry(
    name="ball-v1",
    title="Ball",
    summary="4 robots push a ball to a goal",
    source="made up",
    environments=("near-1", "far-1"),
    params_name="BallParams",
    world_name="BallWorld",
)
