"""The kernel of a world that is controlled from outside: its resets, single steps and outcomes."""

from functools import cache
from typing import Any

import warp as wp

from conevo.kernels import engine
from conevo.kernels.actions import NONE
from conevo.kernels.phases import Phase, barrier, n_lanes, run_of
from conevo.kernels.random import uniform
from conevo.kernels.views import view_of
from conevo.worlds.contract import STAGES, stages_of
from conevo.worlds.protocol import Simulation

__all__ = ["FINISH", "RESET", "STEP", "StepJob", "step_kernel"]

# The tasks of a launch.
STEP = wp.constant(0)
RESET = wp.constant(1)
FINISH = wp.constant(2)
MOST = wp.constant(2**20)  # numbers of a place of ``uniform``


@wp.struct
class StepJob:
    """The arguments that all launches of a stepper share.

    at: [n] the worlds that are reset or finished. given: [n] scenario of each world that is reset,
    -1 for one drawn from the pool. scenario: [n] scenario that each world plays. epochs: [n] how
    often each has been reset. clock: [n] iterations that it has played. seed: of the draws. timed:
    empty, as no phase is timed.
    """

    n_worlds: int
    n_scenarios: int
    n_robots: int
    t_end: int
    seed: wp.uint64
    at: wp.array[wp.bool]
    given: wp.array[int]
    scenario: wp.array[int]
    epochs: wp.array[int]
    clock: wp.array[int]
    timed: wp.array[wp.int64]


@wp.func
def drawn(job: StepJob, b: int) -> int:
    """Return the scenario of world ``b``'s next epoch, from its address alone."""
    epoch = job.epochs[b]
    u = uniform(job.seed, epoch % MOST, epoch // MOST, b)
    return wp.min(int(u * float(job.n_scenarios)), job.n_scenarios - 1)


def step_kernel(simulation: Simulation) -> Any:
    """Return the kernel that resets, steps or finishes worlds, a block for each world.

    A step is the iteration of an epoch from the middle of one to the middle of the next: all robots
    act, and then sense. So a controller outside reads ``inputs`` and writes ``outputs`` in between.
    """
    structs = (simulation.state, simulation.scene, simulation.params_type)
    return _step_kernel(*structs, tuple(stages_of(simulation).values()))


@cache
def _step_kernel(State: Any, Scene: Any, Params: Any, stages: tuple[tuple[Phase, ...], ...]) -> Any:
    view_team, view_scene = view_of(State), view_of(Scene, has_shared=True)
    world = {"team": State, "scene": Scene, "p": Params}
    reset, sense, act, commit, settle, resolve, outcome = (
        run_of(f"run_{name}", phases, world) for name, phases in zip(STAGES, stages, strict=True)
    )

    @wp.kernel(module="unique", module_options=engine.options, grid_stride=False)
    def step(
        batch: State, scenes: Scene, p: Params, job: StepJob, task: int, first: int
    ) -> None:  # fmt: skip
        index, lane = wp.tid()
        b = first + index
        robots = job.n_robots
        t = job.clock[b]
        is_meant = job.at[b]
        place = job.scenario[b]
        if task == STEP:
            is_meant = t < job.t_end
        if task == RESET:
            t = 0
            place = job.given[b]
            if place < 0:
                place = drawn(job, b)
        if is_meant:
            team = view_team(batch, b, job.n_worlds)
            scene = view_scene(scenes, place, job.n_scenarios)
            if task == RESET:
                for i in range(lane, robots, n_lanes()):
                    for k in range(team.inputs.shape[1]):
                        team.inputs[i, k] = 0.0
                    for k in range(team.outputs.shape[1]):
                        team.outputs[i, k] = 0.0
                    team.heuristic[i] = NONE
                reset(team, scene, p, robots, lane, 0, job.timed)
            if task == STEP:
                for i in range(lane, robots, n_lanes()):
                    for k in range(team.outputs.shape[1]):
                        if wp.isnan(team.outputs[i, k]):  # a place that is none ends the process
                            team.outputs[i, k] = 0.0
                barrier()
                act(team, scene, p, robots, lane, t, job.timed)
                commit(team, scene, p, robots, lane, t, job.timed)
                settle(team, scene, p, robots, lane, t, job.timed)
                resolve(team, scene, p, robots, lane, t, job.timed)
                t += 1
            if task == FINISH:
                outcome(team, scene, p, robots, lane, t, job.timed)
            else:
                sense(team, scene, p, robots, lane, t, job.timed)
                if lane == 0:  # all lanes have read these
                    job.clock[b] = t
                    job.scenario[b] = place
                    if task == RESET:
                        job.epochs[b] = job.epochs[b] + 1

    return step
