"""The castes of the fittest teams of a group."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from conevo.palette import caste_colours
from conevo.report.comparison import Cell, Treatment
from conevo.report.exhibits import Column, Exhibit, Figure, Section, Table, plain, rows_of
from conevo.report.figures import curves
from conevo.report.learning_curves import Histories, caste_courses
from conevo.report.sections.arrangement import Arrangement
from conevo.report.sections.scope import KEYS, SHOWN_KEYS, Scope, key, sizes
from conevo.specialization.favourite import MAJORITY
from conevo.terms import NON_SPECIALIZED, S_SCALE, SHARE_SCALE
from conevo.worlds.registry import colours_of

__all__ = ["castes"]

MOST_ROWS = 12  # of panels that fit on a page
TEAMS = f"""
    SELECT cell, count(*), count(*) FILTER (castes = 1), avg(specialized), avg(devoted)
    FROM own JOIN (
        SELECT run, count(DISTINCT caste) AS castes,
            count(DISTINCT caste) FILTER (caste <> '{NON_SPECIALIZED}') AS specialized,
            if(count(setting_share) > 0, count(*) FILTER (setting_share > {MAJORITY}), NULL)
                AS devoted
        FROM robots GROUP BY run
    ) USING (run) GROUP BY cell
"""
MEMBERS = f"""
    SELECT min(cell), caste, favourite_setting, count(*),
        count(*) / sum(count(*)) OVER (PARTITION BY {{group}}), avg(setting_share),
        count(*) FILTER (setting_share > {MAJORITY})
    FROM own JOIN robots USING (run) JOIN runs USING (run) WHERE setting_share IS NOT NULL
    GROUP BY {{group}}, caste, favourite_setting ORDER BY count(*) DESC, caste, favourite_setting
"""


class _Member(NamedTuple):
    """Robots of champions that have a caste and a favourite setting in common.

    cell: of all of them, or the first of their treatment. robots: how many; portion: of all robots
    of the cell or treatment. share: of the setting in those that they used, mean. devoted: how many
    used it in more than half of their work.
    """

    cell: Cell
    caste: str
    setting: str
    robots: int
    portion: float
    share: float
    devoted: int


def castes(scope: Scope, histories: Histories) -> Section:
    """Return castes over generations, and those of the champions."""
    exhibits: list[Exhibit] = []
    x, found = caste_courses(histories)
    at = scope.arranged(found, by_environment=True)
    if found and at.is_drawable and len(at.small_panels()) <= MOST_ROWS:
        exhibits.append(_over_generations(scope, histories, at, x, found))
    exhibits += [*_of_champions(scope), *_by_setting(scope)]
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
        key(cell) | {"evaluations": float(evaluations), "caste": name, "share": float(share)}
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


def _of_champions(scope: Scope) -> list[Table]:
    """Return the castes of each cell's champions, as they were studied; nothing without a study."""
    robots = {
        (cell, caste): robots
        for cell, caste, robots in scope.per_cell(
            "SELECT cell, caste, count(*) FROM own JOIN robots USING (run) GROUP BY ALL"
        )
    }
    if not robots:
        return []
    teams = {cell: team for cell, *team in scope.per_cell(TEAMS)}
    names = sorted({caste for _, caste in robots}, key=lambda name: (name == NON_SPECIALIZED, name))
    rows = [
        key(cell)
        | {"n": n, "one_caste": of_one_caste, "specialized": specialized}
        | {name: robots.get((cell, name), 0) / n for name in names}
        | {"devoted": devoted}
        for cell in scope.ordered(teams)
        for n, of_one_caste, specialized, devoted in [teams[cell]]
    ]
    columns = [
        *SHOWN_KEYS,
        Column("n", "n"),
        *(Column(name, name) for name in names),
        Column("specialized", "specialized castes"),
        Column("one_caste", "teams of one caste"),
        Column("devoted", f"robots above {MAJORITY:g} in one setting"),
    ]
    note = (
        "Robots in each caste, mean over the champions, observed in fresh scenarios; specialized "
        "castes: how many a champion has, mean; n: runs. Castes go by S, which cannot see with "
        f"which setting a robot works: robots above {MAJORITY:g} in one setting do more than half "
        "of their work with it, whatever they do in between."
    )
    return [Table(f"{scope.stem}-champions", "Castes of the champions", note, columns, rows)]


def _by_setting(scope: Scope) -> list[Table]:
    """Show castes by S next to favourite settings, a row per method and pair of them."""
    by_cell, by_treatment = (
        [_Member(*row) for row in scope.per_cell(MEMBERS.format(group=group))]
        for group in ("cell", "method, variant")
    )
    if not by_cell:
        return []
    by_cell.sort(key=lambda one: scope.ordered(scope.cells).index(one.cell))
    by_treatment.sort(key=lambda one: scope.treatments.index(one.cell.treatment))
    pair: list[Column[_Member]] = [
        Column("caste", "caste by S", plain),
        Column("setting", "favourite setting", plain),
        Column("robots", "robots"),
    ]
    of_pair: list[Column[_Member]] = [
        Column("share", "share of it"),
        Column("devoted", f"robots above {MAJORITY:g}"),
    ]
    n: Column[_Member] = Column("n", of=lambda one: len(scope.cells[one.cell]))
    table = Table.of(
        f"{scope.stem}-favourites",
        "Castes by S, and the settings that robots prefer",
        "All robots of the champions, in fresh scenarios, environments together (CSV: each of "
        "them). Share of it: of the actions with the favourite setting in all actions that have "
        f"settings, mean ({SHARE_SCALE}); robots above {MAJORITY:g}: those with more than half of "
        "them. S shows how often a robot switches actions, and cannot see settings: one that "
        "moves and detects in turn has S = 1 and is non-specialized, even if it always detects "
        "with the same setting.",
        [KEYS[-1], *pair, Column("portion", "portion of the robots"), *of_pair],
        by_treatment,
        numbers=rows_of([*KEYS, n, *pair, *of_pair], by_cell),
    )
    return [table]
