"""Names as text."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["enumerated", "listed"]


def listed(words: Sequence[str]) -> str:
    """Return words in a row: "3", "3 and 7", "3, 7 and 8"."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def enumerated(name: str, robots: Sequence[int]) -> str:
    """Return robots by their numbers: "rover 3", "rovers 3 and 7"."""
    return f"{name}{'s' * (len(robots) != 1)} {listed([str(i) for i in robots])}"
