"""Style, size, legends and formats of all drawings of a report.

Matplotlib is used in this folder only.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from conevo.report.figures.lettering import (
    FONT,
    LINE,
    SIZE,
    SMALL,
    fitted,
    labels_of,
    lines_in,
    width_of,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 7.0  # inches: both columns of a page, or its text width
COLUMN = 3.4  # one of two columns
HEIGHT = 9.0  # of a page
HATCHES = (  # by ``palette.Look.number``, as the next two
    "", "//", "||", "\\\\", "", "xx", "--", "++", "..", "oo",
    "**", "OO", "/o", "\\o", "/.", "\\.", "|.", "-.", "|o", "-o",
)  # fmt: skip
DASHES: tuple[Any, ...] = (
    ":", "--", "-.", (0, (5, 1.5, 1, 1.5, 1, 1.5)), "-", (0, (1, 1)), (0, (8, 2)), (0, (3, 3)),
    (0, (8, 2, 2, 2)), (0, (2, 4)), (0, (1, 3)), (0, (5, 1)), (0, (12, 3)), (0, (6, 1, 1, 1)),
    (0, (3, 1, 1, 1, 1, 1)), (0, (12, 2, 3, 2)), (0, (6, 5)), (0, (3, 1)), (0, (1, 1, 4, 1)),
    (0, (2, 1, 2, 4)),
)  # fmt: skip
MARKERS: tuple[Any, ...] = (*"os^DvPX*<p>hd8H.", (4, 1, 0), (6, 1, 0), (3, 1, 0), (8, 1, 0))
EVERYTHING = (-math.inf, math.inf)  # the values of a measure that may have any
SETTINGS: dict[Any, Any] = {
    "font.family": FONT,
    "font.size": SIZE,
    "axes.labelsize": SIZE,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "axes.titlesize": SIZE,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "hatch.linewidth": 0.5,
    "legend.frameon": False,
    "legend.handlelength": 2.2,
    "legend.columnspacing": 1.4,
    "legend.fontsize": SMALL,
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "conevo",
    "text.parse_math": False,
    "path.simplify": True,
}


Key = TypeVar("Key")
PLACES = re.compile(r'\b(?:d|x|y)="[^"]*"')
LONG = re.compile(r"-?\d+\.\d{4,}")


class Drawing(NamedTuple):
    """One figure in two formats, and whether it is as wide as a page."""

    svg: bytes
    pdf: bytes
    is_wide: bool = False


def style() -> Any:
    """Return the context to draw in."""
    import matplotlib

    return matplotlib.rc_context(SETTINGS)


def one_panel(height: float, width: float = WIDTH) -> tuple[Figure, Axes]:
    """Return a drawing with one pair of axes."""
    figure, grid = several_panels(1, 1, height, width)
    return figure, grid[0]


def several_panels(
    n: int, columns: int, height: float, width: float = WIDTH
) -> tuple[Figure, list[Axes]]:
    """Return a drawing with n pairs of axes, row by row, which share their vertical axis."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    grid = figure.subplots(math.ceil(n / columns), columns, sharey=True, squeeze=False)
    listed = list(grid.flat)
    for axes in listed[n:]:
        axes.remove()
    return figure, listed[:n]


def saved(figure: Figure) -> Drawing:
    """Return the drawing without a date or a version in it.

    Places in the SVG are given to a thousandth of a point.
    """
    svg, pdf = io.BytesIO(), io.BytesIO()
    figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    figure.set_layout_engine("none")  # it is laid out: the second format need not do it again
    nothing = {"CreationDate": None, "Creator": None, "Producer": None}
    figure.savefig(pdf, format="pdf", metadata=nothing)
    text = PLACES.sub(lambda found: LONG.sub(_shorter, found[0]), svg.getvalue().decode())
    return Drawing(text.encode(), pdf.getvalue(), float(figure.get_figwidth()) > COLUMN)


def _shorter(number: re.Match[str]) -> str:
    return f"{float(number[0]):.3f}".rstrip("0").rstrip(".")


def name_axes(figure: Figure, x_label: str, y_label: str = "") -> None:
    """Write the names of the axes of all panels below and left of them, in lines that fit."""
    width, height = map(float, figure.get_size_inches())
    figure.supxlabel(fitted(x_label, 0.9 * width, 2), fontsize=SIZE)
    if y_label:
        figure.supylabel(fitted(y_label, 0.75 * height, 3), fontsize=SIZE)


