"""The common data of all sections about a group of runs: cells, treatments, names on axes."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from conevo.campaigns.tables import RunValue, Tables
from conevo.report.comparison import Cell, Group, Treatment, group_values, treatments_of
from conevo.report.exhibits import Column, number, plain, rows_of, slug
from conevo.report.sections.arrangement import Arrangement, arrange
from conevo.worlds.measures import Measure

__all__ = ["KEYS", "SHOWN_KEYS", "Scope", "key", "named", "place_names", "scopes", "sizes", "span"]


OfCell = tuple[Cell, *tuple[Any, ...]]  # a cell, and something about it
KEYS: tuple[Column[OfCell], ...] = (
    Column("environment", "environment", plain, of=lambda one: one[0].environment),
    Column("method", of=lambda one: one[0].treatment.method),
    Column("variant", of=lambda one: one[0].treatment.variant),
    Column("treatment", "method", plain, of=lambda one: one[0].treatment.title),
)
"""Columns that name a cell, in CSV."""
SHOWN_KEYS = [column for column in KEYS if column.title]

Cells = Mapping[Cell, Sequence[RunValue]]


@dataclass(frozen=True)
class Scope:
    """The common data of all sections about a group.

    Attributes:
        tables: the campaign's.
        group: which tasks, at which budget.
        stem: begins the names of the group's files.
        cells: every run's champion in the main measure.
        first: every run's fittest team of generation 0 in the main measure.
        others: the champions in the world's other measures.
    """

    tables: Tables
    group: Group
    stem: str
    cells: Cells
    first: Cells
    others: Mapping[Measure, Cells]

    @property
    def treatments(self) -> list[Treatment]:
        """Treatments in order."""
        return treatments_of(treatment for _, treatment in self.cells)

    @property
    def environments(self) -> list[str]:
        """Environments in order."""
        return list(dict.fromkeys(environment for environment, _ in self.cells))

    @property
    def main(self) -> Measure:
        """The world's main measure."""
        return next(iter(self.cells.values()))[0].measure

    @property
    def unit(self) -> str:
        """The main measure as axes call it, with its unit."""
        return self.main.axis

    @property
    def within(self) -> tuple[float, float]:
        """Smallest and largest possible value of the main measure; infinite if unknown."""
        optima = [one.optimum for values in self.cells.values() for one in values]
        most = max((o for o in optima if o is not None), default=math.inf)
        low, high = self.main.low, self.main.high
        return (
            -math.inf if low is None else low,
            high if high is not None else math.inf if None in optima else most,
        )

    @property
    def about(self) -> str:
        """Direction and optimum of the main measure, as captions begin."""
        optima = {one.optimum for values in self.cells.values() for one in values}
        optimum = optima.pop() if len(optima) == 1 else None
        most = "" if optimum is None else f", {number(optimum)} at most"
        return f"{self.main.direction.capitalize()}{most}."

    @property
    def axis(self) -> str:
        """The name of an axis of environments."""
        short = self.group.world.rpartition("-v")[0] or self.group.world
        if place_names(self.environments) == self.environments:
            return f"{short} environment"
        return f"{short}/{self.group.family}-N, N ="

    def arranged(self, cells: Collection[Cell], *, by_environment: bool = False) -> Arrangement:
        """Return where cells are drawn; with ``by_environment`` places are always environments."""
        environments = [e for e in self.environments if any(c.environment == e for c in cells)]
        treatments = [t for t in self.treatments if any(c.treatment == t for c in cells)]
        return arrange(
            cells,
            environments,
            place_names(environments),
            treatments,
            self.axis,
            by_environment=by_environment,
        )

    def per_cell(self, sql: str) -> list[tuple[Any, ...]]:
        """Return the rows of a query about the group's cells, each after its cell.

        Args:
            sql: its first column is a cell of the table ``own`` (run, cell).
        """
        cells = list(self.cells)
        runs = [(one.run, k) for k, cell in enumerate(cells) for one in self.cells[cell]]
        listed = ", ".join("('{}', {})".format(run.replace("'", "''"), k) for run, k in runs)
        found = self.tables.query(f"WITH own(run, cell) AS (VALUES {listed}) {sql}")[1]
        return [(cells[k], *rest) for k, *rest in found]

    def ordered(self, cells: Collection[Cell]) -> list[Cell]:
        """Return cells by environment, then by treatment."""
        every = (Cell(*pair) for pair in product(self.environments, self.treatments))
        return [cell for cell in every if cell in cells]

    def exchanges(self) -> dict[Cell, tuple[float, float]]:
        """Return the exchange of the populations of each cell, if its method ever exchanges.

        Pairs of sub-populations that recombined between populations in a generation, and their
        share of those that could have, in the mean of the runs.
        """
        found = self.per_cell(
            "SELECT cell, avg(exchanges), avg(exchange_share) FROM own JOIN runs USING (run)"
            " WHERE exchanges IS NOT NULL GROUP BY cell ORDER BY cell"
        )
        return {cell: (pairs, share) for cell, pairs, share in found}


def key(cell: Cell) -> dict[str, Any]:
    """Return how rows of numbers name a cell."""
    return rows_of(KEYS, [(cell,)])[0]


def scopes(tables: Tables) -> list[Scope]:
    """Return the groups of a campaign's runs, in the order of worlds and environments."""
    main = group_values(tables.values())
    first = group_values(tables.values(team="generation 0"))
    measures = [
        measure
        for (measure,) in tables.query(
            "SELECT DISTINCT measure FROM scores WHERE study = 'test' ORDER BY measure"
        )[1]
    ]
    by_measure = {measure: group_values(tables.values(measure)) for measure in measures}
    found: list[Scope] = []
    for group, cells in main.items():
        stem = slug(f"{group.world.rpartition('-v')[0] or group.world}-{group.family}")
        same = sum(one.stem.startswith(stem) for one in found)
        own = next(iter(cells.values()))[0].measure.name
        others = {
            next(iter(groups[group].values()))[0].measure: groups[group]
            for measure, groups in by_measure.items()
            if group in groups and measure != own
        }
        stem = f"{stem}-budget-{same + 1}" if same else stem
        found.append(Scope(tables, group, stem, cells, first.get(group, {}), others))
    return found


def named(cells: Mapping[Cell, int]) -> dict[str, str]:
    """Return the name of each method in legends, with its runs per cell unless all have as many.

    Args:
        cells: with their numbers of runs.
    """
    counts: dict[str, list[int]] = {}
    for treatment in treatments_of(treatment for _, treatment in cells):
        runs = [n for cell, n in cells.items() if cell.treatment == treatment]
        counts.setdefault(treatment.method, []).extend(runs)
    titles = {method: Treatment(method, "").title for method in counts}
    if len(set(cells.values())) < 2:
        return titles
    return {method: f"{title} ({span(counts[method])})" for method, title in titles.items()}


def place_names(environments: Sequence[str]) -> list[str]:
    """Return the names of environments under an axis: numbers alone if they are many."""
    stems = {name.rpartition("-")[0] for name in environments}
    if len(environments) <= 6 or len(stems) > 1:
        return list(environments)
    return [name.rpartition("-")[2] for name in environments]


def sizes(counts: Iterable[int]) -> str:
    """Return the number of runs in words."""
    found = list(counts)
    return f"{span(found)} {'run' if set(found) == {1} else 'runs'}"


def span(counts: Sequence[int]) -> str:
    """Return "n = 20", or "n = 3 to 20"."""
    low, high = min(counts, default=0), max(counts, default=0)
    return f"n = {low}" if low == high else f"n = {low} to {high}"
