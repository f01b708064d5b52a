"""The single episode loop: ``evaluate`` runs batches of teams, ``record`` records one of them.

Teams are rows of a genotype pool. A kernel builds each team's controllers, once for all its
scenarios, so a generation of ten thousand teams needs no unpacked weights. Batches larger than the
workspace run in parts.
"""

import logging
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import warp as wp

from conevo.controllers.protocol import Controller
from conevo.controllers.registry import controller as make_controller
from conevo.controllers.registry import genome_of, refuse_misfit
from conevo.kernels import engine
from conevo.kernels.arrays import allocate, dimensions, first_parts, shapes
from conevo.kernels.views import SHARED_BYTES, near_arrays
from conevo.terms import counted
from conevo.worlds.contract import stages_of
from conevo.worlds.episode import Job, episode_kernel, loading_kernel
from conevo.worlds.measures import measures_of
from conevo.worlds.on_device import WorldOnDevice
from conevo.worlds.protocol import Outcome, Scenarios, World

__all__ = ["Rollout"]

log = logging.getLogger("conevo")

# Worlds simulated at once: bounds memory, keeps all threads or blocks busy.
CHUNK = 512
CUDA_CHUNK = 8192


@dataclass
class _Workspace:
    """Arrays of a batch, reused for each.

    They have room for ``n_worlds`` worlds with a state and a memory each, and for ``n_teams``
    teams' weights.
    """

    n_worlds: int
    n_teams: int
    state: Any
    memory: Any
    weights: Any


