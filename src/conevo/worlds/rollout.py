"""The single episode loop: ``evaluate`` runs batches of teams, ``record`` watches one of them.

Teams are rows of a genotype pool: a kernel builds each team's controllers itself, once for all its
scenarios, so a generation of ten thousand teams needs no unpacked weights. Batches larger than the
workspace run in parts.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import warp as wp

from conevo.controllers.protocol import Controller, Mind
from conevo.controllers.registry import controller as make_controller
from conevo.controllers.registry import genome_of, refuse_misfit
from conevo.errors import EnvironmentFailure, UsageError
from conevo.kernels import engine
from conevo.kernels.arrays import allocate, dimensions, shapes
from conevo.kernels.devices import refuse_unknown_device
from conevo.kernels.phases import Phase, barrier, cycles, n_lanes, run_of
from conevo.worlds.contract import STAGES, refuse_faults, scenario_faults, shapes_of, stages_of
from conevo.worlds.measures import measures_of
from conevo.worlds.protocol import Outcome, Scenarios, Simulation, World

__all__ = ["Rollout", "check_device", "episode_kernel", "loading_kernel"]

# Worlds simulated at once: bounds memory, keeps all threads or blocks busy.
CHUNK = 512
CUDA_CHUNK = 8192


@wp.struct
class Job:
    """What a launch is to do: which teams play, in how many scenarios, which iterations.

    first_team: number of the batch's first team among all, which tells the round that a team is of.
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


def episode_kernel(simulation: Simulation, mind: Mind, timed: bool = False) -> Any:
    """Return the kernel that runs a world's iterations ``t_begin`` to ``t_end``.

    Args:
        simulation: of the world.
        mind: of the controller.
        timed: whether the cycles of each phase are added up in the job's ``clock``.
    """
    structs = (simulation.state, simulation.scene, simulation.params_type)
    brain = (mind.weights, mind.memory, mind.shape_type, mind.clear, mind.think, mind.shared)
    return _episode_kernel(*structs, *brain, tuple(stages_of(simulation).values()), timed)


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
) -> Any:
    view_team, view_scene = engine.view_of(State), engine.view_of(Scene, has_shared=True)
    view_weights, view_memory = engine.view_of(Weights), engine.view_of(Memory)
    world = {"team": State, "scene": Scene, "p": Params}
    runs, at = [], 1
    for name, phases in zip(STAGES, stages, strict=True):
        runs.append(run_of(f"run_{name}", phases, world, at if timed else None))
        at += len(phases)
    reset, sense, act, commit, settle, resolve, outcome = runs
    is_timed = timed
    is_shared = bool(shared)
    values, flags = wp.array2d[float], wp.array[int]
    brain = {"weights": Weights, "memory": Memory, "shape": Shape}
    brain |= {"inputs": values, "outputs": values, "heuristic": flags}
    think_together = run_of("run_think", shared, brain)

    @wp.kernel(module="unique", module_options=engine.options, grid_stride=False)
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
        for t in range(job.t_begin, job.t_end):
            sense(team, scene, p, robots, lane, t, job.clock)
            since = wp.int64(0)
            if wp.static(is_timed):
                since = cycles()
            if wp.static(is_shared) and n_lanes() > 1:
                think_together(
                    weights, memory, shape, team.inputs, team.outputs, team.heuristic,
                    robots, lane, t, job.clock,
                )  # fmt: skip
            else:
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

    return episode


@cache
def loading_kernel(Weights: Any, Shape: Any, load: Any, join: Any) -> Any:
    """Return the kernel that builds the controllers of teams, a block for each team."""
    view_weights = engine.view_of(Weights)
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


def check_device(device: str) -> None:
    """Refuse a device that this machine does not have.

    Raises:
        UsageError: it is not the name of a device.
        EnvironmentFailure: there is none of this name here.
    """
    refuse_unknown_device(device)
    engine.start()
    allowed = ["cpu", *(d.alias for d in wp.get_cuda_devices())]
    if device not in (*allowed, *(["cuda"] if len(allowed) > 1 else [])):
        why = "no CUDA device on this machine; " if len(allowed) == 1 else ""
        raise EnvironmentFailure(f"device {device!r}: {why}allowed here: {', '.join(allowed)}")


@dataclass
class _Workspace:
    """Arrays of a batch, used again and again.

    At most ``n_worlds`` worlds with a state and a memory each, and ``n_teams`` teams' weights.
    """

    n_worlds: int
    n_teams: int
    state: Any
    memory: Any
    weights: Any


