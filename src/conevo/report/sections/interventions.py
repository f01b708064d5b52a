"""Losses of teams without a caste or in changed places, and the performance of teams of clones.

Nitschke 2009, sections 4.6.5, 4.6.6, 5.5.3, 5.5.4, 6.5.4, 6.5.5. Choice: the loss of a run is in
percent of the larger of the two performances, as in the claims, so that a team that achieved almost
nothing before cannot outweigh all others; the thesis' percent of the unchanged team is that of the
means. If smaller values of a measure are better, an increase is a loss.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from statistics import fmean
from typing import NamedTuple

from conevo.report.comparison import Cell
from conevo.report.exhibits import (
    Column,
    Exhibit,
    Figure,
    Section,
    Table,
    interval,
    p_value,
    plain,
    rows_of,
    with_values,
)
from conevo.report.figures import charts as figures
from conevo.report.sections.scope import KEYS, Scope, named, sizes
from conevo.report.statistics import Comparison, Estimate, compare, holm, mean_interval

__all__ = ["interventions"]

MOST = 100.0  # percent that can be lost, and gained: of the larger of two performances
ROTATED = "rotated"  # the study without castes
OVER_CASTES = ": the mean over its castes"
ENDS = "which ends at ±100 %, where losses do"


class _Team(NamedTuple):
    """A changed team of a run: its main measure, and that of the team unchanged."""

    cell: Cell
    run: str
    caste: str
    whole: float
    value: float
    larger_is_better: bool

    @property
    def scale(self) -> float:
        """The larger absolute value of the two; their distance if the signs differ."""
        return max(abs(self.whole), abs(self.value), abs(self.whole - self.value))

    @property
    def lost(self) -> float:
        """The loss in percent of the larger of the two: -100 to 100, below 0 for a gain."""
        lost = self.whole - self.value if self.larger_is_better else self.value - self.whole
        return 100 * lost / self.scale


class _Changed(NamedTuple):
    """The changed teams of a cell and caste, the unchanged ones, and the loss in percent."""

    cell: Cell
    caste: str
    result: Comparison
    lost: Estimate
    p_holm: float | None = None


class _Study(NamedTuple):
    """An intervention: the title of its section, what is changed, and how."""

    title: str
    what: str
    note: str


STUDIES = {
    "lesion": _Study(
        "Lesions",
        "a caste replaced by heuristic robots",
        "All robots of a caste replaced by the heuristic controller that matches it; compared with "
        "the same team unlesioned in the same fresh scenarios.",
    ),
    "clones": _Study(
        "Behavioural validation: clones",
        "a caste cloned",
        "A team of clones of the caste's fittest robot; compared with the evolved team in the same "
        "fresh scenarios.",
    ),
    ROTATED: _Study(
        "Roles: controllers that change places",
        "controllers moved to other robots",
        "Every robot with the controller of the one K before it (conevo test RUN --rotate K), mean "
        "over all K from 1 to R - 1, so also over moves to robots of the same caste; compared with "
        "the evolved team in the same fresh scenarios. Nothing is lost where robots are alike, "
        "much where each has a role, also one that S and favourites do not see.",
    ),
}


def interventions(scope: Scope) -> list[Section]:
    """Return a section per study; none on changed places if no run was studied in that way."""
    return [one for study in STUDIES if (one := _section(scope, study))]


def _section(scope: Scope, study: str) -> Section | None:
    cells, lost = _teams(scope, study)
    if not cells and study == ROTATED:
        return None
    text = []
    if lost:
        text.append(f"Teams left out, as neither they nor the unchanged ones scored: {lost}.")
    if not cells:
        none = "None of these runs has an intervention study."
        return Section(STUDIES[study].title, text or [none])
    exhibits = [_figure(scope, study, cells), _table(scope, study, _compared(cells))]
    return Section(STUDIES[study].title, text, exhibits)


def _teams(scope: Scope, study: str) -> tuple[dict[Cell, list[_Team]], int]:
    """Return the changed teams of each cell by run, and the number with nothing to lose."""
    found = [
        _Team(cell, run, caste, whole, value, scope.main.larger_is_better)
        for cell, run, caste, whole, value in scope.per_cell(
            f"""
            SELECT cell, run, team,
                max(value) FILTER (team = 'whole') OVER (PARTITION BY run) AS whole, value
            FROM (
                SELECT cell, run, seed, team, avg(s.value) AS value
                FROM own JOIN scores s USING (run) JOIN runs r USING (run)
                WHERE s.study = '{study}' AND s.measure = r.measure AND s.value IS NOT NULL
                GROUP BY ALL
            )
            QUALIFY team <> 'whole' AND whole IS NOT NULL ORDER BY seed, run, team
            """
        )
    ]
    able = [team for team in found if team.scale > 0]
    cells = {cell: [team for team in able if team.cell == cell] for cell in scope.cells}
    return {cell: teams for cell, teams in cells.items() if teams}, len(found) - len(able)


def _figure(scope: Scope, study: str, cells: dict[Cell, list[_Team]]) -> Exhibit:
    """Draw a point per run: the mean over its castes."""
    _, what, note = STUDIES[study]
    means = {
        cell: [fmean(team.lost for team in of) for _, of in groupby(teams, lambda one: one.run)]
        for cell, teams in cells.items()
    }
    columns: list[Column[_Team]] = [
        *KEYS,
        Column("run", "run", plain),
        Column("caste", _caste_title(study), plain),
        Column("whole"),
        Column(scope.main.name, of=lambda one: one.value),
        Column("lost", "lost, %"),
    ]
    items = [team for teams in cells.values() for team in teams]
    title = f"Task performance ({scope.unit}) that is lost with {what}"
    at = scope.arranged(means)
    if not at.is_drawable:
        return Table.of(f"{scope.stem}-{study}", title, note, columns, items, is_folded=True)
    several = any(len(values) > 1 for values in means.values())
    size = sizes(len(values) for values in means.values())
    return Figure(
        f"{scope.stem}-{study}",
        title,
        f"{note} Percent of the larger of the two; below 0 the changed team was better "
        f"({scope.main.direction}). A point per run{'' if study == ROTATED else OVER_CASTES}"
        + (f"; next to them the mean with Student's 95 % interval, {ENDS}" if several else "")
        + f". {size} per cell.",
        rows=rows_of(columns, items),
        drawing=figures.points(
            at.grid(means, lambda of: figures.Points(of, mean_interval(of).ends(-MOST, MOST))),
            at.places,
            named({cell: len(values) for cell, values in means.items()}),
            x_label=at.axis,
            y_label="lost, % of the larger",
            reference=0.0,
            within=(-MOST, MOST),
        ),
    )


def _compared(cells: dict[Cell, list[_Team]]) -> list[_Changed]:
    """Return the changed teams of each cell and caste, compared with the unchanged ones."""
    found = []
    for cell, teams in cells.items():
        for caste in sorted({team.caste for team in teams}):
            with_it = [team for team in teams if team.caste == caste]
            result = compare([team.value for team in with_it], [team.whole for team in with_it])
            lost = mean_interval([team.lost for team in with_it])
            found.append(_Changed(cell, caste, result, lost))
    corrected = holm([one.result.p_mann_whitney for one in found])
    return [one._replace(p_holm=p) for one, p in zip(found, corrected, strict=True)]


def _caste_title(study: str) -> str:
    return "" if study == ROTATED else "caste"


def _percent(found: Comparison) -> float | None:
    """Return the mean of changed teams in percent of the unchanged ones', None if that is 0."""
    return 100 * found.mean_a / found.mean_b if found.mean_a is not None and found.mean_b else None


