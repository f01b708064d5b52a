"""What the fittest teams of a group are made of."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from conevo.analysis import curves
from conevo.analysis.comparison import Cell, Treatment
from conevo.analysis.courses import Histories, caste_courses
from conevo.analysis.exhibits import Column, Exhibit, Figure, Section, Table, number
from conevo.analysis.sections.arrangement import Arrangement
from conevo.analysis.sections.scope import KEYS, Scope, sizes
from conevo.palette import caste_colours
from conevo.terms import NON_SPECIALIZED, S_SCALE
from conevo.worlds.registry import colours_of

__all__ = ["castes"]

MOST_ROWS = 12  # of panels that fit on a page


def castes(scope: Scope, histories: Histories) -> Section:
    """Return castes over generations, and those of the champions."""
    exhibits: list[Exhibit] = []
    x, found = caste_courses(histories)
    at = scope.arranged(found, by_environment=True)
    if found and at.is_drawable and len(at.small_panels()) <= MOST_ROWS:
        exhibits.append(_over_generations(scope, histories, at, x, found))
    teams = _champions(scope)
    if teams:
        exhibits.append(_of_champions(scope, teams))
    text = () if exhibits else ("No team of these runs was studied.",)
    return Section("Castes", text, exhibits)


def _over_generations(
    scope: Scope,
    histories: Histories,
    at: Arrangement,
    x: Any,
    found: Mapping[Cell, Mapping[str, Any]],
) -> Figure:
    """Draw castes, a row per environment and variant, a column per method."""
    titles = {treatment.method: Treatment(treatment.method, "").title for _, treatment in found}
    ordered = {
        (row, titles[cell.treatment.method]): found[cell]
        for row, cells in at.small_panels().items()
        for cell in sorted(cells, key=lambda one: at.methods.index(one.treatment.method))
    }
    rows = [
        scope.key(cell.environment, cell.treatment)
        | {"evaluations": float(evaluations), "caste": name, "share": float(share)}
        for cell, parts in found.items()
        for name, shares in parts.items()
        for evaluations, share in zip(x, shares, strict=True)
        if math.isfinite(share)
    ]
    size = sizes(len(scope.cells.get(cell, ())) for cell in found)
    colours = caste_colours(colours_of(scope.group.world), histories.castes)
    return Figure(
        f"{scope.stem}-castes",
        "Castes of the fittest team over the generations",
        "Share of the robots in each caste, mean over runs, at equal numbers of team evaluations; "
        f"a robot is in the caste of what it does most if S < 0.5 ({S_SCALE}). A panel is empty "
        f"until the first generation has ended. {size} per panel.",
        (),
        rows,
        drawing=curves.stacks(
            ordered,
            x,
            {name: colour for name, colour in colours.items() if name in histories.castes},
            x_label="team evaluations",
            y_label="share of the robots",
        ),
    )


def _champions(scope: Scope) -> dict[Cell, list[dict[str, int]]]:
    """Return the castes of each run's champion in the study, with their robots."""
    cells = {one.run: cell for cell, values in scope.cells.items() for one in values}
    teams: dict[str, dict[str, int]] = defaultdict(dict)
    for run, caste, robots in scope.tables.query(
        "SELECT run, caste, count(*) FROM robots GROUP BY ALL ORDER BY ALL"
    )[1]:
        if run in cells:
            teams[run][caste] = robots
    found: dict[Cell, list[dict[str, int]]] = defaultdict(list)
    for run, team in teams.items():
        found[cells[run]].append(team)
    return {cell: found[cell] for cell in scope.cells if cell in found}


def _of_champions(scope: Scope, teams: Mapping[Cell, Sequence[Mapping[str, int]]]) -> Table:
    seen = {caste for of in teams.values() for team in of for caste in team}
    names = [*sorted(seen - {NON_SPECIALIZED}), *({NON_SPECIALIZED} & seen)]
    rows = [
        scope.key(environment, treatment)
        | {"n": len(of), "one_caste": sum(len(team) == 1 for team in of)}
        | {"specialized": float(np.mean([len(set(team) - {NON_SPECIALIZED}) for team in of]))}
        | {name: float(np.mean([team.get(name, 0) for team in of])) for name in names}
        for environment, treatment, of in _in_order(scope, teams)
    ]
    columns = [
        *KEYS,
        Column("n", "n"),
        *(Column(name, name, number) for name in names),
        Column("specialized", "specialized castes"),
        Column("one_caste", "teams of one caste"),
    ]
    return Table(
        f"{scope.stem}-champions",
        "Castes of the champions",
        "Robots in each caste, mean over the champions, observed in fresh scenarios; specialized "
        "castes: how many a champion has, mean; n: runs.",
        columns,
        rows,
        is_open=len(rows) <= 12,
    )


def _in_order(
    scope: Scope, teams: Mapping[Cell, Sequence[Mapping[str, int]]]
) -> list[tuple[str, Treatment, Sequence[Mapping[str, int]]]]:
    return [
        (environment, treatment, teams[Cell(environment, treatment)])
        for environment in scope.environments
        for treatment in scope.treatments
        if Cell(environment, treatment) in teams
    ]
