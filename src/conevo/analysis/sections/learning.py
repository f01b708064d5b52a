"""How the treatments of a group got where they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from conevo.analysis import figures
from conevo.analysis.comparison import (
    Cell,
    Treatment,
)
from conevo.analysis.courses import Course, Histories, courses
from conevo.analysis.exhibits import (
    Exhibit,
    Figure,
    Section,
)
from conevo.analysis.sections.scope import Scope, sizes, span

__all__ = ["learning"]

SHORT: dict[str, str] = {"specialization": "S", "thresholds": "SST, GST", "size": "hidden neurons"}


def learning(scope: Scope, histories: Histories) -> Section:
    """Return learning curves, specialization and thresholds over team evaluations."""
    exhibits: list[Exhibit] = []
    at = "of the fittest team of each generation"
    drawn = (
        ("learning", f"Task performance ({scope.unit}) {at}", {"": "value"}, None),
        ("specialization", f"Degree of specialization S {at}, mean over its robots",
         {"": "specialization"}, (0.0, 1.0)),
        ("thresholds", "Thresholds SST and GST of CONE", {", SST": "sst", ", GST": "gst"},
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
            exhibits.append(_course_figure(scope, name, title, lines, list(columns), limits))
    return Section("Learning", (), exhibits)


def _course_figure(
    scope: Scope,
    name: str,
    title: str,
    lines: Mapping[tuple[Cell, str], Course],
    suffixes: Sequence[str],
    limits: tuple[float, float] | None,
) -> Figure:
    """Draw courses, a panel per environment, a line per treatment and suffix."""
    counts: dict[tuple[Treatment, str], list[int]] = {}
    for (cell, suffix), course in lines.items():
        counts.setdefault((cell.treatment, suffix), []).append(course.n)
    legend = {
        (treatment, suffix): f"{treatment.title}{suffix} ({span(counts[treatment, suffix])})"
        for treatment in scope.treatments
        for suffix in suffixes
        if (treatment, suffix) in counts
    }
    panels: dict[str, dict[str, figures.Band]] = {}
    for (cell, suffix), course in lines.items():
        band = figures.Band(course.x, course.mean, course.low, course.high)
        panels.setdefault(cell.environment, {})[legend[cell.treatment, suffix]] = band
    ordered = {e: panels[e] for e in scope.environments if e in panels}
    rows = [
        scope.key(cell.environment, cell.treatment)
        | ({"threshold": suffix.removeprefix(", ")} if suffix else {})
        | {"evaluations": x, "mean": mean, "interval": (low, high), "n": course.n}
        for (cell, suffix), course in lines.items()
        for x, mean, low, high in zip(*course[:4], strict=True)
    ]
    return Figure(
        f"{scope.stem}-{name}",
        title,
        "Mean over runs at equal numbers of team evaluations, with Student's 95 % interval as a "
        f"band. {sizes(course.n for course in lines.values())} per line.",
        (),
        rows,
        drawing=figures.lines(
            ordered,
            list(legend.values()),
            x_label="team evaluations",
            y_label=SHORT.get(name, scope.unit),
            limits=limits,
        ),
    )
