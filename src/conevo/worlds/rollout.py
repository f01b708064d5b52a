"""The single episode loop: ``evaluate`` runs batches of teams, ``record`` watches one of them.

Teams are rows of a genotype pool: the kernel builds each network itself, so a generation of ten
thousand teams needs no unpacked weights. Batches larger than the workspace run in parts.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import warp as wp

from conevo.errors import EnvironmentFailure, UsageError
from conevo.kernels import engine
from conevo.kernels.devices import refuse_unknown_device
from conevo.kernels.engine import barrier
from conevo.kernels.network import WIDE, Shape, load, out_vector, think, wide_vector
from conevo.worlds.contract import PHASES, refuse_faults, scenario_faults, sizes_of
from conevo.worlds.measures import measures_of
from conevo.worlds.protocol import Outcome, Scenarios, Simulation, World

__all__ = ["Rollout", "check_device", "episode_kernel"]

# Worlds simulated at once: bounds memory (about 0.13 MB each), keeps all threads or blocks busy.
CHUNK = 512
CUDA_CHUNK = 8192


@wp.struct
class Job:
    """What a launch is to do: which networks play, in how many scenarios, which iterations."""

    shape: Shape
    genes: wp.array2d[float]
    slots: wp.array3d[int]
    heuristic: wp.array2d[int]
    n_worlds: int
    n_scenarios: int
    n_robots: int
    t_begin: int
    t_end: int


def episode_kernel(simulation: Simulation) -> Any:
    """Return the kernel that runs a world's iterations ``t_begin`` to ``t_end``."""
    f = simulation.functions
    structs = (simulation.state, simulation.scene, simulation.params_type)
    phases = [f[name] for name in PHASES]
    if "settle" in f:
        return _settling_kernel(*structs, *phases, f["settle"])
    return _episode_kernel(*structs, *phases)


@cache
def _episode_kernel(
    State: Any,
    Scene: Any,
    Params: Any,
    reset: Any,
    sense: Any,
    act: Any,
    commit: Any,
    resolve: Any,
    outcome: Any,
) -> Any:
    view_team, view_scene = engine.view_of(State), engine.view_of(Scene)

    @wp.kernel(module="unique", module_options=engine.options, grid_stride=False)
    def episode(batch: State, scenes: Scene, p: Params, job: Job, first: int) -> None:
        index, lane = wp.tid()
        b = first + index
        lanes = wp.block_dim()
        n = b // job.n_scenarios
        team = view_team(batch, b, job.n_worlds)
        scene = view_scene(scenes, b % job.n_scenarios, job.n_scenarios)
        if job.t_begin == 0:
            for i in range(lane, job.n_robots, lanes):
                reset(team, scene, p, i)
                load(team.nets, job.shape, i, job.genes, job.slots, n)
                team.heuristic[i] = job.heuristic[n, i]
            barrier()
        for t in range(job.t_begin, job.t_end):
            for i in range(lane, job.n_robots, lanes):
                sense(team, scene, p, i, t)
                if team.heuristic[i] < 0:
                    think(team.nets, job.shape, i)
                act(team, scene, p, i, t)
            barrier()
            for i in range(lane, job.n_robots, lanes):
                commit(team, scene, p, i, t)
            barrier()
            for i in range(lane, job.n_robots, lanes):
                resolve(team, scene, p, i, t)
            barrier()
        if lane == 0:
            outcome(team, scene, p, job.t_end)

    return episode


