"""The task performance of the treatments of a group."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import Any

from conevo.campaigns.tables import RunValue
from conevo.report.comparison import Aggregate, Cell, Summary, aggregate, summarize
from conevo.report.exhibits import (
    Column,
    Exhibit,
    Figure,
    Section,
    Table,
    interval,
    number,
    p_value,
    plain,
    rows_of,
    with_values,
)
from conevo.report.figures import charts as figures
from conevo.report.sections.scope import KEYS, SHOWN_KEYS, Scope, named, sizes, span
from conevo.report.statistics import moments
from conevo.worlds.registry import entry_of

__all__ = ["performance"]

MOST_COLUMNS = 5  # of treatments that a table compares with each other


def performance(scope: Scope) -> Section:
    """Return the performance of every cell."""
    found = {cell: summarize(scope.cells[cell]) for cell in scope.ordered(scope.cells)}
    columns = _columns(scope)
    rows = rows_of(columns, found.items())
    exhibits = [
        *_drawn(scope, found, rows),
        _table(scope, columns, rows),
        *_pooled(scope),
        *_others(scope),
    ]
    return Section(f"Task performance: {scope.main.heading}", _warnings(scope), exhibits)


def _columns(scope: Scope) -> list[Column[tuple[Cell, Summary]]]:
    """Return the numbers of a cell; without a generation 0, optimum or exchange None is there."""
    made = scope.exchanges()
    begun = {cell: fmean(run.value for run in runs) for cell, runs in scope.first.items()}
    pairs = {cell: pairs for cell, (pairs, _) in made.items()}
    percent = {cell: 100 * share for cell, (_, share) in made.items()}
    return [
        *KEYS,
        Column("n", "n", of=lambda one: len(one[1].values)),
        Column("mean", "mean", of=lambda one: one[1].mean.value),
        Column("sd", "sd", of=lambda one: one[1].sd),
        Column(
            "interval", "95 % interval", interval, of=lambda one: one[1].mean.within(*scope.within)
        ),
        Column("range", "lowest to highest", interval, of=lambda one: one[1].range),
        Column("generation_0", "generation 0", of=lambda one: begun.get(one[0])),
        Column("share", "share of optimum", of=lambda one: _share(scope.cells[one[0]], one[1])),
        Column("p_ks", "p (KS)", p_value, of=lambda one: one[1].normal.p_ks),
        Column(
            "p_lilliefors", "p (Lilliefors)", p_value, of=lambda one: one[1].normal.p_lilliefors
        ),
        Column("exchanges", "exchange, pairs", of=lambda one: pairs.get(one[0])),
        Column("exchange_share", "exchange, %", of=lambda one: percent.get(one[0])),
    ]


def _drawn(
    scope: Scope, found: Mapping[Cell, Summary], rows: Sequence[Mapping[str, Any]]
) -> list[Exhibit]:
    """Return means as bars, and every run as a point; a table of the runs if that is too much."""
    runs = [(cell, one) for cell, values in scope.cells.items() for one in values]
    columns: list[Column[tuple[Cell, RunValue]]] = [
        *KEYS,
        Column("seed", "seed", of=lambda one: one[1].seed),
        Column("run", of=lambda one: one[1].run),
        Column(scope.main.name, scope.unit, of=lambda one: one[1].value),
    ]
    title = f"Task performance ({scope.unit}) of every run"
    at = scope.arranged(found)
    if not at.is_drawable:
        note = "Mean over fresh scenarios."
        return [Table.of(f"{scope.stem}-runs", title, note, columns, runs, is_folded=True)]
    names = named({cell: len(one.values) for cell, one in found.items()})
    size = sizes(len(one.values) for one in found.values())
    several = any(len(one.values) > 1 for one in found.values())
    bars = Figure(
        f"{scope.stem}-bars",
        f"Task performance ({scope.unit}) by {at.axis_name} and method",
        f"{scope.about} Mean over runs of the fittest team in fresh scenarios"
        + ("; error bars: standard deviation of the runs" if several else "")
        + f". {size} per bar.",
        rows=rows,
        drawing=figures.bars(
            at.grid(found, lambda one: figures.Bar(one.mean.value, one.sd)),
            at.places,
            names,
            x_label=at.axis,
            y_label=scope.unit,
            within=scope.within,
        ),
    )
    if not several:
        return [bars]
    points = Figure(
        f"{scope.stem}-runs",
        title,
        f"{scope.about} A point per run; next to them the mean with Student's 95 % interval. "
        f"{size} per cell.",
        rows=rows_of(columns, runs),
        drawing=figures.points(
            at.grid(found, lambda one: figures.Points(one.values, one.mean.ends(*scope.within))),
            at.places,
            names,
            x_label=at.axis,
            y_label=scope.unit,
            within=scope.within,
        ),
    )
    return [bars, points]


def _table(
    scope: Scope,
    columns: Sequence[Column[tuple[Cell, Summary]]],
    rows: Sequence[Mapping[str, Any]],
) -> Table:
    """Return the performance of every cell, with its statistics."""
    shown = with_values(columns, rows)
    keys = {column.key for column in shown}
    notes = {
        "interval": "95 % interval: Student's t"
        + (", ends where values do" if any(map(math.isfinite, scope.within)) else ""),
        "generation_0": "generation 0: the fittest team of the first generation in the same "
        "scenarios",
        "exchanges": "exchange: pairs of sub-populations that recombined between populations in a "
        "generation, and percent of those that could have",
        "p_ks": "p (KS): Kolmogorov-Smirnov against the normal fitted to the runs, as in the "
        "thesis, which overstates normality",
        "p_lilliefors": "p (Lilliefors): the same distance with the corrected null distribution",
    }
    return Table(
        f"{scope.stem}-performance",
        f"Task performance ({scope.unit}) by environment and method",
        "; ".join(
            [
                f"{scope.about} Mean over runs of the mean over fresh scenarios",
                "n: runs",
            ]
            + [note for key, note in notes.items() if key in keys]
        )
        + ".",
        shown,
        rows,
    )


def _share(runs: Sequence[RunValue], of: Summary) -> float | None:
    """Return the mean as a share of the optimum, None unless it is known and all runs have it."""
    optima = {run.optimum for run in runs}
    optimum = optima.pop() if len(optima) == 1 else None
    return of.mean.value / optimum if optimum and of.mean.value is not None else None


def _warnings(scope: Scope) -> list[str]:
    counts = [len(of) for of in scope.cells.values()]
    text = []
    if max(counts) < 2:
        text.append("One run per cell: no deviation, no interval, and nothing is tested.")
    elif min(counts) < 2:
        text.append("Cells with a single run have no deviation, no interval and no t-test.")
    if max(counts) < 20 and entry_of(scope.group.world):
        text.append(
            f"The thesis has 20 runs per cell; here are {span(counts).removeprefix('n = ')}."
        )
    missing = len(scope.environments) * len(scope.treatments) - len(scope.cells)
    if missing:
        text.append(f"{missing} of the cells of this table have no finished run.")
    return text


def _pooled(scope: Scope) -> list[Exhibit]:
    """Return the table over all environments, unless nothing can be pooled."""
    if max(map(len, scope.cells.values())) < 2:
        return []
    found = aggregate(scope.cells)
    if len(found) < 2 or (found[0].environments < 2 and len(scope.environments) > 1):
        return []
    optima = {one.optimum for of in scope.cells.values() for one in of}
    scale = scope.unit if None in optima else f"share of the optimal {scope.unit}"
    others = [one.treatment for one in found[:-1]] if len(found) <= MOST_COLUMNS else []
    improvement = (
        "P(better than X): probability of improvement, that a run is better than one of X in the "
        f"same environment ({scope.main.direction}); "
    )
    several = found[0].environments > 1
    columns = [
        Column("treatment", "method", plain),
        Column("n", "n"),
        Column("iqm", "IQM"),
        Column("interval", "95 % interval", interval),
        *(Column(f"better than {t.title}", f"P(better than {t.title})", plain) for t in others),
    ]
    return [
        Table(
            f"{scope.stem}-aggregate",
            f"{'All environments together' if several else 'Interquartile means'}: {scale}",
            f"Environments: {found[0].environments}; n: runs; IQM: interquartile mean of the runs; "
            f"{improvement if others else ''}95 % intervals: stratified bootstrap, 2000 "
            "resamples.",
            columns,
            [_aggregate_row(one) for one in found],
        )
    ]


def _aggregate_row(one: Aggregate) -> dict[str, Any]:
    return {
        "treatment": one.treatment.title,
        "n": one.iqm.n,
        "iqm": one.iqm.value,
        "interval": (one.iqm.low, one.iqm.high),
    } | {
        f"better than {other.title}": f"{number(p.value)}"
        + (f" ({interval((p.low, p.high))})" if p.low is not None else "")
        for other, p in one.improvement.items()
    }


def _others(scope: Scope) -> list[Exhibit]:
    """Return a table of the measures other than the main one."""
    about: list[Column[tuple[Cell, Sequence[RunValue]]]] = [
        Column("measure", "measure", plain, of=lambda one: one[1][0].measure.title),
        Column("unit", "unit", plain, of=lambda one: one[1][0].measure.unit),
        Column("direction", "direction", plain, of=lambda one: one[1][0].measure.direction),
    ]
    values: list[Column[tuple[Cell, Sequence[RunValue]]]] = [
        Column("n", "n", of=lambda one: len(one[1])),
        Column("mean", "mean", of=lambda one: moments([run.value for run in one[1]])[0]),
        Column("sd", "sd", of=lambda one: moments([run.value for run in one[1]])[1]),
    ]
    items = [one for cells in scope.others.values() for one in cells.items()]
    note = "Mean over runs of the mean over fresh scenarios; sd: of the runs; n: runs."
    name, title = f"{scope.stem}-measures", "Other measures of task performance"
    environment, method = SHOWN_KEYS
    columns = [environment, *about, method, *values]
    numbers = rows_of([*KEYS, *about, *values], items)
    table = Table.of(name, title, note, columns, items, numbers=numbers, is_folded=True)
    return [table] if items else []
