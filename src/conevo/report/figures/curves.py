"""Drawings over team evaluations: lines with bands, and shares of a whole, in small panels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from conevo.palette import method_looks
from conevo.report.figures.lettering import LINE, drawable, fitted, lines_in, width_of
from conevo.report.figures.small_multiples import Panels
from conevo.report.figures.style import (
    COLUMN,
    DASHES,
    EVERYTHING,
    MARKERS,
    WIDTH,
    Drawing,
    hatches,
    legend_height,
    legend_of,
    name_axes,
    one_panel,
    part_handles,
    put_legend,
    saved,
    style,
    ticks_of,
    width_for,
)
from conevo.report.learning_curves import Course
from conevo.typing import Floats

__all__ = ["Line", "lines", "stacks"]


class Line(NamedTuple):
    """The method of a line, and the quantity if each method has several."""

    method: str
    part: str = ""


def lines(
    panels: Mapping[str, Mapping[Line, Course]],
    names: Mapping[Line, str],
    *,
    x_label: str,
    y_label: str,
    limits: tuple[float, float] | None = None,
    within: tuple[float, float] = EVERYTHING,
) -> Drawing:
    """Draw small panels of lines with bands, all with the same axes.

    Args:
        panels: title of each panel -> line -> its course.
        names: line -> its name in the legend.
        x_label: under the lowest panels.
        y_label: left of the panels.
        limits: of the vertical axis; from the data if not given.
        within: lowest and highest possible value; bands end there.
    """
    with style():
        from matplotlib.collections import PolyCollection

        rows = math.ceil(len(panels) / 5)
        columns = math.ceil(len(panels) / rows)
        width = width_for(list(names.values())) if len(panels) == 1 else WIDTH
        shape = ((width - 0.5) / columns - 0.1, 1.9 if len(panels) == 1 else 1.15)
        titles = [fitted(title, 1.05 * shape[0], 3) for title in panels] if len(panels) > 1 else []
        above = max(map(lines_in, titles), default=0)
        texts = legend_of(names)
        high = rows * (shape[1] + 0.14 + above * LINE) + 0.45
        figure, axes = one_panel(high + legend_height(list(texts.values()), width), width)
        drawn = [_inside(band, within) for of in panels.values() for band in of.values()]
        right = max(float(band.x[-1]) for band in drawn)
        lowest = min(0.0, *(float(np.nanmin([band.low, band.mean])) for band in drawn))
        highest = max(0.0, *(float(np.nanmax([band.high, band.mean])) for band in drawn))
        y_ticks, y_limits = ticks_of(lowest, highest, limits)
        x_ticks, _ = ticks_of(0.0, right, (0.0, right), 3 if columns > 2 else 5)
        field = Panels(axes, rows, columns, (0.0, right), y_limits, shape, above)
        used = [divmod(k, columns) for k in range(len(panels))]
        looks = method_looks(line.method for line in names)
        parts = list(dict.fromkeys(line.part for line in names))
        signs = {}
        for k, name in enumerate(names):
            look = looks[name.method]
            shapes, x, y, marked = [], [np.empty(0)], [np.empty(0)], [np.empty(0, dtype=int)]
            for place, of in zip(used, panels.values(), strict=True):
                if name in of:
                    band, start = _inside(of[name], within), sum(map(len, x))
                    across, middle = field.at(*place, band.x, band.mean)
                    low, up = (field.at(*place, band.x, end)[1] for end in (band.low, band.high))
                    shapes += _outline(low, up, across)
                    every = max(1, len(across) // 6)
                    shift = k * every // max(len(names), 1)
                    marked.append(np.arange(start + shift, start + len(across), every))
                    x += [across, np.array([np.nan])]
                    y += [middle, np.array([np.nan])]
            axes.add_collection(
                PolyCollection(shapes, facecolor=look.area, alpha=0.35, linewidth=0)
            )
            (signs[texts[name]],) = axes.plot(
                np.concatenate(x),
                np.concatenate(y),
                color=look.line,
                linestyle=("-", "--", ":")[parts.index(name.part) % 3]
                if len(parts) > 1
                else DASHES[look.number % len(DASHES)],
                linewidth=1.0,
                marker=MARKERS[look.number % len(MARKERS)],
                markersize=2.8,
                markerfacecolor=look.line if name.part == parts[0] else "white",
                markeredgewidth=0.5,
                markevery=np.concatenate(marked).tolist(),
                clip_on=False,
            )
        for place, title in zip(used, titles, strict=False):
            field.title(*place, title)
        field.frame(used, closed=False)
        field.ticks_below(used, x_ticks, inside=columns > 1)
        field.ticks_at_sides(used, y_ticks)
        name_axes(figure, x_label, y_label)
        put_legend(figure, signs)
        return saved(figure)


def stacks(
    panels: Mapping[tuple[str, str], Mapping[str, Floats]],
    x: Floats,
    colours: Mapping[str, str],
    *,
    x_label: str,
    y_label: str,
) -> Drawing:
    """Draw shares of a whole along an axis, a panel per row and column.

    Args:
        panels: (row, column) -> name in the legend -> shares [X] in [0, 1]; NaN where there are
            none.
        x: [X], above 0, where the axis begins.
        colours: name -> colour, from below.
        x_label: under the panels.
        y_label: left of them.
    """
    with style():
        from matplotlib.collections import PolyCollection

        rows = list(dict.fromkeys(row for row, _ in panels))
        columns = list(dict.fromkeys(column for _, column in panels))
        sides = [fitted(row, 1.4, 3) for row in rows] if len(rows) > 1 else []
        width = WIDTH if len(columns) > 2 or max(map(lines_in, sides), default=1) > 1 else COLUMN
        left = max(map(width_of, sides), default=0.0) + 0.3
        shape = ((width - left) / len(columns) - 0.1, 1.6 if len(rows) == 1 else 0.75)
        titles = [fitted(column, 1.05 * shape[0], 3) for column in columns]
        above = max(map(lines_in, titles))
        colours = {drawable(name): colour for name, colour in colours.items()}
        high = len(rows) * (shape[1] + 0.12) + above * LINE + 0.5
        figure, axes = one_panel(high + legend_height(list(colours), width), width)
        limits = (0.0, float(x[-1]))
        field = Panels(axes, len(rows), len(columns), limits, (0.0, 1.0), shape)
        used = [(rows.index(row), columns.index(column)) for row, column in panels]
        below = [np.zeros(len(x)) for _ in panels]
        for (name, colour), hatch in zip(colours.items(), hatches(len(colours)), strict=True):
            shapes = []
            for i, (place, of) in enumerate(zip(used, panels.values(), strict=True)):
                shares_of = {drawable(part): shares for part, shares in of.items()}
                if name in shares_of:
                    across, foot = field.at(*place, x, below[i])
                    below[i] = below[i] + shares_of[name]
                    shapes += _outline(foot, field.at(*place, x, below[i])[1], across)
            axes.add_collection(
                PolyCollection(
                    shapes,
                    facecolor=colour,
                    hatch=hatch,
                    edgecolor="0.25",
                    linewidth=0.3,
                )
            )
        for k, title in enumerate(titles):
            field.title(0, k, title)
        for k, side in enumerate(sides):
            field.side(k, side)
        field.frame(used, closed=True)
        field.ticks_below(used, limits, inside=True)
        name_axes(figure, x_label, y_label)
        put_legend(figure, part_handles(colours))
        return saved(figure)


def _inside(band: Course, within: tuple[float, float]) -> Course:
    """Return a band that ends where values do."""
    return band._replace(low=np.clip(band.low, *within), high=np.clip(band.high, *within))


def _outline(low: Floats, high: Floats, x: Floats) -> list[Floats]:
    """Return the polygon between two lines, none where there is nothing between them."""
    known = np.isfinite(low) & np.isfinite(high)
    if not (high[known] > low[known]).any():
        return []
    x, low, high = x[known], low[known], high[known]
    return [np.column_stack([np.append(x, x[::-1]), np.append(low, high[::-1])])]
