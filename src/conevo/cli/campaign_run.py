"""Execute a campaign and show its progress."""

from __future__ import annotations

import json
import sys
import time
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any

import click

from conevo.campaigns.campaign import Campaign
from conevo.campaigns.coordinator import Stopped
from conevo.campaigns.devices import CPU, devices_here, parse_devices
from conevo.campaigns.executors.protocol import Ending, Executor
from conevo.campaigns.executors.registry import make_executor
from conevo.campaigns.ledger import Entry
from conevo.campaigns.progress import remaining_seconds
from conevo.cli.campaign_text import counts, grid, heading, print_failed
from conevo.cli.run_to_end import drop_output, style_of
from conevo.errors import EnvironmentFailure, UsageError
from conevo.numbers import duration
from conevo.runs.time_limit import TimeLimit
from conevo.terms import counted, quoted

__all__ = ["Execution", "carry_on", "ready"]

FAILED = 1


@dataclass(frozen=True)
class Execution:
    """Where and how runs are executed, and how progress is reported."""

    executor: Executor
    threads: int
    devices: tuple[str, ...]
    style: str
    limit: TimeLimit | None


def ready(
    executor: str,
    cores: int | None,
    threads: int,
    device: str | None,
    limit: TimeLimit | None,
    as_json: bool,
    quiet: bool,
    address: str | None = None,
    store: str | None = None,
) -> Execution:
    """Return the execution that the options select, before anything is written.

    Raises:
        UsageError: incompatible options, an unknown executor or one not installed.
        EnvironmentFailure: no such device.
    """
    devices = parse_devices(device) if device else ()
    made = make_executor(executor, cores, address, store, devices)
    if executor != "ray":  # tasks of Ray may be on any machine
        devices = devices_here(devices)
    if threads > made.cores:
        raise UsageError(f"--threads {threads}: only {counted(made.cores, 'core')} to use")
    if executor == "serial":
        threads = made.cores  # only one run at a time
    return Execution(made, threads, devices, style_of(as_json, quiet, False), limit)


def carry_on(campaign: Campaign, execution: Execution) -> int:
    """Finish the missing runs, then print the next commands; returns the exit code."""
    view = View(campaign, execution)
    advice = f"conevo campaign start {quoted(campaign.path)}"
    if execution.devices not in ((), (CPU,)):
        advice += f" --device {','.join(execution.devices)}"
    try:
        with view.showing():
            entries = campaign.carry_on(
                execution.executor,
                threads=execution.threads,
                devices=execution.devices,
                watch=view.watch,
                time_limit=execution.limit,
            )
    except (KeyboardInterrupt, BrokenPipeError, Stopped) as error:
        if isinstance(error, BrokenPipeError):
            drop_output()
        word = str(error) if isinstance(error, Stopped) else "interrupted"
        done = counts(campaign.standings())
        click.echo(f"{word} with {done}; continue with: {advice}", err=True)
        if isinstance(error, Stopped) and execution.style == "quiet":
            click.echo(str(campaign.path))
        sys.exit(0 if isinstance(error, Stopped) else 130)
    except EnvironmentFailure as error:
        raise EnvironmentFailure(f"{error}; once fixed: {advice}") from error
    if execution.style == "quiet":
        click.echo(str(campaign.path))
    elif execution.style != "json":
        view.print_end(entries)
    return FAILED if any(entry.state == "failed" for entry in entries.values()) else 0


class View:
    """The display of a campaign while it is executed."""

    def __init__(self, campaign: Campaign, execution: Execution) -> None:
        self.campaign, self.execution = campaign, execution
        self.began = time.monotonic()
        self.live: Any = None
        self.looked = 0.0

    def showing(self) -> Any:
        """Return a context that shows the live table, if the style has one."""
        if self.execution.style == "plain":
            found = self.campaign
            click.echo(f"{heading(found.plan)}\n{found.path}")
            click.echo(f"{counted(len(found.planned), 'run')}, {counts(found.standings())}")
        if self.execution.style != "live":
            return nullcontext()
        from rich.live import Live

        self.live = Live(self.render(self.campaign.standings()), refresh_per_second=4)
        return self.live

    def watch(self, campaign: Campaign, ending: Ending | None) -> None:
        """Update the display; called after each ending, and now and then."""
        if ending is None and (self.live is None or time.monotonic() < self.looked + 1):
            return
        self.looked = time.monotonic()
        entries = {entry.label: entry for entry in campaign.ledger.entries()}
        if self.live is not None:
            self.live.update(self.render(entries))
        elif ending is not None and self.execution.style == "json":
            entry = entries[ending.label]
            place = str(campaign.paths.run(entry.label))
            about = {"run": entry.label, "state": entry.state, "reason": entry.reason}
            spent = {"core_seconds": entry.core_seconds, "path": place}
            click.echo(json.dumps(about | spent | self.progress(entries)))
        elif ending is not None and self.execution.style == "plain":
            entry = entries[ending.label]
            why = f": {entry.reason}" if entry.reason else ""
            click.echo(f"{entry.state} {entry.label}{why}  ({self.line(entries)})")

    def progress(self, entries: dict[str, Entry]) -> dict[str, Any]:
        """Return the numbers of finished and of all runs, and the seconds left, None if unknown."""
        done = sum(entry.state == "finished" for entry in entries.values())
        cores = self.execution.executor.cores
        left = remaining_seconds(self.campaign, entries, cores, time.time())
        left = None if left is None else round(left, 1)
        return {"finished": done, "of": len(self.campaign.planned), "seconds_left": left}

    def line(self, entries: dict[str, Entry]) -> str:
        """Return the number of finished runs and the time left as text."""
        found = self.progress(entries)
        left = found["seconds_left"]
        rest = "time left unknown" if left is None else f"about {duration(left)} left"
        return f"{found['finished']} of {found['of']} finished, {rest}"

    def render(self, entries: dict[str, Entry]) -> Any:
        """Return the live table of this moment."""
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table

        found = self.progress(entries)
        bar = Table.grid()
        bar.add_row(ProgressBar(total=found["of"], completed=found["finished"], width=60))
        head, rows = grid(self.campaign.planned.values(), entries)
        table = Table(*head, box=None, padding=(0, 2, 0, 0))
        for row in rows:
            table.add_row(*row)
        running = [entry.label for entry in entries.values() if entry.state == "running"]
        return Group(
            f"[bold]{heading(self.campaign.plan)}[/bold]\n{self.campaign.path}",
            bar,
            f"{self.line(entries)}, {duration(time.monotonic() - self.began)} so far",
            table,
            *(f"running: {label}" for label in running[:8]),
        )

    def print_end(self, entries: dict[str, Entry]) -> None:
        """Print the final state, and commands to use the results."""
        path = self.campaign.path
        click.echo(f"{counts(entries)}")
        failed = [entry for entry in entries.values() if entry.state == "failed"]
        print_failed(self.campaign, failed)
        if failed:
            click.echo(f"retry them:       conevo campaign retry {quoted(path)}")
        click.echo(f"write a report:   conevo report {quoted(path)}")
        click.echo(
            f"query its tables: conevo query {quoted(path)} "
            '"SELECT task, method, count(*) FROM runs GROUP BY ALL"'
        )
