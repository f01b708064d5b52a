"""A worker: one process that executes one run."""

from __future__ import annotations

import os
import subprocess
import sys

from conevo.campaigns.executors.protocol import RunJob
from conevo.campaigns.paths import Paths

__all__ = ["ONE_THREAD", "spawn", "why_lost", "worker_command"]

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


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
