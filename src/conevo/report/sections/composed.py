"""Teams composed of several behaviours against teams of clones (Nitschke 2009, figure 4.12).

Choice: a composed team is compared with the best of the same run's teams of clones, and methods are
pooled, as figure 4.12 names none; the drawing has every behaviour's clones, of all runs.
"""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

from conevo.report.exhibits import Column, Figure, Section, Table, interval, p_value, plain
from conevo.report.figures import charts as figures
from conevo.report.sections.scope import Scope, place_names
from conevo.report.statistics import Comparison, compare, holm, moments

__all__ = ["composed"]

TITLE = "Behavioural validation: composed teams"
NOTE = (
    "Teams composed of the fittest specialist of each behaviour of a champion, as many as 4.6.5 "
    "lists, and teams of clones of one; all methods together."
)


class _Played(NamedTuple):
    """A team that was played, and what it reached in the mean of its scenarios."""

    environment: str
    study: str
    team: str
    value: float


class _Pair(NamedTuple):
    """Composed teams of one behaviour against the best clones of the same runs."""

    environment: str
    team: str
    found: Comparison
    p_holm: float | None


COLUMNS: list[Column[_Pair]] = [
    Column("environment", "environment", plain),
    Column("team", "team", plain),
    Column("n", "n", of=lambda one: one.found.n_a),
    Column("value", "composed", of=lambda one: one.found.mean_a),
    Column("clones", "best clones", of=lambda one: one.found.mean_b),
    Column("difference", "difference", of=lambda one: one.found.difference),
    Column("interval", "95 % interval", interval, of=lambda one: (one.found.low, one.found.high)),
    Column("p_t", "p (t)", p_value, of=lambda one: one.found.p_t),
    Column("p_mann_whitney", of=lambda one: one.found.p_mann_whitney),
    Column("p_holm", "p (MW, Holm)", p_value),
]


def composed(scope: Scope) -> Section | None:
    """Return what composed teams and teams of clones reach; None if no team was composed."""
    by_run = _played(scope)
    pairs = _pairs(scope, by_run)
    if not pairs:
        return None
    about = f"Task performance ({scope.unit}) of composed teams and teams of clones"
    table = Table.of(
        f"{scope.stem}-composed-teams",
        about,
        f"{NOTE} Best clones: of the same runs. n: runs whose champions have all behaviours of the "
        "team. p (t): Student's independent t-test, uncorrected, as in the thesis; p (MW, Holm): "
        f"Mann-Whitney, corrected by Holm for the {len(pairs)} rows.",
        COLUMNS,
        pairs,
    )
    return Section(TITLE, exhibits=[_figure(scope, about, by_run), table])


def _played(scope: Scope) -> dict[str, list[_Played]]:
    """Return the teams of each run that were composed or cloned."""
    found: dict[str, list[_Played]] = {run.run: [] for of in scope.cells.values() for run in of}
    for cell, run, *played in scope.per_cell(
        """
        SELECT cell, run, s.study, s.team, avg(s.value)
        FROM own JOIN scores s USING (run) JOIN runs r USING (run)
        WHERE s.study IN ('clones', 'composed') AND s.team <> 'whole' AND s.measure = r.measure
            AND s.value IS NOT NULL
        GROUP BY ALL ORDER BY run, s.study, s.team
        """
    ):
        found[run].append(_Played(cell.environment, *played))
    return found


def _pairs(scope: Scope, by_run: dict[str, list[_Played]]) -> list[_Pair]:
    """Return each composed team with the best clones of the same runs."""
    best = max if scope.main.larger_is_better else min
    values: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    for teams in by_run.values():
        clones = [team.value for team in teams if team.study == "clones"]
        for team in teams:
            if team.study == "composed" and clones:
                values[team.environment, team.team].append((team.value, best(clones)))
    found = {key: compare(*zip(*of, strict=True)) for key, of in sorted(values.items())}
    corrected = holm([one.p_mann_whitney for one in found.values()])
    return [_Pair(*key, one, p) for (key, one), p in zip(found.items(), corrected, strict=True)]


def _figure(scope: Scope, about: str, by_run: dict[str, list[_Played]]) -> Figure:
    """Draw a bar per team and environment, clones first: the form of figure 4.12."""
    values: dict[tuple[str, str], dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for environment, study, team, value in (one for of in by_run.values() for one in of):
        values[study, team][environment].append(value)
    names = {
        f"{team} {study}": f"{team} clones" if study == "clones" else team
        for study, team in sorted(values)
    }
    places = [e for e in scope.environments if any(e in of for of in values.values())]
    means = {
        f"{team} {study}": [figures.Bar(*moments(values[study, team].get(e, []))) for e in places]
        for study, team in sorted(values)
    }
    rows = [
        {"environment": e, "study": study, "team": team, "value": value}
        for (study, team), of in sorted(values.items())
        for e in places
        for value in of.get(e, ())
    ]
    return Figure(
        f"{scope.stem}-composed",
        about,
        f"{NOTE} Mean over runs; error bars: standard deviation of the runs.",
        rows=rows,
        drawing=figures.bars(
            {"": means},
            place_names(places),
            names,
            x_label=scope.axis,
            y_label=scope.unit,
            within=scope.within,
        ),
    )