class Rollout:
    """Runs teams in one world.

    Args:
        world: the world and environment to run.
        controller: of the robots; by default the one that the world suggests.
        n_threads: CPU threads; all usable ones by default. Results do not depend on it.
        device: "cpu" or a CUDA device as Warp names it.
        lanes: lanes of a CPU block (for tests of the CUDA form; needs Warp's CPU blocks).
        timed: whether ``cycles`` tells what each phase takes, for benchmarks.

    Raises:
        UsageError: the world lacks what the engine needs of it, the controller does not fit it, or
            no device is named so.
        EnvironmentFailure: the device does not exist.
    """

    def __init__(
        self,
        world: World,
        controller: Controller | None = None,
        n_threads: int | None = None,
        device: str = "cpu",
        lanes: int = 1,
        timed: bool = False,
    ) -> None:
        engine.start()
        self.world = world
        self.controller = controller or make_controller(world=world)
        self.device = device
        self.n_threads = n_threads or engine.usable_threads()
        self.lanes = 32 if device != "cpu" else lanes
        self._chunk = CHUNK if device == "cpu" else CUDA_CHUNK
        check_device(device)
        with engine.building:
            self._simulation = world.simulation()
            refuse_faults(world, self._simulation)
            refuse_misfit(self.controller, world)
            self.genome = genome_of(self.controller, world)
            self._mind = self.controller.mind(len(world.inputs), len(world.outputs))
            self._kernel = episode_kernel(self._simulation, self._mind, timed)
            mind = self._mind
            self._loading = loading_kernel(mind.weights, mind.shape_type, mind.load, mind.join)
        self._shapes = shapes_of(world, self._simulation)
        sizes = {"robots": world.n_robots, "team": 1} | mind.sizes
        self._mind_shapes = {
            struct: shapes(dimensions(struct, lambda _: ("robots",)), sizes)
            for struct in (mind.memory, mind.weights)
        }
        stages = stages_of(self._simulation).items()
        self._phases = ["think", *(f"{at} {one.name}" for at, those in stages for one in those)]
        self._clock = wp.zeros(len(self._phases) if timed else 0, dtype=wp.int64, device=device)
        self._is_built = False
        self._workspace: _Workspace | None = None

    def build(self) -> Self:
        """Compile and load the kernels, which the first launch does otherwise; return this rollout.

        Raises:
            UsageError: the world's functions cannot be compiled; names file and line.
            EnvironmentFailure: the compiled kernel cannot be written.
        """
        if not self._is_built:
            for kernel in (self._kernel, self._loading):
                engine.build(kernel, self.device, self.lanes)
            self._is_built = True
        return self

    @property
    def cycles(self) -> dict[str, int]:
        """Cycles that each phase has taken so far, by stage and name; 0 unless timed.

        Counted on the first lane of every block: with one CPU thread, on the CPU.
        """
        counted = self._clock.numpy().tolist() or [0] * len(self._phases)
        return dict(zip(self._phases, counted, strict=True))

    @property
    def fingerprint(self) -> str:
        """Sixteen hex digits that change with anything the kernels are made of."""
        return engine.kernel_hash(self._kernel, self._loading)

    def evaluate(
        self,
        genes: npt.NDArray[np.float32],
        teams: npt.NDArray[np.int32],
        scenarios: Scenarios,
        heuristic: npt.NDArray[np.int32] | None = None,
        rounds: int = 1,
    ) -> Outcome:
        """Run every team in every scenario of its round and return what happened.

        Args:
            genes: pool of genotypes [K, G], float32.
            teams: pool rows of the parts [N, R, U] (team, robot, slot), -1 for an empty slot.
            scenarios: E scenarios of this world for each round, one round after another.
            heuristic: [N, R], index of a heuristic controller of the world, -1 for the robot's own.
            rounds: the teams come in so many parts of equal length, each with its own scenarios.

        Raises:
            ValueError: shapes or rows that do not fit this world.
            UsageError: scenarios whose arrays are not those of the world's scene.
        """
        self._refuse_faulty(scenarios)
        genes, teams, heuristic = self._checked(genes, teams, heuristic)
        n_teams, r = len(teams), self.world.n_robots
        e, odd = divmod(len(scenarios), rounds)
        if odd or n_teams % rounds:
            raise ValueError(f"{n_teams} teams, {len(scenarios)} scenarios: not {rounds} rounds")
        n_castes = len(self.world.castes)
        parts = []
        scene = self._scene(scenarios)
        job = self._job(len(scenarios), e, n_teams // rounds)
        step = max(1, self._chunk // e)
        pool = self._array(genes)
        for first in range(0, n_teams, step):
            some = slice(first, min(first + step, n_teams))
            n = some.stop - some.start
            batch = self._batch(n * e, n)
            job.first_team, job.heuristic = first, self._array(heuristic[some])
            self._load(batch, pool, teams[some])
            self._launch(batch, scene, job, n * e)
            parts.append(self._collect(batch, n, e))
        joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        return Outcome(
            fitness=joined["fitness"].reshape(n_teams, e, r),
            counts=joined["counts"].reshape(n_teams, e, r, n_castes),
            switches=joined["switches"].reshape(n_teams, e, r),
            performance={
                name: joined["performance"].reshape(n_teams, e, -1)[:, :, k]
                for k, name in enumerate(one.name for one in measures_of(self.world))
            },
        )

    def record(
        self,
        genes: npt.NDArray[np.float32],
        team: npt.NDArray[np.int32],
        scenarios: Scenarios,
        heuristic: npt.NDArray[np.int32] | None = None,
    ) -> dict[str, npt.NDArray[Any]]:
        """Run one team in one scenario and return its state after every iteration.

        The same kernel as ``evaluate``, launched one iteration at a time, so the same bits.

        Args:
            genes: pool of genotypes [K, G].
            team: pool rows [R, U].
            scenarios: exactly one scenario.
            heuristic: [R] or None.

        Returns:
            The world's recorded arrays, each [T, its dimensions], and those it records at the end
            as they are; ``inputs`` [T, R, S], ``outputs`` [T, R, O] and ``hidden`` [T, R, U], the
            activation of the part in each slot; ``performance`` [T, measures], each as if the epoch
            ended there.
        """
        self._refuse_faulty(scenarios)
        if len(scenarios) != 1:
            raise ValueError(f"record takes one scenario, got {len(scenarios)}")
        genes, teams, modes = self._checked(
            genes, team[None], None if heuristic is None else heuristic[None]
        )
        scene, batch = self._scene(scenarios), self._batch(1, 1)
        job = self._job(1, 1, 1)
        job.heuristic = self._array(modes)
        self._load(batch, self._array(genes), teams)
        names = dict.fromkeys((*self._simulation.recorded, "performance", "inputs", "outputs"))
        steps: dict[str, list[npt.NDArray[Any]]] = {name: [] for name in (*names, "hidden")}
        mind = self._mind
        probe = self._mind_shapes[mind.memory][mind.probe]
        for t in range(self.world.params.iterations):
            job.t_begin, job.t_end = t, t + 1
            self._launch(batch, scene, job, 1)
            for name in names:
                steps[name].append(self._read(batch, name, 1)[0])
            seen = _first(getattr(batch.memory, mind.probe), 1, probe)[0]
            steps["hidden"].append(seen[:, : self.genome.max_parts].copy())
        final = {n: self._read(batch, n, 1)[0] for n in self._simulation.recorded_at_end}
        return {name: np.stack(values) for name, values in steps.items()} | final

    def _refuse_faulty(self, scenarios: Scenarios) -> None:
        """Raise UsageError for scenarios that are not those of the world's scene."""
        n = len(getattr(scenarios, "seed", ()))
        for fault in scenario_faults(self._simulation.scene, scenarios, n):
            raise UsageError(f"world {self.world.name}: scenarios: {fault}")

    def _checked(
        self,
        genes: npt.NDArray[np.float32],
        teams: npt.NDArray[np.int32],
        heuristic: npt.NDArray[np.int32] | None,
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        genome, r = self.genome, self.world.n_robots
        if genes.ndim != 2 or genes.shape[1] != genome.n_genes:
            raise ValueError(f"genes must be [K, {genome.n_genes}], got {list(genes.shape)}")
        if teams.ndim != 3 or teams.shape[1:] != (r, genome.max_parts):
            raise ValueError(f"teams must be [N, {r}, {genome.max_parts}], got {list(teams.shape)}")
        if not len(teams):
            raise ValueError("teams must hold at least one team")
        if teams.min() < -1 or teams.max() >= len(genes):
            raise ValueError(f"teams must hold rows -1..{len(genes) - 1} of the pool")
        if heuristic is None:
            heuristic = np.full(teams.shape[:2], -1, dtype=np.int32)
        n = len(self.world.heuristics)
        if heuristic.shape != teams.shape[:2] or heuristic.min() < -1 or heuristic.max() >= n:
            raise ValueError(f"heuristic must be {list(teams.shape[:2])} of -1..{n - 1}")
        return (
            np.ascontiguousarray(genes, dtype=np.float32),
            np.ascontiguousarray(teams, dtype=np.int32),
            np.ascontiguousarray(heuristic, dtype=np.int32),
        )

    def _scene(self, scenarios: Scenarios) -> Any:
        scene = self._simulation.scene()
        for name in self._simulation.scene.vars:
            values = getattr(scenarios, name)
            setattr(scene, name, self._array(values if self.is_shared(name) else values.ravel()))
        return scene

    def is_shared(self, name: str) -> bool:
        """Return whether all scenarios have a field of theirs in common."""
        field = self._simulation.scene.vars.get(name)
        return field is not None and field.type.ndim > 1

    def _array(self, values: npt.NDArray[Any]) -> Any:
        dtype = wp.dtype_from_numpy(values.dtype)
        values = np.ascontiguousarray(values)  # views are made from pointers: strides would be lost
        return wp.array(values, dtype=dtype, device=self.device, copy=self.device != "cpu")

    def _job(self, n_scenes: int, n_scenarios: int, teams_per_round: int) -> Any:
        job = Job()
        job.n_scenarios = n_scenarios
        job.n_scenes = n_scenes
        job.n_robots = self.world.n_robots
        job.first_team = 0
        job.teams_per_round = teams_per_round
        job.clock = self._clock
        job.t_begin, job.t_end = 0, self.world.params.iterations
        return job

    def _batch(self, n_worlds: int, n_teams: int) -> _Workspace:
        """Return a workspace of at least so many worlds and teams."""
        had = self._workspace
        if had is None or had.n_worlds < n_worlds or had.n_teams < n_teams:
            if had is not None:
                n_worlds, n_teams = max(n_worlds, had.n_worlds), max(n_teams, had.n_teams)
            self._workspace = None  # frees what was there before more is taken
            mind, wanted = self._mind, self._mind_shapes
            self._workspace = _Workspace(
                n_worlds,
                n_teams,
                allocate(self._simulation.state, self._shapes, n_worlds, self.device),
                allocate(mind.memory, wanted[mind.memory], n_worlds, self.device),
                allocate(mind.weights, wanted[mind.weights], n_teams, self.device),
            )
        assert self._workspace is not None
        return self._workspace

    def _read(self, batch: _Workspace, name: str, n: int) -> npt.NDArray[Any]:
        """Return a copy of an array of the first ``n`` worlds' state, [n, its dimensions]."""
        return _first(getattr(batch.state, name), n, self._shapes[name]).copy()

    def _load(self, batch: _Workspace, pool: Any, teams: npt.NDArray[np.int32]) -> None:
        """Build the controllers of some teams."""
        inputs = [batch.weights, self._mind.shape, pool, self._array(teams), batch.n_teams]
        self._run(self._loading, len(teams), inputs)

    def _launch(self, batch: _Workspace, scene: Any, job: Any, n: int) -> None:
        job.n_worlds, job.n_teams = batch.n_worlds, batch.n_teams
        brains = (batch.weights, batch.memory, self._mind.shape)
        self._run(self._kernel, n, [batch.state, scene, self._simulation.params, *brains, job])

    def _run(self, kernel: Any, n: int, inputs: list[Any]) -> None:
        self.build()
        engine.launch(
            kernel, n, inputs, device=self.device, n_threads=self.n_threads, lanes=self.lanes
        )

    def _collect(self, batch: _Workspace, n_teams: int, e: int) -> dict[str, npt.NDArray[Any]]:
        names = ("fitness", "counts", "switches", "performance")
        return {name: self._read(batch, name, n_teams * e) for name in names}


def _first(array: Any, n: int, shape: tuple[int, ...]) -> npt.NDArray[Any]:
    """Return what the first ``n`` parts of a batch hold, each of a shape."""
    values: npt.NDArray[Any] = array.numpy().reshape(-1, *shape)[:n]
    return values
