"""Draw the learning curves of the campaign of all techniques, a row for each task.

    python experiments/techniques_figure.py campaigns/techniques --write docs/results/techniques.png

A column holds the methods of one kind in colour, and all others in grey. The means over the seeds
at 40 numbers of team evaluations go to ``techniques-curves.csv`` next to the picture; ``--again``
draws from that file.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from conevo.campaigns.tables import Tables
from conevo.cli.lookup import find_campaign, sealed
from conevo.evolution.methods.registry import title_of
from conevo.palette import several
from conevo.report.comparison import group_values
from conevo.report.figures.style import grey, style
from conevo.report.learning_curves import courses, read_histories
from pages import Row, read, write

KINDS = {
    "five of the thesis": ("homcne", "hetcne", "ccga", "mesp", "cone"),
    "neurons and networks": ("sane", "esp", "cosyne", "hyb-ccea"),
    "topology and rules": ("neat", "hyperneat", "ccga thresholds", "ccga rules"),
    "strategies": ("openai-es", "cma-es", "hom-es", "cone-es"),
    "diversity": ("novelty", "map-elites"),
}
POINTS = 40
SIZE = (12.0, 8.0)  # inches


def curves_of(name: str) -> list[Row]:
    """Return a row per task, technique and number of team evaluations: mean over seeds."""
    rows: list[Row] = []
    with sealed(find_campaign(name)) as folder, Tables(folder) as tables:
        for group in group_values(tables.values()):
            for cell, course in courses(read_histories(tables, group), "value", POINTS).items():
                task = f"{group.world}/{cell.environment}"
                what = technique(cell.treatment.method, cell.treatment.variant)
                rows += [
                    {"task": task, "technique": what, "evaluations": float(x), "value": float(y)}
                    for x, y in zip(course.x, course.mean, strict=True)
                ]
    return rows


def technique(method: str, variant: str) -> str:
    """Return a method, and the controller if it is not the default one."""
    controller = variant.rpartition("=")[2]
    return method if controller in ("", "srn") else f"{method} {controller}"


def title(of: str) -> str:
    """Return a technique as the legend shows it."""
    method, _, controller = of.partition(" ")
    return f"{title_of(method)}, {controller}" if controller else title_of(method)


def draw(rows: Sequence[Row], picture: Path) -> None:
    """Write the picture."""
    lines: dict[str, dict[str, tuple[list[float], list[float]]]] = {}
    for row in rows:
        x, y = lines.setdefault(row["task"], {}).setdefault(row["technique"], ([], []))
        x.append(row["evaluations"])
        y.append(row["value"])
    with style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=SIZE, layout="constrained")
        grid = figure.subplots(len(lines), len(KINDS), sharex="row", sharey="row", squeeze=False)
        for panels, (task, of) in zip(grid, lines.items(), strict=True):
            panels[0].set_ylabel(task)
            for axes, (kind, names) in zip(panels, KINDS.items(), strict=True):
                for x, y in of.values():
                    axes.plot(x, y, color=grey(0.2), linewidth=0.7)
                for name, colour in zip(names, several(len(names)), strict=True):
                    if name in of:
                        axes.plot(*of[name], color=colour, linewidth=1.5, label=title(name))
                axes.set_ylim(bottom=0)
                if axes in grid[0]:
                    axes.set_title(kind)
                if axes in grid[-1]:
                    axes.set_xlabel("team evaluations")
        for axes in grid[0]:
            axes.legend(loc="lower right", frameon=False)
        figure.savefig(picture, dpi=110, metadata={"Software": None})


def main() -> None:
    """Draw the curves."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("campaign", nargs="?")
    parser.add_argument("--write", type=Path, required=True)
    parser.add_argument("--again", action="store_true")
    args = parser.parse_args()
    numbers = args.write.with_name(f"{args.write.stem}-curves.csv")
    if not args.again:
        write(curves_of(args.campaign), numbers)
    draw(read(numbers), args.write)


if __name__ == "__main__":
    main()
