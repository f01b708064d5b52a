"""Test which robots can stand in for each other: champions with controllers moved between robots.

    python experiments/rotations.py CAMPAIGN --write docs/results/specialists.md

Robot i starts in region i mod 4 (``world.starts=by_robot``). Moved on by 4, 8 or 12 robots, every
controller gets to a robot that starts in the same region; by 1, 2 or 3 to one of another region.
The controllers of two regions are also swapped, pair by pair. If moves within regions cost nothing
and every swap costs much, the robots of a region are a caste: they can stand in for each other, but
for no others. The script also measures where robots are in the second half of an epoch, by the
region of their start. With ``--write`` a row per run goes to PAGE-rotations.csv, and the tables
between the page's markers ``<!-- rotations -->``, ``<!-- swaps -->`` and ``<!-- places -->``.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from compare_levels import level_name
from conevo.cli.lookup import find_campaign
from conevo.errors import ConevoError, UsageError
from conevo.evolution.methods.registry import title_of
from conevo.evolution.protocol import IntArray
from conevo.rng import fold
from conevo.runs.lab import Lab
from conevo.runs.run import Run
from conevo.worlds.rover.rocks import layout
from conevo.worlds.rover.sites import N_REGIONS, rock_sites
from page_arguments import PageParser
from pages import Row, put, read, table, write
from regime_tables import number

SAME = tuple(N_REGIONS * k for k in (1, 2, 3))
OTHER = tuple(range(1, N_REGIONS))
PAIRS = tuple(itertools.combinations(range(N_REGIONS), 2))
FEW = 3  # scenarios in which places of robots are recorded
ABCD = "ABCD"  # regions, by the type that lies there


def swap_name(pair: tuple[int, int]) -> str:
    """Return the column of a swap: "A and B"."""
    return f"{ABCD[pair[0]]} and {ABCD[pair[1]]}"


def place_name(begin: int, at: int) -> str:
    """Return the column of a share of time: "A in C"."""
    return f"{ABCD[begin]} in {ABCD[at]}"


FACTS = {"seed", "own", "same region", "other region"}
FACTS |= {swap_name(pair) for pair in PAIRS}
FACTS |= {place_name(a, b) for a, b in itertools.product(range(N_REGIONS), repeat=2)}


def orders(n_robots: int) -> dict[str, list[IntArray]]:
    """Return the number of each robot's controller, [R], for every kind of change."""
    robots = np.arange(n_robots)
    swapped = {}
    for a, b in PAIRS:
        there = np.select([robots % N_REGIONS == a, robots % N_REGIONS == b], [b - a, a - b], 0)
        swapped[swap_name((a, b))] = [(robots + there) % n_robots]
    return {
        "own": [robots],
        "same region": [np.roll(robots, k) for k in SAME],
        "other region": [np.roll(robots, k) for k in OTHER],
        **swapped,
    }


def rows_of(name: str, methods: Sequence[str]) -> list[Row]:
    """Return the value of each champion and of its changed teams, and the places of robots.

    Raises:
        UsageError: the campaign does not exist, or has no finished run with starts by region.
    """
    campaign = find_campaign(name)
    rows: list[Row] = []
    for label, entry in campaign.standings().items():
        planned = campaign.planned[label]
        if entry.state != "finished" or planned.method not in methods:
            continue
        run = Run(campaign.paths.run(label))
        if getattr(run.config.world_params, "starts", None) != "by_robot":
            continue
        levels = dict(part.partition("=")[::2] for part in planned.variant.split(", ") if part)
        row: Row = {"method": planned.method, **levels, "seed": run.config.run.seed}
        rows.append(row | _values(run))
    if not rows:
        raise UsageError(f"{campaign.path} has no finished run of {', '.join(methods)} by region")
    return rows


