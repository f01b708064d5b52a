"""Provenance of a campaign's results for its page: runs, cost, versions, machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from conevo.campaigns.campaign import Campaign
from conevo.runs.run import Run
from pages import Row, table

__all__ = ["made_with", "versions"]

PROVENANCE = {
    "conevo": "conevo", "kernel": "kernel_hash", "Warp": "warp", "numpy": "numpy",
    "Python": "python", "processor": "cpu",
}  # fmt: skip


def versions(campaign: Campaign) -> tuple[list[dict[str, Any]], int, dict[str, str]]:
    """Return the provenance of each finished run, the number of planned runs, and the versions."""
    standings = campaign.standings()
    done = [label for label, entry in standings.items() if entry.state == "finished"]
    about = [Run(campaign.paths.run(label)).provenance for label in done]
    each = {
        title: ", ".join(sorted({str(one[key]) for one in about}))
        for title, key in PROVENANCE.items()
    }
    return about, len(standings), each


def made_with(campaign: Campaign, rows: Sequence[Row]) -> str:
    """Return the provenance of the runs: seeds, budget, versions, machine, time."""
    about, planned, each = versions(campaign)
    worlds = sorted({one["world"]["name"] for one in about})
    seeds = sorted({int(row["seed"]) for row in rows})
    spent = [int(row["evaluations"]) for row in rows]
    lines = [
        ["runs finished, of those planned", f"{len(about)} of {planned}"],
        ["seeds", ", ".join(map(str, seeds))],
        ["team evaluations of a run", f"{min(spent):,} to {max(spent):,}"],
        ["team-steps", f"{sum(row['team_steps'] for row in rows) / 1e9:.2f} x 10^9"],
        ["core seconds, tests and studies too", f"{sum(row['core_seconds'] for row in rows):,.0f}"],
        ["worlds", ", ".join(worlds)],
        *map(list, each.items()),
    ]
    return table(["", ""], lines)
