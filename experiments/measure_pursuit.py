"""Measure the effect of pursuit-evasion's chosen parameters on fixed teams.

    python experiments/measure_pursuit.py --run RUN_DIRECTORY [--run RUN_DIRECTORY] [--seed 1]

plays fixed teams (heuristic predators, random networks, the champions of the given runs of
``pursuit/team-3``) in the same scenarios with one parameter changed at a time. It writes
``docs/results/sensitivity-pursuit.csv`` (every number) and the tables between the markers of
``docs/results/sensitivity-pursuit.md``. The same seed and runs give the same numbers. It takes
about twenty minutes of one core.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import conevo
import pages
from conevo.worlds.pursuit.world import PursuitParams
from pages import Row
from teams import champion, controlled, error, keys_of, play, random_networks, ratio, sample

ENVIRONMENT = "pursuit/team-3"
N_SCENARIOS, N_RANDOM = 200, 100
PAGE = Path(__file__).parents[1] / "docs" / "results" / "sensitivity-pursuit.md"
DEFAULTS = PursuitParams()
FACTORS = {
    "sensor_angle_deg": (0.7, 1.3),
    "sensor_range_cm": (0.7, 1.3),
    "max_speed_cm": (0.7, 1.3),
    "capture_window": (0.5, 2.0),
    "capture_share": (0.5, 2.0),
    "capture_distance_cm": (0.5, 2.0),
}


def settings() -> dict[str, Row]:
    """Return the changes of parameters, the default first."""
    found: dict[str, Row] = {"default": {}}
    for name, factors in FACTORS.items():
        before = getattr(DEFAULTS, name)
        for factor in factors:
            value = type(before)(round(before * factor, 6))
            found[f"`{name}` {value:g}"] = {name: value}
    found["`prey_speed` 1"] = {"prey_speed": 1.0}
    found["`n_obstacles` 4"] = {"n_obstacles": 4}
    return found


def measure(runs: list[str], seed: int) -> list[Row]:
    """Return a row for every setting and kind of teams."""
    world = conevo.world(ENVIRONMENT)
    teams = controlled(world, "heuristic", 0)
    teams += random_networks(world, N_RANDOM, seed, "sensitivity")
    for path in runs:
        run = conevo.Run(path)
        teams += champion(run, f"{run.config.method} seed {run.config.run.seed}")
    keys = keys_of(seed, N_SCENARIOS, "sensitivity")
    rows, base = [], None
    for name, changed in settings().items():
        outcome = play(conevo.world(ENVIRONMENT, **changed), teams, keys)
        time = outcome.performance["capture_time"]
        base = time if base is None else base
        for kind in dict.fromkeys(teams.kinds):
            some = teams.of(kind)
            now, before = sample(time, some), sample(base, some)
            quotient, quotient_se = ratio(now, before)
            row: Row = {"setting": name.replace("`", ""), "teams": kind, "n_teams": len(some)}
            row |= {"n_scenarios": N_SCENARIOS, "capture_time": now.mean(), "se": error(now)}
            row |= {"ratio": quotient, "ratio_se": quotient_se, "name": name}
            rows.append(row | {"captured": float((time[some] > 0).mean())})
        print(name, flush=True)
    return rows


def cell(row: Row) -> str:
    """Return a ratio as text: bold if further than three standard errors from 1."""
    if np.isnan(row["ratio"]):
        return "–"
    if row["ratio"] == 1 and row["ratio_se"] == 0:
        return "same"
    text = f"{row['ratio']:.3f} ± {row['ratio_se']:.3f}"
    return f"**{text}**" if abs(row["ratio"] - 1) > 3 * row["ratio_se"] else text


def tables(rows: list[Row]) -> str:
    """Return the page's two tables: capture time with all defaults, then ratios to it."""
    kinds = list(dict.fromkeys(row["teams"] for row in rows))
    lines = []
    for row in rows:
        if row["setting"] == "default":
            caught = f"{row['captured']:.0%}".replace("%", " %")
            time = f"{row['capture_time']:.1f} ± {row['se']:.1f}"
            lines.append([row["teams"], row["n_teams"], time, caught])
    text = "**With all defaults**\n\n"
    text += pages.table(["teams", "number", "capture time", "epochs with a capture"], lines)
    text += "\n**Ratio of capture time to the default's**\n\n"
    lines = []
    for name in dict.fromkeys(row["name"] for row in rows if row["setting"] != "default"):
        by_kind = {row["teams"]: row for row in rows if row["name"] == name}
        lines.append([name, *(cell(by_kind[kind]) for kind in kinds)])
    return text + pages.table(["changed", *kinds], lines)


def main() -> None:
    """Measure and write everything."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--run", action="append", default=[], help="finished run; may be repeated")
    parser.add_argument("--seed", type=int, default=1, help="of scenarios and random networks")
    args = parser.parse_args()
    rows = measure(args.run, args.seed)
    numbers = [{k: v for k, v in row.items() if k != "name"} for row in rows]
    pages.write(numbers, PAGE.with_suffix(".csv"))
    pages.put(tables(rows), PAGE)
    print(tables(rows))
    rollout = conevo.Rollout(conevo.world(ENVIRONMENT), n_threads=1)
    print(f"kernel {rollout.fingerprint}")


if __name__ == "__main__":
    main()