class Rollout(WorldOnDevice):
    """Runs teams in one world.

    Args:
        world: the world and environment to run.
        controller: of the robots; by default the one that the world suggests.
        n_threads: CPU threads; all usable ones by default. Results do not depend on it.
        device: "cpu", a CUDA device as Warp names it, or "auto": a CUDA device if the machine has
            one.
        lanes: of a block; by default those that the world suggests on a CUDA device, and one on the
            CPU (more are for tests of the CUDA form, and need Warp's CPU blocks).
        timed: whether ``cycles`` measures each phase, for benchmarks.
        shared_bytes: shared memory that a block on a CUDA device may take.

    Raises:
        UsageError: the world does not meet the engine's requirements, the controller does not fit
            it, or the device's name is unknown.
        EnvironmentFailure: the device does not exist.
    """

    def __init__(
        self,
        world: World,
        controller: Controller | None = None,
        n_threads: int | None = None,
        device: str = "cpu",
        lanes: int | None = None,
        timed: bool = False,
        shared_bytes: int = SHARED_BYTES,
    ) -> None:
        super().__init__(world, n_threads, device, lanes)
        self.controller = controller or make_controller(world=world)
        self._chunk = CHUNK if self.device == "cpu" else CUDA_CHUNK
        with engine.building:
            refuse_misfit(self.controller, world)
            self.genome = genome_of(self.controller, world)
            self._mind = self.controller.mind(len(world.inputs), len(world.outputs))
            mind = self._mind
            self._loading = loading_kernel(mind)
        sizes = {"robots": world.n_robots, "team": 1} | mind.sizes
        self._mind_shapes = {
            struct: shapes(dimensions(struct, lambda _: ("robots",)), sizes)
            for struct in (mind.memory, mind.weights)
        }
        if self.device == "cpu":
            with engine.building:
                self._kernel = episode_kernel(self._simulation, mind, timed)
        else:
            self._kernel = self.cuda_form(self.lanes, timed, shared_bytes)
        stages = stages_of(self._simulation).items()
        self._phases = ["think", *(f"{at} {one.name}" for at, those in stages for one in those)]
        self._clock = wp.zeros(
            len(self._phases) if timed else 0, dtype=wp.int64, device=self.device
        )
        self._is_built = False
        self._workspace: _Workspace | None = None

    def cuda_form(self, lanes: int, timed: bool = False, shared_bytes: int = SHARED_BYTES) -> Any:
        """Return the kernel in the form for a CUDA device; arguments as for the rollout."""
        state, memory = self._simulation.state, self._mind.memory
        shape_of = {state: self._shapes, memory: self._mind_shapes[memory]}
        chosen = near_arrays(shape_of, shared_bytes)
        near = chosen[state], chosen[memory]
        with engine.building:
            return episode_kernel(self._simulation, self._mind, timed, near, lanes)

    def build(self) -> Self:
        """Compile and load the kernels now, not at the first launch; return this rollout.

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
        """Sixteen hex digits that change with any part of the kernels."""
        with engine.building:  # always the untimed form for the CPU
            episode = episode_kernel(self._simulation, self._mind)
        return engine.kernel_hash(episode, self._loading)

    def evaluate(
        self,
        genes: npt.NDArray[np.float32],
        teams: npt.NDArray[np.int32],
        scenarios: Scenarios,
        heuristic: npt.NDArray[np.int32] | None = None,
        rounds: int = 1,
        iterations: int | None = None,
    ) -> Outcome:
        """Run every team in every scenario of its round and return the outcome.

        Args:
            genes: pool of genotypes [K, G], float32.
            teams: pool rows of the parts [N, R, U] (team, robot, slot), -1 for an empty slot.
            scenarios: E scenarios of this world for each round, one round after another.
            heuristic: [N, R], index of a heuristic controller of the world, -1 for the robot's own.
            rounds: number of equal parts of the teams, each with its own scenarios.
            iterations: number of iterations to play, all by default.

        Raises:
            ValueError: shapes or rows that do not fit this world.
            UsageError: scenarios whose arrays are not those of the world's scene.
            EnvironmentFailure: the memory is too small even for one team.
        """
        self._refuse_faulty(scenarios)
        genes, teams, heuristic = self._checked(genes, teams, heuristic)
        n_teams = len(teams)
        e, odd = divmod(len(scenarios), rounds)
        if odd or n_teams % rounds:
            raise ValueError(f"{n_teams} teams, {len(scenarios)} scenarios: not {rounds} rounds")
        parts = []
        scene = self._scene(scenarios)
        job = self._job(len(scenarios), e, n_teams // rounds)
        job.t_end = min(iterations or job.t_end, job.t_end)
        pool = self._array(genes)
        first = 0
        while first < n_teams:
            batch, n = self._room(n_teams - first, e)
            some = slice(first, first + n)
            job.first_team, job.heuristic = first, self._array(heuristic[some])
            self._load(batch, pool, teams[some])
            self._launch(batch, scene, job, n * e)
            parts.append(self._collect(batch, n, e))
            first += n
        joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        return self._outcome(joined, n_teams, e)

    def record(
        self,
        genes: npt.NDArray[np.float32],
        team: npt.NDArray[np.int32],
        scenarios: Scenarios,
        heuristic: npt.NDArray[np.int32] | None = None,
    ) -> dict[str, npt.NDArray[Any]]:
        """Run one team in one scenario and return its state after every iteration.

        It launches the kernel of ``evaluate`` one iteration at a time, so the results are equal
        bit for bit.

        Args:
            genes: pool of genotypes [K, G].
            team: pool rows [R, U].
            scenarios: exactly one scenario.
            heuristic: [R] or None.

        Returns:
            The world's recorded arrays, each [T, its dimensions], and those that it records only at
            the end; ``inputs`` [T, R, S], ``outputs`` [T, R, O] and ``hidden`` [T, R, U], the
            activation of the part in each slot; ``performance`` [T, measures], each as if the epoch
            ended there.
        """
        return self.record_with_outcome(genes, team, scenarios, heuristic)[0]

    def record_with_outcome(
        self,
        genes: npt.NDArray[np.float32],
        team: npt.NDArray[np.int32],
        scenarios: Scenarios,
        heuristic: npt.NDArray[np.int32] | None = None,
    ) -> tuple[dict[str, npt.NDArray[Any]], Outcome]:
        """Return the results of ``record``, and the outcome of the same epoch, played once."""
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
                steps[name].append(self._read(batch.state, name, 1)[0])
            seen = first_parts(getattr(batch.memory, mind.probe), 1, probe)[0]
            steps["hidden"].append(seen[:, : self.genome.max_parts])
        final = {n: self._read(batch.state, n, 1)[0] for n in self._simulation.recorded_at_end}
        seen = {name: np.stack(values) for name, values in steps.items()} | final
        return seen, self._outcome(self._collect(batch, 1, 1), 1, 1)

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

    def _room(self, n_teams: int, e: int) -> tuple[_Workspace, int]:
        """Return a workspace for some teams in ``e`` scenarios, and their number.

        If the device has too little memory the number is halved, now and from then on.
        """
        wanted = n = min(n_teams, max(1, self._chunk // e))
        while True:
            is_grown = self._workspace is not None  # to the worlds and teams of any two batches
            try:
                batch = self._batch(n * e, n)
                break
            except engine.OutOfMemory:
                if n == 1 and not is_grown:
                    raise
                n = n if is_grown else n // 2
        if n < wanted:
            self._chunk = n * e
            log.warning(
                "device %s lacks memory for %s at once: it plays %s, with the same results",
                self.device,
                counted(wanted * e, "world"),
                n * e,
            )
        return batch, n

    def _batch(self, n_worlds: int, n_teams: int) -> _Workspace:
        """Return a workspace for at least these numbers of worlds and teams."""
        had = self._workspace
        if had is None or had.n_worlds < n_worlds or had.n_teams < n_teams:
            if had is not None:
                n_worlds, n_teams = max(n_worlds, had.n_worlds), max(n_teams, had.n_teams)
            had = self._workspace = None  # frees its memory before more is allocated
            mind, wanted = self._mind, self._mind_shapes
            with engine.memory_named(self.device):
                self._workspace = _Workspace(
                    n_worlds,
                    n_teams,
                    allocate(self._simulation.state, self._shapes, n_worlds, self.device),
                    allocate(mind.memory, wanted[mind.memory], n_worlds, self.device),
                    allocate(mind.weights, wanted[mind.weights], n_teams, self.device),
                )
        assert self._workspace is not None
        return self._workspace

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
        return {name: self._read(batch.state, name, n_teams * e) for name in names}

    def _outcome(self, arrays: dict[str, npt.NDArray[Any]], n: int, e: int) -> Outcome:
        """Return the arrays of ``_collect`` for n teams in e scenarios as their outcome."""
        r, measures = self.world.n_robots, measures_of(self.world)
        performance = arrays["performance"].reshape(n, e, -1)
        return Outcome(
            fitness=arrays["fitness"].reshape(n, e, r),
            counts=arrays["counts"].reshape(n, e, r, len(self.world.castes)),
            switches=arrays["switches"].reshape(n, e, r),
            performance={one.name: performance[:, :, k] for k, one in enumerate(measures)},
        )
