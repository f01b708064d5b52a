"""Ask who can take whose place: champions of a campaign with their controllers moved on.

    python experiments/rotations.py CAMPAIGN --write docs/results/specialists.md

Robot i begins in region i mod 4 (``world.starts=by_robot``). Moved on by 4, 8 or 12 robots, every
controller gets to a robot that begins in the same region; by 1, 2 or 3 to one of another region. If
the first costs nothing and the second much, the robots of a region are a caste: they can stand in
for each other, and for nobody else. With ``--write`` a row per run goes to PAGE-rotations.csv, and
the table between the page's markers ``<!-- rotations -->``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1] / "docs"))
from conevo.cli.find import find_campaign
from conevo.errors import ConevoError, UsageError
from conevo.evolution.methods.registry import title_of
from conevo.runs.run import Run
from conevo.worlds.rover.sites import N_REGIONS
from pages import Row, put, read, table, write
from regime_tables import number

SAME = tuple(N_REGIONS * k for k in (1, 2, 3))
OTHER = tuple(range(1, N_REGIONS))
FACTS = {"seed", "own", "same region", "other region"}


def rows_of(name: str, methods: Sequence[str]) -> list[Row]:
    """Return the value of each finished champion, and of the same team moved on.

    Raises:
        UsageError: there is no such campaign, or no finished run in which robots begin by region.
    """
    campaign = find_campaign(name)
    rows: list[Row] = []
    for label, entry in campaign.standings().items():
        planned = campaign.planned[label]
        if entry.state != "finished" or planned.method not in methods:
            continue
        run = Run(campaign.places.run(label))
        if getattr(run.config.world_params, "starts", None) != "by_robot":
            continue
        levels = dict(part.partition("=")[::2] for part in planned.variant.split(", ") if part)
        means = {k: _value(run, k) for k in (0, *SAME, *OTHER)}
        row: Row = {"method": planned.method, **levels, "seed": run.config.run.seed}
        row |= {"own": means[0], "same region": float(np.mean([means[k] for k in SAME]))}
        rows.append(row | {"other region": float(np.mean([means[k] for k in OTHER]))})
    if not rows:
        raise UsageError(f"{campaign.path} has no finished run of {', '.join(methods)} by region")
    return rows


def _value(run: Run, rotate: int) -> float:
    tested = run.test_under(rotate=rotate, threads=1)["changed"]
    return float(tested["performance"]["value"]["mean"])


def rotation_table(rows: Sequence[Row]) -> str:
    """Return what is left of the value in each cell, mean over runs and from least to most."""
    names = [key for key in rows[0] if key not in FACTS]
    cells: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        cells.setdefault(tuple(_level(row.get(key)) for key in names), []).append(row)
    lines = []
    for cell, runs in cells.items():
        at = [title_of(v) if k == "method" else v for k, v in zip(names, cell, strict=True)]
        line = [*at, len(runs), number(float(np.mean([float(run["own"]) for run in runs])), ".0f")]
        for where in ("same region", "other region"):
            left = [100 * float(run[where]) / float(run["own"]) for run in runs]
            line.append(f"{np.mean(left):.0f} % ({min(left):.0f} to {max(left):.0f})")
        lines.append(line)
    head = [*names, "runs", "value", "moved within the region", "moved to another region"]
    return table(head, lines)


def _level(of: object) -> str:
    return f"{of:g}" if isinstance(of, float) else "–" if of is None else str(of)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("campaign", nargs="?", help="directory, or name in campaigns/")
    parser.add_argument("--methods", default="cone-es", help="of these methods: A,B (%(default)s)")
    parser.add_argument("--write", type=Path, help="page whose table is replaced")
    parser.add_argument("--again", action="store_true", help="from the CSV file, not a campaign")
    args = parser.parse_args(arguments)
    page: Path | None = args.write
    if page and not page.is_file():
        parser.error(f"--write {page}: there is no such page")
    if args.again != (args.campaign is None) or (args.again and page is None):
        parser.error("name a CAMPAIGN, or --again with --write PAGE, whose CSV file is read")
    try:
        numbers = page and page.with_name(f"{page.stem}-rotations.csv")
        if not args.again:
            rows = rows_of(args.campaign, args.methods.split(","))
            if numbers:
                write(rows, numbers)
        if numbers:
            rows = read(numbers)
    except (ConevoError, OSError) as error:
        parser.error(str(error))
    print(rotation_table(rows))
    if page:
        put(rotation_table(rows), page, "rotations")


if __name__ == "__main__":
    main()
