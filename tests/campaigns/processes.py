"""The processes that carry out a campaign's runs, and their progress."""

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
        except OSError:  # ended meanwhile
            continue
        if "conevo.campaigns.worker" in words and str(root.resolve()) in words:
            found[int(place.name)] = words
    return found


def n_generations(campaign: Campaign, label: str) -> int:
    """Return the number of finished generations of a run, 0 if it has not started."""
    path = campaign.paths.run(label) / "generations.jsonl"
    return path.read_bytes().count(b"\n") if path.is_file() else 0


def until(condition: Callable[[], Any], seconds: float = 90) -> Any:
    """Wait for a condition, and fail if it stays false."""
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, "the condition stayed false"
        time.sleep(0.02)
    return found
