"""Text in drawings, measured before it is drawn: broken into lines, shortened, turned.

Widths are those of the outlines that SVG and PDF contain, in inches.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

__all__ = [
    "FONT",
    "LINE",
    "SIZE",
    "SMALL",
    "Labels",
    "drawable",
    "fitted",
    "labels_of",
    "lines_in",
    "width_of",
]

FONT = "DejaVu Sans"
SIZE, SMALL = 7.5, 7.0  # points: of text, and of numbers along axes; journals ask for 7 at least
LINE = 1.2 * SIZE / 72  # inches from one line to the next
# A line may end after any of these, but not inside a number such as 1,000, 0.5, -2 or 1e-5.
BREAKS = re.compile(r"(?<=[\s_/=·])(?=\S)|(?<=[,.])(?=[^\s\d])|(?<=\w-)(?<!\de-)(?=\S)")


class Labels(NamedTuple):
    """Names along an axis: their text, and the angle they are turned by, in degrees."""

    texts: list[str]
    angle: float


@cache
def width_of(text: str, size: float = SIZE) -> float:
    """Return how wide the widest line of a text is."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(family=FONT, size=size)
    return max(
        (
            float(text_to_path.get_text_width_height_descent(line, font, ismath=False)[0]) / 72
            for line in text.split("\n")
            if line
        ),
        default=0.0,
    )


def lines_in(text: str) -> int:
    """Return the number of lines of a text."""
    return text.count("\n") + 1


@cache
def drawable(text: str) -> str:
    """Return a text with "?" for letters that the font does not have, and in one line."""
    known = _letters()
    return "".join(letter if ord(letter) in known else "?" for letter in " ".join(text.split()))


@cache
def fitted(text: str, width: float, lines: int = 3, size: float = SIZE) -> str:
    """Return a text in lines of at most ``width``, the last shortened with "…".

    It is broken after spaces and signs; a word that does not fit is cut.
    """
    rest = [word for word in BREAKS.split(drawable(text)) if word]
    made: list[str] = []
    while rest and len(made) < lines:
        line = rest.pop(0)
        while rest and width_of((line + rest[0]).rstrip(), size) <= width:
            line += rest.pop(0)
        made.append(line.rstrip())
    if rest:
        made[-1] += "…"
    return "\n".join(_cut(line, width, size) for line in made)


def labels_of(names: Sequence[str], slot: float, size: float = SIZE) -> Labels:
    """Return names for places along an axis, each ``slot`` wide: in lines, turned if they must be.

    All are turned if one of them does not fit whole in two lines.
    """
    room = 0.92 * slot
    level = [fitted(name, room, 2, size) for name in names]
    if all("…" not in text for text in level):
        return Labels(level, 0.0)
    return Labels([fitted(name, 1.2, 1, size) for name in names], 90.0 if slot < 0.3 else 30.0)


def _cut(line: str, width: float, size: float) -> str:
    """Return a line, shortened if it is too wide."""
    if width_of(line, size) <= width:
        return line
    letters = line.rstrip("…")
    while len(letters) > 1 and width_of(letters + "…", size) > width:
        letters = letters[:-1]
    return letters + "…"


@cache
def _letters() -> frozenset[int]:
    from matplotlib.font_manager import findfont, get_font

    return frozenset(get_font(findfont(FONT)).get_charmap())
