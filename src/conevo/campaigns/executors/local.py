"""Executors on this machine, and the process that executes one run."""

from __future__ import annotations

import os
import subprocess
import sys
import time

from conevo.campaigns.executors.protocol import Ending, RunJob
from conevo.campaigns.paths import Paths
from conevo.campaigns.worker import carry_out, core_seconds

__all__ = ["ONE_THREAD", "Processes", "Serial", "spawn", "why_lost", "worker_command"]

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Serial:
    """One run after the other, in this process: for debugging."""

    def __init__(self, cores: int) -> None:
        self.cores = cores
        self._endings: list[Ending] = []

    def submit(self, job: RunJob) -> None:
        """Execute the job now; Ctrl-C reaches the run itself."""
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
        """Return the endings since the last call."""
        endings, self._endings = self._endings, []
        return endings

    def stop(self) -> None:
        """Do nothing: no worker outlives ``submit``."""


class Processes:
    """One spawned process per run, so that the failure of one does not affect others."""

    def __init__(self, cores: int) -> None:
        self.cores = cores
        self._workers: dict[str, subprocess.Popen[bytes]] = {}

    def submit(self, job: RunJob) -> None:
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


def spawn(job: RunJob) -> subprocess.Popen[bytes]:
    """Start a worker, which leaves when its stdin ends; its output goes to the run's log."""
    log = Paths(job.root).log(job.label)
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


def worker_command(job: RunJob) -> list[str]:
    """Return the command that executes a job."""
    arguments = [str(job.root.resolve()), job.label, str(job.threads)]
    arguments += [job.device] if job.device else []
    return [sys.executable, "-m", "conevo.campaigns.worker", *arguments]


def why_lost(code: int) -> str:
    """Return why a worker with this exit code could not record how it ended; "" if it could."""
    if code in (0, 1):
        return ""
    return f"killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
