"""What the predators of a group do: collective and individual behaviours (pursuit only)."""

from __future__ import annotations

from collections import Counter, defaultdict

from conevo.analysis import tiles
from conevo.analysis.captures import COLLECTIVES
from conevo.analysis.comparison import Cell
from conevo.analysis.exhibits import Column, Figure, Section, Table, number
from conevo.analysis.sections.scope import KEYS, Scope, sizes
from conevo.palette import FAINT, several

__all__ = ["behaviours"]

MOST_BARS = 45  # that fit on a page
COLOURS = (*several(len(COLLECTIVES) - 1), FAINT)


def behaviours(scope: Scope) -> Section | None:
    """Return which collective behaviours captured the prey; None in other worlds."""
    cells = {one.run: cell for cell, values in scope.cells.items() for one in values}
    counts: dict[str, dict[Cell, Counter[str]]] = defaultdict(lambda: defaultdict(Counter))
    studied: dict[Cell, set[str]] = defaultdict(set)
    for run, kind, behaviour, count in scope.tables.query(
        "SELECT run, kind, behaviour, count FROM behaviours ORDER BY ALL"
    )[1]:
        if run in cells:
            # The team's row names its most frequent behaviour: there it is runs that are counted.
            counts[kind][cells[run]][behaviour] += 1 if kind == "team" else count
            studied[cells[run]].add(run)
    if not counts:
        return None
    ordered = [
        Cell(environment, treatment)
        for environment in scope.environments
        for treatment in scope.treatments
        if Cell(environment, treatment) in studied
    ]
    n = {cell: len(studied[cell]) for cell in ordered}
    return Section(
        "Behaviours",
        (),
        [*_captures(scope, counts["collective"], n), _table(scope, counts, n)],
    )


def _captures(scope: Scope, counts: dict[Cell, Counter[str]], n: dict[Cell, int]) -> list[Figure]:
    """Draw a bar per cell that captured something; nothing if they are too many for a page."""
    total = {cell: sum(counts[cell].values()) for cell in n}
    names = list(COLLECTIVES)
    shares = {
        (cell.environment, f"{cell.treatment.title} (n = {n[cell]}, {total[cell]} captures)"): {
            name: counts[cell][name] / total[cell] for name in names
        }
        for cell in n
        if total[cell]
    }
    if not 0 < len(shares) <= MOST_BARS:
        return []
    rows = [
        scope.key(cell.environment, cell.treatment)
        | {"n": n[cell], "captures": total[cell], "behaviour": name, "count": counts[cell][name]}
        for cell in n
        for name in names
    ]
    figure = Figure(
        f"{scope.stem}-captures",
        "Captures by collective behaviour",
        "Share of all captures of the champions in fresh scenarios. "
        f"{sizes(n.values())} per bar; teams that captured nothing have no bar.",
        (),
        rows,
        drawing=tiles.shares(
            shares, dict(zip(names, COLOURS, strict=True)), x_label="share of the captures"
        ),
    )
    return [figure]


def _table(scope: Scope, counts: dict[str, dict[Cell, Counter[str]]], n: dict[Cell, int]) -> Table:
    individual = sorted({name for of in counts["individual"].values() for name in of})
    collective = [name for name in COLLECTIVES if any(of[name] for of in counts["team"].values())]
    rows = [
        scope.key(cell.environment, cell.treatment)
        | {"n": n[cell]}
        | {f"runs {name}": counts["team"][cell][name] for name in collective}
        | {f"robots {name}": counts["individual"][cell][name] / n[cell] for name in individual}
        for cell in n
    ]
    columns = [
        *KEYS,
        Column("n", "n"),
        *(Column(f"runs {name}", name, number) for name in collective),
        *(Column(f"robots {name}", name, number) for name in individual),
    ]
    return Table(
        f"{scope.stem}-behaviours",
        "Behaviours of the champions",
        f"First {len(collective)} behaviours: runs whose champion captures so most often; last "
        f"{len(individual)}: predators of a champion that are specialized to it, mean; n: runs.",
        columns,
        rows,
        is_open=len(rows) <= 12,
    )
