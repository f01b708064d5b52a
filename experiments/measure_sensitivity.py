"""Measure the effect of the multi-rover world's chosen parameters on fixed teams.

    python experiments/measure_sensitivity.py --run RUN_DIRECTORY [--run RUN_DIRECTORY] [--seed 1]

plays fixed teams (heuristic controllers, random networks, the champions of the given runs) in the
same scenarios with one parameter changed at a time. It writes ``docs/results/sensitivity.csv``
(every number) and the tables between the markers of ``docs/results/sensitivity.md``. The same seed
and runs give the same numbers. It takes about five minutes of one core.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import numpy.typing as npt
from annotated_types import Le

import conevo
from conevo.worlds.protocol import Outcome
from conevo.worlds.rover.world import RoverParams
from pages import Row, put, write
from teams import (
    Numbers,
    Teams,
    champion,
    controlled,
    error,
    keys_of,
    play,
    random_networks,
    ratio,
    sample,
)

ENVIRONMENT = "rover/complex-5"
N_RANDOM = 20
PAGE = Path(__file__).parents[1] / "docs" / "results" / "sensitivity.md"
DEFAULTS = RoverParams()
RANGES = ("low_range", "med_range", "hi_range")
GROUPS = {
    "three ranges": RANGES,
    **{name: (name,) for name in RANGES},
    "three accuracies": ("low_accuracy", "med_accuracy", "hi_accuracy"),
    "three costs": ("low_cost", "med_cost", "hi_cost"),
    **{
        name: (name,)
        for name in (
            *("energy", "rover_sensor_range", "move_range"),
            *("report_cost", "min_distance", "separation"),
        )
    },
}
SCALES = ((0.07, 0.05, 0.03), (0.10, 0.08, 0.06), (0.20, 0.15, 0.10))
Params = dict[str, Any]


# --- settings -------------------------------------------------------------------------------------


def scaled(names: tuple[str, ...], factor: float) -> Params:
    """Return the parameters times a factor, up to the bounds of ``RoverParams``."""
    types = get_type_hints(RoverParams, include_extras=True)
    found = {}
    for name in names:
        bounds = [m.le for m in getattr(types[name], "__metadata__", ()) if isinstance(m, Le)]
        found[name] = round(min([getattr(DEFAULTS, name) * factor, *bounds]), 6)
    return found


def settings() -> Iterator[tuple[str, Params]]:
    """Yield every setting at the desk preset's length, the default first."""
    yield "default", {}
    for title, names in GROUPS.items():
        for factor, sign in ((0.7, "-30 %"), (1.3, "+30 %")):
            yield f"{title} {sign}", scaled(names, factor)
    yield "ranges as sides of squares", scaled(RANGES, np.pi**-0.5)
    yield "step without the root of 2", scaled(("move_range",), 2**-0.5)
    yield "fitness value_times_area", {"fitness": "product"}


def long_settings() -> Iterator[tuple[str, Params]]:
    """Yield the settings at the thesis' length, the default first."""
    for scale in SCALES:
        yield (
            "ranges " + " / ".join(f"{r:.2f}" for r in scale),
            dict(zip(RANGES, scale, strict=True)),
        )
    yield "energy -30 %", scaled(("energy",), 0.7)
    yield "three costs +30 %", scaled(GROUPS["three costs"], 1.3)


# --- who plays ------------------------------------------------------------------------------------


