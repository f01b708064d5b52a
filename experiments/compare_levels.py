"""Compare the levels of one factor of a campaign with its baseline, cell by cell.

    python experiments/compare_levels.py CAMPAIGN --baseline credit=equation --write PAGE

Runs with the baseline's level of FACTOR are compared with all others that agree in the factors that
both have: with ``credit=equation`` each credit within each method and range, with ``method=mesp``
each form of exchange of CONE within each world. With ``--write`` a row per run goes to the CSV file
next to the page and the tables between the page's markers; ``--again`` makes the tables from the
CSV file. Several ``--baseline`` give a table each, ``<!-- BASELINE -->``. If the page has the
marker ``<!-- BASELINE pooled -->`` it also gets one over all cells.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from conevo.campaigns.tables import Tables
from conevo.cli.lookup import find_campaign, sealed
from conevo.errors import ConevoError, UsageError
from conevo.evolution.methods.registry import title_of
from conevo.report.statistics import Comparison, compare, holm
from contrasts import contrast
from page_arguments import PageParser, rows_for
from pages import Row, put, table
from provenance import made_with
from regime_tables import interval, number, percent

COST = ("evaluations", "team_steps", "core_seconds", "exchanges")
SIGNAL = ("icc", "reliability")  # of generation 0's units on trial: of a trial, of the scheme
FACTS = {"seed", "value", "first", *COST, *SIGNAL}


def rows_and_cost(name: str) -> tuple[list[Row], str]:
    """Return a row per finished run of a campaign (levels, value, cost), and their provenance.

    Raises:
        UsageError: the campaign does not exist, or none of its runs is finished.
    """
    campaign = find_campaign(name)
    with sealed(campaign) as folder, Tables(folder) as tables:
        first = {one.run: one.value for one in tables.values(team="generation 0")}
        sql = f"SELECT run, {', '.join(COST)} FROM runs"
        spent = {run: rest for run, *rest in tables.query(sql)[1]}
        sql = "SELECT run, any_value(icc), any_value(icc_of_scheme) FROM signal"
        sql += " WHERE generation = 'first' GROUP BY run HAVING count(*) = 1"
        signal = {run: rest for run, *rest in tables.query(sql)[1]}
        rows: list[Row] = []
        for one in tables.values():
            levels = dict(part.partition("=")[::2] for part in one.variant.split(", ") if part)
            row: Row = {"task": one.task, "method": one.method, **levels, "seed": one.seed}
            row |= {"value": one.value, "first": first.get(one.run)}
            row |= dict(zip(COST, spent[one.run], strict=True))
            row |= dict(zip(SIGNAL, signal.get(one.run, (None, None)), strict=True))
            rows.append(row)
    if not rows:
        raise UsageError(f"{campaign.path} has no finished run")
    return rows, made_with(campaign, rows)


def factors_of(row: Row) -> dict[str, str]:
    """Return the levels of a run."""
    return {key: level_name(one) for key, one in row.items() if key not in FACTS}


def groups(rows: Sequence[Row], factor: str, level: str) -> Iterator[tuple[Any, ...]]:
    """Yield the comparisons: shared levels, name of the rest, its runs, runs of the baseline."""
    baseline = [row for row in rows if factors_of(row).get(factor) == level]
    if not baseline:
        levels = sorted({level_name(row[factor]) for row in rows if factor in row})
        raise UsageError(f"no run has {factor}={level}; levels: {', '.join(levels) or 'none'}")
    shared = [key for key in factors_of(baseline[0]) if key != factor]
    cells: dict[tuple[str, ...], dict[str, list[Row]]] = {}
    for row in rows:
        of = factors_of(row)
        if of.get(factor, level) == level or not set(shared) <= of.keys():
            continue
        own = {key: title_of(one) if key == "method" else one for key, one in of.items()}
        rest = ", ".join(own[key] for key in of if key not in shared)
        cells.setdefault(tuple(of[key] for key in shared), {}).setdefault(rest, []).append(row)
    for at, others in cells.items():
        wanted = dict(zip(shared, at, strict=True))
        same = [row for row in baseline if wanted.items() <= factors_of(row).items()]
        if same:
            yield from ((wanted, rest, runs, same) for rest, runs in others.items())


def mean(runs: Sequence[Row], of: str) -> float | None:
    """Return the mean of a column over the runs that have it, None if none has it."""
    found = [float(row[of]) for row in runs if row.get(of) is not None]
    return float(np.mean(found)) if found else None


def comparison_table(rows: Sequence[Row], factor: str, level: str) -> str:
    """Return every level next to the baseline: values, difference, its interval, seeds above."""
    found = list(groups(rows, factor, level))
    if not found:
        raise UsageError(f"{factor}={level}: no other run agrees with one of these in all else")
    values = [
        ([float(row["value"]) for row in runs], [float(row["value"]) for row in same])
        for _, _, runs, same in found
    ]
    compared = [compare(a, b) for a, b in values]
    corrected = holm([one.p_welch for one in compared])
    hidden = {key for key in found[0][0] if len({one[0][key] for one in found}) == 1}
    keys = [key for key in found[0][0] if key not in hidden]
    title = title_of(level) if factor == "method" else level
    head = [*keys, factor if factor != "method" else "compared", "runs of both", f"{title} (sd)"]
    head += ["value (sd)", "difference", "95 % interval", "relative", "p, Holm"]
    head += ["seeds above", "exchanges"] if mean(rows, "exchanges") else ["seeds above"]
    lines = []
    for (levels, rest, runs, same), one, p in zip(found, compared, corrected, strict=True):
        by_seed = {row["seed"]: float(row["value"]) for row in same}
        pairs = [(float(r["value"]), by_seed[r["seed"]]) for r in runs if r["seed"] in by_seed]
        base = one.mean_b or 1.0
        form = ".0f" if max(one.mean_a or 0.0, one.mean_b or 0.0) >= 20 else ".2f"
        line = [title_of(levels[key]) if key == "method" else levels[key] for key in keys]
        line += [rest, f"{one.n_a}, {one.n_b}", _spread(one.mean_b, one.sd_b, form)]
        line += [_spread(one.mean_a, one.sd_a, form), number(one.difference, f"+{form}")]
        line += [interval(one.low, one.high, f"+{form}"), percent((one.difference or 0.0) / base)]
        line += [
            "< 0.001" if p is not None and p < 0.001 else number(p, ".3f"),
            f"{sum(a > b for a, b in pairs)} of {len(pairs)}",
        ]
        lines.append(line + [number(mean(runs, "exchanges"), ".3g")] * (len(head) > len(line)))
    clear = [one for one in compared if one.low is not None and one.high is not None]
    up = sum(one.low > 0 for one in clear if one.low is not None)
    down = sum(one.high < 0 for one in clear if one.high is not None)
    tail = (
        f"{len(compared)} rows, {len(clear)} with an interval; it lies above 0 in {up}, below in "
        f"{down}. By chance alone about {0.05 * len(clear):.1f} of them would exclude 0.\n"
    )
    return f"{table(head, lines)}\n{tail}"


def pooled_table(rows: Sequence[Row], factor: str, level: str) -> str:
    """Return the mean relative difference over the cells of a comparison.

    A row for each level over all cells, and one for each of its methods. Cells with a single run
    on either side do not count. The intervals are Welch's of ratios, by the delta method: the
    baseline's standard deviation counts times the ratio.
    """
    pooled: dict[tuple[str, str], list[Comparison]] = {}
    for levels, rest, runs, same in groups(rows, factor, level):
        one = compare(*([float(row["value"]) for row in of] for of in (runs, same)))
        if one.low is not None and one.mean_b:
            ratio = (one.mean_a or 0.0) / one.mean_b
            one = replace(one, sd_b=ratio * (one.sd_b or 0.0))
            pooled.setdefault((rest, ""), []).append(one)
            if "method" in levels:
                pooled.setdefault((rest, title_of(levels["method"])), []).append(one)
    lines = []
    for (rest, method), cells in pooled.items():
        found = contrast([(1 / len(cells) / (one.mean_b or 1.0), one) for one in cells])
        around = f"{percent(found.low)} to {percent(found.high)}"
        lines.append([rest, method or "all", len(cells), percent(found.value), around])
    lines.sort(key=lambda line: (line[1] != "all", line[1], line[0]))
    head = [factor if factor != "method" else "compared", "method", "cells"]
    return table([*head, "relative difference, mean over cells", "95 % interval"], lines)


def signal_table(rows: Sequence[Row]) -> str:
    """Return the signal of generation 0 in each cell: of one trial, and of a generation's."""
    cells: dict[tuple[str, ...], list[Row]] = {}
    each = [factors_of(row) for row in rows]
    names = [key for key in each[0] if len({of.get(key) for of in each}) > 1]
    for row, of in zip(rows, each, strict=True):
        if row.get("icc") is not None:
            cells.setdefault(tuple(of.get(key, "–") for key in names), []).append(row)
    lines = [
        [
            *(title_of(v) if k == "method" else v for k, v in zip(names, cell, strict=True)),
            len(runs),
            number(mean(runs, "icc"), ".4f"),
            number(mean(runs, "reliability"), ".3f"),
        ]
        for cell, runs in cells.items()
    ]
    return table([*names, "runs", "of a trial", "of all trials of a generation"], lines)


