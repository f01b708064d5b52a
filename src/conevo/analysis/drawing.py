"""What all drawings of a report have in common: style, size, legends, formats.

Together with ``figures`` the only place that knows Matplotlib.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 7.0  # inches: the text width of a page
HALF = 4.6  # of a drawing with little in it
STYLES = (  # colour of areas, colour of lines, hatch, line, marker
    ("#fae8bd", "#c0922e", "", ":", "o"),
    ("#c3dcd8", "#5f9c93", "//", "--", "s"),
    ("#eaa78f", "#c9582f", "||", "-.", "^"),
    ("#7fabcb", "#2f6d9c", "\\\\", (0, (5, 1.5, 1, 1.5, 1, 1.5)), "D"),
    ("#63668a", "#14162b", "", "-", "v"),
    ("#c9b3d1", "#84629a", "xx", (0, (1, 1)), "P"),
    ("#a98c6d", "#6b4e30", "--", (0, (8, 2)), "X"),
    ("#dcdcdc", "#8a8a8a", "++", (0, (3, 3)), "*"),
)
SETTINGS: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 7.5,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "hatch.linewidth": 0.5,
    "legend.frameon": False,
    "legend.handlelength": 2.2,
    "legend.columnspacing": 1.4,
    "legend.fontsize": 7.2,
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "conevo",
    "text.parse_math": False,
    "path.simplify": True,
}


PLACES = re.compile(r'\b(?:d|x|y)="[^"]*"')
LONG = re.compile(r"-?\d+\.\d{4,}")


class Drawing(NamedTuple):
    """One figure in two formats."""

    svg: bytes
    pdf: bytes


def style() -> Any:
    """Return the context to draw in."""
    import matplotlib

    return matplotlib.rc_context(SETTINGS)


def one_panel(height: float, width: float = WIDTH) -> tuple[Figure, Axes]:
    """Return a drawing with one pair of axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.add_subplot()


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
    return Drawing(text.encode(), pdf.getvalue())


def _shorter(number: re.Match[str]) -> str:
    return f"{float(number[0]):.3f}".rstrip("0").rstrip(".")


def mark_places(axes: Axes, places: Sequence[str], label: str) -> None:
    """Name the places along the axis, without ticks."""
    axes.set_xticks(range(len(places)), places)
    axes.set_xlim(-0.5, len(places) - 0.5)
    axes.tick_params(axis="x", length=0)
    axes.set_xlabel(label)


def put_legend(figure: Figure, grid: Sequence[Axes], names: Sequence[str]) -> None:
    """Put one legend of the lines, points or bars of all panels above them."""
    found = {
        name: handle
        for axes in grid
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    _legend(figure, {name: found[name] for name in names if name in found})


def put_part_legend(figure: Figure, names: Sequence[str]) -> None:
    """Put the shades of parts of a whole above the drawing."""
    from matplotlib.patches import Patch

    handles = {}
    for k, name in enumerate(names):
        shade, hatch = shade_of(k, len(names))
        handles[name] = Patch(facecolor=shade, hatch=hatch, edgecolor="0.25", linewidth=0.3)
    _legend(figure, handles)


def put_grey_legend(figure: Figure, meanings: Sequence[tuple[float, str]]) -> None:
    """Put what each darkness means above the drawing."""
    from matplotlib.patches import Patch

    _legend(
        figure,
        {
            text: Patch(facecolor=grey(darkness), edgecolor="0.4", linewidth=0.4)
            for darkness, text in meanings
        },
    )


def _legend(figure: Figure, handles: Mapping[str, Any]) -> None:
    """Put a legend above the drawing, to be read row by row, in as few rows as fit."""
    names = list(handles)
    room = 125 * float(figure.get_figwidth()) / WIDTH
    rows = math.ceil(sum(len(name) + 7 for name in names) / room)
    columns = max(1, math.ceil(len(names) / max(rows, 1)))
    order = [name for column in range(columns) for name in names[column::columns]]
    figure.legend([handles[name] for name in order], order, loc="outside upper left", ncols=columns)


def grey(darkness: float) -> str:
    """Return the grey of a darkness from 0, white, to 1."""
    return f"{1 - 0.75 * darkness:.3f}"


def shade_of(k: int, n: int) -> tuple[str, str]:
    """Return colour and hatch of part k of n: from dark to light; the last is the rest, plain."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    if k == n - 1:
        return "#f2f2f2", ""
    return to_hex(colormaps["cividis"](0.05 + 0.9 * k / max(n - 2, 1))), ("", "//", "", "||")[k % 4]


def is_dark(colour: str) -> bool:
    """Return whether white shows on a colour like "#2d3047"."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return 0.3 * red + 0.59 * green + 0.11 * blue < 100


def spread_of(i: int, n: int) -> float:
    """Return where in [0, 1] point i of n stands: evenly, neighbours far apart."""
    return 0.5 if n == 1 else (i * 0.6180339887 + 0.25) % 1.0


def marker_size(cells: int) -> float:
    """Return the size of points for a number of cells beside each other."""
    return 4.0 if cells <= 10 else 3.0 if cells <= 30 else 2.2


def numbers(values: Sequence[float | None]) -> npt.NDArray[np.float64]:
    """Return values with NaN for None."""
    return np.array([math.nan if value is None else value for value in values], dtype=np.float64)


def is_positive(values: Mapping[str, Sequence[Sequence[float]]]) -> bool:
    """Return whether no value is below 0."""
    return all(value >= 0 for of in values.values() for runs in of for value in runs)


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


def short(value: float) -> str:
    """Return 20000 as 20k, which is short enough for small panels."""
    for size, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= size:
            return f"{value / size:.3g}{letter}"
    return f"{value:.3g}"
