"""The performance of champions in the scenarios that selected them, and in fresh ones."""

from __future__ import annotations

from typing import NamedTuple

from conevo.report.comparison import Cell
from conevo.report.exhibits import Column, Section, Table, plain
from conevo.report.sections.scope import KEYS, Scope
from conevo.terms import counted

__all__ = ["champions"]

NAMES = {
    ("test", "champion"): "the test of champions",
    ("test", "generation 0"): "the test of generation 0",
    ("lesion", ""): "lesions of castes",
    ("clones", ""): "teams of clones",
    ("rotated", ""): "teams whose controllers changed places",
}
"""Names of a study, and where it matters of its team, in a sentence."""

CHOSEN = """
    SELECT cell, replace(measure, '_', ' '), count(*), avg(selection), avg(validation), avg(test)
    FROM own JOIN champions USING (run)
    WHERE measure IN ('fitness', '{measure}') AND selection IS NOT NULL
        AND validation IS NOT NULL AND test IS NOT NULL
    GROUP BY cell, measure ORDER BY measure <> 'fitness', cell
"""


class _Champions(NamedTuple):
    """A measure of the champions of a cell's runs: means over runs."""

    cell: Cell
    measure: str
    n: int
    selection: float
    validation: float
    test: float

    @property
    def ratio(self) -> float | None:
        """Performance in the test, as a share of that which was selected."""
        return self.test / self.selection if self.selection > 0 else None


def champions(scope: Scope) -> Section | None:
    """Return selection, validation and test of each cell's champions; None if no run has them."""
    measure = scope.main.name.replace("'", "''")
    chosen = [_Champions(*row) for row in scope.per_cell(CHOSEN.format(measure=measure))]
    text = _not_finite(scope)
    if not chosen:
        return Section("How champions were chosen", text) if text else None
    columns: list[Column[_Champions]] = [
        *KEYS,
        Column("measure", "measure", plain),
        Column("n", "n"),
        Column("selection", "selection"),
        Column("validation", "validation"),
        Column("test", "test"),
        Column("ratio", "test / selection"),
    ]
    note = (
        "Means over runs. Selection: in the scenarios that the fittest team of each generation "
        "meets, by which finalists are kept; validation: in separate scenarios, by which the "
        "champion is chosen among them; test: in fresh ones. Fitness: mean of the robots, on which "
        "methods select. Where the test is worse than the selection (a ratio below 1 if larger is "
        "better, above 1 if smaller is) the champion was lucky when it was selected. "
        "n: runs in which all three are finite."
    )
    title = "Champions: selection, validation and test"
    table = Table.of(f"{scope.stem}-chosen", title, note, columns, chosen)
    return Section("How champions were chosen", text, [table])


def _not_finite(scope: Scope) -> list[str]:
    """Return a sentence for each study and measure that lacks values."""
    found = scope.tables.query(
        "SELECT s.measure, s.study, if(s.study = 'test', s.team, '') AS team,"
        " count(DISTINCT run) FILTER (s.value IS NULL), count(DISTINCT run),"
        " count(*) FILTER (s.value IS NULL), count(*) FROM scores s JOIN runs r USING (run)"
        f" JOIN budgets b USING (run) WHERE {scope.group.condition}"
        " GROUP BY ALL HAVING count(*) > count(s.value) ORDER BY ALL"
    )[1]
    return [
        f"Not finite: {measure.replace('_', ' ')} in {values} of {counted(of_values, 'value')} of "
        f"{NAMES.get((study, team), study)}, of {runs} of {counted(of_runs, 'run')}. Means are "
        "those of the other scenarios; a run without any is left out of tables and figures."
        for measure, study, team, runs, of_runs, values, of_values in found
    ]
