"""Light: three robots walk toward a light.

=============  ==========================================================
name           ``light-v1``
source         made up, the smallest world there is
environments   ``dark-1`` (the light stands anywhere)
robots         3
epoch          100 iterations
sensors        x and y of the light, seen from the robot
actions        rest; move
controller     6-4-4 simple recurrent network (2 sensors, 4 context units)
performance    ``nearness`` to the light at the end, mean over the team
=============  ==========================================================

The recipe *add a world* of CONTRIBUTING.md puts this file into the package. It also works from
outside: ``python examples/light.py`` evolves a team for it with ask and tell.

Version history:

- v1: first version.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np
import numpy.typing as npt
import warp as wp
from annotated_types import Ge, Gt, Le

from conevo import Layout, Rollout, Scores, method
from conevo.controllers import ControllerSpec
from conevo.kernels.network import Networks, sigmoid
from conevo.kernels.random import uniform
from conevo.rng import fold, stream
from conevo.worlds.protocol import Simulation

__all__ = ["LightParams", "LightScenarios", "LightWorld"]


@dataclass(frozen=True)
class LightParams:
    """Parameters of the world; lengths in sides of the square."""

    n_robots: Annotated[int, Ge(2), Le(64)] = 3
    iterations: Annotated[int, Ge(2)] = 100
    step: Annotated[float, Gt(0), Le(0.1)] = 0.02
    n_hidden: Annotated[int, Ge(2), Le(16)] = 4
    max_hidden: Annotated[int, Ge(2), Le(32)] = 8

    def __post_init__(self) -> None:
        """Refuse a controller that begins with more neurons than it has room for."""
        if self.max_hidden < self.n_hidden:
            raise ValueError(
                f"max_hidden ({self.max_hidden}) must not be below n_hidden ({self.n_hidden})"
            )


# --- state ----------------------------------------------------------------------------------------


@wp.struct
class Params:
    """``LightParams`` for the kernels."""

    n_robots: int
    step: float


@wp.struct
class Scene:
    """A scenario, flat over the scenarios of a batch."""

    start_x: wp.array[float]
    start_y: wp.array[float]
    light: wp.array[float]  # x, y
    seed: wp.array[wp.uint64]


@wp.struct
class Team:
    """State of a team of R robots, flat over a batch."""

    nets: Networks
    x: wp.array[float]
    y: wp.array[float]
    action: wp.array[int]  # executed in the previous iteration, -1 before the first
    chosen: wp.array[int]
    heuristic: wp.array[int]
    fitness: wp.array[float]
    counts: wp.array[int]  # [R, A]
    switches: wp.array[int]
    performance: wp.array[float]


# --- one iteration --------------------------------------------------------------------------------


@wp.func
def reset(team: Team, scene: Scene, p: Params, i: int) -> None:
    """Put robot ``i`` at its start."""
    team.x[i] = scene.start_x[i]
    team.y[i] = scene.start_y[i]
    team.action[i] = -1
    team.fitness[i] = 0.0
    team.switches[i] = 0
    team.counts[2 * i] = 0
    team.counts[2 * i + 1] = 0


@wp.func
def sense(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Fill robot ``i``'s sensor inputs."""
    first = i * (team.nets.inputs.shape[0] // p.n_robots)
    team.nets.inputs[first] = scene.light[0] - team.x[i]
    team.nets.inputs[first + 1] = scene.light[1] - team.y[i]


@wp.func
def act(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Choose robot ``i``'s action; heuristic 0 rests half of the time."""
    if team.heuristic[i] == 0:
        team.chosen[i] = int(uniform(scene.seed[0], t, 0, i) * 2.0)
    else:
        sums = team.nets.sums[i]
        team.chosen[i] = wp.where(sums[1] > sums[0], 1, 0)


@wp.func
def commit(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Make robot ``i``'s action its state, and count it."""
    a = team.chosen[i]
    if a == 1:
        sums = team.nets.sums[i]
        team.x[i] = wp.clamp(team.x[i] + p.step * (sigmoid(sums[2]) - 0.5), 0.0, 1.0)
        team.y[i] = wp.clamp(team.y[i] + p.step * (sigmoid(sums[3]) - 0.5), 0.0, 1.0)
    if team.action[i] >= 0 and team.action[i] != a:
        team.switches[i] = team.switches[i] + 1
    team.action[i] = a
    team.counts[2 * i + a] = team.counts[2 * i + a] + 1


@wp.func
def resolve(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:
    """Score robot ``i``: one minus its distance from the light."""
    dx = scene.light[0] - team.x[i]
    dy = scene.light[1] - team.y[i]
    team.fitness[i] = 1.0 - wp.sqrt(dx * dx + dy * dy)


@wp.func
def outcome(team: Team, scene: Scene, p: Params, t_end: int) -> None:
    """Write the team's task performance."""
    total = float(0.0)  # noqa: UP018 (declares a variable for Warp)
    for i in range(p.n_robots):
        total = total + team.fitness[i]
    team.performance[0] = total / float(p.n_robots)


FUNCTIONS = {
    "reset": reset,
    "sense": sense,
    "act": act,
    "commit": commit,
    "resolve": resolve,
    "outcome": outcome,
}


# --- the world ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LightScenarios:
    """E scenarios: start_x, start_y [E, R] and light [E, 2] float32; seed [E] uint64."""

    start_x: npt.NDArray[np.float32]
    start_y: npt.NDArray[np.float32]
    light: npt.NDArray[np.float32]
    seed: npt.NDArray[np.uint64]

    def __len__(self) -> int:
        """Return the number of scenarios."""
        return len(self.seed)


@dataclass(frozen=True)
class LightWorld:
    """One environment of the light task."""

    environment: str
    params: LightParams = field(default_factory=LightParams)

    name: ClassVar[str] = "light-v1"
    actions: ClassVar[tuple[str, ...]] = ("rest", "move")
    performance: ClassVar[tuple[str, ...]] = ("nearness",)
    heuristics: ClassVar[tuple[str, ...]] = ("idler",)

    @property
    def n_robots(self) -> int:
        """Number of robots."""
        return self.params.n_robots

    @property
    def iterations(self) -> int:
        """Iterations of one epoch."""
        return self.params.iterations

    @property
    def controller(self) -> ControllerSpec:
        """Two sensors; rest, move, dx, dy."""
        p = self.params
        return ControllerSpec(
            n_sensors=2, n_hidden=p.n_hidden, n_outputs=4, max_hidden=p.max_hidden
        )

    def scenarios(self, keys: Sequence[int]) -> LightScenarios:
        """Return one scenario per key."""
        drawn = [stream(key, "light-v1").random((self.n_robots + 1, 2)) for key in keys]
        places = np.array(drawn, dtype=np.float32)
        return LightScenarios(
            start_x=np.ascontiguousarray(places[:, :-1, 0]),
            start_y=np.ascontiguousarray(places[:, :-1, 1]),
            light=np.ascontiguousarray(places[:, -1]),
            seed=np.array(keys, dtype=np.uint64),
        )

    def simulation(self) -> Simulation:
        """Return the Warp side of this world."""
        params = Params()
        params.n_robots = self.params.n_robots
        params.step = self.params.step
        r = self.n_robots
        names = ("x", "y", "action", "chosen", "heuristic", "fitness", "switches")
        return Simulation(
            state=Team,
            sizes=dict.fromkeys(names, r) | {"counts": 2 * r, "performance": 1},
            scene=Scene,
            params_type=Params,
            params=params,
            functions=FUNCTIONS,
            recorded=("x", "y", "action", "fitness"),
        )


# --- evolution by hand ----------------------------------------------------------------------------


def main() -> None:
    """Evolve a team for 40 generations with HomCNE and print how it comes along."""
    light = LightWorld("dark-1")
    rollout = Rollout(light)
    spec = light.controller
    chosen = method("homcne", genotypes=60, elite_portion=0.25, n_elitist=1)
    layout = Layout(light.n_robots, spec.n_hidden, spec.max_hidden, spec.n_genes)
    state = chosen.init(layout, root=1)
    while state.generation < 40:
        trials = chosen.ask(state)
        scenarios = light.scenarios([fold(1, "epoch", state.generation, e) for e in range(5)])
        outcome = rollout.evaluate(trials.genes, trials.teams, scenarios)
        if trials.phase == "fittest" and state.generation % 13 == 0:
            nearness = outcome.performance["nearness"].mean()
            print(f"generation {state.generation}: nearness {nearness:.3f}")
        fitness = outcome.fitness.mean(axis=1, dtype=np.float64)
        state = chosen.tell(state, trials, Scores(fitness, np.zeros_like(fitness)))


if __name__ == "__main__":
    main()
