"""A campaign in notebooks: the states of its runs, a bar for each cell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from conevo.campaigns.ledger import STATES, Entry
from conevo.campaigns.progress import cell_text, cells, progress_of
from conevo.palette import GREEN, ORANGE, VERMILION
from conevo.runs.html import bar, card, escape, table

if TYPE_CHECKING:
    from conevo.campaigns.campaign import Campaign

__all__ = ["campaign_card"]


FAILURES = 10  # failed runs whose reason is shown


def campaign_card(campaign: Campaign) -> str:
    """Return a table of finished runs: a row per environment and variant, a column per method.

    A bar is green for finished runs, orange for the part of running ones that is over, and red for
    failed ones.
    """
    plan = campaign.plan
    about = [f"preset {plan.preset}", "running" if campaign.is_running else "not running"]

    def parts() -> Iterable[str]:
        entries = campaign.standings()
        found = Counter(entry.state for entry in entries.values())
        yield f"<p>{', '.join(f'{found[state]} {state}' for state in STATES if found[state])}</p>"
        rows = cells(campaign.planned.values(), entries)
        methods = list(dict.fromkeys(method for row in rows.values() for method in row))
        yield table(
            ["finished", *methods],
            (
                [escape(name), *(_cell(campaign, row.get(m, ())) for m in methods)]
                for name, row in rows.items()
            ),
        )
        failed = [entry for entry in entries.values() if entry.state == "failed"]
        for entry in failed[:FAILURES]:
            yield f"<p>failed {escape(entry.label)}: {escape(entry.reason)}</p>"

    return card(plan.title or plan.name, [*about, str(campaign.path)], parts)


def _cell(campaign: Campaign, entries: Sequence[Entry]) -> str:
    """Return a bar, and the text of ``cell_text``."""
    text = cell_text(entries)
    if not entries:
        return text
    n, found = len(entries), Counter(entry.state for entry in entries)
    begun = [
        progress_of(campaign.paths, campaign.planned[entry.label]).share
        for entry in entries
        if entry.state == "running"
    ]
    finished, failed = (found[state] / n for state in ("finished", "failed"))
    return f"{bar((finished, GREEN), (sum(begun) / n, ORANGE), (failed, VERMILION))} {text}"
