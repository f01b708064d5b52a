"""The protocol of executors. One only decides where runs are executed; ``worker`` executes them.

Results are files in the campaign's directory. An executor only reports that a worker has left.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from conevo.runs.time_limit import TimeLimit

__all__ = ["Ending", "Executor", "RunJob"]


@dataclass(frozen=True)
class RunJob:
    """One run to execute, with its number of threads and its device.

    Without a device it starts on the CPU, and continues on its previous one. ``limit`` is for an
    executor that runs in this process.
    """

    root: Path
    label: str
    threads: int
    device: str | None = None
    limit: TimeLimit = field(default_factory=lambda: TimeLimit(None), compare=False)


@dataclass(frozen=True)
class Ending:
    """A worker that has left.

    Attributes:
        label: of its run.
        lost: why it could not record how it ended ("killed by signal 9"); "" if it could.
    """

    label: str
    lost: str = ""


class Executor(Protocol):
    """Executes jobs.

    Attributes:
        cores: CPU cores that jobs may use together.
    """

    cores: int

    def submit(self, job: RunJob) -> None:
        """Start a job; only called when its cores are free."""

    def wait(self, seconds: float) -> list[Ending]:
        """Return the workers that have left; wait at most about this long for one."""

    def stop(self) -> None:
        """Let every worker write its checkpoint and leave; return when all have."""
