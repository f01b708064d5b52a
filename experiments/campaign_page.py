"""Put the results of a campaign into its page.

    python experiments/campaign_page.py CAMPAIGN FOLDER [--method METHOD] [--foreign FILE.json ...]

writes the report of a finished campaign into ``FOLDER/report``, and tables between the markers of
``FOLDER/README.md``: runs and their cost, performance, comparisons of one method (CONE) with the
others, castes and, if the page has a place for them, the claims of the thesis. Results of other
tools, with steps of teams, join the report.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

import pages
from conevo.campaigns.campaign import Campaign
from conevo.campaigns.tables import RunValue, Tables
from conevo.cli.lookup import sealed
from conevo.evolution.methods.registry import METHODS
from conevo.numbers import plus_minus
from conevo.report.claims import verdicts
from conevo.report.files import write_report
from conevo.report.foreign import read_foreign
from conevo.report.statistics import compare, holm
from provenance import versions


def by_cell(values: list[RunValue]) -> dict[str, dict[str, list[float]]]:
    """Return the runs' values: task -> method -> values."""
    found: dict[str, dict[str, list[float]]] = {}
    for one in values:
        found.setdefault(one.task, {}).setdefault(one.method, []).append(one.value)
    return {
        task: {method: of[method] for method in METHODS if method in of}
        for task, of in found.items()
    }


def spread(values: list[float]) -> str:
    """Return mean and standard deviation of runs."""
    return plus_minus(fmean(values), stdev(values) if len(values) > 1 else None)


def p(value: float | None) -> str:
    """Return a probability of error."""
    return "-" if value is None else "< 0.001" if value < 0.001 else f"{value:.3f}"


def cost_table(tables: Tables) -> str:
    """Return runs, seeds, evaluations and cost of each task."""
    _, rows = tables.query(
        "SELECT task, count(*), count(DISTINCT method), min(seed), max(seed), min(evaluations), "
        "max(evaluations), sum(team_steps), sum(core_seconds) FROM runs GROUP BY task ORDER BY task"
    )
    head = ["task", "runs", "methods", "seeds", "team evaluations a run", "team-steps", "core time"]
    return pages.table(
        head,
        [
            [
                task,
                n,
                methods,
                f"{first}-{last}",
                f"{least:,}-{most:,}",
                f"{steps / 1e9:.2f} x 10^9",
                f"{seconds / 60:.0f} min",
            ]
            for task, n, methods, first, last, least, most, steps, seconds in rows
        ],
    )


def performance_table(tables: Tables) -> str:
    """Return mean and deviation of every cell: generation 0, champion, and share of the optimum."""
    last = by_cell(tables.values())
    first = by_cell(tables.values(team="generation 0"))
    optimum = {one.task: one.optimum for one in tables.values()}
    measure = {one.task: one.measure for one in tables.values()}
    rows: list[list[Any]] = []
    for task, of in last.items():
        for method, values in of.items():
            best = optimum[task]
            share = "-" if not best else f"{100 * fmean(values) / best:.1f} %"
            title = METHODS[method].title
            start = spread(first[task][method])
            rows.append(
                [task, title, len(values), measure[task].name, start, spread(values), share]
            )
    head = ["task", "method", "n", "measure", "generation 0", "champion", "of the optimum"]
    return pages.table(head, rows)


def comparison_table(tables: Tables, method: str) -> str:
    """Return a method against each other one; Holm's correction is over those of a task."""
    rows: list[list[Any]] = []
    for task, of in by_cell(tables.values()).items():
        others = [other for other in of if other != method]
        found = [compare(of[method], of[other]) for other in others]
        corrected = holm([one.p_mann_whitney for one in found])
        for other, one, ranked in zip(others, found, corrected, strict=True):
            interval = "-" if one.low is None else f"{one.low:.4g} to {one.high:.4g}"
            rows.append(
                [
                    task,
                    METHODS[other].title,
                    f"{one.n_a}, {one.n_b}",
                    f"{one.difference:+.4g}",
                    interval,
                    p(one.p_t),
                    p(one.p_welch),
                    p(ranked),
                    f"{one.a12:.2f}",
                ]
            )
    minus = f"{METHODS[method].title} minus"
    head = ["task", minus, "n", "difference", "95 % interval (Welch)", "p, t-test"]
    return pages.table([*head, "p, Welch", "p, Mann-Whitney, Holm", "A12"], rows)


def caste_table(tables: Tables) -> str:
    """Return the champions' castes: mean number of robots over the runs."""
    _, rows = tables.query(
        "SELECT task, method, caste, count(*) / any_value(n) FROM robots JOIN runs USING (run) "
        "JOIN (SELECT task, method, count(*) AS n FROM runs GROUP BY ALL) USING (task, method) "
        "GROUP BY task, method, caste ORDER BY task, method, count(*) DESC, caste"
    )
    found: dict[tuple[str, str], list[str]] = {}
    for task, method, caste, robots in rows:
        found.setdefault((task, method), []).append(f"{caste} {robots:.1f}")
    order = sorted(found, key=lambda key: (key[0], list(METHODS).index(key[1])))
    lines = [[task, METHODS[m].title, ", ".join(found[task, m])] for task, m in order]
    return pages.table(["task", "method", "robots of a champion, mean over runs"], lines)


def claims_table(tables: Tables) -> str:
    """Return every claim with its verdict."""
    rows = []
    for one in verdicts(tables):
        interval = "-" if one.low is None else f"{one.low:.3g} to {one.high:.3g}"
        rows.append([one.id, one.claim, one.effect or "-", interval, one.n or "-", one.verdict])
    return pages.table(["id", "claim", "effect", "95 % interval", "n", "verdict"], rows)


def provenance(campaign: Campaign) -> str:
    """Return versions and machine of the finished runs, and the number of the others."""
    about, planned, each = versions(campaign)
    words = "; ".join(f"{title} {values}" for title, values in each.items())
    return f"Made with {words}. Runs that did not finish: {planned - len(about)}.\n"


def main() -> None:
    """Write the report and the page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("campaign", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--method", default="cone", choices=METHODS)
    parser.add_argument("--foreign", type=Path, nargs="+", default=[])
    args = parser.parse_args()
    campaign, folder = Campaign(args.campaign), args.folder
    others = read_foreign(args.foreign, "team") if args.foreign else []
    shutil.copyfile(campaign.paths.plan, folder / "plan.toml")
    page = folder / "README.md"
    with sealed(campaign) as sources, Tables(sources) as tables:
        write_report(campaign, folder / "report", sources, others)
        pages.put(provenance(campaign) + "\n" + cost_table(tables), page, "cost")
        pages.put(performance_table(tables), page, "performance")
        pages.put(comparison_table(tables, args.method), page, "comparisons")
        pages.put(caste_table(tables), page, "castes")
        if "<!-- claims -->" in page.read_text():
            pages.put(claims_table(tables), page, "claims")


if __name__ == "__main__":
    main()
