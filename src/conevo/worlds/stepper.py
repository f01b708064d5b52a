"""Worlds that a program outside plays step by step: it reads inputs and writes outputs.

A rollout runs whole epochs with the robots' controllers inside the kernel. A stepper runs one
iteration of many worlds in each launch, for controllers that conevo does not know, such as the
policies of a reinforcement learner. Its results equal those of ``Rollout.record`` bit for bit if
the outputs do.
"""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import warp as wp

from conevo.errors import UsageError, unknown_name
from conevo.kernels import engine
from conevo.kernels.arrays import allocate
from conevo.kernels.launches import Launches
from conevo.rng import fold
from conevo.worlds.on_device import WorldOnDevice
from conevo.worlds.protocol import World
from conevo.worlds.step_kernel import FINISH, RESET, StepJob, step_kernel

__all__ = ["MOST_WORLDS", "Stepper", "whole"]

POOL = 256  # scenarios
MOST_WORLDS = 2**20
MOST_SCENARIOS = 2**24


class Stepper(WorldOnDevice):
    """Plays ``n`` worlds of one environment, one iteration in each step.

    Each world has its own clock and its own scenario, one of a pool that all share. A world's
    results depend on its scenario and its outputs alone: not on the other worlds, threads, lanes or
    device. After its last iteration, in which robots sense once more, a world stays as it is until
    it is reset.

    On the CPU ``.numpy()`` of an array is a view, not a copy: take it once. On a CUDA device
    ``warp.to_torch`` gives a view. Every step overwrites the arrays.

    Args:
        world: the world and environment.
        n: number of worlds, up to 2**20.
        scenarios: number of scenarios in the pool, or their keys.
        seed: of the pool, unless keys are given, and of the order in which worlds play its
            scenarios. The pool has the scenarios that a run with this seed meets in generation 0
            (keys ``fold(seed, "epoch", 0, k)``).
        device: "cpu", a CUDA device as Warp names it, or "auto": a CUDA device if the machine has
            one.
        n_threads: CPU threads; by default one or all usable ones, whichever the first steps show to
            be faster.
        lanes: of a block; see ``WorldOnDevice``.

    Attributes:
        inputs: [n, R, S] float32, what the robots sense now.
        outputs: [n, R, O] float32, written by the caller before each step: real numbers, as the
            world's controllers give them. A NaN counts as 0. A world may overwrite them (noise).
        fitness: [n, R] float32, of each robot so far.
        performance: [n, measures] float32, as of the last ``finish``.
        clock: [n] int32, iterations played.
        scenario: [n] int32, index of the world's scenario in the pool.
        keys: of the pool's scenarios.
        recorded: names of the arrays that ``Rollout.record`` keeps of each iteration.
        recorded_at_end: names of those that it keeps at the end.

    Raises:
        UsageError: the world does not meet the engine's requirements; the device's name, a key or a
            number is not allowed.
        EnvironmentFailure: the device does not exist or has too little memory.
    """

    def __init__(
        self,
        world: World,
        n: int = 1,
        scenarios: int | Sequence[int] = POOL,
        seed: int = 0,
        device: str = "cpu",
        n_threads: int | None = None,
        lanes: int | None = None,
    ) -> None:
        super().__init__(world, n_threads, device, lanes)
        self.n = whole(n, "n", MOST_WORLDS)
        self.recorded = self._simulation.recorded
        self.recorded_at_end = self._simulation.recorded_at_end
        with engine.building:
            kernel = step_kernel(self._simulation)
        engine.build(kernel, self.device, self.lanes)
        with engine.memory_named(self.device):
            self._state = allocate(self._simulation.state, self._shapes, self.n, self.device)
        self._job = self._new_job()
        self.inputs, self.outputs = self._view("inputs"), self._view("outputs")
        self.fitness, self.performance = self._view("fitness"), self._view("performance")
        self.clock, self.scenario = self._job.clock, self._job.scenario
        self._launches = Launches(
            kernel,
            self.n,
            device=self.device,
            n_threads=self.n_threads,
            is_given=n_threads is not None,
            lanes=self.lanes,
        )
        self._scenarios: int | Sequence[int] = scenarios
        self.draw(scenarios, seed)

    def draw(self, scenarios: int | Sequence[int] | None = None, seed: int = 0) -> Self:
        """Draw another pool of scenarios; all worlds must be reset before the next step.

        Args:
            scenarios: number of scenarios, or their keys; as many as before, or the same keys, by
                default.
            seed: as for the stepper.

        Raises:
            UsageError: a number or a key is not allowed.
        """
        scenarios = self._scenarios if scenarios is None else scenarios
        seed = whole(seed, "seed", 2**64 - 1, 0)
        if isinstance(scenarios, Sequence | np.ndarray):
            keys = tuple(whole(key, "a scenario's key", 2**64 - 1, 0) for key in scenarios)
        else:
            n_scenarios = whole(scenarios, "scenarios", MOST_SCENARIOS)
            keys = tuple(fold(seed, "epoch", 0, k) for k in range(n_scenarios))
        whole(len(keys), "the number of scenarios", MOST_SCENARIOS)
        drawn = self.world.scenarios(keys)
        self._refuse_faulty(drawn)
        self._scenarios, self.keys = scenarios, keys
        job = self._job
        job.n_scenarios, job.seed = len(keys), fold(seed, "stepper")
        job.epochs.zero_()
        self._launches.record(
            [self._state, self._scene(drawn), self._simulation.params, job],
        )
        self._is_begun = False
        return self

    def reset(
        self,
        at: Any = None,
        scenario: int | Sequence[int] | npt.NDArray[np.integer[Any]] | None = None,
        seed: int | None = None,
    ) -> None:
        """Start a new epoch in some worlds: their robots are at their places and have sensed.

        Args:
            at: [n] mask of these worlds, a numpy array or, on the stepper's device, a Warp array;
                all worlds by default.
            scenario: index into the pool, for all of these worlds or [n], one for each world. By
                default each world draws one: its k-th epoch since ``draw`` always has the same.
            seed: draws another pool first (``draw``); not with ``at``.

        Raises:
            UsageError: a mask, an index or a seed that does not fit; ``at`` before the first reset
                of all worlds.
        """
        if seed is not None:
            if at is not None:
                raise UsageError("reset(seed=...) draws scenarios for all worlds: leave out 'at'")
            self.draw(seed=seed)
        if at is not None and not self._is_begun:
            raise UsageError("reset all worlds first: leave out 'at'")
        if scenario is None:
            self._job.given.fill_(-1)
        else:
            self._job.given.assign(self._indices(scenario))
        self._choose(at)
        self._launches.run(int(RESET))
        self._is_begun = True

    def step(self) -> None:
        """Play one iteration in every world that has not ended: all robots act, then sense.

        On a CUDA device the launch may still be running on return; reading an array waits for it.

        Raises:
            UsageError: worlds that have not been reset.
        """
        if not self._is_begun:
            raise UsageError("reset the worlds before the first step")
        self._launches.run(0)

    def finish(self, at: Any = None) -> None:
        """Write ``performance`` as if the epoch ended now.

        It is not a part of each step, as it may take three times as long as one; nor does it change
        what happens after it.

        Args:
            at: [n] mask of the worlds, as for ``reset``.

        Raises:
            UsageError: a mask that does not fit; worlds that have not been reset.
        """
        if not self._is_begun:
            raise UsageError("reset the worlds before they finish")
        self._choose(at)
        self._launches.run(int(FINISH))

    def read(self, name: str) -> npt.NDArray[Any]:
        """Return a copy of an array of the worlds' state, [n, its dimensions], such as "x".

        An array that ``sense`` writes is that of the next iteration: in the gathering world,
        ``detected`` already has the objects that robots detect then.

        Raises:
            UsageError: the state has no such array.
        """
        if name not in self._shapes:
            raise unknown_name("array", name, self._shapes, f"in {self.world.name}")
        return self._read(self._state, name, self.n)

    def _new_job(self) -> Any:
        job = StepJob()
        with engine.memory_named(self.device):
            for name in ("given", "scenario", "epochs", "clock"):
                setattr(job, name, wp.zeros(self.n, dtype=int, device=self.device))
            job.at = wp.zeros(self.n, dtype=wp.bool, device=self.device)
            job.timed = wp.zeros(0, dtype=wp.int64, device=self.device)
        job.n_worlds, job.n_robots = self.n, self.world.n_robots
        job.t_end = self.world.params.iterations
        return job

    def _view(self, name: str) -> Any:
        """Return an array of the state as [n, its dimensions], in the same memory."""
        return getattr(self._state, name).reshape((self.n, *self._shapes[name]))

    def _choose(self, at: Any) -> None:
        """Choose worlds by a mask."""
        if at is None:
            self._job.at.fill_(True)
            return
        given = at if isinstance(at, wp.array) else np.asarray(at)
        if given.shape != (self.n,) or given.dtype not in (wp.bool, np.dtype(bool)):
            kind = getattr(given.dtype, "__name__", given.dtype)
            raise UsageError(f"at must be {self.n} truth values, not {list(given.shape)} of {kind}")
        self._job.at.assign(given)

    def _indices(self, scenario: Any) -> npt.NDArray[np.int32]:
        """Return the scenario of each world."""
        given, size = np.asarray(scenario), len(self.keys)
        if given.shape not in ((), (self.n,)) or given.dtype.kind not in "iu":
            raise UsageError(
                f"scenario must be a whole number or {self.n} of them, not "
                f"{list(given.shape)} of {given.dtype}"
            )
        if given.min() < 0 or given.max() >= size:
            bad = given[(given < 0) | (given >= size)].flat[0]
            raise UsageError(f"scenario = {bad}: must be from 0 to {size - 1}, one of the pool")
        return np.broadcast_to(given, self.n).astype(np.int32)


def whole(given: Any, what: str, most: int, least: int = 1) -> int:
    """Return a whole number between two others, both allowed.

    Raises:
        UsageError: it is another number, or none.
    """
    is_whole = isinstance(given, int | np.integer) and not isinstance(given, bool)
    if not is_whole or not least <= given <= most:
        raise UsageError(f"{what} = {given!r}: must be an integer from {least} to {most}")
    return int(given)
