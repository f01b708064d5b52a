"""Colours that readers with any kind of colour vision can tell apart.

The eight of Okabe and Ito (2008), and lighter or darker forms of them for what belongs together:
hue says of which type something is, lightness what is done with it.
"""

from __future__ import annotations

__all__ = [
    "BLUE",
    "FAINT",
    "GREEN",
    "GROUND",
    "INK",
    "ORANGE",
    "PURPLE",
    "SKY",
    "VERMILION",
    "YELLOW",
    "several",
    "shade",
]

ORANGE, SKY, GREEN, YELLOW = "#e69f00", "#56b4e9", "#009e73", "#f0e442"
BLUE, VERMILION, PURPLE = "#0072b2", "#d55e00", "#cc79a7"
INK, FAINT, GROUND = "#1c1c22", "#9a9aa5", "#fbfaf7"  # text, what hardly matters, the world's floor

_ORDER = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION, YELLOW, INK)


def several(n: int) -> tuple[str, ...]:
    """Return n colours; from the ninth on darker forms of the first."""
    return tuple(shade(_ORDER[k % 8], -0.4 * (k // 8)) for k in range(n))


def shade(colour: str, by: float) -> str:
    """Return a colour lighter (by > 0, to white at 1) or darker (by < 0, to black at -1)."""
    goal = 255 if by > 0 else 0
    parts = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return "#" + "".join(f"{round(p + (goal - p) * min(abs(by), 1.0)):02x}" for p in parts)
