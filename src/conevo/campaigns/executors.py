"""Where runs are carried out. An executor only decides that; what a run is, ``work`` knows.

Results are files in the campaign's directory. An executor reports that a worker is gone, never
what it found.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Protocol

from conevo.campaigns.devices import CPU, check_here
from conevo.campaigns.places import Places
from conevo.campaigns.work import carry_out, core_seconds
from conevo.errors import UsageError, unknown_name
from conevo.runs.time_limit import TimeLimit

__all__ = ["EXECUTORS", "Ending", "Executor", "Job", "make_executor", "usable_cores"]

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Job:
    """One run to carry out, on so many threads and, if it has not begun, on this device.

    ``limit`` is for an executor that is no other process.
    """

    root: Path
    label: str
    threads: int
    device: str = CPU
    limit: TimeLimit = field(default_factory=lambda: TimeLimit(None), compare=False)


@dataclass(frozen=True)
class Ending:
    """A worker that is gone.

    Attributes:
        label: of its run.
        lost: why it could not write down how it ended ("killed by signal 9"); "" if it could.
    """

    label: str
    lost: str = ""


class Executor(Protocol):
    """Carries out jobs.

    Attributes:
        name: as on the command line.
        cores: CPU cores that jobs may use together.
    """

    name: ClassVar[str]
    cores: int

    def submit(self, job: Job) -> None:
        """Begin a job; only called when the cores it asks for are free."""

    def wait(self, seconds: float) -> list[Ending]:
        """Return the workers that are gone, after at most about so long if there are none."""

    def stop(self) -> None:
        """Let every worker write its checkpoint and leave; return when all have."""


class Serial:
    """One run after the other, in this process: for debugging."""

    name: ClassVar[str] = "serial"

    def __init__(self, cores: int) -> None:
        self.cores = cores
        self._endings: list[Ending] = []

    def submit(self, job: Job) -> None:
        """Carry the job out now; Ctrl-C reaches the run itself."""
        carry_out(
            job.root,
            job.label,
            job.threads,
            device=job.device,
            limit=job.limit,
            spent_before=core_seconds(),
        )
        self._endings.append(Ending(job.label))

    def wait(self, seconds: float) -> list[Ending]:
        """Return what was carried out since the last call."""
        endings, self._endings = self._endings, []
        return endings

    def stop(self) -> None:
        """Do nothing: no worker outlives ``submit``."""


class Processes:
    """One spawned process per run: what befalls one run befalls no other."""

    name: ClassVar[str] = "processes"

    def __init__(self, cores: int) -> None:
        self.cores = cores
        self._workers: dict[str, subprocess.Popen[bytes]] = {}

    def submit(self, job: Job) -> None:
        """Spawn a worker; it leaves when this process does, since its stdin ends then."""
        self._workers[job.label] = spawn(job)

    def wait(self, seconds: float) -> list[Ending]:
        """Return the workers that have ended."""
        deadline = time.monotonic() + seconds
        while True:
            codes = {label: worker.poll() for label, worker in self._workers.items()}
            gone = {label: code for label, code in codes.items() if code is not None}
            if gone or time.monotonic() >= deadline:
                break
            time.sleep(min(0.02, max(0.0, deadline - time.monotonic())))
        for label in gone:
            self._close(label)
        return [Ending(label, why_lost(code)) for label, code in gone.items()]

    def stop(self) -> None:
        """End the workers' stdin, and wait for them."""
        for worker in self._workers.values():
            if worker.stdin is not None:
                worker.stdin.close()
        for label in list(self._workers):
            self._workers[label].wait()
            self._close(label)

    def _close(self, label: str) -> None:
        worker = self._workers.pop(label)
        if worker.stdin is not None and not worker.stdin.closed:
            worker.stdin.close()


def spawn(job: Job) -> subprocess.Popen[bytes]:
    """Begin a worker, which leaves when its stdin ends; what it says goes to the run's log."""
    log = Places(job.root).log(job.label)
    log.parent.mkdir(exist_ok=True)
    with log.open("ab") as file:
        return subprocess.Popen(
            worker_command(job),
            stdin=subprocess.PIPE,
            stdout=file,
            stderr=file,
            start_new_session=True,  # Ctrl-C is for the coordinator, which ends its workers
            env=os.environ | dict.fromkeys(ONE_THREAD, "1"),
        )


def worker_command(job: Job) -> list[str]:
    """Return the command that carries a job out."""
    arguments = [str(job.root.resolve()), job.label, str(job.threads)]
    arguments += [job.device] if job.device != CPU else []
    return [sys.executable, "-m", "conevo.campaigns.work", *arguments]


def why_lost(code: int) -> str:
    """Return what an exit code says of a worker that may not have written how it ended."""
    if code in (0, 1):
        return ""
    return f"killed by signal {-code}" if code < 0 else f"ended with exit code {code}"


def usable_cores() -> int:
    """Return the number of CPU cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


EXECUTORS = (Processes.name, Serial.name, "ray")


def make_executor(
    name: str,
    cores: int | None = None,
    address: str | None = None,
    store: str | None = None,
    devices: Sequence[str] = (CPU,),
) -> Executor:
    """Return an executor.

    Args:
        name: of ``EXECUTORS``.
        cores: that its jobs may use together; by default all usable ones, of a cluster all it has.
        address: of an existing Ray cluster, or "auto"; by default Ray is started here.
        store: address of an object store ("s3://BUCKET/PATH") for Ray's nodes, if they do not see
            the campaign's directory.
        devices: that its jobs will name.

    Raises:
        UsageError: there is no such executor, what it needs is not installed, it has no address, or
            devices that it does not choose among.
        EnvironmentFailure: it does not have such a device.
    """
    if name not in EXECUTORS:
        raise unknown_name("executor", name, EXECUTORS)
    if name == "ray":
        from conevo.campaigns.executors_ray import RayCluster

        return RayCluster(cores, address, store or "", devices)
    for option, value in (("--address", address), ("--store", store)):
        if value is not None:
            raise UsageError(f"{option} {value}: only the executor ray has one, not {name}")
    check_here(devices)
    kinds: dict[str, Callable[[int], Executor]] = {k.name: k for k in (Serial, Processes)}
    return kinds[name](cores or usable_cores())
