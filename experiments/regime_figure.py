"""The regime map as a picture: differences in colour, castes and the rule in grey."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import Any

from conevo.palette import BLUE, INK, VERMILION, shade
from conevo.report.figures.lettering import SIZE, SMALL
from conevo.report.figures.style import grey, is_dark, style
from pages import Row
from regime_cells import CLONES, INDIVIDUAL, Cell, apart
from regime_tables import number, percent

__all__ = ["draw"]

WIDTH = 8.0  # inches
MAP, SMALL_MAP = (0.55, 0.75), (0.42, 0.65)  # inches of a row, and of the margins around the rows
DPI = 150
DARKEST = 0.6  # black can be read on it
LEAST = 0.05  # smallest share of the clones' value with the full colour
Write = Callable[[Cell], tuple[str, str, bool]]  # colour, text, whether it is marked
Numbers = Callable[[Cell], list[float | None]]


def draw(cells: Sequence[Cell]) -> bytes:
    """Return the picture as PNG: the map above, castes and the rule below."""
    with style():
        from matplotlib.figure import Figure

        n = len({(cell.ranges, cell.accuracies) for cell in cells})
        heights = [n * row + around for row, around in (MAP, SMALL_MAP)]
        figure = Figure(figsize=(WIDTH, sum(heights)), layout="constrained")
        above, below = figure.subfigures(2, 1, height_ratios=heights)
        most = max([LEAST, *(abs(cell.share(cell.value.difference) or 0) for cell in cells)])
        panel(above.subplots(), cells, lambda cell: difference(cell, most), "")
        above.suptitle(
            "Value of CONE-ES minus that of HomES, its 95 % interval (Welch), and as a share of "
            "HomES; n: runs of HomES, CONE-ES.\nBlue: individual controllers are better; red: "
            "clones are; framed: the interval excludes 0.",
            fontsize=SIZE,
            x=0.01,
            ha="left",
        )
        grids = below.subplots(1, 4, sharey=True)
        for axes, (title, of, lightest, darkest) in zip(grids, small(), strict=True):
            panel(axes, cells, shaded(of, lightest, darkest), title)
        above.supxlabel(
            "segregation of the types; the rule's threshold is found without 0.25 and 0.75",
            fontsize=SIZE,
        )
        below.supxlabel(
            "segregation of the types; the first three panels show CONE-ES (HomES)", fontsize=SIZE
        )
        file = io.BytesIO()
        figure.savefig(file, format="png", dpi=DPI, metadata={"Software": None})
    return file.getvalue()


def small() -> list[tuple[str, Numbers, float, float]]:
    """Return the lower panels: title, numbers, and the values drawn white and darkest."""

    def of_both(what: str | Callable[[Row], float]) -> Numbers:
        return lambda cell: [cell.mean(method, what) for method in (INDIVIDUAL, CLONES)]

    return [
        ("favourite setting's share", of_both("favourite share"), 1 / 3, 1),
        ("difference between regions", of_both(apart), 0, 0.6),
        ("S", of_both("S"), 0, 1),
        ("castes / switchers by the rule", lambda cell: [cell.incentive], 0.3, 1.7),
    ]


def difference(cell: Cell, most: float) -> tuple[str, str, bool]:
    """Return colour and text of a cell of the map."""
    of = cell.value
    share = cell.share(of.difference)
    runs = f"n {of.n_b}, {of.n_a}"
    if share is None:
        return "#ffffff", runs, False
    hue = BLUE if share > 0 else VERMILION
    around = "" if of.low is None else f"\n{number(of.low, '+.0f')} to {number(of.high, '+.0f')}"
    text = f"{number(of.difference, '+.0f')}{around}\n{percent(share)} · {runs}"
    strength = (0.85 if around else 0.25) * min(abs(share) / most, 1)  # faint without an interval
    return shade(hue, 1 - strength), text, cell.is_clear


def shaded(of: Numbers, lightest: float, darkest: float) -> Write:
    """Return the writer of grey cells: shaded by the first number, the next one in brackets."""

    def write(cell: Cell) -> tuple[str, str, bool]:
        value, *others = of(cell)
        text = "\n".join([number(value), *(f"({number(one)})" for one in others)])
        if value is None:
            return "#ffffff", text, False
        darkness = DARKEST * min(max((value - lightest) / (darkest - lightest), 0), 1)
        part = round(255 * float(grey(darkness)))
        return f"#{part:02x}{part:02x}{part:02x}", text, False

    return write


def panel(axes: Any, cells: Sequence[Cell], write: Write, title: str) -> None:
    """Draw a cell of each regime: segregation across, ranges and accuracies down."""
    from matplotlib.patches import Rectangle

    across = sorted({cell.regime.segregation for cell in cells})
    down = list(dict.fromkeys((cell.ranges, cell.accuracies) for cell in cells))
    frames = []
    for cell in cells:
        x = across.index(cell.regime.segregation)
        y = down.index((cell.ranges, cell.accuracies))
        colour, text, is_marked = write(cell)
        axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=colour, edgecolor="0.75"))
        if is_marked:
            frames.append(Rectangle((x - 0.47, y - 0.46), 0.94, 0.92, fill=False, ec=INK, lw=2))
        axes.text(
            x,
            y,
            text,
            ha="center",
            va="center",
            fontsize=SMALL,
            color="white" if is_dark(colour) else "black",
            weight="bold" if is_marked else "normal",
        )
    for frame in frames:
        axes.add_patch(frame)
    axes.set_xlim(-0.5, len(across) - 0.5)
    axes.set_ylim(len(down) - 0.5, -0.5)
    axes.set_xticks(range(len(across)), [f"{s:g}" for s in across])
    axes.set_yticks(range(len(down)), [f"{r} ranges,\n{a} accuracies" for r, a in down])
    axes.tick_params(length=0)
    axes.set_title(title)
    for spine in axes.spines.values():
        spine.set_visible(False)
