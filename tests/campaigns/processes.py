"""The processes that carry out a campaign's runs, and how far these have come."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from conevo.campaigns.campaign import Campaign


def workers(root: Path) -> dict[int, list[str]]:
    """Return the processes that carry out a run in a directory: number -> words of the command."""
    found = {}
    for place in Path("/proc").glob("[0-9]*"):
        try:
            words = (place / "cmdline").read_text().split("\0")[:-1]
        except OSError:  # gone since
            continue
        if "conevo.campaigns.worker" in words and str(root.resolve()) in words:
            found[int(place.name)] = words
    return found


def n_generations(campaign: Campaign, label: str) -> int:
    """Return how many generations a run has behind it, 0 if it has not begun."""
    path = campaign.paths.run(label) / "generations.jsonl"
    return path.read_bytes().count(b"\n") if path.is_file() else 0


def until(condition: Callable[[], Any], seconds: float = 90) -> Any:
    """Wait for a condition, and fail if it does not come about."""
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)
    return found
