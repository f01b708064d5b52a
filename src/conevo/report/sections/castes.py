"""The castes of the fittest teams of a group."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from conevo.palette import caste_colours
from conevo.report.comparison import Cell, Treatment
from conevo.report.exhibits import Column, Exhibit, Figure, Section, Table, number, plain
from conevo.report.figures import curves
from conevo.report.learning_curves import Histories, caste_courses
from conevo.report.sections.arrangement import Arrangement
from conevo.report.sections.scope import KEYS, Scope, sizes
from conevo.specialization.favourite import MAJORITY
from conevo.terms import NON_SPECIALIZED, S_SCALE, SHARE_SCALE
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
    if members := _members(scope):
        exhibits.append(_by_setting(scope, members))
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
        f"a robot is in the caste of its most frequent action if S < 0.5 ({S_SCALE}). A panel is "
        f"empty until the first generation has ended. {size} per panel.",
        rows=rows,
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
    found: dict[Cell, dict[str, dict[str, int]]] = defaultdict(lambda: defaultdict(dict))
    for cell, run, caste, robots in scope.rows(
        "SELECT run, caste, count(*) FROM robots GROUP BY ALL ORDER BY ALL"
    ):
        found[cell][run][caste] = robots
    return {cell: list(teams.values()) for cell, teams in found.items()}


def _devoted(scope: Scope) -> dict[Cell, float]:
    """Return how many robots of a champion do more than half of their work in one setting, mean."""
    found = scope.per_cell(
        f"SELECT cell, avg(n) FROM (SELECT run, count(*) FILTER (setting_share > {MAJORITY}) AS n"
        " FROM robots GROUP BY run HAVING count(setting_share) > 0) JOIN own USING (run)"
        " GROUP BY cell"
    )
    return dict(found)


def _of_champions(scope: Scope, teams: Mapping[Cell, Sequence[Mapping[str, int]]]) -> Table:
    seen = {caste for of in teams.values() for team in of for caste in team}
    names = [*sorted(seen - {NON_SPECIALIZED}), *({NON_SPECIALIZED} & seen)]
    devoted = _devoted(scope)
    rows: list[dict[str, Any]] = [
        scope.key(*cell)
        | {"n": len(of), "one_caste": sum(len(team) == 1 for team in of)}
        | {"specialized": float(np.mean([len(set(team) - {NON_SPECIALIZED}) for team in of]))}
        | {name: float(np.mean([team.get(name, 0) for team in of])) for name in names}
        | {"devoted": devoted.get(cell)}
        for cell in scope.ordered(teams)
        for of in [teams[cell]]
    ]
    columns = [
        *KEYS,
        Column("n", "n"),
        *(Column(name, name, number) for name in names),
        Column("specialized", "specialized castes"),
        Column("one_caste", "teams of one caste"),
        Column("devoted", f"robots above {MAJORITY:g} in one setting"),
    ]
    return Table(
        f"{scope.stem}-champions",
        "Castes of the champions",
        "Robots in each caste, mean over the champions, observed in fresh scenarios; specialized "
        "castes: how many a champion has, mean; n: runs. Castes go by S, which cannot see with "
        f"which setting a robot works: robots above {MAJORITY:g} in one setting do more than half "
        "of their work with it, whatever they do in between.",
        columns,
        rows,
    )


class _Member(NamedTuple):
    """Robots of a cell's champions that have a caste and a favourite setting in common.

    robots: how many; share: of the setting in those that they used, mean; devoted: how many used
    it in more than half of their work.
    """

    cell: Cell
    caste: str
    setting: str
    robots: int
    share: float
    devoted: int


def _members(scope: Scope) -> list[_Member]:
    """Return who is in which caste with which favourite; of studies that have favourites."""
    found = scope.per_cell(
        "SELECT cell, caste, favourite_setting, count(*), avg(setting_share),"
        f" count(*) FILTER (setting_share > {MAJORITY}) FROM own JOIN robots USING (run)"
        " WHERE setting_share IS NOT NULL GROUP BY ALL"
        " ORDER BY cell, count(*) DESC, caste, favourite_setting"
    )
    return [_Member(*row) for row in found]


def _by_setting(scope: Scope, members: Sequence[_Member]) -> Table:
    """Show castes by S next to favourite settings, a row per method and pair of them."""
    numbers = [
        scope.key(*cell) | {"n": len(scope.cells[cell])} | _shown([one])
        for cell in scope.ordered(scope.cells)
        for one in members
        if one.cell == cell
    ]
    rows = []
    for treatment in scope.treatments:
        pairs: dict[tuple[str, str], list[_Member]] = defaultdict(list)
        for one in members:
            if one.cell.treatment == treatment:
                pairs[one.caste, one.setting].append(one)
        of = [_shown(group) for group in pairs.values()]
        total = sum(row["robots"] for row in of)
        rows += [
            {"treatment": treatment.title} | row | {"portion": row["robots"] / total}
            for row in sorted(of, key=lambda row: (-row["robots"], row["caste"], row["setting"]))
        ]
    columns = [
        KEYS[1],
        Column("caste", "caste by S", plain),
        Column("setting", "favourite setting", plain),
        Column("robots", "robots"),
        Column("portion", "portion of the robots"),
        Column("share", "share of it"),
        Column("devoted", f"robots above {MAJORITY:g}"),
    ]
    return Table(
        f"{scope.stem}-favourites",
        "Castes by S, and the settings that robots prefer",
        "All robots of the champions, in fresh scenarios, environments together (CSV: each of "
        "them). Share of it: of the actions with the favourite setting in all actions that have "
        f"settings, mean ({SHARE_SCALE}); robots above {MAJORITY:g}: those with more than half of "
        "them. S shows how often a robot switches actions, and cannot see settings: one that "
        "moves and detects in turn has S = 1 and is non-specialized, even if it always detects "
        "with the same setting.",
        columns,
        rows,
        numbers=numbers,
    )


def _shown(group: Sequence[_Member]) -> dict[str, Any]:
    """Return members of one caste and favourite as a row."""
    robots = sum(one.robots for one in group)
    return {
        "caste": group[0].caste,
        "setting": group[0].setting,
        "robots": robots,
        "share": sum(one.share * one.robots for one in group) / robots,
        "devoted": sum(one.devoted for one in group),
    }
