"""The signal of each treatment of a group: the information of fitness about genotypes."""

from __future__ import annotations

from typing import Any, NamedTuple

from conevo.numbers import plus_minus
from conevo.report.comparison import Cell
from conevo.report.exhibits import Column, Section, Table, plain
from conevo.report.sections.scope import SHOWN_KEYS, Scope, key
from conevo.studies.repeatability import LEAST_RELIABILITY, has_signal

__all__ = ["blind_cells", "signal"]


class MeasuredSignal(NamedTuple):
    """The signal of a cell's first or last populations: means over runs, None if unknown."""

    unit: str = ""
    scheme: int = 0
    n: int = 0
    icc: float | None = None
    error: float | None = None
    reliability: float | None = None
    rounds: float | None = None
    best: float | None = None


NOTE = (
    "Genotypes of the first and last populations, tried again and again with other partners, in "
    "other scenarios. ICC: intra-class correlation, the share of a trial's fitness that is the "
    "genotype's own, mean of the runs ± its standard error. Reliability: that of the mean of the "
    "trials that the method gives each genotype, by Spearman-Brown; below {least} in "
    "both, a method has no signal. Rounds for .5: rounds of which the mean would have a "
    "reliability of .5."
)


def signal(scope: Scope) -> Section | None:
    """Return a row per treatment and environment; None if no run has a study of signal."""
    found = _found(scope)
    rows = [_row(cell, own) for cell, own in found.items()]
    if not rows:
        return None
    blind = [row for row in rows if row["verdict"] != "signal"]
    text = []
    if blind:
        names = " and ".join(dict.fromkeys(row["treatment"] for row in blind))
        text.append(
            f"Not tested: no signal in {len(blind)} of {len(rows)} cells ({names}). Selection among"
            " these genotypes is nearly blind, and comparisons of these cells hardly test methods."
        )
    columns = [
        *SHOWN_KEYS,
        Column("unit", "unit on trial", plain),
        Column("n", "n"),
        Column("scheme", "trials"),
        Column("shown_first", "ICC of a trial, first", plain),
        Column("reliability_first", "reliability, first"),
        Column("rounds_first", "rounds for .5"),
        Column("shown_last", "ICC of a trial, last", plain),
        Column("reliability_last", "reliability, last"),
        Column("verdict", "verdict", plain),
    ]
    note = NOTE.format(least=LEAST_RELIABILITY)
    return Section("Signal", text, [Table(f"{scope.stem}-signal", "Signal", note, columns, rows)])


def blind_cells(scope: Scope) -> set[Cell]:
    """Return the cells whose runs have studies of signal, and had none first or last."""
    found = _found(scope)
    return {cell for cell, own in found.items() if not has_signal(own["first"].best)}


def _found(scope: Scope) -> dict[Cell, dict[str, MeasuredSignal]]:
    """Return the signals "first" and "last" of each cell that has any.

    Fitness that is always the same has an ICC and a reliability of 0. The best reliability is the
    larger one of each run.
    """
    found: dict[Cell, dict[str, MeasuredSignal]] = {}
    for cell, generation, *rest in scope.per_cell(
        "SELECT cell, generation, first(unit ORDER BY seed), first(scheme ORDER BY seed), count(*),"
        " avg(coalesce(icc, 0)), sqrt(sum(standard_error ** 2)) / count(standard_error),"
        " avg(coalesce(icc_of_scheme, 0)), avg(rounds_for_half), avg(best)"
        " FROM own JOIN (SELECT *, max(coalesce(icc_of_scheme, 0)) OVER (PARTITION BY run) AS best"
        " FROM signal) USING (run) JOIN runs USING (run)"
        " GROUP BY cell, generation ORDER BY cell"
    ):
        found.setdefault(cell, {})[generation] = MeasuredSignal(*rest)
    return found


def _row(cell: Cell, own: dict[str, MeasuredSignal]) -> dict[str, Any]:
    """Return the numbers of a cell."""
    first = own["first"]
    row = key(cell) | {"unit": first.unit, "n": first.n, "scheme": first.scheme}
    for generation in ("first", "last"):
        one = own.get(generation, MeasuredSignal())
        row |= {
            f"shown_{generation}": None if one.icc is None else plus_minus(one.icc, one.error),
            f"icc_{generation}": one.icc,
            f"error_{generation}": one.error,
            f"reliability_{generation}": one.reliability,
            f"rounds_{generation}": one.rounds,
        }
    is_there = has_signal(first.best)
    return row | {"verdict": "signal" if is_there else "not tested: no signal"}
