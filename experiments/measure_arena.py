"""Measure how often predators meet prey, in arenas of several sizes and at two speeds.

    python experiments/measure_arena.py [--prey heuristic shaped] [--run RUN_DIRECTORY] [--seed 1]

plays teams of random networks, of heuristic predators and the champions of the given pursuit runs
in arenas of 100 to the printed 1000 cm, at Khepera speed and at the largest that makes physical
sense. ``evolved`` (``--evolve N``) also evolves a team in each of the four corners of that table.
It writes ``docs/results/arena.csv`` (every number), the tables between the markers of
``docs/results/arena.md`` and ``docs/results/arena.png``. The same seed gives the same numbers. It
takes about five minutes of one core for each kind of prey; ``--evolve 4000`` takes half an hour.

The world's own kernel counts how often predators are near: if every prey counts as immobilized at
once (``capture_window=1, capture_distance_cm=100``), capture time is the time with
``capture_predators`` of them in light range. Captures do not influence motion, so the epochs are
equal bit for bit.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import conevo
import pages
from pages import Row
from teams import Numbers, Teams, champion, controlled, error, keys_of, play, random_networks

PAGE = Path(__file__).parents[1] / "docs" / "results" / "arena.md"
ENVIRONMENTS = ("team-1", "team-3", "team-5")
ARENAS = (100, 200, 400, 1000)
SPEEDS = (0.8, 5.0)
N_SCENARIOS = 1000
N_RANDOM = 500  # teams of random networks, each in its own two of the scenarios
ALWAYS = {"capture_window": 1, "capture_distance_cm": 100.0}  # every prey counts as immobilized
COUNTS = {
    "one": ALWAYS | {"capture_predators": 1},
    "two": ALWAYS | {"capture_predators": 2},
    "capture": {},
}
NAMES = {"random": "random networks", "heuristic": "heuristic predators"}


# --- measure --------------------------------------------------------------------------------------


def epochs(environment: str, params: Row, teams: Teams, seed: int) -> dict[str, Numbers]:
    """Return capture time and first capture [N, E] for each of the three ways to count.

    Every team has its own share of the scenarios.
    """
    keys = keys_of(seed, N_SCENARIOS, "arena")
    share = N_SCENARIOS // len(teams.kinds)
    found: dict[str, Numbers] = {}
    for name, counted in COUNTS.items():
        world = conevo.world(f"pursuit/{environment}", **params, **counted)
        outcomes = [
            play(world, teams.one(n), keys[n * share : (n + 1) * share])
            for n in range(len(teams.kinds))
        ]
        for measure in ("capture_time", "first_capture"):
            values = np.concatenate([one.performance[measure] for one in outcomes])
            found[f"{name} {measure}"] = values.astype(np.float64)
    return found


def row_of(environment: str, params: Row, teams: Teams, kind: str, seed: int) -> Row:
    """Return the numbers of one kind of teams in one arena at one speed."""
    found = epochs(environment, params, teams, seed)
    n_teams = len(teams.kinds)
    row: Row = {
        "environment": environment,
        "teams": kind,
        "n_teams": n_teams,
        "n_scenarios": N_SCENARIOS,
        "prey": params["prey"],
        "arena_cm": params["arena_cm"],
        "max_speed_cm": params["max_speed_cm"],
    }
    for name in ("one", "two", "capture"):
        time = found[f"{name} capture_time"]
        for what, values in ((f"{name}_ever", time > 0), (f"{name}_iterations", time)):
            each = values.mean(axis=1) if n_teams > 1 else values[0].astype(np.float64)
            row[what], row[f"{what}_se"] = float(each.mean()), error(each)
        met = time > 0
        first = found[f"{name} first_capture"]
        row[f"{name}_first"] = float(first[met].mean()) if met.any() else float("nan")
    row["captured_teams"] = float((found["capture capture_time"] > 0).any(axis=1).mean())
    return row


def measure(prey: list[str], runs: list[str], seed: int) -> list[Row]:
    """Return a row for every prey, team type, arena, speed and kind of teams."""
    champions = [(conevo.Run(path), path) for path in runs]
    rows = []
    for who in prey:
        for environment in ENVIRONMENTS:
            world = conevo.world(f"pursuit/{environment}")
            kinds = {
                "random": random_networks(world, N_RANDOM, seed, "arena"),
                "heuristic": controlled(world, "heuristic", 0),
            }
            for run, path in champions:
                if run.config.environment == environment:
                    kinds[path] = champion(run, path)
            for arena in ARENAS:
                for speed in SPEEDS:
                    params = {"prey": who, "arena_cm": float(arena), "max_speed_cm": speed}
                    for kind, teams in kinds.items():
                        rows.append(row_of(environment, params, teams, kind, seed))
                    print(f"{who} prey, {environment}, {arena} cm, {speed} cm", flush=True)
    return rows


def evolved(
    environment: str, params: Row, evaluations: int, seed: int, method: str = "homcne"
) -> Row:
    """Evolve a team in an arena (preset desk with another budget) and measure it there.

    Returns:
        The numbers of ``row_of``, and capture time in the testing phase, champion and generation 0.
    """
    overrides: dict[str, Any] = {f"world.{name}": value for name, value in params.items()}
    overrides["run.budget_evaluations"] = evaluations
    with tempfile.TemporaryDirectory() as folder:
        task = f"pursuit/{environment}"
        run = conevo.evolve(
            task, method, "desk", seed, Path(folder) / "run", overrides=overrides, threads=1
        )
        teams, test = champion(run, "evolved"), run.test_result
        generations = run.generations()
    row = row_of(environment, params, teams, f"{method} seed {seed}", seed)
    row["team_evaluations"] = generations[-1]["team_evaluations"]
    row["test"] = test["champion"]["performance"]["capture_time"]["mean"]
    row["test_first"] = test["generation_0"]["performance"]["capture_time"]["mean"]
    row["mean_fitness_first"] = generations[0]["mean_fitness"]
    return row


def evolve_corners(prey: str, evaluations: int, seeds: list[int]) -> list[Row]:
    """Return the rows of teams that evolved in the smallest and largest arena at both speeds."""
    rows = []
    for arena in (ARENAS[0], ARENAS[-1]):
        for speed in SPEEDS:
            params = {"prey": prey, "arena_cm": float(arena), "max_speed_cm": speed}
            for seed in seeds:
                rows.append(evolved("team-3", params, evaluations, seed))
                print(f"evolved in {arena} cm, {speed} cm, seed {seed}", flush=True)
    return rows


# --- tables ---------------------------------------------------------------------------------------


def percent(row: Row, name: str) -> str:
    """Return a share of epochs with its standard error."""
    return f"{row[name]:.1%} ± {row[f'{name}_se']:.1%}".replace("%", " %")


def number(row: Row, name: str) -> str:
    """Return a mean over epochs with its standard error."""
    return f"{row[name]:.1f} ± {row[f'{name}_se']:.1f}"


def arena_table(rows: list[Row]) -> str:
    """Return one line per arena, speed, team type and kind of teams."""
    head = ["arena, cm", "speed, cm", "team", "one near, ever", "two near, ever"]
    head += ["iterations with two near", "captured, ever", "capture time"]
    lines = []
    for row in rows:
        line = [f"{row['arena_cm']:.0f}", f"{row['max_speed_cm']:g}", row["environment"]]
        line += [percent(row, "one_ever"), percent(row, "two_ever"), number(row, "two_iterations")]
        lines.append([*line, percent(row, "capture_ever"), number(row, "capture_iterations")])
    return pages.table(head, lines)


def tables(rows: list[Row]) -> str:
    """Return all tables of the page."""
    text = ""
    fixed = [row for row in rows if "test" not in row]
    for prey in dict.fromkeys(row["prey"] for row in fixed):
        for kind in dict.fromkeys(row["teams"] for row in fixed):
            some = [row for row in fixed if row["prey"] == prey and row["teams"] == kind]
            text += f"**{NAMES.get(kind, kind).capitalize()}, {prey} prey**\n\n"
            text += arena_table(sorted(some, key=lambda r: (r["arena_cm"], r["max_speed_cm"])))
            text += "\n"
    grown = [row for row in rows if "test" in row]
    if grown:
        first = grown[0]
        text += f"**Evolved where they play: {first['environment']}, {first['prey']} prey, "
        text += f"{first['team_evaluations']:,} team evaluations (HomCNE, preset desk)**\n\n"
        head = ["arena, cm", "speed, cm", "seed", "mean fitness, generation 0"]
        head += ["capture time in the testing phase, generation 0", "champion"]
        head += ["champion: two near, ever", "iterations with two near"]
        lines = [
            [f"{row['arena_cm']:.0f}", f"{row['max_speed_cm']:g}", row["teams"].split()[-1]]
            + [f"{row[name]:.2f}" for name in ("mean_fitness_first", "test_first", "test")]
            + [percent(row, "two_ever"), number(row, "two_iterations")]
            for row in grown
        ]
        text += pages.table(head, lines) + "\n"
    return text.rstrip("\n") + "\n"


def draw(rows: list[Row], path: Path) -> None:
    """Draw the share of epochs in which two predators are ever near, over the arena's side."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    prey = rows[0]["prey"]
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), sharey=True, layout="constrained")
    for ax, kind in zip(axes, NAMES, strict=True):
        for k, environment in enumerate(ENVIRONMENTS):
            for speed in SPEEDS:
                some = [
                    row
                    for row in rows
                    if "test" not in row
                    and (row["prey"], row["teams"]) == (prey, kind)
                    and (row["environment"], row["max_speed_cm"]) == (environment, speed)
                ]
                ax.plot(
                    [row["arena_cm"] for row in some],
                    [100 * row["two_ever"] for row in some],
                    color=plt.get_cmap("viridis")(k / 2.5),
                    linestyle="-" if speed == SPEEDS[0] else "--",
                    marker="os^"[k],
                    markersize=4,
                    label=f"{environment}, {speed:g} cm",
                )
        ax.set_xscale("log")
        ax.set_xticks(ARENAS, list(map(str, ARENAS)))
        ax.minorticks_off()
        ax.set_xlabel("side of the arena, cm")
        ax.set_title(NAMES[kind], loc="left", fontsize=10)
        ax.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("epochs with two near, %")
    axes[0].set_ylim(-3, 103)
    axes[1].legend(frameon=False, fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(path, dpi=110, metadata={"Software": None})


def main() -> None:
    """Measure and write everything."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--prey", nargs="+", default=["heuristic"])
    parser.add_argument("--run", action="append", default=[], help="finished run; may be repeated")
    parser.add_argument("--evolve", type=int, default=0, help="team evaluations; 0: no evolution")
    parser.add_argument("--evolve-seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--seed", type=int, default=1, help="of scenarios and random networks")
    args = parser.parse_args()
    rows = measure(args.prey, args.run, args.seed)
    if args.evolve:
        rows += evolve_corners(args.prey[0], args.evolve, args.evolve_seeds)
    pages.write(rows, PAGE.with_suffix(".csv"))
    pages.put(tables(rows), PAGE)
    draw(rows, PAGE.with_suffix(".png"))
    print(tables(rows))
    rollout = conevo.Rollout(conevo.world("pursuit/team-3"), n_threads=1)
    print(f"kernel {rollout.fingerprint}")


if __name__ == "__main__":
    main()
