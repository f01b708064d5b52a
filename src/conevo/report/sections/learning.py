"""The learning curves of the treatments of a group."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from conevo.report.comparison import Cell
from conevo.report.exhibits import Column, Exhibit, Figure, Section, Table, plain
from conevo.report.figures import curves
from conevo.report.figures.style import EVERYTHING
from conevo.report.learning_curves import Course, Histories, courses
from conevo.report.sections.scope import KEYS, Scope, key, named, sizes
from conevo.terms import S_SCALE

__all__ = ["learning"]

MOST_PANELS = 40  # of curves that fit on a page
SHORT: dict[str, str] = {"specialization": "S", "thresholds": "SST, GST", "size": "hidden neurons"}


def learning(scope: Scope, histories: Histories) -> Section:
    """Return learning curves, specialization and thresholds over team evaluations."""
    exhibits: list[Exhibit] = []
    at = "of the fittest team of each generation"
    drawn = (
        ("learning", f"Task performance ({scope.unit}; {scope.main.direction}) {at}",
         {"": "value"}, None),
        ("specialization", f"Degree of specialization S ({S_SCALE}) {at}, mean over its robots",
         {"": "specialization"}, (0.0, 1.0)),
        ("thresholds", "Thresholds SST and GST of CONE", {"SST": "sst", "GST": "gst"},
         (0.0, 1.0)),
        ("size", f"Hidden neurons per controller {at}", {"": "hidden"}, None),
    )  # fmt: skip
    for name, title, columns, limits in drawn:
        lines: dict[tuple[Cell, str], Course] = {}
        for suffix, column in columns.items():
            found = courses(histories, column)
            lines |= {(cell, suffix): course for cell, course in found.items()}
        if name == "size" and all(c.mean.min() == c.mean.max() for c in lines.values()):
            continue
        if lines:
            exhibits.append(_exhibit(scope, name, title, lines, limits))
    return Section("Learning", (), exhibits)


def _exhibit(
    scope: Scope,
    name: str,
    title: str,
    lines: Mapping[tuple[Cell, str], Course],
    limits: tuple[float, float] | None,
) -> Exhibit:
    """Draw courses, a panel per environment and variant; a table if those are too many."""
    rows = [
        key(cell)
        | ({"threshold": suffix} if suffix else {})
        | {"evaluations": x, "mean": mean, "interval": (low, high), "n": course.n}
        for (cell, suffix), course in lines.items()
        for x, mean, low, high in zip(*course[:4], strict=True)
    ]
    several = any(course.n > 1 for course in lines.values())
    note = "Mean over runs at equal numbers of team evaluations" if several else "One run per cell"
    at = scope.arranged({cell for cell, _ in lines}, by_environment=True)
    if not at.is_drawable or len(at.small_panels()) > MOST_PANELS:
        return _course_table(scope, name, title, f"{note}.", lines, rows)
    counts = {cell: course.n for (cell, _), course in lines.items()}
    titles = named(counts)
    suffixes = list(dict.fromkeys(suffix for _, suffix in lines))
    legend = {
        curves.Line(method, suffix): f"{titles[method]}, {suffix}" if suffix else titles[method]
        for method in titles
        for suffix in suffixes
        if any(of == suffix and cell.treatment.method == method for cell, of in lines)
    }
    panels = {
        title: {
            curves.Line(cell.treatment.method, suffix): course
            for (cell, suffix), course in lines.items()
            if cell in cells
        }
        for title, cells in at.small_panels().items()
    }
    return Figure(
        f"{scope.stem}-{name}",
        title,
        note
        + (", with Student's 95 % interval as a band" if several else "")
        + f". {sizes(counts.values())} per line.",
        rows=rows,
        drawing=curves.lines(
            panels,
            legend,
            x_label="team evaluations",
            y_label=SHORT.get(name, scope.unit),
            limits=limits,
            within=limits or (scope.within if name == "learning" else EVERYTHING),
        ),
    )


def _course_table(
    scope: Scope,
    name: str,
    title: str,
    note: str,
    lines: Mapping[tuple[Cell, str], Course],
    numbers: Sequence[Mapping[str, Any]],
) -> Table:
    """Return courses at quarters of the budget."""
    most = max(float(course.x[-1]) for course in lines.values())
    quarters = [round(most * k / 4) for k in (1, 2, 3, 4)]
    has_parts = any(suffix for _, suffix in lines)
    columns: list[Column[tuple[Cell, str, Course]]] = [
        *KEYS,
        Column("threshold", "threshold" * has_parts, plain, of=lambda one: one[1]),
        Column("n", "n", of=lambda one: one[2].n),
        *map(_at, quarters),
    ]
    items = [(*about, course) for about, course in lines.items()]
    note += " At the number of team evaluations given; n: runs."
    return Table.of(f"{scope.stem}-{name}", title, note, columns, items, True, numbers)


def _at(evaluations: int) -> Column[tuple[Cell, str, Course]]:
    """Return the values of courses after that number of team evaluations; None before a start."""

    def value(one: tuple[Cell, str, Course]) -> float | None:
        reached = one[2].x <= evaluations
        return float(one[2].mean[reached][-1]) if reached.any() else None

    return Column(str(evaluations), f"at {evaluations:,}", of=value)
