"""Make the map of regimes: where CONE-ES is better than the same strategy over clones, HomES.

    python experiments/regime_map.py CAMPAIGN --write docs/results/regimes.md

reads the finished runs of a campaign of the plan `regimes`. With ``--write`` a row per run goes to
the CSV file next to the page, the figure to the PNG file, and the tables between the page's
markers; ``--again`` makes tables and figure from the CSV file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from conevo.campaigns.plan import PlannedRun
from conevo.campaigns.tables import Tables
from conevo.cli.lookup import find_campaign, sealed
from conevo.errors import ConevoError, UsageError
from conevo.runs.records import own_numbers
from conevo.runs.run import Run
from incentives import OF_REGION
from page_arguments import PageParser, rows_for
from pages import Row, put
from provenance import made_with
from regime_cells import CLONES, INDIVIDUAL, REGIONS, cells_of, used
from regime_figure import draw
from regime_tables import PAGE_PARTS

SETTINGS = ("low", "med", "hi")


def regime_of(planned: PlannedRun) -> Row:
    """Return the regime of a run: the names of its levels, and the numbers for the rule.

    Raises:
        UsageError: the run does not belong to the plan.
    """
    levels = dict(part.partition("=")[::2] for part in planned.variant.split(", "))
    if missing := {"segregation", "accuracies", "ranges"} - levels.keys():
        raise UsageError(
            f"{planned.label} has no level of {', '.join(sorted(missing))}; "
            "the map takes campaigns of the plan regimes"
        )
    params = planned.configs()[-1].world_params
    numbers = {f"{one}_{what}" for what in ("range", "accuracy") for one in SETTINGS}
    return {
        "ranges": levels["ranges"],
        "accuracies": levels["accuracies"],
        **{name: getattr(params, name) for name in ("segregation", "starts", "iterations")},
        **{name: getattr(params, name) for name in sorted(numbers)},
    }


def rows_of(tables: Tables, planned: Sequence[PlannedRun], own: Mapping[str, Row]) -> list[Row]:
    """Return a row per finished run of the two methods: its regime, value, cost and castes.

    Args:
        tables: of the campaign.
        planned: its runs.
        own: the method's own numbers of each finished run, by label.
    """
    regimes = {one.label: regime_of(one) for one in planned}
    first = {one.run: one.value for one in tables.values(team="generation 0")}
    cost = _keyed(tables, "SELECT run, evaluations, team_steps, core_seconds FROM runs")
    shares = _keyed(
        tables,
        "SELECT run, avg(setting_share), avg(specialization) FROM robots "
        "WHERE setting_share IS NOT NULL GROUP BY run",
    )
    castes = _castes(tables)
    rows = []
    for one in tables.values():
        if one.run not in regimes or one.method not in (INDIVIDUAL, CLONES):
            continue
        row: Row = regimes[one.run] | {"method": one.method, "seed": one.seed, "value": one.value}
        row |= {"first value": first.get(one.run)}
        row |= dict(zip(("evaluations", "team_steps", "core_seconds"), cost[one.run], strict=True))
        if one.run in shares:
            row |= dict(zip(("favourite share", "S"), shares[one.run], strict=True))
        rows.append(row | castes.get(one.run, {}) | own.get(one.run, {}))
    order = ("ranges", "accuracies", "segregation", "method", "seed")
    return sorted(rows, key=lambda row: tuple(row[name] for name in order))


def own_numbers_of(run: Run) -> Row:
    """Return the method's own numbers of a run's last generation."""
    last = run.generations()[-1:]
    return {name: last[0][name] for name in own_numbers(last)}


def _keyed(tables: Tables, sql: str) -> dict[str, tuple[Any, ...]]:
    return {run: tuple(rest) for run, *rest in tables.query(sql)[1]}


def _castes(tables: Tables) -> dict[str, Row]:
    """Return, for each run, how often each region's robots used each setting, and "in place".

    "in place" is the portion, of robots that used any setting, whose favourite is one that the type
    of their region requires (robot i starts in region i mod 4).
    """
    counts: dict[str, Counter[str]] = {}
    for run, robot, action, n in tables.query("SELECT run, robot, action, count FROM actions")[1]:
        if action in SETTINGS:
            counts.setdefault(run, Counter())[used(REGIONS[robot % 4], action)] += n
    fits: dict[str, list[bool]] = {}
    for run, robot, setting in tables.query("SELECT run, robot, favourite_setting FROM robots")[1]:
        if setting is not None:
            wanted = {SETTINGS[k] for k in OF_REGION[robot % 4]}
            fits.setdefault(run, []).append(setting in wanted)
    return {
        run: {used(r, s): of[used(r, s)] for r in REGIONS for s in SETTINGS}
        | ({"in place": float(np.mean(fits[run]))} if run in fits else {})
        for run, of in counts.items()
    }


def write_page(rows: list[Row], page: Path) -> None:
    """Write figure and tables of the rows of runs."""
    cells = cells_of(rows)
    for name, make in PAGE_PARTS.items():
        put(make(cells), page, name)
    page.with_suffix(".png").write_bytes(draw(cells))


def show(cells: Any) -> None:
    """Print every table."""
    for name, make in PAGE_PARTS.items():
        print(f"{name}\n\n{make(cells)}")


def rows_and_cost(name: str) -> tuple[list[Row], str]:
    """Return the rows of a campaign's runs, and their cost.

    Raises:
        UsageError: the campaign does not exist, or has no finished run of the two methods.
    """
    campaign = find_campaign(name)
    planned: Mapping[str, PlannedRun] = campaign.planned
    with sealed(campaign) as folder, Tables(folder) as tables:
        names = [run for (run,) in tables.query("SELECT run FROM runs")[1]]
        own = {name: own_numbers_of(Run(campaign.paths.run(name))) for name in names}
        rows = rows_of(tables, list(planned.values()), own)
    if not rows:
        raise UsageError(f"{campaign.path} has no finished run of {INDIVIDUAL} or {CLONES}")
    return rows, made_with(campaign, rows)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the map."""
    parser = PageParser(__doc__)
    args = parser.parse(arguments)
    page: Path | None = args.write
    try:
        rows = rows_for(args, rows_and_cost)
    except (ConevoError, OSError) as error:
        parser.error(str(error))
    if page:
        write_page(rows, page)
    show(cells_of(rows))


if __name__ == "__main__":
    main()
