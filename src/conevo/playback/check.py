"""Checks that a playback's parts fit together, and the error for a damaged recording.

Numbers, names and texts of a file are checked once, where it is loaded
(``conevo.replay.trajectory``); every channel where it is read (``conevo.playback.reading``).
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

from conevo.errors import UsageError
from conevo.playback.schema import Playback

__all__ = ["DAMAGE", "DAMAGED", "MOST_EVENTS", "checked", "one_line", "refusal"]

MOST_EVENTS = 5_000
# Errors that damaged numbers and names cause.
DAMAGE = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
DAMAGED = "the trajectory is damaged: "


def checked(playback: Playback) -> Playback:
    """Return a playback after checking its parts, with its events in order of time.

    Choice: of more than 5,000 events the rarest kinds are kept, and the first ones of the kind that
    no longer fits; a fact reports it.

    Raises:
        ValueError: some parts do not fit together.
    """
    x0, y0, x1, y1 = playback.bounds
    if not (all(map(math.isfinite, playback.bounds)) and x0 < x1 and y0 < y1):
        raise ValueError(f"bounds {playback.bounds}")
    n = playback.sensors.codes.shape[2] if playback.sensors is not None else 0
    for group in playback.sensor_groups:
        if group.first + group.count > n:
            raise ValueError(f"{group.name} are {group.first + group.count} of {n} sensors")
    n = playback.hidden.codes.shape[2] if playback.hidden is not None else math.inf
    for robot in playback.robots:
        if not (robot.heuristic or all(0 <= slot < n for slot in robot.neurons)):
            raise ValueError(f"neurons {robot.neurons} of {n} in a hidden layer")
    for part in playback.backdrop:
        if part.cells is not None and not part.cells.codes.size:
            raise ValueError(f"{part.label} without cells")
    events = sorted(playback.events, key=lambda event: (event.t, event.kind))
    if len(events) <= MOST_EVENTS:
        return replace(playback, events=tuple(events))
    counts = Counter(event.kind for event in events)
    by_rarity = sorted(events, key=lambda event: (counts[event.kind], event.kind))
    shown = sorted(by_rarity[:MOST_EVENTS], key=lambda event: (event.t, event.kind))
    note = ("events", f"{MOST_EVENTS:,} of {len(events):,} shown, the rarest kinds first")
    return replace(playback, events=tuple(shown), facts=(*playback.facts, note))


def refusal(error: Exception) -> UsageError:
    """Return the error for a damaged trajectory: one line with the reason."""
    return UsageError(DAMAGED + one_line(str(error) or type(error).__name__))


def one_line(text: str) -> str:
    """Return the beginning of a text, which may be from a damaged file, as one printable line."""
    return "".join(c if c.isprintable() else " " for c in text[:200])
