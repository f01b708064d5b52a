"""The coordinator of a campaign: starts runs as cores become free, and records how they end."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from conevo.campaigns.devices import next_device
from conevo.campaigns.ended import read_ended
from conevo.campaigns.executors.protocol import Ending, Executor, RunJob
from conevo.runs.time_limit import TimeLimit

if TYPE_CHECKING:
    from conevo.campaigns.campaign import Campaign

__all__ = ["ATTEMPTS", "Coordinator", "Stopped", "Watch"]

ATTEMPTS = 3  # of a run whose worker is lost, or whose machine failed
SEAL_EVERY = 60.0  # seconds at least from one update of the tables to the next
LOOK = 0.25  # seconds between two looks at workers and the order to stop
Watch = Callable[["Campaign", "Ending | None"], None]


class Stopped(Exception):
    """The campaign was stopped by ``Campaign.stop``, or its time is over."""


@dataclass(frozen=True)
class Coordinator:
    """Carries out a campaign whose lock is held; the fields are as for ``Campaign.carry_on``."""

    campaign: Campaign
    executor: Executor
    threads: int
    devices: Sequence[str]
    watch: Watch | None
    limit: TimeLimit

    def carry_on(self) -> None:
        """Execute the pending runs.

        Raises:
            Stopped: as ``Campaign.carry_on``.
        """
        campaign, executor, limit = self.campaign, self.executor, self.limit
        waiting = deque(
            entry.label
            for entry in campaign.ledger.entries()
            if entry.state == "pending" and entry.label in campaign.planned
        )
        at_work: dict[str, RunJob] = {}
        next_seal = time.monotonic() + SEAL_EVERY
        while waiting or at_work:
            free = executor.cores - sum(job.threads for job in at_work.values())
            ready = self._ready(waiting, free) if waiting and free >= self.threads else deque()
            while ready and free >= self.threads:
                share = max(self.threads, free // len(ready))
                device = next_device(self.devices, (job.device for job in at_work.values()))
                job = RunJob(campaign.path, ready.popleft(), share, device, limit)
                waiting.remove(job.label)
                at_work[job.label] = job
                free -= share
                campaign.paths.ended(job.label).unlink(missing_ok=True)
                campaign.ledger.begin(job.label, share, time.time())
                executor.submit(job)
            if waiting and not at_work:
                time.sleep(LOOK)  # other processes have the runs that are left
            for ending in executor.wait(LOOK) if at_work else ():
                del at_work[ending.label]
                if limit.is_over and not (
                    campaign.paths.ended(ending.label).is_file() or ending.lost
                ):
                    waiting.appendleft(ending.label)  # it stopped in time
                    continue
                if self._settle(ending) == "pending":
                    waiting.appendleft(ending.label)
                if self.watch is not None:
                    self.watch(campaign, ending)
            if campaign.paths.stop.is_file():
                raise Stopped("stopped")
            if limit.is_over and (waiting or at_work):
                raise Stopped("time limit reached")
            if (began := time.monotonic()) >= next_seal:
                campaign.seal()
                ended = time.monotonic()
                next_seal = ended + max(SEAL_EVERY, 20 * (ended - began))
            if self.watch is not None:
                self.watch(campaign, None)

    def _ready(self, waiting: deque[str], most: int) -> deque[str]:
        """Return runs that no process has; those that others have finished leave the queue."""
        free: deque[str] = deque()
        for label in list(waiting):
            if len(free) == most:
                break
            if self.campaign.is_finished(label):
                waiting.remove(label)
                self.campaign.ledger.put([label], "finished", "found finished")
            elif not self.campaign.is_held(label):
                free.append(label)
        return free

    def _settle(self, ending: Ending) -> str:
        """Record how a worker ended, and return the state of its run."""
        label, paths, ledger = ending.label, self.campaign.paths, self.campaign.ledger
        attempts = 1 + next(e.attempts for e in ledger.entries() if e.label == label)
        if (ended := read_ended(paths.ended(label))) is None:
            lost = ending.lost or f"worker exited without reporting; see {paths.log(label)}"
            state = "pending" if attempts < ATTEMPTS else "failed"
            ledger.end(label, state, f"{lost} (attempt {attempts} of {ATTEMPTS})")
            return state
        state = str(ended["status"])
        if state == "failed" and ended["origin"] == "machine" and attempts < ATTEMPTS:
            state = "pending"
        ledger.end(label, state, ended["message"], ended["core_seconds"])
        return state