def _table(scope: Scope, study: str, changed: Sequence[_Changed]) -> Table:
    _, what, note = STUDIES[study]
    columns: list[Column[_Changed]] = [
        *KEYS,
        Column("caste", _caste_title(study), plain),
        Column("n", "n", of=lambda one: one.lost.n),
        Column("whole", "unchanged", of=lambda one: one.result.mean_b),
        Column("changed", "changed", of=lambda one: one.result.mean_a),
        Column("percent", "% of unchanged", of=lambda one: _percent(one.result)),
        Column("lost", "lost, %", of=lambda one: one.lost.value),
        Column("interval", "95 % interval", interval, of=lambda one: one.lost.within(-MOST, MOST)),
        Column("p_t", "p (t)", p_value, of=lambda one: one.result.p_t),
        Column("p_mann_whitney", of=lambda one: one.result.p_mann_whitney),
        Column("p_holm", "p (MW, Holm)", p_value),
    ]
    rows = rows_of(columns, changed)
    shown = with_values(columns, rows)
    is_tested = any(column.key == "p_t" for column in shown)
    tests = (
        f" with Student's 95 % interval, {ENDS}. p (t): Student's independent t-test of changed "
        "and unchanged teams, uncorrected, as in the thesis; p (MW, Holm): Mann-Whitney, corrected "
        f"by Holm for the {len(rows)} rows."
    )
    return Table(
        f"{scope.stem}-{study}-castes",
        f"Task performance ({scope.unit}) with {what}",
        f"{note} n: runs{'' if study == ROTATED else ' that have the caste'}; % of unchanged: of "
        "the means; lost: percent of the "
        f"larger of the two, mean over runs{tests if is_tested else '.'}",
        shown,
        rows,
    )
