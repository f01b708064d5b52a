"""A world's phases one by one, robots visited in any order: for checks, not for evolution.

The kernel of ``worlds.rollout`` visits robots in the order of their numbers. This one runs a single
phase of one iteration and visits them in an order that is given for each world, with arrays checked
for their bounds. Between phases everything in the state can be seen and changed.
"""

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import warp as wp

from conevo.kernels import engine
from conevo.kernels.network import OUT, load, think
from conevo.worlds.contract import PHASES
from conevo.worlds.protocol import Scenarios, World
from conevo.worlds.rollout import Job, Rollout

__all__ = ["STEPS", "Stepper"]

# In a rollout each robot senses, thinks and acts before the next does: "act" is all three.
STEPS = ("reset", "act", "commit", "settle", "resolve", "outcome", "sense")
Order = npt.NDArray[np.int32]
Arrays = dict[str, npt.NDArray[Any]]


@cache
def _stepping_kernel(
    State: Any,
    Scene: Any,
    Params: Any,
    reset: Any,
    sense: Any,
    act: Any,
    commit: Any,
    resolve: Any,
    outcome: Any,
    settle: Any,
) -> Any:
    view_team, view_scene = engine.view_of(State), engine.view_of(Scene)
    if settle is None:

        @wp.func
        def settle(team: State, scene: Scene, p: Params, t: int) -> None:
            """Settle nothing."""

    checked = engine.options | {"mode": "debug"}

    @wp.kernel(module="unique", module_options=checked, grid_stride=False)
    def step(
        batch: State, scenes: Scene, p: Params, job: Job, order: wp.array2d[int], phase: int,
        t: int, unused: float,
    ) -> None:  # fmt: skip
        b = wp.tid()
        n = b // job.n_scenarios
        team = view_team(batch, b, job.n_worlds)
        scene = view_scene(scenes, b % job.n_scenarios, job.n_scenarios)
        if phase == 3:
            settle(team, scene, p, t)
        if phase == 5:
            outcome(team, scene, p, t + 1)
        for k in range(order.shape[1]):
            i = order[b, k]
            if i >= 0:
                if phase == 0:
                    reset(team, scene, p, i)
                    load(team.nets, job.shape, i, job.genes, job.slots, n)
                    team.heuristic[i] = job.heuristic[n, i]
                if phase == 1:
                    sense(team, scene, p, i, t)
                    if team.heuristic[i] < 0:
                        think(team.nets, job.shape, i)
                        sums = team.nets.sums[i]
                        for o in range(job.shape.n_outputs, OUT):
                            sums[o] = unused
                        team.nets.sums[i] = sums
                    act(team, scene, p, i, t)
                if phase == 2:
                    commit(team, scene, p, i, t)
                if phase == 4:
                    resolve(team, scene, p, i, t)
                if phase == 6:
                    sense(team, scene, p, i, t)

    return step


class Stepper(Rollout):
    """Runs the teams of one batch phase by phase, each in each scenario: B worlds in all.

    Args:
        world: the world.
        genes: pool of neuron genotypes [K, G].
        teams: pool rows of the neurons [N, R, U].
        scenarios: E scenarios.
        heuristic: [N, R], -1 for the network.
        unused: what the output sums beyond those of the controller are set to; by default what they
            are in a rollout.
    """

    def __init__(
        self,
        world: World,
        genes: npt.NDArray[np.float32],
        teams: npt.NDArray[np.int32],
        scenarios: Scenarios,
        heuristic: npt.NDArray[np.int32],
        unused: float | None = None,
    ) -> None:
        super().__init__(world, n_threads=1)
        sim, functions = self._simulation, self._simulation.functions
        with engine.building:
            self._kernel = _stepping_kernel(
                *(sim.state, sim.scene, sim.params_type),
                *(functions[name] for name in PHASES),
                functions.get("settle"),
            )
        self.n_worlds = len(teams) * len(scenarios)
        self._scenes = self._scene(scenarios)
        self._task = self._job(*self._checked(genes, teams, heuristic), len(scenarios))
        self._state = self._batch(self.n_worlds).state
        self._task.n_worlds = self.n_worlds
        self._unused = self._shape.bias if unused is None else unused
        self.build()

    @property
    def natural(self) -> Order:
        """The order of a rollout, [B, R]."""
        robots = np.arange(self.world.n_robots, dtype=np.int32)
        return np.tile(robots, (self.n_worlds, 1))

    def step(self, name: str, order: Order, t: int = 0) -> None:
        """Run one of ``STEPS``.

        Args:
            name: which.
            order: [B, R] robots in the order in which they are visited, -1 for none.
            t: the iteration.
        """
        arguments = [self._state, self._scenes, self._simulation.params, self._task]
        seen = wp.array(np.ascontiguousarray(order), dtype=int, device="cpu")
        more = [seen, STEPS.index(name), t, self._unused]
        wp.launch(self._kernel, dim=self.n_worlds, inputs=[*arguments, *more], device="cpu")

    def arrays(self) -> Arrays:
        """Return the state, each array [B, its size]: what is written there, the next step sees.

        ``inputs`` and ``sums`` are those of the networks, [B, R, inputs] and [B, R, 8].
        """
        n, r = self.n_worlds, self.world.n_robots
        seen = {name: getattr(self._state, name).numpy().reshape(n, -1) for name in self._sizes}
        nets = self._state.nets
        seen["inputs"] = nets.inputs.numpy().reshape(n, r, -1)
        seen["sums"] = nets.sums.numpy().reshape(n, r, -1)
        return seen

    def epoch(self, iterations: int) -> Iterator[tuple[str, int]]:
        """Yield the steps of an epoch, in turn, with their iterations."""
        yield "reset", 0
        middle = [s for s in STEPS[1:5] if s != "settle" or s in self._simulation.functions]
        for t in range(iterations):
            for name in middle:
                yield name, t
        yield "outcome", iterations - 1
