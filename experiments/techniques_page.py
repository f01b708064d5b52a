"""Tables and learning curves of the campaign of all techniques, for its page.

    python experiments/techniques_page.py campaigns/techniques --write docs/results/techniques.md

The page gets one table with a row for each technique, and one that compares all with HomCNE. The
picture has a row for each task and a column for each kind of technique, with all others in grey.
Next to the page are a CSV file of the runs and one of the curves: means over the seeds at 40
numbers of team evaluations. ``--again`` makes all from these files.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import fmean, stdev

from compare_levels import comparison_table, rows_and_cost
from conevo.campaigns.tables import Tables
from conevo.cli.lookup import find_campaign, sealed
from conevo.errors import ConevoError
from conevo.evolution.methods.registry import title_of
from conevo.numbers import plus_minus
from conevo.palette import several
from conevo.report.comparison import group_values
from conevo.report.figures.style import grey, style
from conevo.report.learning_curves import courses, read_histories
from page_arguments import PageParser, rows_for
from pages import Row, put, read, table, write

KINDS = {
    "five of the thesis": ("homcne", "hetcne", "ccga", "mesp", "cone"),
    "neurons and networks": ("sane", "esp", "cosyne", "hyb-ccea"),
    "topology and rules": ("neat", "hyperneat", "ccga thresholds", "ccga rules"),
    "strategies": ("openai-es", "cma-es", "hom-es", "cone-es"),
    "diversity": ("novelty", "map-elites"),
}
CLONES = {"homcne", "sane", "esp", "cosyne", "neat", "openai-es", "cma-es", "hom-es"}
CLONES |= {"novelty", "map-elites"}  # with the default of method.team, as in the plan
POINTS = 40
SIZE = (12.0, 8.0)  # inches


def curves_of(name: str) -> list[Row]:
    """Return a row per task, technique and number of team evaluations: mean over seeds."""
    rows: list[Row] = []
    with sealed(find_campaign(name)) as folder, Tables(folder) as tables:
        for group in group_values(tables.values()):
            for cell, course in courses(read_histories(tables, group), "value", POINTS).items():
                task = f"{group.world}/{cell.environment}"
                controller = cell.treatment.variant.rpartition("=")[2]
                what = technique(cell.treatment.method, controller)
                rows += [
                    {"task": task, "technique": what, "evaluations": float(x), "value": float(y)}
                    for x, y in zip(course.x, course.mean, strict=True)
                ]
    return rows


def technique(method: str, controller: str) -> str:
    """Return a method, and the controller if it is not the default one."""
    return method if controller in ("", "srn") else f"{method} {controller}"


def overview(rows: Sequence[Row]) -> str:
    """Return a row for each technique: value and core seconds of a run in each task."""
    of: dict[str, dict[str, list[Row]]] = {}
    for row in rows:
        what = technique(row["method"], row.get("name", ""))
        of.setdefault(what, {}).setdefault(row["task"], []).append(row)
    tasks = list(dict.fromkeys(row["task"] for row in rows))
    lines = []
    for names in KINDS.values():
        for name in (one for one in names if one in of):
            line = [title(name), "clones" if name in CLONES else "different"]
            for task in tasks:
                runs = of[name].get(task, [])
                values = [float(run["value"]) for run in runs]
                sd = stdev(values) if len(values) > 1 else None
                line += [plus_minus(fmean(values), sd) if values else "-"]
                line += [f"{fmean(run['core_seconds'] for run in runs):.1f} s" if runs else "-"]
            lines.append(line)
    head = ["technique", "robots"]
    return table([*head, *(part for task in tasks for part in (task, "a run"))], lines)


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


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables and the picture."""
    parser = PageParser(__doc__)
    args = parser.parse(arguments)
    page: Path | None = args.write
    try:
        rows = rows_for(args, rows_and_cost)
        parts = {"overview": overview(rows), "homcne": comparison_table(rows, "method", "homcne")}
        for name, text in parts.items():
            print(f"{name}\n\n{text}")
            if page:
                put(text, page, name)
        if page:
            curves = page.with_name(f"{page.stem}-curves.csv")
            if not args.again:
                write(curves_of(args.campaign), curves)
            draw(read(curves), page.with_suffix(".png"))
    except (ConevoError, OSError) as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
