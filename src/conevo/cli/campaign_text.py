"""Campaigns as text: experiments, plans, states of runs."""

from __future__ import annotations

import dataclasses
import json
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click

from conevo.campaigns.campaign import CAMPAIGNS, Campaign
from conevo.campaigns.ledger import Entry
from conevo.campaigns.plan import Plan, PlannedRun
from conevo.campaigns.plan_file import preset_names, read_preset
from conevo.campaigns.progress import (
    cell_text,
    cells,
    last_written,
    progress_of,
    remaining_seconds,
)
from conevo.cli.format import progress, table
from conevo.cli.lookup import directories
from conevo.errors import ConevoError
from conevo.kernels.threads import usable_cores
from conevo.numbers import duration
from conevo.terms import counted

__all__ = [
    "campaigns_here",
    "counts",
    "experiments",
    "grid",
    "heading",
    "print_lists",
    "print_failed",
    "print_plan",
    "print_status",
]

SHOWN = ("finished", "running", "pending", "interrupted", "failed")  # in the live page's order

Rows = list[dict[str, Any]]


def experiments() -> Rows:
    """Return the plans that come with conevo."""
    plans = [read_preset(name) for name in preset_names()]
    return [
        {"name": p.name, "runs": p.n_runs, "title": p.title, "produces": list(p.produces)}
        for p in plans
    ]


def campaigns_here() -> Rows:
    """Return the campaigns in campaigns/."""
    rows: Rows = []
    for path in directories(CAMPAIGNS, "campaign"):
        try:
            found = Campaign(path)
            stands = counts(found.standings())
            rows.append({"campaign": str(path), "preset": found.plan.preset, "runs": stands})
        except ConevoError as error:
            rows.append({"campaign": str(path), "preset": "", "runs": f"damaged: {error}"})
    return rows


def print_lists(experiments: Rows, campaigns: Rows) -> None:
    """Print both lists."""
    rows = [
        [row["name"], str(row["runs"]), row["title"], "; ".join(row["produces"])]
        for row in experiments
    ]
    click.echo(table(["experiment", "runs", "what", "of the thesis"], rows))
    click.echo("\nstart one: conevo campaign start NAME [--preset smoke] [--seeds N]\n")
    if campaigns:
        click.echo(table(list(campaigns[0]), [[*row.values()] for row in campaigns]))
    else:
        click.echo(f"no campaigns in {CAMPAIGNS}/ yet")


def print_plan(runs: Iterable[PlannedRun], as_json: bool) -> None:
    """Print every run of a plan."""
    if as_json:
        for run in runs:
            click.echo(json.dumps({"run": run.label, "run_ids": run.run_ids, **run.overrides}))
        return
    rows = [[run.label, run.preset, " ".join(run.run_ids)] for run in runs]
    click.echo(table(["run", "preset", "run id"], rows))


def print_status(campaign: Campaign, with_runs: bool, as_json: bool) -> bool:
    """Print the state of a campaign; returns whether runs have failed."""
    standings = campaign.standings()
    entries = {
        label: dataclasses.replace(entry, state="interrupted")
        if entry.state == "pending" and last_written(campaign.paths, label) is not None
        else entry
        for label, entry in standings.items()
    }  # as on the live page: a run that has a generation is not pending
    failed = [entry for entry in entries.values() if entry.state == "failed"]
    left = None
    if campaign.is_running:
        left = remaining_seconds(campaign, standings, usable_cores(), time.time())
    if as_json:
        rows = [
            {"run": e.label, "state": e.state, "attempts": e.attempts, "reason": e.reason}
            | _how_far(campaign, e)
            for e in entries.values()
        ]
        about = {"campaign": str(campaign.path), "running": campaign.is_running}
        click.echo(json.dumps(about | {"seconds_left": left, "runs": rows}))
        return bool(failed)
    click.echo(heading(campaign.plan))
    rest = f", about {duration(left)} left" if left is not None else ""
    click.echo(f"{campaign.path}: {_whose(campaign, entries)}, {counts(entries)}{rest}")
    if sign := _sign_of_life(campaign, entries):
        click.echo(sign)
    click.echo()
    if with_runs:
        rows_of = [
            [e.label, e.state, *_progress(campaign, e), str(e.attempts), e.reason]
            for e in entries.values()
        ]
        click.echo(table(["run", "state", "done", "last written", "attempts", "reason"], rows_of))
    else:
        head, cells = grid(campaign.planned.values(), entries)
        click.echo(table(head, cells))
    print_failed(campaign, failed)
    return bool(failed)


def print_failed(campaign: Campaign, failed: Iterable[Entry]) -> None:
    """Print why runs failed, and how to use a corrected file of their world."""
    files = set()
    for entry in failed:
        click.echo(f"failed {entry.label}: {entry.reason}")
        file, _, _ = campaign.planned[entry.label].world.rpartition(":")
        files |= {Path(file).name} if file else set()
    for file in sorted(files):
        click.echo(
            f"the campaign keeps its copy of {file}: once yours is corrected, start another "
            f"campaign with --out DIR"
        )


def _whose(campaign: Campaign, entries: Mapping[str, Entry]) -> str:
    """Return whether the campaign is running, and with a coordinator, as far as files show it."""
    if campaign.is_running:
        return "running"
    if any(entry.state == "running" for entry in entries.values()):
        return "running without a coordinator"
    return "not running"


def _sign_of_life(campaign: Campaign, entries: Mapping[str, Entry]) -> str:
    """Return when an unfinished run was last written, by any process on any machine."""
    labels = [e.label for e in entries.values() if e.state in ("pending", "interrupted", "running")]
    at = max(filter(None, (last_written(campaign.paths, label) for label in labels)), default=None)
    return "" if at is None else f"last generation written {_ago(at)}"


def _ago(at: float) -> str:
    return f"{duration(max(time.time() - at, 0.0))} ago"


def _progress(campaign: Campaign, entry: Entry) -> tuple[str, str]:
    """Return a run's progress and the time since it was last written, for a table."""
    found = progress_of(campaign.paths, campaign.planned[entry.label])
    if found.written is None:
        return "", ""
    done = counted(found.generations, "generation")
    if entry.state == "finished":
        return done, ""
    if found.of:
        done = progress(found.generations, found.of, found.evaluations, found.budget)
    return done, _ago(found.written)


def _how_far(campaign: Campaign, entry: Entry) -> dict[str, Any]:
    """Return a run's progress as JSON has it."""
    found = progress_of(campaign.paths, campaign.planned[entry.label])
    return {
        "generations": found.generations,
        "generations_planned": found.of,
        "evaluations": found.evaluations,
        "budget": found.budget,
        "written": found.written,
    }


def heading(plan: Plan) -> str:
    """Return a plan's title and preset."""
    return f"{plan.title or plan.name} (preset {plan.preset})"


def counts(entries: Mapping[str, Entry]) -> str:
    """Return the number of runs in each state: "12 finished, 2 running, 76 pending"."""
    found = Counter(entry.state for entry in entries.values())
    return ", ".join(f"{found[state]} {state}" for state in SHOWN if found[state])


def grid(
    planned: Iterable[PlannedRun], entries: Mapping[str, Entry]
) -> tuple[list[str], list[list[str]]]:
    """Return a table of finished runs: a row per environment and variant, a column per method."""
    rows = cells(planned, entries)
    methods = list(dict.fromkeys(method for row in rows.values() for method in row))
    lines = [[name, *(cell_text(row.get(m, [])) for m in methods)] for name, row in rows.items()]
    return ["finished", *methods], lines
