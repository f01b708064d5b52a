"""Drawings made of tiles: shares of a whole, and tables of shaded cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from conevo.report.figures.lettering import LINE, SMALL, drawable, fitted, lines_in, width_of
from conevo.report.figures.style import (
    COLUMN,
    WIDTH,
    Drawing,
    grey,
    hatches,
    legend_height,
    mark_places,
    name_axes,
    one_panel,
    part_handles,
    put_legend,
    saved,
    style,
)

__all__ = ["Shade", "heat_map", "shares"]


class Shade(NamedTuple):
    """A cell of a heat map: darkness from 0 to 1 and what is written on it."""

    darkness: float
    text: str


def shares(
    bars_of: Mapping[tuple[str, str], Mapping[str, float]],
    colours: Mapping[str, str],
    *,
    x_label: str,
) -> Drawing:
    """Draw lying bars of shares that add up to 1, in groups.

    Args:
        bars_of: (group, bar) -> name in the legend -> share.
        colours: name -> colour, from the left.
        x_label: under the axis.
    """
    with style():
        colours = {drawable(name): colour for name, colour in colours.items()}
        height, labels, last = 0.0, [], None
        places = []
        for group, bar in bars_of:
            height -= 1.0 if group == last or last is None else 1.6
            places.append(height)
            text = f"{group}  {bar}" if group != last else bar
            labels.append(fitted(text, 0.4 * WIDTH, 1, SMALL))
            last = group
        legend = legend_height(list(colours), WIDTH)
        figure, axes = one_panel(0.17 * (-height) + 0.55 + legend, WIDTH)
        left = np.zeros(len(places))
        for (name, colour), hatch in zip(colours.items(), hatches(len(colours)), strict=True):
            wide = np.array([
                sum(part for other, part in parts.items() if drawable(other) == name)
                for parts in bars_of.values()
            ])  # fmt: skip
            axes.barh(
                places,
                wide,
                0.86,
                left=left,
                color=colour,
                hatch=hatch,
                edgecolor="0.25",
                linewidth=0.3,
            )
            left = left + wide
        axes.set_yticks(places, labels)
        axes.tick_params(axis="y", length=0)
        axes.set_xlim(0, 1)
        axes.set_ylim(height - 0.7, -0.3)
        name_axes(figure, x_label)
        put_legend(figure, part_handles(colours))
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
        from matplotlib.collections import PatchCollection
        from matplotlib.patches import Patch, Rectangle

        side = [_side(row) for row in rows]
        lines = max(map(lines_in, side))
        left = max(width_of(text, SMALL) for text in side) + 0.3
        wide = max(width_of(shade.text, SMALL) for shade in cells.values()) + 0.16
        wide = max(wide, min(0.8, max(width_of(drawable(name), SMALL) for name in columns) + 0.1))
        needed = left + wide * len(columns)
        width = COLUMN if needed <= COLUMN else WIDTH
        wide = min(wide, (width - left) / len(columns))
        tall = lines * LINE + 0.07
        above = legend_height([text for _, text in legend], width)
        figure, axes = one_panel(tall * len(rows) + 0.55 + above, width)
        across = max(len(columns), (width - left) / wide)
        placed = {key: (columns.index(key[1]), -rows.index(key[0]) - 1) for key in cells}
        axes.add_collection(
            PatchCollection(
                [Rectangle((x - 0.5, y), 1, 1) for x, y in placed.values()],
                facecolor=[grey(shade.darkness) for shade in cells.values()],
                edgecolor="0.75",
                linewidth=0.6,
            )
        )
        for key, shade in cells.items():
            x, y = placed[key]
            ink = "white" if shade.darkness > 0.6 else "black"
            axes.text(x, y + 0.5, shade.text, color=ink, ha="center", va="center", fontsize=SMALL)
        mark_places(axes, columns, wide)
        axes.set_xlim(-0.5, across - 0.5)
        axes.set_ylim(-len(rows), 0)
        axes.set_yticks(-np.arange(len(rows)) - 0.5, side)
        axes.tick_params(length=0)
        for spine in axes.spines.values():
            spine.set_visible(False)
        axes.set_xlabel(fitted(x_label, 0.6 * width, 2), x=0.5 * len(columns) / across)
        handles = {
            text: Patch(facecolor=grey(darkness), edgecolor="0.4", linewidth=0.4)
            for darkness, text in legend
        }
        put_legend(figure, handles)
        return saved(figure)


def _side(row: str) -> str:
    """Return the name of a row: "a − b" in two lines if it is long."""
    room = 0.4 * WIDTH
    if width_of(drawable(row), SMALL) <= 0.5 * room:
        return drawable(row)
    return "\n".join(
        fitted(part, room, 1, SMALL) for part in row.replace(" − ", " −\n").split("\n")
    )