# A text of its own, so that a world without the phase keeps its kernel and its kernel's hash.
@cache
def _settling_kernel(
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

    @wp.kernel(module="unique", module_options=engine.options, grid_stride=False)
    def episode(batch: State, scenes: Scene, p: Params, job: Job, first: int) -> None:
        index, lane = wp.tid()
        b = first + index
        lanes = wp.block_dim()
        n = b // job.n_scenarios
        team = view_team(batch, b, job.n_worlds)
        scene = view_scene(scenes, b % job.n_scenarios, job.n_scenarios)
        if job.t_begin == 0:
            for i in range(lane, job.n_robots, lanes):
                reset(team, scene, p, i)
                load(team.nets, job.shape, i, job.genes, job.slots, n)
                team.heuristic[i] = job.heuristic[n, i]
            barrier()
        for t in range(job.t_begin, job.t_end):
            for i in range(lane, job.n_robots, lanes):
                sense(team, scene, p, i, t)
                if team.heuristic[i] < 0:
                    think(team.nets, job.shape, i)
                act(team, scene, p, i, t)
            barrier()
            for i in range(lane, job.n_robots, lanes):
                commit(team, scene, p, i, t)
            barrier()
            if lane == 0:
                settle(team, scene, p, t)
            barrier()
            for i in range(lane, job.n_robots, lanes):
                resolve(team, scene, p, i, t)
            barrier()
        if lane == 0:
            outcome(team, scene, p, job.t_end)

    return episode


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
    """Arrays of a batch of at most ``n`` worlds, used again and again."""

    n: int
    state: Any


class Rollout:
    """Runs teams in one world.

    Args:
        world: the world and environment to run.
        n_threads: CPU threads; all usable ones by default. Results do not depend on it.
        device: "cpu" or a CUDA device as Warp names it.
        lanes: lanes of a CPU block (for tests of the CUDA form; needs Warp's CPU blocks).

    Raises:
        UsageError: the world lacks what the engine needs of it, or no device is named so.
        EnvironmentFailure: the device does not exist.
    """

    def __init__(
        self, world: World, n_threads: int | None = None, device: str = "cpu", lanes: int = 1
    ) -> None:
        engine.start()
        self.world = world
        self.device = device
        self.n_threads = n_threads or engine.usable_threads()
        self.lanes = 32 if device != "cpu" else lanes
        self._chunk = CHUNK if device == "cpu" else CUDA_CHUNK
        check_device(device)
        with engine.building:
            self._simulation = world.simulation()
            refuse_faults(world, self._simulation)
            self._kernel = episode_kernel(self._simulation)
        self._sizes = sizes_of(world, self._simulation)
        spec = world.controller
        shape = Shape()
        shape.n_sensors = spec.n_sensors
        shape.n_context = spec.n_context
        shape.n_inputs = spec.n_inputs
        shape.n_outputs = spec.n_outputs
        shape.n_slots = spec.max_hidden
        shape.n_chunks = -(-spec.max_hidden // int(WIDE))
        shape.weight_scale = spec.weight_scale
        shape.bias = float(spec.bias)
        self._shape = shape
        self._is_built = False
        self._workspace: _Workspace | None = None

    def build(self) -> Self:
        """Compile and load the kernel, which the first launch does otherwise; return this rollout.

        Raises:
            UsageError: the world's functions cannot be compiled; names file and line.
            EnvironmentFailure: the compiled kernel cannot be written.
        """
        if not self._is_built:
            engine.build(self._kernel, self.device, self.lanes)
            self._is_built = True
        return self

    @property
    def kernel_hash(self) -> str:
        """Sixteen hex digits that change with anything the kernel is made of."""
        return engine.kernel_hash(self._kernel)

    def evaluate(
        self,
        genes: npt.NDArray[np.float32],
        teams: npt.NDArray[np.int32],
        scenarios: Scenarios,
        heuristic: npt.NDArray[np.int32] | None = None,
    ) -> Outcome:
        """Run every team in every scenario and return what happened.

        Args:
            genes: pool of neuron genotypes [K, G], float32.
            teams: pool rows of the neurons [N, R, U] (team, robot, slot), -1 for an empty slot.
            scenarios: E scenarios of this world.
            heuristic: [N, R], index of a heuristic controller of the world, -1 for the network.

        Raises:
            ValueError: shapes or rows that do not fit this world.
            UsageError: scenarios whose arrays are not those of the world's scene.
        """
        self._refuse_faulty(scenarios)
        genes, teams, heuristic = self._checked(genes, teams, heuristic)
        n_teams, e, r = len(teams), len(scenarios), self.world.n_robots
        n_castes = len(self.world.castes)
        parts = []
        scene = self._scene(scenarios)
        step = max(1, self._chunk // e)
        for first in range(0, n_teams, step):
            some = slice(first, min(first + step, n_teams))
            batch = self._batch((some.stop - some.start) * e)
            job = self._job(genes, teams[some], heuristic[some], e)
            self._launch(batch, scene, job, (some.stop - some.start) * e)
            parts.append(self._collect(batch, some.stop - some.start, e))
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
            genes: pool of neuron genotypes [K, G].
            team: pool rows [R, U].
            scenarios: exactly one scenario.
            heuristic: [R] or None.

        Returns:
            The world's recorded arrays, each [T, its size], and those it records at the end as they
            are; ``inputs`` [T, R, sensors + context], of every iteration with the context that it
            left; ``sums`` [T, R, outputs], weighted sums of the output units; ``performance``
            [T, measures], each as if the epoch ended there.
        """
        self._refuse_faulty(scenarios)
        if len(scenarios) != 1:
            raise ValueError(f"record takes one scenario, got {len(scenarios)}")
        genes, teams, modes = self._checked(
            genes, team[None], None if heuristic is None else heuristic[None]
        )
        scene, batch = self._scene(scenarios), self._batch(1)
        job = self._job(genes, teams, modes, 1)
        names = dict.fromkeys((*self._simulation.recorded, "performance"))
        steps: dict[str, list[npt.NDArray[Any]]] = {name: [] for name in (*names, "inputs", "sums")}
        state, sizes, r = batch.state, self._sizes, self.world.n_robots
        n_inputs, n_outputs = self._shape.n_inputs, self._shape.n_outputs
        for t in range(self.world.params.iterations):
            job.t_begin, job.t_end = t, t + 1
            self._launch(batch, scene, job, 1)
            for name in names:
                steps[name].append(getattr(state, name).numpy()[: sizes[name]].copy())
            inputs = state.nets.inputs.numpy()[: r * n_inputs]
            steps["inputs"].append(inputs.reshape(r, n_inputs).copy())
            steps["sums"].append(state.nets.sums.numpy()[:r, :n_outputs].copy())
        final = {n: getattr(state, n).numpy() for n in self._simulation.recorded_at_end}
        return {name: np.stack(values) for name, values in steps.items()} | {
            name: values[: sizes[name]].copy() for name, values in final.items()
        }

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
        spec, r = self.world.controller, self.world.n_robots
        if genes.ndim != 2 or genes.shape[1] != spec.n_genes:
            raise ValueError(f"genes must be [K, {spec.n_genes}], got {list(genes.shape)}")
        if teams.ndim != 3 or teams.shape[1:] != (r, spec.max_hidden):
            raise ValueError(f"teams must be [N, {r}, {spec.max_hidden}], got {list(teams.shape)}")
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

    def _job(
        self,
        genes: npt.NDArray[np.float32],
        teams: npt.NDArray[np.int32],
        heuristic: npt.NDArray[np.int32],
        n_scenarios: int,
    ) -> Any:
        job = Job()
        job.shape = self._shape
        job.genes = self._array(genes)
        job.slots = self._array(teams)
        job.heuristic = self._array(heuristic)
        job.n_scenarios = n_scenarios
        job.n_robots = self.world.n_robots
        job.t_begin, job.t_end = 0, self.world.params.iterations
        return job

    def _batch(self, n: int) -> _Workspace:
        """Return a workspace of at least n worlds."""
        if self._workspace is None or self._workspace.n < n:
            r, chunks = self.world.n_robots, self._shape.n_chunks
            state = self._simulation.state()
            for name, size in self._sizes.items():
                dtype = self._simulation.state.vars[name].type.dtype
                setattr(state, name, wp.zeros(n * size, dtype=dtype, device=self.device))
            nets = state.nets
            slots = chunks * int(WIDE)
            zeros = {"device": self.device}
            nets.w_in = wp.zeros(n * r * chunks * self._shape.n_inputs, dtype=wide_vector, **zeros)
            nets.w_out = wp.zeros(n * r * slots, dtype=out_vector, **zeros)
            nets.filled = wp.zeros(n * r * chunks, dtype=wide_vector, **zeros)
            nets.n_used = wp.zeros(n * r, dtype=int, **zeros)
            nets.inputs = wp.zeros(n * r * self._shape.n_inputs, dtype=float, **zeros)
            nets.sums = wp.zeros(n * r, dtype=out_vector, **zeros)
            self._workspace = _Workspace(n, state)
        return self._workspace

    def _launch(self, batch: _Workspace, scene: Any, job: Any, n: int) -> None:
        self.build()
        job.n_worlds = batch.n
        engine.launch(
            self._kernel,
            n,
            [batch.state, scene, self._simulation.params, job],
            device=self.device,
            n_threads=self.n_threads,
            lanes=self.lanes,
        )

    def _collect(self, batch: _Workspace, n_teams: int, e: int) -> dict[str, npt.NDArray[Any]]:
        n = n_teams * e
        return {
            name: getattr(batch.state, name)
            .numpy()[: n * self._sizes[name]]
            .reshape(n_teams, -1)
            .copy()
            for name in ("fitness", "counts", "switches", "performance")
        }
