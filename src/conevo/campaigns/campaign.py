"""A campaign on disk.

::

    plan.toml             the plan, resolved: scale, seeds and all settings
    inputs/               copies of the files that it names: of worlds and prey
    runs.jsonl            every run of the plan, written before anything starts
    code.json             the versions of the code that may continue it
    ledger.sqlite         the state of every run; written by the coordinator only
    runs/LABEL/           the runs, each like any other; or shapings
    studies/LABEL.json    the study of a finished run's fittest team
    studies/signal/       the signal of its populations, as LABEL.json
    ended/LABEL.json      how the last worker of a run ended
    logs/LABEL.txt        output of its workers
    tables/*.parquet      read by reports, made of all finished runs
    lock                  held (flock) by the coordinator

Runs, not the ledger, are the truth: after any kill, starting the campaign again finishes what is
missing, and a finished run is never executed twice.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from conevo.campaigns.admission import admit_code
from conevo.campaigns.coordinator import Coordinator, Watch
from conevo.campaigns.ended import read_ended
from conevo.campaigns.executors.protocol import Executor
from conevo.campaigns.extension import check_plan, settle, texts_of
from conevo.campaigns.inputs import located
from conevo.campaigns.ledger import Entry, Ledger
from conevo.campaigns.paths import Paths
from conevo.campaigns.plan import Plan, PlannedRun
from conevo.campaigns.plan_file import read_plan
from conevo.campaigns.worker import planned_runs
from conevo.errors import UsageError, unknown_name
from conevo.evolution.methods.registry import resolve as resolve_method
from conevo.reading import read_json
from conevo.runs import locks
from conevo.runs.directory import LOCK, Directory, appearing, as_json
from conevo.runs.durable import is_there, replace_file
from conevo.runs.time_limit import TimeLimit
from conevo.terms import quoted
from conevo.worlds.registry import resolve as resolve_world

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["CAMPAIGNS", "Campaign", "check", "create"]

CAMPAIGNS = Path("campaigns")  # default folder, of new campaigns and for names


def check(plan: Plan, path: Path) -> list[PlannedRun]:
    """Return the runs of a plan, if ``create`` can write it out; write nothing.

    Raises:
        UsageError: an impossible run, or ``path`` has a campaign that this plan does not extend.
    """
    runs = plan.write_out()
    if is_there(Paths(path).plan):
        check_plan(Campaign(path), {run.label: run for run in runs})
    return runs


def create(plan: Plan, path: Path, accept_other_code: bool = False) -> Campaign:
    """Write a campaign; nothing is started.

    An existing campaign is extended, if the plan has all its runs, as long or longer, and perhaps
    more.

    Args:
        plan: its runs.
        path: its directory.
        accept_other_code: extend a campaign although other code has begun it.

    Raises:
        UsageError: an impossible run, a world whose kernel cannot be built, ``path`` has other
            contents, or other code has begun the campaign there; nothing was written.
        EnvironmentFailure: it cannot be written.
    """
    plan = plan.mapped(lambda value: located(value, Path.cwd()))
    runs = check(plan, path)
    _build_worlds(runs)
    if not is_there(Paths(path).plan):
        with appearing(path) as draft:
            paths, texts = Paths(draft), texts_of(plan, runs, draft)
            replace_file(paths.plan, texts["plan"].encode())
            replace_file(paths.runs, texts["runs"].encode())
        return Campaign(path)
    campaign = Campaign(path)
    with campaign.locked():
        campaign.settle()
        check_plan(campaign, {run.label: run for run in runs})
        campaign.admit_code(accept_other_code)
        replace_file(campaign.paths.extension, as_json(texts_of(plan, runs, campaign.path)))
        campaign.settle()  # the new plan replaces the old one in one step
    return campaign


def _build_worlds(runs: Iterable[PlannedRun]) -> None:
    """Build the kernels of all worlds, once for all runs, before any of them starts.

    Raises:
        UsageError: a mistake in a user's world, such as an index outside its array.
        EnvironmentFailure: compiled kernels cannot be written.
    """
    from conevo.controllers.registry import controller
    from conevo.runs.settings import controller_of
    from conevo.worlds.checking import refuse_wild_indices
    from conevo.worlds.simulators import simulator

    chosen = {
        (r.world, str(r.overrides.get("controller.name", controller_of(resolve_method(r.method)))))
        for r in runs
    }
    for address, name in sorted(chosen):
        entry, environment = resolve_world(address)
        built = entry.build(environment, entry.params(environment))
        simulator(built, controller(name, world=built))
        refuse_wild_indices(entry, environment, built.params)


class Campaign:
    """A campaign on disk, finished or not.

    Args:
        path: its directory.

    Raises:
        UsageError: ``path`` is not a campaign, or it is damaged.
    """

    def __init__(self, path: str | Path) -> None:
        self._directory = Directory(Path(path), "campaign")
        self.path = self._directory.path
        self.paths = Paths(self.path)
        self._load()
        self.ledger = Ledger(self.paths.ledger)
        self.locked = self._directory.locked

    def _load(self) -> None:
        self.plan: Plan = read_plan(self.paths.plan)
        self.planned: dict[str, PlannedRun] = planned_runs(self.path)
        self._shorter: set[str] | None = None  # runs found with another length than planned

    def settle(self) -> None:
        """Put in place a new plan that a killed process has left; the lock is held."""
        settle(self.paths)
        self._load()

    def __repr__(self) -> str:
        return f"Campaign({str(self.path)!r})"

    def _repr_html_(self) -> str:
        from conevo.campaigns.html import campaign_card

        return campaign_card(self)

    def frame(self, table: str = "runs") -> DataFrame:
        """Return a table of the finished runs, one of ``SCHEMA``, as a pandas DataFrame.

        Raises:
            UsageError: no such table, or every run is damaged.
            EnvironmentFailure: pandas is not installed, or tables cannot be made anywhere.
        """
        from conevo.campaigns.schema import SCHEMA

        if table not in SCHEMA:
            raise unknown_name("table", table, SCHEMA, "of a campaign")
        return self.query(f"SELECT * FROM {table}")

    def query(self, sql: str) -> DataFrame:
        """Return the result of one SQL query of these tables as a pandas DataFrame.

        Raises:
            UsageError: not a query, DuckDB's reason for refusing it, or every run is damaged.
            EnvironmentFailure: as ``frame``.
        """
        from conevo.campaigns.sealing import sealed_tables
        from conevo.campaigns.tables import Tables

        with sealed_tables(self) as folder, Tables(folder, may_be_empty=True) as tables:
            return tables.frame(sql)

    @property
    def is_running(self) -> bool:
        """Whether a coordinator is running."""
        return self._directory.is_in_use

    def is_finished(self, label: str) -> bool:
        """Whether a run is sealed, has the planned length, and is studied."""
        if not ((self.paths.run(label) / "DONE").is_file() and self._is_studied(label)):
            return False
        if self._shorter is None:
            self._shorter = {one for one in self.planned if self._is_shorter(one)}
        return label not in self._shorter or not self._is_shorter(label)

    def _is_shorter(self, label: str) -> bool:
        """Whether a sealed run has another length than in the plan, which was extended since."""
        planned, path = self.planned[label], self.paths.run(label)
        if planned.in_stages or not (path / "DONE").is_file():
            return False
        return read_json(path / "provenance.json").get("run_id") != planned.run_ids[0]

    def _is_studied(self, label: str) -> bool:
        planned = self.planned[label]
        return all(
            self.paths.study(name, kind).is_file()
            for name in planned.courses
            for kind in planned.studies
        )

    def standings(self) -> dict[str, Entry]:
        """Return the state of every run, in the order of the plan; write nothing.

        A run is running if a coordinator that is running has started it, or if any process holds
        its lock: a SLURM task or a ``conevo resume``. It has failed according to the ledger, or to
        the ``ended`` file of a worker without a coordinator.
        """
        known = {entry.label: entry for entry in self.ledger.entries()}
        is_coordinated = self.is_running
        found = {}
        for label in self.planned:
            entry = known.get(label, Entry(label))
            if self.is_finished(label):
                entry = dataclasses.replace(entry, state="finished")
            elif self.is_held(label):
                entry = dataclasses.replace(entry, state="running")
            elif entry.state == "finished" or (entry.state == "running" and not is_coordinated):
                entry = dataclasses.replace(entry, state="pending")
            if entry.state == "pending" and entry.attempts == 0:
                ended = read_ended(self.paths.ended(label))  # without a coordinator
                if ended is not None and ended["status"] == "failed":
                    entry = dataclasses.replace(entry, state="failed", reason=ended["message"])
            found[label] = entry
        return found

    def is_held(self, label: str) -> bool:
        """Whether a process, as far as this machine knows, holds a run."""
        return locks.is_held(self.paths.run(label) / LOCK)

    def admit_code(self, accept: bool = False) -> None:
        """Let this version of conevo continue the campaign; see ``admission``.

        Raises:
            UsageError: other code has begun it, and this one is not accepted.
        """
        admit_code(self.paths, self.planned, accept)

    def stop(self) -> None:
        """Ask the coordinator to stop: its workers write their checkpoints and leave.

        Raises:
            UsageError: none is running.
        """
        if not self.is_running:
            raise UsageError(
                f"{self.path} is not running; see 'conevo campaign status {quoted(self.path)}'"
            )
        replace_file(self.paths.stop, b"")

    def retry(self) -> list[str]:
        """Make failed runs pending again, and return their labels.

        Raises:
            UsageError: a coordinator is running.
        """
        with self.locked():
            self.settle()
            self._reconcile()
            failed = [label for label, one in self.standings().items() if one.state == "failed"]
            for label in failed:
                self.paths.ended(label).unlink(missing_ok=True)
            self.ledger.put(failed, "pending", "to be tried again")
        return failed

    def carry_on(
        self,
        executor: Executor,
        *,
        threads: int = 1,
        devices: Sequence[str] = (),
        watch: Watch | None = None,
        time_limit: float | TimeLimit | None = None,
    ) -> dict[str, Entry]:
        """Finish the missing runs, and make the tables of all finished ones.

        A failed run is recorded and does not end the campaign. The last runs get the cores that no
        pending run needs.

        Args:
            executor: of the runs.
            threads: CPU threads of a run, at most the executor's cores.
            devices: for runs in turn, begun or not; the executor must have them. By default runs
                start on the CPU, and continue on their previous device.
            watch: called with the campaign and each ending, and with None between endings.
            time_limit: seconds after which it stops, as by ``stop``.

        Raises:
            UsageError: another coordinator is running, or other code has begun the campaign.
            EnvironmentFailure: compiled kernels or the campaign's files cannot be written.
            Stopped: by ``stop``, or the time is over; the campaign can be continued.
        """
        limit = time_limit if isinstance(time_limit, TimeLimit) else TimeLimit(time_limit)
        with self.locked():
            self.settle()
            self.admit_code()
            left = [run for label, run in self.planned.items() if not self.is_finished(label)]
            with suppress(UsageError):  # of a world: its runs record it
                _build_worlds(left)
            self.paths.stop.unlink(missing_ok=True)
            self._reconcile()
            try:
                least = min(threads, executor.cores)
                Coordinator(self, executor, least, devices, watch, limit).carry_on()
            finally:
                executor.stop()
                self.ledger.release()
                self._reconcile()
                self.paths.stop.unlink(missing_ok=True)
            self.seal()
        return self.standings()

    @property
    def finished(self) -> list[PlannedRun]:
        """The finished runs, in the order of the plan."""
        return [run for label, run in self.planned.items() if self.is_finished(label)]

    def seal(self, into: Path | None = None) -> None:
        """Make the tables of all finished runs, unless they are up to date.

        Args:
            into: a folder to make them in, if not the campaign's own.
        """
        if finished := self.finished:
            from conevo.campaigns.sealing import seal_tables  # loads numpy

            spent = {entry.label: entry.core_seconds for entry in self.ledger.entries()}
            seal_tables(self.paths, finished, spent, into)

    def _reconcile(self) -> None:
        """Update the ledger from the runs' directories."""
        self.ledger.enrol(self.planned)
        self.ledger.release()
        entries = {entry.label: entry.state for entry in self.ledger.entries()}
        done = {label for label in self.planned if self.is_finished(label)}
        was = {label for label, state in entries.items() if state == "finished"}
        self.ledger.put(sorted(done - was), "finished", "found finished")
        self.ledger.put(sorted((was & set(self.planned)) - done), "pending", "found unfinished")
