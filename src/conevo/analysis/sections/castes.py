"""What the fittest teams of a group are made of."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from conevo.analysis import figures
from conevo.analysis.comparison import Cell, Treatment
from conevo.analysis.courses import Histories, caste_courses
from conevo.analysis.exhibits import Column, Exhibit, Figure, Section, Table, number, plain
from conevo.analysis.sections.scope import Scope, sizes
from conevo.specialization.individual import NON_SPECIALIZED

__all__ = ["castes"]


def castes(scope: Scope, histories: Histories) -> Section:
    """Return castes over generations, and those of the champions."""
    exhibits: list[Exhibit] = []
    x, found = caste_courses(histories)
    if found:
        exhibits.append(_over_generations(scope, histories, x, found))
    teams = _champions(scope)
    if teams:
        exhibits.append(_of_champions(scope, teams))
    text = () if exhibits else ("No team of these runs was studied.",)
    return Section("Castes", text, exhibits)


def _over_generations(
    scope: Scope, histories: Histories, x: Any, found: Mapping[Cell, Mapping[str, Any]]
) -> Figure:
    names = [*(name for name in histories.castes if name != NON_SPECIALIZED), NON_SPECIALIZED]
    titles = {treatment: treatment.title for treatment in scope.treatments}
    ordered = {
        (environment, titles[treatment]): found[Cell(environment, treatment)]
        for environment in scope.environments
        for treatment in scope.treatments
        if Cell(environment, treatment) in found
    }
    rows = [
        scope.key(cell.environment, cell.treatment)
        | {"evaluations": float(at), "caste": name, "share": float(share)}
        for cell, parts in found.items()
        for name, shares in parts.items()
        for at, share in zip(x, shares, strict=True)
    ]
    size = sizes(len(values) for values in scope.cells.values())
    return Figure(
        f"{scope.stem}-castes",
        "Castes of the fittest team over the generations",
        "Share of the robots in each caste, mean over runs, at equal numbers of team evaluations; "
        f"a robot is in the caste of what it does most if S < 0.5. {size} per panel.",
        (),
        rows,
        drawing=figures.stacks(
            ordered,
            x,
            names,
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
        Column("environment", "environment", plain),
        Column("treatment", "method", plain),
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
