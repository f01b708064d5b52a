"""Drawings of a report: readable in grey, the same bytes for the same numbers.

Every treatment has one colour, hatch, line and marker throughout a report; colours differ in
lightness. Each function returns the drawing as SVG and as PDF.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from conevo.analysis.drawing import (
    HALF,
    STYLES,
    WIDTH,
    Drawing,
    grey,
    is_dark,
    is_positive,
    mark_places,
    marker_size,
    numbers,
    one_panel,
    put_grey_legend,
    put_legend,
    put_part_legend,
    saved,
    shade_of,
    short,
    spread_of,
    style,
    ticks_of,
)
from conevo.analysis.panels import Panels

__all__ = [
    "Band",
    "Drawing",
    "Shade",
    "bars",
    "heat_map",
    "lines",
    "points",
    "shares",
    "stacks",
]


class Band(NamedTuple):
    """A line with a band around it: x, middle, low and high [X]; NaN where there is none."""

    x: npt.NDArray[np.float64]
    middle: npt.NDArray[np.float64]
    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]


class Shade(NamedTuple):
    """A cell of a heat map: darkness from 0 to 1 and what is written on it."""

    darkness: float
    text: str


def bars(
    places: Sequence[str],
    heights: Mapping[str, Sequence[float | None]],
    deviations: Mapping[str, Sequence[float | None]],
    *,
    x_label: str,
    y_label: str,
) -> Drawing:
    """Draw a group of bars per place, with a deviation on each: the form of the thesis.

    Args:
        places: P names under the groups.
        heights: P heights for each name in the legend; None: no bar.
        deviations: P deviations for each of them; None: none drawn.
        x_label: under the axis.
        y_label: beside the axis.
    """
    with style():
        figure, axes = one_panel(2.5, _wide(len(places) * len(heights)))
        width = 0.84 / len(heights)
        for k, (name, values) in enumerate(heights.items()):
            area, _, hatch, _, _ = STYLES[k % len(STYLES)]
            x = np.arange(len(places)) + (k - (len(heights) - 1) / 2) * width
            y, error = numbers(values), numbers(deviations[name])
            axes.bar(
                x,
                y,
                width,
                label=name,
                color=area,
                hatch=hatch,
                edgecolor="white" if is_dark(area) else "black",
                linewidth=0.4,
            )
            has = np.isfinite(error) & np.isfinite(y)
            down = np.minimum(error, np.maximum(y, 0))  # a measure below 0 does not exist
            axes.errorbar(
                x[has],
                y[has],
                np.array([down[has], error[has]]),
                fmt="none",
                ecolor="black",
                elinewidth=0.7,
                capsize=min(2.5, 18 * width),
                capthick=0.7,
            )
        mark_places(axes, places, x_label)
        axes.set_ylabel(y_label)
        axes.set_ylim(bottom=0)
        put_legend(figure, [axes], list(heights))
        return saved(figure)


def points(
    places: Sequence[str],
    values: Mapping[str, Sequence[Sequence[float]]],
    intervals: Mapping[str, Sequence[tuple[float, float, float] | None]],
    *,
    x_label: str,
    y_label: str,
    reference: float | None = None,
) -> Drawing:
    """Draw every run as a point, and beside the runs of a cell their mean with its interval.

    Args:
        places: P names.
        values: for each name in the legend P lists of values, one per run.
        intervals: for each of them P times mean, low and high; None: not drawn.
        x_label: under the axis.
        y_label: beside the axis.
        reference: a height with a line across.
    """
    with style():
        figure, axes = one_panel(2.7, _wide(len(places) * len(values)))
        width = 0.86 / len(values)
        if reference is not None:
            axes.axhline(reference, color="0.55", linewidth=0.7, linestyle=(0, (4, 3)), zorder=0)
        for place in range(1, len(places)):
            axes.axvline(place - 0.5, color="0.85", linewidth=0.6, zorder=0)
        for k, (name, runs) in enumerate(values.items()):
            area, dark, _, _, marker = STYLES[k % len(STYLES)]
            left = (k - len(values) / 2) * width
            x = [
                place + left + width * (0.12 + 0.5 * spread_of(i, len(of)))
                for place, of in enumerate(runs)
                for i in range(len(of))
            ]
            axes.plot(
                x,
                [value for of in runs for value in of],
                linestyle="none",
                marker=marker,
                markersize=marker_size(len(places) * len(values)),
                markerfacecolor=area,
                markeredgecolor=dark,
                markeredgewidth=0.4,
                label=name,
            )
            known = [(p, one) for p, one in enumerate(intervals[name]) if one is not None]
            if known:
                at = np.array([p + left + 0.82 * width for p, _ in known])
                middle, low, high = np.array([one for _, one in known]).T
                axes.errorbar(
                    at,
                    middle,
                    np.array([middle - low, high - middle]),
                    fmt="_",
                    color="black",
                    markersize=max(2.5, 24 * width),
                    markeredgewidth=1.1,
                    elinewidth=0.8,
                )
        mark_places(axes, places, x_label)
        axes.set_ylabel(y_label)
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]) if is_positive(values) else None)
        put_legend(figure, [axes], list(values))
        return saved(figure)


def lines(
    panels: Mapping[str, Mapping[str, Band]],
    names: Sequence[str],
    *,
    x_label: str,
    y_label: str,
    limits: tuple[float, float] | None = None,
) -> Drawing:
    """Draw small panels of lines with bands, all with the same axes.

    Args:
        panels: title of each panel -> name in the legend -> line.
        names: all that the legend tells, in the order of the styles.
        x_label: under the lowest panels.
        y_label: beside the panels on the left.
        limits: of the vertical axis; from the data if not given.
    """
    with style():
        from matplotlib.collections import PolyCollection

        columns = min(len(panels), 5)
        rows = math.ceil(len(panels) / columns)
        shape = (WIDTH / columns - 0.2, 2.2 if len(panels) == 1 else 1.15)
        figure, axes = one_panel(rows * (shape[1] + 0.25) + 0.75)
        drawn = [band for of in panels.values() for band in of.values()]
        right = max(float(band.x[-1]) for band in drawn)
        y_ticks, y_limits = ticks_of(_lowest(drawn), _highest(drawn), limits)
        x_ticks, _ = ticks_of(0.0, right, (0.0, right), 3 if columns > 2 else 6)
        field = Panels(axes, rows, columns, (0.0, right), y_limits, shape)
        used = [divmod(k, columns) for k in range(len(panels))]
        for k, name in enumerate(names):
            area, dark, _, line, marker = STYLES[k % len(STYLES)]
            shapes, x, y, marked = [], [np.empty(0)], [np.empty(0)], [np.empty(0, dtype=int)]
            for place, of in zip(used, panels.values(), strict=True):
                if name in of:
                    band, start = of[name], sum(map(len, x))
                    across, middle = field.at(*place, band.x, band.middle)
                    low, high = (field.at(*place, band.x, end)[1] for end in (band.low, band.high))
                    shapes += _outline(low, high, across)
                    every = max(1, len(across) // 6)
                    shift = k * every // max(len(names), 1)
                    marked.append(np.arange(start + shift, start + len(across), every))
                    x += [across, np.array([np.nan])]
                    y += [middle, np.array([np.nan])]
            axes.add_collection(PolyCollection(shapes, facecolor=area, alpha=0.35, linewidth=0))
            axes.plot(
                np.concatenate(x),
                np.concatenate(y),
                color=dark,
                linestyle=line,
                linewidth=1.0,
                marker=marker,
                markersize=2.8,
                markevery=np.concatenate(marked).tolist(),
                label=name,
                clip_on=False,
            )
        if len(panels) > 1:
            for place, title in zip(used, panels, strict=True):
                field.title(*place, title)
        field.frame(used, closed=False)
        field.ticks_below(used, x_ticks, [short(value) for value in x_ticks])
        field.ticks_beside(used, y_ticks, [short(value) for value in y_ticks])
        figure.supxlabel(x_label, fontsize=7.5)
        figure.supylabel(y_label, fontsize=7.5)
        put_legend(figure, [axes], names)
        return saved(figure)


def stacks(
    panels: Mapping[tuple[str, str], Mapping[str, npt.NDArray[np.float64]]],
    x: npt.NDArray[np.float64],
    names: Sequence[str],
    *,
    x_label: str,
    y_label: str,
) -> Drawing:
    """Draw shares of a whole along an axis, a panel per row and column.

    Args:
        panels: (row, column) -> name in the legend -> shares [X] in [0, 1].
        x: [X].
        names: all that the legend tells, from below; the same shade everywhere.
        x_label: under the panels.
        y_label: beside them.
    """
    with style():
        from matplotlib.collections import PolyCollection

        rows = list(dict.fromkeys(row for row, _ in panels))
        columns = list(dict.fromkeys(column for _, column in panels))
        shape = (WIDTH / max(len(columns), 3) - 0.3, 1.9 if len(rows) == 1 else 0.75)
        width = WIDTH if len(columns) > 2 else HALF
        figure, axes = one_panel(len(rows) * (shape[1] + 0.12) + 0.9, width)
        limits = (float(x[0]), float(x[-1]))
        field = Panels(axes, len(rows), len(columns), limits, (0.0, 1.0), shape)
        used = [(rows.index(row), columns.index(column)) for row, column in panels]
        below = [np.zeros(len(x)) for _ in panels]
        for k, name in enumerate(names):
            shapes = []
            for i, (place, shares_of) in enumerate(zip(used, panels.values(), strict=True)):
                if name in shares_of:
                    across, foot = field.at(*place, x, below[i])
                    below[i] = below[i] + shares_of[name]
                    shapes += _outline(foot, field.at(*place, x, below[i])[1], across)
            shade, hatch = shade_of(k, len(names))
            axes.add_collection(
                PolyCollection(
                    shapes, facecolor=shade, hatch=hatch, edgecolor="0.25", linewidth=0.3
                )
            )
        for k, column in enumerate(columns):
            field.title(0, k, column)
        if len(rows) > 1:
            for k, row in enumerate(rows):
                field.side(k, row)
        field.frame(used, closed=True)
        field.ticks_below(used, limits, [short(value) for value in limits], inside=True)
        figure.supxlabel(x_label, fontsize=7.5)
        figure.supylabel(y_label, fontsize=7.5)
        put_part_legend(figure, names)
        return saved(figure)


def shares(
    bars_of: Mapping[tuple[str, str], Mapping[str, float]],
    names: Sequence[str],
    *,
    x_label: str,
) -> Drawing:
    """Draw lying bars of shares that add up to 1, in groups.

    Args:
        bars_of: (group, bar) -> name in the legend -> share.
        names: all that the legend tells, from the left.
        x_label: under the axis.
    """
    with style():
        figure, axes = one_panel(0.17 * len(bars_of) + 0.9)
        height, labels, last = 0.0, [], None
        for (group, bar), parts in bars_of.items():
            height -= 1.0 if group == last or last is None else 1.6
            labels.append((height, f"{group}  {bar}" if group != last else bar))
            last, left = group, 0.0
            for k, name in enumerate(names):
                shade, hatch = shade_of(k, len(names))
                wide = parts.get(name, 0.0)
                if wide > 0:
                    axes.barh(
                        height,
                        wide,
                        0.86,
                        left=left,
                        color=shade,
                        hatch=hatch,
                        edgecolor="0.25",
                        linewidth=0.3,
                    )
                left += wide
        axes.set_yticks([y for y, _ in labels], [text for _, text in labels])
        axes.tick_params(axis="y", length=0)
        axes.set_xlim(0, 1)
        axes.set_ylim(height - 0.7, -0.3)
        axes.set_xlabel(x_label)
        put_part_legend(figure, names)
        return saved(figure)


def heat_map(
    rows: Sequence[str],
    columns: Sequence[str],
    cells: Mapping[tuple[str, str], Shade],
    legend: Sequence[tuple[float, str]],
    *,
    x_label: str,
) -> Drawing:
    """Draw a table of shaded cells.

    Args:
        rows: R names on the left.
        columns: C names below.
        cells: (row, column) -> shade; what is missing stays empty.
        legend: darkness and what it means.
        x_label: below.
    """
    with style():
        from matplotlib.patches import Rectangle

        figure, axes = one_panel(0.2 * len(rows) + 0.9, _wide(2 * len(columns)))
        for (row, column), shade in cells.items():
            x, y = columns.index(column), -rows.index(row)
            axes.add_patch(
                Rectangle(
                    (x, y - 1), 1, 1, facecolor=grey(shade.darkness), edgecolor="white", linewidth=1
                )
            )
            ink = "white" if shade.darkness > 0.6 else "black"
            axes.text(
                x + 0.5, y - 0.5, shade.text, color=ink, ha="center", va="center", fontsize=6.5
            )
        axes.set_xlim(0, max(len(columns), 5))
        axes.set_ylim(-len(rows), 0)
        axes.set_xticks(np.arange(len(columns)) + 0.5, columns)
        axes.set_yticks(-np.arange(len(rows)) - 0.5, rows)
        axes.tick_params(length=0)
        for spine in axes.spines.values():
            spine.set_visible(False)
        axes.set_xlabel(x_label, x=0.5 * len(columns) / max(len(columns), 5))
        put_grey_legend(figure, legend)
        return saved(figure)


def _wide(cells: int) -> float:
    """Return the width that a number of cells beside each other needs."""
    return WIDTH if cells > 8 else HALF


def _outline(
    low: npt.NDArray[np.float64], high: npt.NDArray[np.float64], x: npt.NDArray[np.float64]
) -> list[npt.NDArray[np.float64]]:
    """Return the polygon between two lines, none where there is nothing between them."""
    known = np.isfinite(low) & np.isfinite(high)
    if not (high[known] > low[known]).any():
        return []
    x, low, high = x[known], low[known], high[known]
    return [np.column_stack([np.append(x, x[::-1]), np.append(low, high[::-1])])]


def _lowest(bands: Sequence[Band]) -> float:
    return min(0.0, *(float(np.nanmin([band.low, band.middle])) for band in bands))


def _highest(bands: Sequence[Band]) -> float:
    return max(float(np.nanmax([band.high, band.middle])) for band in bands)
