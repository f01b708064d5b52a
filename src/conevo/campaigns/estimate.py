"""The time until a campaign is finished, estimated from its finished runs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from statistics import fmean

from conevo.campaigns.campaign import Campaign
from conevo.campaigns.ledger import Entry
from conevo.campaigns.progress import progress_of

__all__ = ["remaining_seconds"]


def remaining_seconds(
    campaign: Campaign, entries: Mapping[str, Entry], cores: int, at: float
) -> float | None:
    """Return the seconds until the last run is finished; None if that cannot be estimated yet.

    A run is expected to take the mean core seconds of the finished runs of its cell, else of its
    world, else of all; while none is finished, of the running ones, judged by their progress.

    Args:
        campaign: that the runs are of.
        entries: their states.
        cores: that execute them together.
        at: the present time, seconds since 1970.
    """
    planned = campaign.planned
    spent = {k: one.core_seconds for k, one in entries.items() if one.state == "finished"}
    if not any(spent.values()):
        for label, entry in entries.items():
            if entry.state == "running" and (passed := _passed(entry, at)) > 0:
                share = progress_of(campaign.paths, planned[label]).share
                spent[label] = passed / share if share > 0 else 0.0
    known: dict[tuple[str, ...], list[float]] = defaultdict(list)
    for label, seconds in spent.items():
        for key in _keys(campaign, label) if seconds > 0 else ():
            known[key].append(seconds)
    left = 0.0
    for label, entry in entries.items():
        if label not in planned or entry.state not in ("pending", "running"):
            continue
        costs = next((known[key] for key in _keys(campaign, label) if key in known), None)
        if costs is None:
            return None
        passed = _passed(entry, at) if entry.state == "running" else 0.0
        left += max(fmean(costs) - passed, 0.0)
    longest = max((e.threads for e in entries.values() if e.state == "running"), default=1)
    return left / max(cores, longest, 1)


def _keys(campaign: Campaign, label: str) -> list[tuple[str, ...]]:
    """Return the groups of similar runs that a run belongs to, the most similar first."""
    run = campaign.planned[label]
    return [(run.world, run.method, run.variant), (run.world.partition("/")[0],), ()]


def _passed(entry: Entry, at: float) -> float:
    """Return the core seconds that an attempt has used."""
    return max(at - (entry.began or at), 0.0) * entry.threads
