"""The signal of each treatment of a group: the information of fitness about genotypes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from conevo.numbers import plus_minus
from conevo.report.comparison import Cell
from conevo.report.exhibits import Column, Section, Table, plain
from conevo.report.sections.scope import KEYS, Scope
from conevo.studies.repeatability import LEAST_RELIABILITY, has_signal

__all__ = ["blind_cells", "signal"]


class MeasuredSignal(NamedTuple):
    """The signal of a run's first or last populations; None where all fitness was the same."""

    unit: str
    scheme: int
    icc: float | None
    error: float | None
    reliability: float | None
    rounds: float | None


NOTE = (
    "Genotypes of the first and last populations, tried again and again with other partners, in "
    "other scenarios. ICC: intra-class correlation, the share of a trial's fitness that is the "
    "genotype's own, mean of the runs ± its standard error. Reliability: that of the mean of the "
    "trials that the method gives each genotype, by Spearman-Brown; below {least} at first a "
    "method has no signal. Rounds for .5: rounds of which the mean would have a reliability of .5."
)


def signal(scope: Scope) -> Section | None:
    """Return a row per treatment and environment; None if no run has a study of signal."""
    found = _found(scope)
    rows = [_row(scope, cell, own) for cell, own in found.items()]
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
        *KEYS,
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
    """Return the cells whose runs have studies of signal, and had none at first."""
    found = _found(scope)
    return {cell for cell, own in found.items() if not has_signal(_reliability(own["first"]))}


def _found(scope: Scope) -> dict[Cell, dict[str, list[MeasuredSignal]]]:
    """Return the signals of the runs of each cell that has any, "first" and "last"."""
    found: dict[Cell, dict[str, list[MeasuredSignal]]] = {}
    for cell, _, generation, *rest in scope.rows(
        "SELECT s.run, s.generation, unit, scheme, icc, standard_error, icc_of_scheme,"
        " rounds_for_half FROM signal s JOIN runs USING (run) ORDER BY seed, s.run, s.generation"
    ):
        found.setdefault(cell, {}).setdefault(generation, []).append(MeasuredSignal(*rest))
    return {cell: found[cell] for cell in scope.cells if cell in found}


def _row(scope: Scope, cell: Cell, own: dict[str, list[MeasuredSignal]]) -> dict[str, Any]:
    """Return the numbers of a cell."""
    first = own["first"]
    row: dict[str, Any] = {**scope.key(cell.environment, cell.treatment)}
    row |= {"unit": first[0].unit, "n": len(first), "scheme": first[0].scheme}
    for generation in ("first", "last"):
        runs = own.get(generation, [])
        icc = _mean([one.icc or 0.0 for one in runs])
        errors = [one.error for one in runs if one.error is not None]
        error = math.sqrt(math.fsum(e * e for e in errors)) / len(errors) if errors else None
        row |= {
            f"shown_{generation}": None if icc is None else plus_minus(icc, error),
            f"icc_{generation}": icc,
            f"error_{generation}": error,
            f"reliability_{generation}": _reliability(runs),
            f"rounds_{generation}": _mean([one.rounds for one in runs if one.rounds is not None]),
        }
    is_there = has_signal(row["reliability_first"])
    return row | {"verdict": "signal" if is_there else "not tested: no signal"}


def _reliability(runs: Sequence[MeasuredSignal]) -> float | None:
    """Return the mean reliability of fitness; fitness that is always the same has none."""
    return _mean([one.reliability or 0.0 for one in runs])


def _mean(values: Sequence[float]) -> float | None:
    return math.fsum(values) / len(values) if values else None
