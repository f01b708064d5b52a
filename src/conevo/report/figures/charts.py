"""Drawings of results: bars with deviations, and every run as a point.

Drawings are readable in grey, and the same bytes for the same numbers. Every method has one colour,
hatch, line and marker in all drawings; colours differ in lightness. Each function returns
the drawing as SVG and as PDF.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from conevo.palette import method_looks
from conevo.report.figures.lettering import LINE, SIZE, fitted, lines_in
from conevo.report.figures.style import (
    EVERYTHING,
    HATCHES,
    HEIGHT,
    MARKERS,
    WIDTH,
    Drawing,
    is_dark,
    legend_height,
    legend_of,
    mark_places,
    marker_size,
    name_axes,
    put_legend,
    saved,
    several_panels,
    spread_of,
    style,
    width_for,
)
from conevo.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Bar", "Drawing", "Points", "bars", "points"]

SLOT = 0.5  # inches: most that one method takes of an axis


class Bar(NamedTuple):
    """Mean and standard deviation of a cell; None: not drawn."""

    height: float | None
    deviation: float | None


class Points(NamedTuple):
    """The runs of a cell, and their mean with the ends of its interval, if it has one."""

    values: Sequence[float]
    interval: tuple[float, float, float] | None


def bars(
    panels: Mapping[str, Mapping[str, Sequence[Bar | None]]],
    places: Sequence[str],
    names: Mapping[str, str],
    *,
    x_label: str,
    y_label: str,
    within: tuple[float, float] = EVERYTHING,
) -> Drawing:
    """Draw a group of bars per place, with a deviation on each: the form of the thesis.

    Bars begin at zero, upward and downward.

    Args:
        panels: title of each panel -> method -> P bars; None: no runs.
        places: P names under the groups.
        names: method -> its name in the legend.
        x_label: under the axes.
        y_label: left of the axes.
        within: lowest and highest possible value; deviations end there.
    """
    with style():
        figure, grid, slot = _panels_of(list(panels), places, names)
        looks = method_looks(names)
        width = 0.84 / len(names)
        ends = [0.0]
        signs = {}
        for axes, of in zip(grid, panels.values(), strict=True):
            for k, (method, cells) in enumerate(of.items()):
                look = looks[method]
                known = [(p, one) for p, one in enumerate(cells) if one and one.height is not None]
                if not known:
                    continue
                y, spread = np.array([one for _, one in known], dtype=np.float64).T  # NaN for None
                x = np.array([p for p, _ in known]) + (k - (len(names) - 1) / 2) * width
                signs[method] = axes.bar(
                    x,
                    y,
                    width,
                    color=look.area,
                    hatch=HATCHES[look.number % len(HATCHES)],
                    edgecolor="white" if is_dark(look.area) else "black",
                    linewidth=0.4,
                )
                ends += [*y, *_whiskers(axes, x, y, y - spread, y + spread, within, width)]
            axes.axhline(0, color="black", linewidth=0.6)
        _bound(grid, ends)
        _finish(figure, grid, places, names, signs, (x_label, y_label), slot)
        return saved(figure)


def points(
    panels: Mapping[str, Mapping[str, Sequence[Points | None]]],
    places: Sequence[str],
    names: Mapping[str, str],
    *,
    x_label: str,
    y_label: str,
    reference: float | None = None,
    within: tuple[float, float] = EVERYTHING,
) -> Drawing:
    """Draw every run as a point, and next to the runs of a cell their mean with its interval.

    Args:
        panels: title of each panel -> method -> P cells; None: no runs.
        places: P names.
        names: method -> its name in the legend.
        x_label: under the axes.
        y_label: left of the axes.
        reference: a height with a line across.
        within: lowest and highest possible value; intervals end there.
    """
    with style():
        figure, grid, slot = _panels_of(list(panels), places, names)
        looks = method_looks(names)
        width = 0.86 / len(names)
        ends = [] if reference is None else [reference]
        signs = {}
        for axes, of in zip(grid, panels.values(), strict=True):
            if reference is not None:
                axes.axhline(
                    reference, color="0.55", linewidth=0.7, linestyle=(0, (4, 3)), zorder=0
                )
            for place in range(1, len(places)):
                axes.axvline(place - 0.5, color="0.85", linewidth=0.6, zorder=0)
            for k, (method, cells) in enumerate(of.items()):
                look = looks[method]
                left = (k - len(names) / 2) * width
                x = [
                    place + left + width * (0.12 + 0.5 * spread_of(i, len(cell.values)))
                    for place, cell in enumerate(cells)
                    if cell
                    for i in range(len(cell.values))
                ]
                y = [value for cell in cells if cell for value in cell.values]
                if not y:
                    continue
                (signs[method],) = axes.plot(
                    x,
                    y,
                    linestyle="none",
                    marker=MARKERS[look.number % len(MARKERS)],
                    markersize=marker_size(len(places) * len(names)),
                    markerfacecolor=look.area,
                    markeredgecolor=look.line,
                    markeredgewidth=0.5,
                )
                ends += y
                known = [(p, c.interval) for p, c in enumerate(cells) if c and c.interval]
                if known:
                    at = np.array([p + left + 0.82 * width for p, _ in known])
                    middle, low, high = np.array([one for _, one in known]).T
                    axes.plot(
                        at,
                        middle,
                        linestyle="none",
                        marker="_",
                        color="black",
                        markersize=min(7.0, max(2.5, 20 * slot * width)),
                        markeredgewidth=1.1,
                    )
                    ends += _whiskers(axes, at, middle, low, high, within, 0.0)
        _bound(grid, ends)
        _finish(figure, grid, places, names, signs, (x_label, y_label), slot)
        return saved(figure)


def _panels_of(
    titles: Sequence[str], places: Sequence[str], names: Mapping[str, str]
) -> tuple[Figure, list[Axes], float]:
    """Return a drawing with its panels, and the inches that a place has in each."""
    cells = len(places) * len(names)
    width = width_for(list(names.values())) if cells <= 8 and len(titles) == 1 else WIDTH
    least = max(1.6, 0.11 * cells, 0.35 * len(places))
    columns = max(1, min(len(titles), 4, int((width - 0.5) / least)))
    columns = math.ceil(len(titles) / math.ceil(len(titles) / columns))
    each = (width - 0.5) / columns
    title = [fitted(one, 0.92 * each, 2) for one in titles]
    rows = math.ceil(len(titles) / columns)
    legend = legend_height(list(legend_of(names).values()), width)
    above = max(map(lines_in, title)) * LINE if len(titles) > 1 else 0.0
    high = min(rows * ((1.9 if rows == 1 else 1.3) + above + 0.25) + 0.3 + legend, HEIGHT)
    figure, grid = several_panels(len(titles), columns, high, width)
    if len(titles) > 1:
        for axes, text in zip(grid, title, strict=True):
            axes.set_title(text, fontsize=SIZE, pad=3)
    return figure, grid, (each - 0.15) / len(places)


def _finish(
    figure: Figure,
    grid: Sequence[Axes],
    places: Sequence[str],
    names: Mapping[str, str],
    signs: Mapping[str, object],
    labels: tuple[str, str],
    slot: float,
) -> None:
    """Name places and axes, and put the legend above."""
    for axes in grid:
        mark_places(axes, places, slot)
        spare = slot * len(places) / (SLOT * len(names))  # a lonely bar is not as wide as the axes
        if spare > len(places):
            axes.set_xlim(len(places) / 2 - 0.5 - spare / 2, len(places) / 2 - 0.5 + spare / 2)
    name_axes(figure, *labels)
    put_legend(figure, {text: signs[key] for key, text in legend_of(names).items() if key in signs})


def _whiskers(
    axes: Axes,
    x: Floats,
    middle: Floats,
    low: Floats,
    high: Floats,
    within: tuple[float, float],
    width: float,
) -> list[float]:
    """Draw lines from low to high, with caps unless the width is 0, and return their ends."""
    has = np.isfinite(low) & np.isfinite(high)
    if not has.any():
        return []
    low, high = np.clip(low, *within), np.clip(high, *within)
    axes.errorbar(
        x[has],
        middle[has],
        np.maximum([middle[has] - low[has], high[has] - middle[has]], 0),
        fmt="none",
        ecolor="black",
        elinewidth=0.8,
        capsize=min(2.5, 18 * width),
        capthick=0.7,
    )
    return [*low[has], *high[has]]


def _bound(grid: Sequence[Axes], ends: Sequence[float]) -> None:
    """Give all panels a vertical axis on which everything is seen, from zero if that is near."""
    low, high = min(ends, default=0.0), max(ends, default=0.0)
    if low > 0 and low < 0.7 * high:
        low = 0.0
    if high < 0 and high > 0.7 * low:
        high = 0.0
    room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    bottom, top = (low if low == 0 else low - room), (high if high == 0 > low else high + room)
    grid[0].set_ylim(bottom, top)
