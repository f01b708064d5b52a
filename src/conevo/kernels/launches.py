"""Launches that are repeated thousands of times: recorded once, on threads that are kept.

``engine.launch`` prepares its arguments and its threads each time, which takes longer than a step
of a single world.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from time import perf_counter
from typing import Any

import warp as wp

__all__ = ["Launches"]

TRIES = 6  # for each number of threads


class Launches:
    """The launches of one kernel for all worlds of a batch, one for each of its tasks.

    The kernel's arguments are inputs, the task and the first world of a slice; its thread index is
    ``(world in slice, lane)``.

    Choice: if no number of threads is given, the first launches of task 0 are timed on one thread
    and on all in turn, and the faster number is kept. Several threads are slower for few worlds:
    handing over work takes some 50 us.

    Args:
        kernel: made with ``engine.options``, and built.
        n_worlds: number of worlds.
        device: "cpu" or a CUDA device.
        n_threads: CPU threads.
        is_given: whether all of them are to be used; otherwise one, if that is faster.
        lanes: lanes of a block.
    """

    def __init__(
        self,
        kernel: Any,
        n_worlds: int,
        *,
        device: str,
        n_threads: int,
        is_given: bool,
        lanes: int,
    ) -> None:
        self._kernel, self._n_worlds = kernel, n_worlds
        self._device, self._lanes = device, lanes
        is_parallel = device == "cpu" and wp.config.mode == "release"
        is_parallel = is_parallel and not wp.config.enable_cpu_blocks  # as in engine.launch
        self.n_threads = min(n_threads, n_worlds) if is_parallel else 1
        tried = [] if is_given or self.n_threads == 1 else [1, self.n_threads] * TRIES
        self._to_try = tried
        self._seconds: dict[int, float] = {}
        self._inputs: list[Any] = []
        self._recorded: dict[tuple[int, int], list[Any]] = {}
        self._pool: ThreadPoolExecutor | None = None
        self._process = os.getpid()

    def record(self, inputs: Sequence[Any]) -> None:
        """Use these inputs from now on."""
        self._inputs, self._recorded = list(inputs), {}

    def run(self, task: int) -> None:
        """Launch the kernel for a task; on a CUDA device it may still run on return."""
        if not self._to_try or task != 0:
            self._run(task, self.n_threads)
            return
        n_threads = self._to_try.pop()
        start = perf_counter()
        self._run(task, n_threads)
        seconds = perf_counter() - start
        self._seconds[n_threads] = min(seconds, self._seconds.get(n_threads, seconds))
        if not self._to_try:
            self.n_threads = min(self._seconds, key=self._seconds.__getitem__)

    def _run(self, task: int, n_threads: int) -> None:
        first, *others = self._commands(task, n_threads)
        if not others:
            first.launch()
            return
        pool = self._threads(n_threads)
        waiting = [pool.submit(one.launch) for one in others]
        first.launch()
        for one in waiting:
            one.result()

    def _commands(self, task: int, n_threads: int) -> list[Any]:
        """Return the recorded launches of a task, one for each thread."""
        key = task, n_threads
        if key not in self._recorded:
            ends = [self._n_worlds * k // n_threads for k in range(n_threads + 1)]
            self._recorded[key] = [
                wp.launch_tiled(
                    self._kernel,
                    dim=[end - first],
                    inputs=[*self._inputs, task, first],
                    block_dim=self._lanes,
                    device=self._device,
                    record_cmd=True,
                )
                for first, end in pairwise(ends)
            ]
        return self._recorded[key]

    def _threads(self, n_threads: int) -> ThreadPoolExecutor:
        """Return the threads that are kept; a process forked from another one has its own."""
        if self._pool is None or self._process != os.getpid():
            self._pool, self._process = ThreadPoolExecutor(n_threads - 1), os.getpid()
        return self._pool