def mark_places(axes: Axes, places: Sequence[str], slot: float) -> None:
    """Name the places along the axis, each ``slot`` inches wide, without ticks."""
    labels = labels_of(places, slot, SMALL)
    turned: dict[str, Any] = {"rotation": labels.angle, "rotation_mode": "anchor", "ha": "right"}
    if labels.angle == 90.0:
        turned["va"] = "center"
    axes.set_xticks(range(len(places)), labels.texts, **(turned if labels.angle else {}))
    axes.set_xlim(-0.5, len(places) - 0.5)
    axes.tick_params(axis="x", length=0)


def legend_of(names: Mapping[Key, str]) -> dict[Key, str]:
    """Return the text of each key in a legend, in lines that fit in a column of a page."""
    return {key: fitted(name, 0.7 * COLUMN, 2, SMALL) for key, name in names.items()}


def legend_height(names: Sequence[str], width: float) -> float:
    """Return how high a legend above a drawing of that width gets, in inches."""
    columns = _columns(names, width)
    rows = [names[k : k + columns] for k in range(0, len(names), columns)]
    return sum(max(map(lines_in, row)) for row in rows) * LINE + 0.15


def width_for(names: Sequence[str]) -> float:
    """Return a column of a page, or both if a legend needs much room in one."""
    texts = legend_of(dict(enumerate(names)))
    return COLUMN if legend_height(list(texts.values()), COLUMN) <= 0.8 else WIDTH


def put_legend(figure: Figure, handles: Mapping[str, Any]) -> None:
    """Put a legend above the drawing, to be read row by row, in as few rows as fit."""
    names = list(handles)
    columns = _columns(names, float(figure.get_figwidth()))
    order = [name for column in range(columns) for name in names[column::columns]]
    figure.legend([handles[name] for name in order], order, loc="outside upper left", ncols=columns)


def _columns(names: Sequence[str], width: float) -> int:
    """Return in how many columns a legend fits, as few rows as there may be."""
    handle, gap, rim = 3.2 * SMALL / 72, 1.4 * SMALL / 72, 2.0 * SMALL / 72
    for rows in range(1, len(names)):
        columns = math.ceil(len(names) / rows)
        # The widest of each column, with the sign before it and the gap after it.
        used = [max(width_of(n, SMALL) for n in names[k::columns]) for k in range(columns)]
        if sum(used) + columns * (handle + gap) + rim <= width:
            return columns
    return 1


def part_handles(colours: Mapping[str, str]) -> dict[str, Any]:
    """Return signs for the parts of a whole."""
    from matplotlib.patches import Patch

    return {
        name: Patch(facecolor=colour, hatch=hatch, edgecolor="0.25", linewidth=0.3)
        for (name, colour), hatch in zip(colours.items(), hatches(len(colours)), strict=True)
    }


def grey(darkness: float) -> str:
    """Return the grey of a darkness from 0, white, to 1."""
    return f"{1 - 0.75 * darkness:.3f}"


def hatches(n: int) -> list[str]:
    """Return the hatches of n parts of a whole: neighbours differ, the last, the rest, is plain."""
    return [("\\\\", "//", "..", "||", "--")[k % 5] for k in range(n - 1)] + [""]


def is_dark(colour: str) -> bool:
    """Return whether white shows on a colour like "#2d3047"."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return 0.3 * red + 0.59 * green + 0.11 * blue < 100


def spread_of(i: int, n: int) -> float:
    """Return where in [0, 1] point i of n stands: evenly, neighbours far apart."""
    return 0.5 if n == 1 else (i * 0.6180339887 + 0.25) % 1.0


def marker_size(cells: int) -> float:
    """Return the size of points for a number of cells next to each other."""
    return 4.0 if cells <= 10 else 3.0 if cells <= 30 else 2.2


def ticks_of(
    low: float, high: float, limits: tuple[float, float] | None = None, n: int = 5
) -> tuple[list[float], tuple[float, float]]:
    """Return about n round values, and the limits of an axis: those given, or with some room."""
    from matplotlib.ticker import MaxNLocator

    if limits is None:
        limits = (low, low + 1.04 * (high - low) if high > low else low + 1.0)
    found = MaxNLocator(n).tick_values(*limits)
    near = 1e-9 * (limits[1] - limits[0])
    return [v for v in map(float, found) if limits[0] - near <= v <= limits[1] + near], limits
