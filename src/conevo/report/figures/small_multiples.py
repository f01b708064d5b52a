"""Many small panels with the same axes, drawn as one: frames, ticks and places by hand.

A page may have a hundred panels; real axes for each would take most of a report's time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

from conevo.numbers import short
from conevo.report.figures.lettering import LINE, SMALL
from conevo.typing import Floats

__all__ = ["Panels"]

GAP_X = 0.1  # between panels, in panels
TICK = 0.025
BLACK: dict[str, Any] = {"color": "black", "linewidth": 0.6, "clip_on": False}


class Panels:
    """Panels in rows and columns on one pair of axes without a frame.

    Attributes:
        axes: what to draw on, in places that ``at`` gives.
        x, y: limits of every panel.
        shape: width and height of a panel, in inches: so that ticks are as long both ways.
        gap_y: between rows, in panels: room for numbers and for the lines of titles.
    """

    def __init__(
        self,
        axes: Axes,
        rows: int,
        columns: int,
        x: tuple[float, float],
        y: tuple[float, float],
        shape: tuple[float, float],
        title_lines: int = 1,
    ) -> None:
        self.axes, self.x, self.y, self.shape = axes, x, y, shape
        self.gap_y = (0.12 + title_lines * LINE) / shape[1]
        axes.set_axis_off()
        axes.set_xlim(-0.02, columns * (1 + GAP_X) - GAP_X + 0.02)
        axes.set_ylim(-(rows - 1) * (1 + self.gap_y) - 0.02, 1.02)

    def corner(self, row: int, column: int) -> tuple[float, float]:
        """Return the place of a panel's lower left corner."""
        return column * (1 + GAP_X), -row * (1 + self.gap_y)

    def at(self, row: int, column: int, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Return the places of points of a panel."""
        left, foot = self.corner(row, column)
        across = (x - self.x[0]) / ((self.x[1] - self.x[0]) or 1.0)
        up = (y - self.y[0]) / ((self.y[1] - self.y[0]) or 1.0)
        return left + across, foot + up

    def title(self, row: int, column: int, text: str) -> None:
        """Write above a panel."""
        left, foot = self.corner(row, column)
        self.axes.text(left + 0.5, foot + 1.02, text, ha="center", va="bottom")

    def side(self, row: int, text: str) -> None:
        """Write left of a row."""
        foot = self.corner(row, 0)[1]
        self.axes.text(-0.04, foot + 0.5, text, ha="right", va="center")

    def frame(self, used: Sequence[tuple[int, int]], *, closed: bool) -> None:
        """Draw the axes of panels, or a frame around each if ``closed``."""
        corners = ((0, 1), (0, 0), (1, 0), (1, 1), (0, 1))[: 5 if closed else 3]
        x: list[float] = []
        y: list[float] = []
        for row, column in used:
            left, foot = self.corner(row, column)
            x += [*(left + dx for dx, _ in corners), np.nan]
            y += [*(foot + dy for _, dy in corners), np.nan]
        self.axes.plot(x, y, **BLACK, solid_joinstyle="miter")

    def ticks_below(
        self, used: Sequence[tuple[int, int]], values: Sequence[float], *, inside: bool = False
    ) -> None:
        """Mark values on the horizontal axes, and name them under the lowest panel of a column.

        With ``inside`` the names of both ends stay under their own panel.
        """
        long, ends = TICK / self.shape[1], dict(zip(self.x, ("left", "right"), strict=True))
        marks, foot = np.array(values, dtype=np.float64), np.full(len(values), self.y[0])
        x, y = np.hstack([self.at(row, column, marks, foot) for row, column in used])
        self.axes.vlines(x, y - long, y, **BLACK)
        for row, column in {column: (row, column) for row, column in sorted(used)}.values():
            for value, across, up in zip(values, *self.at(row, column, marks, foot), strict=True):
                side = ends.get(value, "center") if inside else "center"
                low = up - 1.6 * long
                self.axes.text(across, low, short(value), ha=side, va="top", fontsize=SMALL)

    def ticks_at_sides(self, used: Sequence[tuple[int, int]], values: Sequence[float]) -> None:
        """Mark values on the vertical axes, and name them left of the first column."""
        long = TICK / self.shape[0]
        marks, left = np.array(values, dtype=np.float64), np.full(len(values), self.x[0])
        x, y = np.hstack([self.at(row, column, left, marks) for row, column in used])
        self.axes.hlines(y, x - long, x, **BLACK)
        about: dict[str, Any] = {"ha": "right", "va": "center_baseline", "fontsize": SMALL}
        for row in {row for row, column in used if column == 0}:
            for value, across, up in zip(values, *self.at(row, 0, left, marks), strict=True):
                self.axes.text(across - 1.6 * long, up, short(value), **about)