def level_name(of: object) -> str:
    """Return a level as it is named in a plan; a dash for none."""
    return f"{of:g}" if isinstance(of, float) else "–" if of is None else str(of)


def _spread(centre: float | None, sd: float | None, form: str) -> str:
    return f"{number(centre, form)} ({number(sd, form)})"


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables."""
    parser = PageParser(__doc__)
    parser.add_argument("--baseline", action="append", required=True, metavar="FACTOR=LEVEL")
    args = parser.parse(arguments)
    page: Path | None = args.write
    try:
        rows = rows_for(args, rows_and_cost)
        if wrong := [one for one in args.baseline if "=" not in one]:
            parser.error(f"--baseline {wrong[0]}: must be FACTOR=LEVEL, for example method=hom-es")
        parts = {one: comparison_table(rows, *one.split("=", 1)) for one in args.baseline}
        parts |= {f"{one} pooled": pooled_table(rows, *one.split("=", 1)) for one in args.baseline}
    except (ConevoError, OSError) as error:
        parser.error(str(error))
    if any(row.get("icc") is not None for row in rows):
        parts["signal"] = signal_table(rows)
    for name, text in parts.items():
        print(f"{name}\n\n{text}")
        if page and (name in args.baseline or f"<!-- {name} -->" in page.read_text()):
            put(text, page, name)


if __name__ == "__main__":
    main()
