"""Runs as tasks of a Ray cluster, which executes a task again if its node was lost.

A task reserves the cores of its run and spawns the same worker as the executor "processes", so that
a run is executed in the same way everywhere, and its failure does not affect others. Ray only
returns the worker's exit code. Results are files: in the campaign's directory, if all nodes see it,
or else in an object store, from which they are fetched.
"""

from __future__ import annotations

import os
import signal
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from conevo.campaigns.devices import AUTO, CPU
from conevo.campaigns.executors.local import spawn, why_lost
from conevo.campaigns.executors.protocol import Ending, RunJob
from conevo.campaigns.object_store import ObjectStore
from conevo.campaigns.paths import Paths
from conevo.errors import EnvironmentFailure, UsageError
from conevo.kernels.threads import usable_cores

__all__ = ["RayCluster"]

RETRIES = 3  # of a task whose node or Ray worker is lost
MEMORY = 80 * 2**20  # bytes of Ray's own object store, near the least that Ray allows
COPY_EVERY = 120.0  # seconds between two copies of a running run into the object store


class RayCluster:
    """A Ray task per run, here or on a cluster.

    Args:
        cores: that jobs may use together; None for all cores of the cluster.
        address: of a running cluster, "auto" or "HOST:PORT"; None starts one on this machine, which
            ends with this executor. conevo must be installed on all nodes.
        store: address of an object store, if the nodes do not see the campaign's directory.
        devices: of its jobs: "cpu", "cuda" for a GPU per task, or "auto", which is "cuda" if a node
            has a GPU.

    Raises:
        UsageError: Ray is not installed, a wrong address of the object store, or other devices.
        EnvironmentFailure: no cluster at the address, or it has no GPU.
    """

    def __init__(
        self,
        cores: int | None = None,
        address: str | None = None,
        store: str = "",
        devices: Sequence[str] = (CPU,),
    ) -> None:
        if not set(devices) <= {AUTO, CPU, "cuda"}:
            raise UsageError(
                f"--device {','.join(devices)}: with the executor ray it is auto, cpu or cuda; Ray "
                f"gives every task its own GPU"
            )
        os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
        try:
            self._ray: Any = import_module("ray")
        except ImportError as error:
            raise UsageError("executor 'ray' needs Ray: pip install 'conevo[ray]'") from error
        self._store = ObjectStore(store) if store else None
        self._tasks: dict[Any, RunJob] = {}  # by the reference of the exit code to come
        options: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
        if address is None:
            options |= {"num_cpus": cores or usable_cores(), "object_store_memory": MEMORY}
            options |= {"include_dashboard": False}
        try:
            self._ray.init(address or "local", **options)
            nodes = [int(n["Resources"].get("CPU", 0)) for n in self._ray.nodes() if n["Alive"]]
            if not any(nodes):
                raise RuntimeError("no node has CPU cores")
            self._has_gpus = bool(self._ray.cluster_resources().get("GPU"))
            if "cuda" in devices and not self._has_gpus:
                raise RuntimeError("no node has a GPU, for --device cuda")
        except Exception as error:  # Ray raises bare ones, as when a node is slow to start
            self._ray.shutdown()
            line = " ".join(str(error).split())
            raise EnvironmentFailure(f"Ray at {address or 'this machine'}: {line}") from error
        self._widest = max(nodes)
        self.cores = min(cores or sum(nodes), sum(nodes))

    def submit(self, job: RunJob) -> None:
        """Submit a task; it never asks for more cores than one node has."""
        threads = min(job.threads, self._widest)
        job = replace(job, root=job.root.resolve(), threads=threads)
        uri = ""
        if self._store is not None:
            uri = self._store.uri
            self._store.put_plan(job.root)
            if not self._store.has_run(job.label):
                self._store.put_run(job.root, job.label)
            self._store.forget_ending(job.root, job.label)
        gpus = {"num_gpus": 1} if job.device not in (None, CPU) and self._has_gpus else {}
        task = self._ray.remote(num_cpus=threads, max_retries=RETRIES, **gpus)(_carry)
        self._tasks[task.remote(str(job.root), job.label, threads, uri, job.device)] = job

    def wait(self, seconds: float) -> list[Ending]:
        """Return the workers that have left, after their files have been fetched."""
        waiting = list(self._tasks)
        if not waiting:
            return []
        self._ray.wait(waiting, num_returns=1, timeout=seconds)
        gone, _ = self._ray.wait(waiting, num_returns=len(waiting), timeout=0)
        return [self._end(task) for task in gone]

    def stop(self) -> None:
        """Cancel all tasks, wait until their workers have written their files, and disconnect."""
        try:
            for task in self._tasks:
                self._ray.cancel(task, force=False)
            for task in list(self._tasks):
                self._end(task)
        finally:
            self._ray.shutdown()

    def _end(self, task: Any) -> Ending:
        """Return how a task ended, after it has."""
        job = self._tasks[task]
        try:
            lost = why_lost(self._ray.get(task))
        except self._ray.exceptions.RayError as error:
            lost = f"lost by Ray: {' '.join(str(error).split())[:300]}"
        if self._store is not None:
            self._store.get_run(job.root, job.label)
        del self._tasks[task]
        return Ending(job.label, lost)


def _carry(root: str, label: str, threads: int, store: str, device: str | None = None) -> int:
    """Execute a run on the node where this is called; return the worker's exit code."""
    if not store:
        return _supervise(RunJob(Path(root), label, threads, device))
    copies = ObjectStore(store)
    with tempfile.TemporaryDirectory(prefix="conevo-") as folder:
        job = RunJob(Path(folder), label, threads, device)
        copies.get_plan(job.root)
        copies.get_run(job.root, label)
        Paths(job.root).ended(label).unlink(missing_ok=True)
        code = _supervise(job, copies)
        copies.put_run(job.root, label)
    return code


def _supervise(job: RunJob, copies: ObjectStore | None = None) -> int:
    """Spawn a worker and return its exit code; if the task is cancelled, the worker leaves.

    The worker also leaves when this process is killed: its stdin ends then.
    """
    # A shell's background jobs ignore interrupts; so would Ray's worker, which is cancelled by one.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    worker = spawn(job)
    try:
        copied = time.monotonic()
        while worker.poll() is None:
            time.sleep(0.05)  # Ray's cancelling does not interrupt wait()
            if copies is not None and time.monotonic() - copied > COPY_EVERY:
                with suppress(EnvironmentFailure):  # the last copy decides
                    copies.put_run(job.root, job.label)
                copied = time.monotonic()
    except KeyboardInterrupt:
        pass
    finally:
        if worker.stdin is not None:
            worker.stdin.close()
    return worker.wait()
