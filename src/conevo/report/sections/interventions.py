"""Losses of teams without a caste or in changed places, and the performance of teams of clones.

Nitschke 2009, sections 4.6.5, 4.6.6, 5.5.3, 5.5.4, 6.5.4, 6.5.5. Choice: the loss of a run is in
percent of the larger of the two performances, as in the claims, so that a team that achieved almost
nothing before cannot outweigh all others; the thesis' percent of the unchanged team is that of the
means. If smaller values of a measure are better, an increase is a loss.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any, NamedTuple

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
    with_values,
)
from conevo.report.figures import charts as figures
from conevo.report.sections.scope import KEYS, Scope, named, sizes
from conevo.report.statistics import compare, mean_interval, with_holm

__all__ = ["interventions"]

MOST = 100.0  # percent that can be lost, and gained: of the larger of two performances
ROTATED = "rotated"  # the study without castes
OVER_CASTES = ": the mean over its castes"
ENDS = "which ends at ±100 %, where losses do"


class _Team(NamedTuple):
    """A changed team of a run: its main measure, and that of the team unchanged."""

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
    return [
        _section(scope, name, cells, lost)
        for name in STUDIES
        for cells, lost in [_teams(scope, name)]
        if cells or name != ROTATED
    ]


def _section(scope: Scope, study: str, cells: dict[Cell, list[_Team]], lost: int) -> Section:
    text = []
    if lost:
        text.append(f"Teams left out, as neither they nor the unchanged ones scored: {lost}.")
    if not cells:
        none = "None of these runs has an intervention study."
        return Section(STUDIES[study].title, text or [none])
    exhibits = [_figure(scope, study, cells), _table(scope, study, _rows(scope, cells))]
    return Section(STUDIES[study].title, text, exhibits)


def _teams(scope: Scope, study: str) -> tuple[dict[Cell, list[_Team]], int]:
    """Return the changed teams of each cell by run, and the number with nothing to lose."""
    found = [
        (cell, _Team(run, caste, whole, value, scope.main.larger_is_better))
        for cell, run, caste, whole, value in scope.rows(
            f"""
            WITH played AS (
                SELECT s.run, r.seed, s.team, avg(s.value) AS value
                FROM scores s JOIN runs r USING (run)
                WHERE s.study = '{study}' AND s.measure = r.measure AND s.value IS NOT NULL
                GROUP BY ALL
            )
            SELECT run, changed.team, whole.value, changed.value
            FROM played changed JOIN played whole USING (run)
            WHERE whole.team = 'whole' AND changed.team <> 'whole'
            ORDER BY changed.seed, run, changed.team
            """
        )
    ]
    able = {
        cell: [team for own, team in found if own == cell and team.scale > 0]
        for cell in scope.cells
    }
    kept = {cell: teams for cell, teams in able.items() if teams}
    return kept, len(found) - sum(map(len, kept.values()))


def _figure(scope: Scope, study: str, cells: dict[Cell, list[_Team]]) -> Exhibit:
    """Draw a point per run: the mean over its castes."""
    _, what, note = STUDIES[study]
    means: dict[Cell, list[float]] = {}
    for cell, teams in cells.items():
        of_run = defaultdict(list)
        for team in teams:
            of_run[team.run].append(team.lost)
        means[cell] = [sum(values) / len(values) for values in of_run.values()]
    rows = [
        scope.key(cell.environment, cell.treatment)
        | {"run": team.run, "caste": team.caste, "whole": team.whole, scope.measure: team.value}
        | {"lost": team.lost}
        for cell, teams in cells.items()
        for team in teams
    ]
    title = f"Task performance ({scope.unit}) that is lost with {what}"
    at = scope.arranged(means)
    if not at.is_drawable:
        columns = [
            *KEYS,
            Column("run", "run", plain),
            *_by_caste(study),
            Column("lost", "lost, %"),
        ]
        return Table(f"{scope.stem}-{study}", title, note, columns, rows, is_folded=True)
    several = any(len(values) > 1 for values in means.values())
    size = sizes(len(values) for values in means.values())
    return Figure(
        f"{scope.stem}-{study}",
        title,
        f"{note} Percent of the larger of the two; below 0 the changed team was better "
        f"({scope.main.direction}). A point per run{'' if study == ROTATED else OVER_CASTES}"
        + (f"; next to them the mean with Student's 95 % interval, {ENDS}" if several else "")
        + f". {size} per cell.",
        rows=rows,
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


def _rows(scope: Scope, cells: dict[Cell, list[_Team]]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for cell, teams in cells.items():
        for caste in sorted({team.caste for team in teams}):
            with_it = [team for team in teams if team.caste == caste]
            result = compare([team.value for team in with_it], [team.whole for team in with_it])
            lost = mean_interval([team.lost for team in with_it])
            of = _percent(result.mean_a, result.mean_b)
            rows.append(
                scope.key(cell.environment, cell.treatment)
                | {"caste": caste, "n": len(with_it)}
                | {"whole": result.mean_b, "changed": result.mean_a, "percent": of}
                | {"lost": lost.value, "interval": lost.within(-MOST, MOST)}
                | {"p_t": result.p_t, "p_mann_whitney": result.p_mann_whitney}
            )
    return with_holm(rows)


def _by_caste(study: str) -> list[Column]:
    return [] if study == ROTATED else [Column("caste", "caste", plain)]


def _percent(changed: float | None, whole: float | None) -> float | None:
    """Return the changed value in percent of the whole, None without one."""
    return 100 * changed / whole if changed is not None and whole else None


def _table(scope: Scope, study: str, rows: list[dict[str, Any]]) -> Table:
    _, what, note = STUDIES[study]
    columns = [
        *KEYS,
        *_by_caste(study),
        Column("n", "n"),
        Column("whole", "unchanged"),
        Column("changed", "changed"),
        Column("percent", "% of unchanged"),
        Column("lost", "lost, %"),
        Column("interval", "95 % interval", interval),
        Column("p_t", "p (t)", p_value),
        Column("p_holm", "p (MW, Holm)", p_value),
    ]
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