def _values(run: Run) -> Row:
    champion = run.champion
    if champion is None:
        raise UsageError(f"{run.path} has no champion")
    lab = Lab.equip(run.config, 1, "cpu")
    seed, n_tests = run.config.run.seed, run.config.run.n_tests
    keys = [fold(seed, "test", k) for k in range(n_tests)]
    genes, teams = champion.as_trial()
    changed = orders(teams.shape[1])
    trials = np.stack([teams[0][order] for some in changed.values() for order in some])
    outcome = lab.simulator.evaluate(genes, trials, lab.world.scenarios(keys))
    each = iter(outcome.performance["value"].mean(axis=1, dtype=np.float64))
    values = {name: float(np.mean([next(each) for _ in some])) for name, some in changed.items()}
    sites, shares = rock_sites(layout(run.config.environment)), np.zeros((N_REGIONS, N_REGIONS))
    for key in keys[:FEW]:
        seen = lab.simulator.record(genes, teams[0], lab.world.scenarios([key]))
        late = np.stack([seen["x"], seen["y"]], axis=-1)[len(seen["x"]) // 2 :]
        at = sites.region(late.astype(np.float32))
        for begin in range(N_REGIONS):
            own = at[:, np.arange(at.shape[1]) % N_REGIONS == begin]
            shares[begin] += np.bincount(own.ravel(), minlength=N_REGIONS) / own.size / FEW
    places = itertools.product(range(N_REGIONS), repeat=2)
    return values | {place_name(a, b): float(shares[a, b]) for a, b in places}


def _cells(rows: Sequence[Row]) -> tuple[list[str], dict[tuple[str, ...], list[Row]]]:
    """Return the names of the levels, and the runs of each combination of them."""
    names = list(dict.fromkeys(key for row in rows for key in row if key not in FACTS))
    cells: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        at = {key: level_name(row.get(key)) for key in names}
        at["method"] = title_of(at["method"])
        cells.setdefault(tuple(at.values()), []).append(row)
    return names, cells


def _left(runs: Sequence[Row], name: str) -> str:
    """Return the remaining share of the value: mean over runs, smallest and largest."""
    left = [100 * float(run[name]) / float(run["own"]) for run in runs]
    return f"{np.mean(left):.0f} % ({min(left):.0f} to {max(left):.0f})"


def rotation_table(rows: Sequence[Row]) -> str:
    """Return the remaining value in each cell after moves within and between regions."""
    names, cells = _cells(rows)
    lines = [
        [
            *at,
            len(runs),
            number(float(np.mean([float(run["own"]) for run in runs])), ".0f"),
            _left(runs, "same region"),
            _left(runs, "other region"),
        ]
        for at, runs in cells.items()
    ]
    head = [*names, "runs", "value", "moved within the region", "moved to another region"]
    return table(head, lines)


def swap_table(rows: Sequence[Row]) -> str:
    """Return the remaining value in each cell after swaps of the controllers of two regions."""
    names, cells = _cells(rows)
    swaps = [swap_name(pair) for pair in PAIRS]
    lines = [[*at, *(_left(runs, swap) for swap in swaps)] for at, runs in cells.items()]
    return table([*names, *swaps], lines)


def place_table(rows: Sequence[Row]) -> str:
    """Return the share of the second half of an epoch that robots spend in each region."""
    names, cells = _cells(rows)
    lines = []
    for at, runs in cells.items():
        for begin in range(N_REGIONS):
            shares = [[float(run[place_name(begin, k)]) for run in runs] for k in range(N_REGIONS)]
            lines.append([*at, ABCD[begin], *(f"{np.mean(share):.2f}" for share in shares)])
    return table([*names, "begins in", *(f"in {one}" for one in ABCD)], lines)


PARTS = {"rotations": rotation_table, "swaps": swap_table, "places": place_table}


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the table."""
    parser = PageParser(__doc__)
    parser.add_argument("--methods", default="cone-es", help="of these methods: A,B (%(default)s)")
    args = parser.parse(arguments)
    page: Path | None = args.write
    try:
        numbers = page and page.with_name(f"{page.stem}-rotations.csv")
        if page and not any(f"<!-- {name} -->" in page.read_text() for name in PARTS):
            parser.error(f"--write {page}: it has none of the markers {', '.join(PARTS)}")
        if not args.again:
            rows = rows_of(args.campaign, args.methods.split(","))
            if numbers:
                write(rows, numbers)
        if numbers:
            rows = read(numbers)
    except (ConevoError, OSError) as error:
        parser.error(str(error))
    for name, make in PARTS.items():
        print(make(rows))
        if page and f"<!-- {name} -->" in page.read_text():
            put(make(rows), page, name)


if __name__ == "__main__":
    main()