def make_teams(runs: list[str], seed: int) -> Teams:
    """Return clones of each heuristic, the mixed castes, random networks and the champions."""
    world = conevo.world(ENVIRONMENT)
    n = len(world.heuristics)
    made = [controlled(world, name, k) for k, name in enumerate(world.heuristics)]
    made.append(controlled(world, "mixed", np.repeat(np.arange(n), world.n_robots // n)))
    made.append(random_networks(world, N_RANDOM, seed, "sensitivity"))
    for path in runs:
        run = conevo.Run(path)
        made.append(champion(run, f"{run.config.method} seed {run.config.run.seed}"))
    teams = made[0]
    for more in made[1:]:
        teams += more
    return teams


# --- statistics -----------------------------------------------------------------------------------


def ranks(values: Numbers) -> Numbers:
    """Return the ranks of numbers; ties share their mean rank."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    found: Numbers = (np.cumsum(counts) - (counts - 1) / 2)[inverse]
    return found


def spearman(a: Numbers, b: Numbers) -> float:
    """Return the rank correlation, nan if one side is constant."""
    x, y = ranks(a), ranks(b)
    if x.std() == 0 or y.std() == 0:
        return float("nan")
    return float(np.corrcoef(x, y)[0, 1])


def measure(teams: Teams, name: str, params: Params, outcome: Outcome, base: Outcome) -> list[Row]:
    """Return a row of numbers for each kind of team."""
    rows = []
    for kind in dict.fromkeys(teams.kinds):
        some = teams.of(kind)
        row: Row = {
            "iterations": params["iterations"],
            "setting": name,
            "changed": " ".join(f"{k}={v}" for k, v in params.items() if k != "iterations"),
            "teams": kind,
            "n_teams": len(some),
            "n_scenarios": outcome.fitness.shape[1],
        }
        for measured in ("value", "area"):
            now = sample(outcome.performance[measured], some)
            before = sample(base.performance[measured], some)
            row[measured], row[f"{measured}_se"] = now.mean(), error(now)
            row[f"{measured}_ratio"], row[f"{measured}_ratio_se"] = ratio(now, before)
        row["nothing"] = float((outcome.performance["value"][some] == 0).mean())
        row["identical"] = int(
            np.array_equal(outcome.counts[some], base.counts[some])
            and all(
                np.array_equal(values[some], base.performance[k][some])
                for k, values in outcome.performance.items()
            )
        )
        rows.append(row | compare_fitness(outcome.fitness[some], base.fitness[some]))
    return rows


def compare_fitness(changed: npt.NDArray[Any], default: npt.NDArray[Any]) -> Row:
    """Return mean fitness and rank correlations between two fitness arrays [N, E, R]."""
    means = [f.astype(np.float64).mean(axis=1).ravel() for f in (changed, default)]
    both = (means[0] > 0) & (means[1] > 0)
    single = [
        spearman(changed[:, e].ravel(), default[:, e].ravel()) for e in range(changed.shape[1])
    ]
    defined = [one for one in single if not np.isnan(one)]
    return {
        "fitness": means[0].mean(),
        "fitness_rank": spearman(*means),
        "n_positive": int(both.sum()),
        "fitness_rank_positive": (
            spearman(means[0][both], means[1][both]) if both.sum() > 2 else float("nan")
        ),
        "fitness_rank_one_scenario": float(np.mean(defined)) if defined else float("nan"),
    }


# --- tables ---------------------------------------------------------------------------------------


def grid(rows: list[Row], cell: Any, corner: str, kinds: list[str]) -> str:
    """Return a table: one line per setting, one column per kind of team."""
    lines = [f"| {corner} | " + " | ".join(kinds) + " |", "|---" * (len(kinds) + 1) + "|"]
    for name in dict.fromkeys(row["setting"] for row in rows):
        by_kind = {row["teams"]: row for row in rows if row["setting"] == name}
        lines.append(f"| {name} | " + " | ".join(cell(by_kind[kind]) for kind in kinds) + " |")
    return "\n".join(lines) + "\n"


def ratio_cell(measured: str) -> Any:
    """Return the function that writes a ratio: bold if over three standard errors from 1."""
    digits = 2 if measured == "value" else 3

    def cell(row: Row) -> str:
        if row["identical"]:
            return "same"
        value, se = row[f"{measured}_ratio"], row[f"{measured}_ratio_se"]
        if np.isnan(value):
            return "-"
        if value == 1 and se == 0:
            return "same value" if measured == "value" else "same area"
        text = f"{value:.{digits}f} ± {se:.{digits}f}"
        return f"**{text}**" if abs(value - 1) > 3 * se else text

    return cell


def absolute(row: Row) -> str:
    """Return value with its standard error."""
    return f"{row['value']:.0f} ± {row['value_se']:.0f}"


def number(value: float) -> str:
    """Return a correlation, or a dash if it is not defined."""
    return "-" if np.isnan(value) else f"{value:.2f}"


def tables(rows: list[Row]) -> str:
    """Return all tables of the page."""
    desk = [row for row in rows if row["iterations"] == 1250]
    full = [row for row in rows if row["iterations"] == 2500]
    kinds = list(dict.fromkeys(row["teams"] for row in desk))
    useful = [k for k in kinds if k != "med"]
    varied = [row for row in desk if row["setting"] != "default"]
    text = "**The teams with all defaults, 1250 iterations**\n\n"
    text += "| teams | number | value | area | scenarios with value 0 |\n|---|---|---|---|---|\n"
    for row in desk:
        if row["setting"] == "default":
            text += (
                f"| {row['teams']} | {row['n_teams']} | {absolute(row)} "
                f"| {row['area']:.3f} ± {row['area_se']:.3f} | {row['nothing']:.0%} |\n"
            )
    for measured in ("value", "area"):
        text += f"\n**Ratio of {measured} to the default, 1250 iterations**\n\n"
        text += grid(varied, ratio_cell(measured), "changed", useful)
    text += "\n**Rank correlation of the robots' fitness with that of the default**\n\n"
    text += "| changed | teams | robots | mean of 20 scenarios | of those, both above 0 "
    text += "| one scenario |\n|---|---|---|---|---|---|\n"
    for row in desk:
        of_heuristic = row["setting"].startswith("min_distance") and row["teams"] in kinds[:5]
        if row["teams"] != "med" and (row["setting"].startswith("fitness") or of_heuristic):
            text += (
                f"| {row['setting']} | {row['teams']} | {20 * row['n_teams']} "
                f"| {number(row['fitness_rank'])} "
                f"| {number(row['fitness_rank_positive'])} ({row['n_positive']} robots) "
                f"| {number(row['fitness_rank_one_scenario'])} |\n"
            )
    scale = [row for row in full if row["setting"].startswith("ranges")]
    text += "\n**Value at the thesis' length (2500 iterations) with three scales of ranges**\n\n"
    text += grid(scale, absolute, "low / med / hi", kinds)
    text += "\nScenarios in which random networks detect nothing: "
    text += ", ".join(
        f"{row['nothing']:.0%} ({row['setting'].removeprefix('ranges ')})"
        for row in scale
        if row["teams"] == "random"
    )
    text += ".\n\n**Ratio of value to the default, 2500 iterations**\n\n"
    text += grid([r for r in full if r not in scale], ratio_cell("value"), "changed", useful)
    return text


def main() -> None:
    """Measure and write everything."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--run", action="append", default=[], help="finished run; may be repeated")
    parser.add_argument("--seed", type=int, default=1, help="of scenarios and random networks")
    args = parser.parse_args()
    teams = make_teams(args.run, args.seed)
    rows = []
    for iterations, n_scenarios, some in ((1250, 20, settings()), (2500, 15, long_settings())):
        base: Outcome | None = None
        for name, changed in some:
            params = {"iterations": iterations, **changed}
            world = conevo.world(ENVIRONMENT, **params)
            outcome = play(world, teams, keys_of(args.seed, n_scenarios, "sensitivity"))
            base = base or outcome
            rows += measure(teams, name, params, outcome, base)
            print(f"{iterations} iterations, {name}", flush=True)
    write(rows, PAGE.with_suffix(".csv"))
    put(tables(rows), PAGE)
    print(tables(rows))
    world = conevo.world(ENVIRONMENT)
    print(f"kernel {conevo.Rollout(world, n_threads=1).fingerprint}")


if __name__ == "__main__":
    main()
