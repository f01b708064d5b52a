"""A world's phases one by one, robots visited in any order: for checks, not for evolution.

The kernel of ``worlds.rollout`` visits robots in the order of their numbers. This one runs a single
phase of one iteration and visits them in an order given for each world, with bounds of arrays
checked. Between phases the whole state can be read and changed.
"""

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import warp as wp

from conevo.kernels import engine
from conevo.kernels.phases import Phase, walk_of
from conevo.kernels.views import view_of
from conevo.worlds.contract import STAGES, stages_of
from conevo.worlds.episode import Job, given_to_think
from conevo.worlds.protocol import Scenarios, World
from conevo.worlds.rollout import Rollout

__all__ = ["STEPS", "Walk"]

STEPS = ("reset", "sense", "think", "act", "commit", "settle", "resolve", "outcome")
Order = npt.NDArray[np.int32]
Arrays = dict[str, npt.NDArray[Any]]


@cache
def _walking_kernel(
    State: Any,
    Scene: Any,
    Params: Any,
    Weights: Any,
    Memory: Any,
    Shape: Any,
    clear: Any,
    think: Any,
    stages: tuple[tuple[Phase, ...], ...],
) -> Any:
    view_team, view_scene = view_of(State), view_of(Scene, has_shared=True)
    view_weights, view_memory = view_of(Weights), view_of(Memory)
    world = {"team": State, "scene": Scene, "p": Params}
    reset, sense, act, commit, settle, resolve, outcome = (
        walk_of(f"walk_{name}", phases, world) for name, phases in zip(STAGES, stages, strict=True)
    )
    is_alone = not isinstance(think, tuple)
    together = think if isinstance(think, tuple) else ()
    think_together = walk_of("walk_think", together, given_to_think(Weights, Memory, Shape))
    checked = engine.options | {"mode": "debug"}

    @wp.kernel(module="unique", module_options=checked, grid_stride=False)
    def step(
        batch: State, scenes: Scene, p: Params, brains: Weights, memories: Memory, shape: Shape,
        job: Job, order: wp.array2d[int], phase: int, t: int,
    ) -> None:  # fmt: skip
        b = wp.tid()
        n = b // job.n_scenarios
        team = view_team(batch, b, job.n_worlds)
        scene = view_scene(scenes, b % job.n_scenarios, job.n_scenarios)
        weights = view_weights(brains, n, job.n_teams)
        memory = view_memory(memories, b, job.n_worlds)
        for k in range(order.shape[1]):
            i = order[b, k]
            if i >= 0:
                if phase == 0:
                    clear(memory, shape, i)
                    for j in range(team.inputs.shape[1]):
                        team.inputs[i, j] = 0.0
                    for j in range(team.outputs.shape[1]):
                        team.outputs[i, j] = 0.0
                    team.heuristic[i] = job.heuristic[n, i]
                if wp.static(is_alone):
                    if phase == 2 and team.heuristic[i] < 0:
                        think(weights, memory, shape, team.inputs, team.outputs, i)
        if phase == 0:
            reset(team, scene, p, order, b, 0)
        if phase == 1:
            sense(team, scene, p, order, b, t)
        if phase == 2:
            think_together(
                weights, memory, shape, team.inputs, team.outputs, team.heuristic, order, b, t
            )
        if phase == 3:
            act(team, scene, p, order, b, t)
        if phase == 4:
            commit(team, scene, p, order, b, t)
        if phase == 5:
            settle(team, scene, p, order, b, t)
        if phase == 6:
            resolve(team, scene, p, order, b, t)
        if phase == 7:
            outcome(team, scene, p, order, b, t + 1)

    return step


class Walk(Rollout):
    """Runs the teams of one batch phase by phase, each in each scenario: B worlds in all.

    Args:
        world: the world.
        genes: pool of neuron genotypes [K, G].
        teams: pool rows of the neurons [N, R, U].
        scenarios: E scenarios.
        heuristic: [N, R], -1 for the network.
    """

    def __init__(
        self,
        world: World,
        genes: npt.NDArray[np.float32],
        teams: npt.NDArray[np.int32],
        scenarios: Scenarios,
        heuristic: npt.NDArray[np.int32],
    ) -> None:
        super().__init__(world, n_threads=1)
        sim, mind = self._simulation, self._mind
        with engine.building:
            self._kernel = _walking_kernel(
                *(sim.state, sim.scene, sim.params_type),
                *(mind.weights, mind.memory, mind.shape_type, mind.clear, mind.think),
                tuple(stages_of(sim).values()),
            )
        self.n_worlds = len(teams) * len(scenarios)
        self._scenes = self._scene(scenarios)
        genes, teams, heuristic = self._checked(genes, teams, heuristic)
        self._task = self._job(len(scenarios), len(scenarios), len(teams))
        self._task.heuristic = self._array(heuristic)
        self._task.n_worlds, self._task.n_teams = self.n_worlds, len(teams)
        self._epochs = self._batch(self.n_worlds, len(teams))
        self._load(self._epochs, self._array(genes), teams)

    @property
    def natural(self) -> Order:
        """The order of a rollout, [B, R]."""
        robots = np.arange(self.world.n_robots, dtype=np.int32)
        return np.tile(robots, (self.n_worlds, 1))

    def step(self, name: str, order: Order, t: int = 0) -> None:
        """Run one of ``STEPS``.

        Args:
            name: of the step.
            order: [B, R] robots in the order in which they are visited, -1 for none.
            t: the iteration.
        """
        batch, mind = self._epochs, self._mind
        arguments = [batch.state, self._scenes, self._simulation.params]
        arguments += [batch.weights, batch.memory, mind.shape, self._task]
        seen = wp.array(np.ascontiguousarray(order), dtype=int, device="cpu")
        more = [seen, STEPS.index(name), t]
        wp.launch(self._kernel, dim=self.n_worlds, inputs=[*arguments, *more], device="cpu")

    def arrays(self) -> Arrays:
        """Return the state, each array [B, its dimensions].

        The next step reads the values written there.
        """
        n, state = self.n_worlds, self._epochs.state
        shape_of = self._shapes.items()
        return {name: getattr(state, name).numpy().reshape(n, *shape) for name, shape in shape_of}

    def epoch(self, iterations: int) -> Iterator[tuple[str, int]]:
        """Yield the steps of an epoch, in turn, with their iterations."""
        yield "reset", 0
        middle = [s for s in STEPS[1:7] if s != "settle" or s in self._simulation.functions]
        for t in range(iterations):
            for name in middle:
                yield name, t
        yield "outcome", iterations - 1
