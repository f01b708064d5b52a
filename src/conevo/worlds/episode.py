"""The kernels of an epoch: one builds teams' controllers, one runs a world's iterations."""

from functools import cache
from typing import Any

import warp as wp

from conevo.controllers.protocol import Mind
from conevo.kernels import engine
from conevo.kernels.phases import Phase, barrier, cycles, n_lanes, run_of
from conevo.kernels.views import Near, copy_of, view_of
from conevo.worlds.contract import STAGES, stages_of
from conevo.worlds.protocol import Simulation

__all__ = ["Job", "episode_kernel", "given_to_think", "loading_kernel"]

# Threads of a multiprocessor that has 65,536 registers, 85 for each. Choice: a prototype of the
# rover world was fastest with 8 blocks of 96 lanes (H100).
THREADS = 768


@wp.struct
class Job:
    """The work of a launch: which teams play, in how many scenarios, which iterations.

    first_team: number of the batch's first team among all teams, which determines the rounds.
    """

    heuristic: wp.array2d[int]
    n_worlds: int
    n_teams: int
    n_scenarios: int
    n_scenes: int
    n_robots: int
    first_team: int
    teams_per_round: int
    t_begin: int
    t_end: int
    clock: wp.array[wp.int64]


def episode_kernel(
    simulation: Simulation,
    mind: Mind,
    timed: bool = False,
    near: tuple[Near, Near] = ((), ()),
    lanes: int = 0,
) -> Any:
    """Return the kernel that runs a world's iterations ``t_begin`` to ``t_end``.

    Args:
        simulation: of the world.
        mind: of the controller.
        timed: whether the cycles of each phase are added up in the job's ``clock``.
        near: arrays of the state, and of the memory, that lie in shared memory on a CUDA device.
        lanes: of a block on a CUDA device, which limit the registers of a thread; 0 on the CPU.
    """
    structs = (simulation.state, simulation.scene, simulation.params_type)
    brain = (mind.weights, mind.memory, mind.shape_type, mind.clear, mind.think, mind.shared)
    stages = tuple(stages_of(simulation).values())
    return _episode_kernel(*structs, *brain, stages, timed, *near, lanes)


@cache
def _episode_kernel(
    State: Any,
    Scene: Any,
    Params: Any,
    Weights: Any,
    Memory: Any,
    Shape: Any,
    clear: Any,
    think: Any,
    shared: tuple[Phase, ...],
    stages: tuple[tuple[Phase, ...], ...],
    timed: bool,
    near_state: Near,
    near_memory: Near,
    lanes: int,
) -> Any:
    view_team, view_memory = view_of(State, near=near_state), view_of(Memory, near=near_memory)
    view_far_team, view_far_memory = view_of(State), view_of(Memory)
    copy_team, copy_memory = copy_of(State, near_state), copy_of(Memory, near_memory)
    view_scene, view_weights = view_of(Scene, has_shared=True), view_of(Weights)
    has_near = bool(near_state or near_memory)
    world = {"team": State, "scene": Scene, "p": Params}
    runs, at = [], 1
    for name, phases in zip(STAGES, stages, strict=True):
        runs.append(run_of(f"run_{name}", phases, world, at if timed else None))
        at += len(phases)
    reset, sense, act, commit, settle, resolve, outcome = runs
    is_timed = timed
    is_alone = not isinstance(think, tuple)
    together = think if isinstance(think, tuple) else shared
    is_shared = bool(together)
    think_together = run_of("run_think", together, given_to_think(Weights, Memory, Shape))

    bounds = {"launch_bounds": (lanes, max(1, min(16, THREADS // lanes)))} if lanes else {}

    @wp.kernel(module="unique", module_options=engine.options, grid_stride=False, **bounds)
    def episode(
        batch: State, scenes: Scene, p: Params, brains: Weights, memories: Memory, shape: Shape,
        job: Job, first: int,
    ) -> None:  # fmt: skip
        index, lane = wp.tid()
        b = first + index
        n = b // job.n_scenarios
        place = (job.first_team + n) // job.teams_per_round * job.n_scenarios + b % job.n_scenarios
        team = view_team(batch, b, job.n_worlds)
        scene = view_scene(scenes, place, job.n_scenes)
        weights = view_weights(brains, n, job.n_teams)
        memory = view_memory(memories, b, job.n_worlds)
        robots = job.n_robots
        if job.t_begin == 0:
            for i in range(lane, robots, n_lanes()):
                clear(memory, shape, i)
                for k in range(team.inputs.shape[1]):
                    team.inputs[i, k] = 0.0
                for k in range(team.outputs.shape[1]):
                    team.outputs[i, k] = 0.0
                team.heuristic[i] = job.heuristic[n, i]
            reset(team, scene, p, robots, lane, 0, job.clock)
        if wp.static(has_near):
            if job.t_begin > 0:
                copy_team(view_far_team(batch, b, job.n_worlds), team, lane)
                copy_memory(view_far_memory(memories, b, job.n_worlds), memory, lane)
                barrier()
        for t in range(job.t_begin, job.t_end):
            sense(team, scene, p, robots, lane, t, job.clock)
            since = wp.int64(0)
            if wp.static(is_timed):
                since = cycles()
            if wp.static(is_shared) and (wp.static(not is_alone) or n_lanes() > 1):
                think_together(
                    weights, memory, shape, team.inputs, team.outputs, team.heuristic,
                    robots, lane, t, job.clock,
                )  # fmt: skip
            elif wp.static(is_alone):
                for i in range(lane, robots, n_lanes()):
                    if team.heuristic[i] < 0:
                        think(weights, memory, shape, team.inputs, team.outputs, i)
                barrier()
            if wp.static(is_timed):
                if lane == 0:
                    wp.atomic_add(job.clock, 0, cycles() - since)
            act(team, scene, p, robots, lane, t, job.clock)
            commit(team, scene, p, robots, lane, t, job.clock)
            settle(team, scene, p, robots, lane, t, job.clock)
            resolve(team, scene, p, robots, lane, t, job.clock)
        outcome(team, scene, p, robots, lane, job.t_end, job.clock)
        if wp.static(has_near):
            barrier()
            copy_team(team, view_far_team(batch, b, job.n_worlds), lane)
            copy_memory(memory, view_far_memory(memories, b, job.n_worlds), lane)

    return episode


def given_to_think(Weights: Any, Memory: Any, Shape: Any) -> dict[str, Any]:
    """Return the names and types of the arguments of a controller's phases."""
    values = wp.array2d[float]
    brain = {"weights": Weights, "memory": Memory, "shape": Shape}
    return brain | {"inputs": values, "outputs": values, "heuristic": wp.array[int]}


def loading_kernel(mind: Mind) -> Any:
    """Return the kernel that builds the controllers of teams, a block for each team."""
    return _loading_kernel(mind.weights, mind.shape_type, mind.load, mind.join)


@cache
def _loading_kernel(Weights: Any, Shape: Any, load: Any, join: Any) -> Any:
    view_weights = view_of(Weights)
    joins = join is not None

    @wp.kernel(module="unique", module_options=engine.options, grid_stride=False)
    def loading(
        brains: Weights, shape: Shape, genes: wp.array2d[float], rows: wp.array3d[int],
        n_teams: int, first: int,
    ) -> None:  # fmt: skip
        index, lane = wp.tid()
        n = first + index
        weights = view_weights(brains, n, n_teams)
        for i in range(lane, rows.shape[1], n_lanes()):
            load(weights, shape, i, genes, rows, n)
        if wp.static(joins):
            barrier()
            if lane == 0:
                join(weights, shape, rows.shape[1])

    return loading
