"""Measure the performance of teams that do not learn in gathering and construction.

    python experiments/measure_gacc.py [--run RUN_DIRECTORY ...] [--seed 1]

In each of ``CASES`` it plays every heuristic controller alone, the best mix of them that a search
finds, teams of random networks and of their clones, and the champions of the given runs (of preset
desk). In the first case it also plays the same teams with one chosen parameter changed at a time.
It writes ``docs/results/gacc.csv`` (every number) and the tables between the markers of
``docs/results/gacc.md``. The same seed and runs give the same numbers. It takes ten minutes of a
core.

The numbers of the best mix (``mixes.py``) come from scenarios that its search has not used.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import numpy.typing as npt
from annotated_types import Le

import conevo
import pages
from conevo.runs.config import resolve
from conevo.worlds.gacc.state import DELIVERED, GRIPPED, HELPED, UNDETECTED, WAITING
from conevo.worlds.gacc.world import GaccParams, GaccWorld
from mixes import Mix, best, team_of, written
from pages import Row
from teams import (
    Numbers,
    Teams,
    champion,
    controlled,
    error,
    keys_of,
    play,
    random_clones,
    random_networks,
    sample,
)

SHORT = resolve("gacc/complex-1", preset="desk").world_params.iterations
CASES = (  # environment and iterations
    *((name, SHORT) for name in ("complex-1", "complex-4", "complex-9", "simple-1")),
    ("complex-1", 3000),
)
N_SCENARIOS = 200  # of a heuristic team or a champion
N_RANDOM, N_EPOCHS = 200, 5  # random teams of each kind, and scenarios of each
N_WATCHED = 20  # epochs in which every object is tracked
FATES = ("detected", "gripped", "brought home", "helped")
HALVED_AND_DOUBLED = (
    *("home_side", "home_range", "home_sight", "object_accuracy", "object_cost"),
    *("grip_distance", "grip_cost", "move_range", "min_distance", "separation"),
)
NARROW = {"home_side": 0.2, "home_sight": 0.05, "grip_distance": 0.02, "needs_detection": True}
HOME_SIDES = (0.2, 0.5)
DEFAULTS = GaccParams()
PAGE = Path(__file__).parents[1] / "docs" / "results" / "gacc.md"


def world_of(environment: str, **params: Any) -> GaccWorld:
    """Return an environment with changed parameters."""
    found = conevo.world(f"gacc/{environment}", **params)
    assert isinstance(found, GaccWorld)
    return found


def settings() -> dict[str, Row]:
    """Return the changes of parameters, the default first."""
    types = get_type_hints(GaccParams, include_extras=True)
    found: dict[str, Row] = {"default": {}}
    for name in HALVED_AND_DOUBLED:
        bounds = [m.le for m in getattr(types[name], "__metadata__", ()) if isinstance(m, Le)]
        for factor in (0.5, 2.0):
            value = round(min([getattr(DEFAULTS, name) * factor, *bounds]), 6)
            if value != getattr(DEFAULTS, name):
                found[f"`{name}` {value:g}"] = {name: value}
    for side in HOME_SIDES:
        found[f"`home_side` {side:g}"] = {"home_side": side}
    needs = not DEFAULTS.needs_detection
    found[f"`needs_detection` {str(needs).lower()}"] = {"needs_detection": needs}
    words = " ".join(f"`{name}` {str(value).lower()}" for name, value in NARROW.items())
    return found | {f"all of {words}": dict(NARROW)}


# --- measurements ---------------------------------------------------------------------------------


def watch(world: GaccWorld, teams: Teams, keys: list[int]) -> Row:
    """Return the fates of objects, in percent of all; one epoch of each of the first teams."""
    rollout = conevo.Rollout(world, n_threads=1)
    found = []
    for k, key in enumerate(keys):
        one = teams.one(k % len(teams.kinds))
        seen = rollout.record(one.genes, one.slots[0], world.scenarios([key]), one.heuristic[0])
        life, detected = seen["life"], seen["detected"].min(axis=0)
        is_home = (life >= WAITING) & (life <= DELIVERED)
        is_helped = (life == HELPED) | (life == DELIVERED)
        reached = [detected < int(UNDETECTED), (life == GRIPPED).any(axis=0)]
        reached += [is_home.any(axis=0), is_helped.any(axis=0)]
        found.append([100 * some.mean() for some in reached])
    return dict(zip(FATES, np.mean(found, axis=0).tolist(), strict=True))


def summary(teams: Teams, delivered: npt.NDArray[Any], kind: str, n_objects: int) -> Row:
    """Return the deliveries of the teams of a kind."""
    some = teams.of(kind)
    means: Numbers = sample(delivered, some)
    any_at_all = sample(delivered > 0, some)
    return {
        "teams": kind,
        "n_teams": len(some),
        "n_scenarios": delivered.shape[1],
        "delivered": float(means.mean()),
        "se": error(means),
        "optimum": 100 * float(means.mean()) / n_objects,
        "epochs_with_any": float(any_at_all.mean()),
        "epochs_with_any_se": error(any_at_all),
        "teams_with_any": float((delivered[some] > 0).any(axis=1).mean()),
        "most": int(delivered[some].max()),
    }


def groups(world: GaccWorld, mix: Mix, runs: list[str], seed: int) -> list[tuple[Teams, int]]:
    """Return the teams that play, with the number of their scenarios."""
    fixed = controlled(world, world.heuristics[0], 0)
    for k, name in enumerate(world.heuristics[1:], start=1):
        fixed += controlled(world, name, k)
    fixed += team_of(world, mix)
    for path in runs:
        run = conevo.Run(path)
        config = run.config
        if config.environment == world.environment and config.world_params == world.params:
            fixed += champion(run, f"{config.method} seed {config.run.seed}")
    networks = random_networks(world, N_RANDOM, seed, "measure_gacc")
    clones = random_clones(world, N_RANDOM, seed, "measure_gacc")
    return [(fixed, N_SCENARIOS), (networks, N_EPOCHS), (clones, N_EPOCHS)]


def measure(
    world: GaccWorld, some: list[tuple[Teams, int]], setting: str, seed: int, is_watched: bool
) -> list[Row]:
    """Return a row for each kind of team."""
    rows = []
    for teams, n in some:
        keys = keys_of(seed, n, "measure_gacc")
        delivered = play(world, teams, keys).performance["delivered"]
        for kind in dict.fromkeys(teams.kinds):
            row: Row = {"environment": world.environment, "iterations": world.params.iterations}
            row["setting"] = setting.replace("`", "")
            row |= summary(teams, delivered, kind, world.plan.parts.size)
            if is_watched:
                row |= watch(world, teams.only(kind), keys_of(seed, N_WATCHED, "measure_gacc"))
            rows.append(row | {"name": setting})
    return rows


# --- tables ---------------------------------------------------------------------------------------


def percent(value: float) -> str:
    """Return a percentage with at most two significant digits."""
    return f"{value:.0f} %" if value >= 10 else f"{value:.2g} %"


def bars_table(rows: list[Row]) -> str:
    """Return deliveries with all defaults: kinds of teams without any share a line."""
    head = ["teams", "number", "delivered", "of the optimum", "epochs with any", "teams with any"]
    head += [f"objects {fate}" for fate in FATES]
    lines, nothing = [], []
    for row in rows:
        if row["most"] == 0 and row["n_teams"] == 1:
            nothing.append(row["teams"])
            continue
        line = [row["teams"], row["n_teams"], f"{row['delivered']:.3g} ± {row['se']:.2g}"]
        line += [percent(row["optimum"]), percent(100 * row["epochs_with_any"])]
        line += [percent(100 * row["teams_with_any"]) if row["n_teams"] > 1 else "–"]
        lines.append([*line, *(f"{row[fate]:.0f} %" for fate in FATES)])
    text = pages.table(head, lines)
    return text + (f"\nNothing at all: {', '.join(nothing)}.\n" if nothing else "")


def settings_table(rows: list[Row], kinds: list[str]) -> str:
    """Return one line per setting: objects delivered; of random teams, epochs with any."""
    lines = []
    for name in dict.fromkeys(row["name"] for row in rows):
        by_kind = {row["teams"]: row for row in rows if row["name"] == name}
        line = [name]
        for kind in kinds:
            row = by_kind[kind]
            if row["n_teams"] == 1:
                line.append(f"{row['delivered']:.2f} ± {row['se']:.2f}")
            else:
                share, se = 100 * row["epochs_with_any"], 100 * row["epochs_with_any_se"]
                line.append(f"{share:.1f} ± {se:.1f} %")
        lines.append(line)
    return pages.table(["changed", *kinds], lines)


def main() -> None:
    """Measure and write everything."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--run", action="append", default=[], help="finished run; may be repeated")
    parser.add_argument("--seed", type=int, default=1, help="of scenarios, mixes and networks")
    args = parser.parse_args()
    rows, text = [], ""
    for number, (environment, iterations) in enumerate(CASES):
        world = world_of(environment, iterations=iterations)
        mix = best(world, args.seed)
        some = groups(world, mix, args.run, args.seed)
        found = measure(world, some, "default", args.seed, is_watched=True)
        next(row for row in found if row["teams"] == "best mix")["mix"] = written(world, mix)
        rows += found
        text += (
            f"**`gacc/{environment}`, {iterations} iterations, {world.plan.parts.size} objects.** "
        )
        text += f"Best mix: {written(world, mix)}.\n\n{bars_table(found)}\n"
        print(
            f"{environment}, {iterations}: {written(world, mix)}\n{bars_table(found)}", flush=True
        )
        if number == 0:
            alone = range(len(world.heuristics) - 1)  # but the non-specialized
            varied = [(some[0][0].without(alone), N_SCENARIOS), *some[1:]]
    found = []
    for name, changed in settings().items():
        world = world_of(CASES[0][0], iterations=CASES[0][1], **changed)
        found += measure(world, varied, name, args.seed, is_watched=False)
        print(name, flush=True)
    kinds = [kind for teams, _ in varied for kind in dict.fromkeys(teams.kinds)]
    numbers = [{k: v for k, v in row.items() if k != "name"} for row in rows + found]
    pages.write(numbers, PAGE.with_suffix(".csv"))
    pages.put(text, PAGE, "bars")
    pages.put(settings_table(found, kinds), PAGE, "settings")
    print(text, settings_table(found, kinds), sep="\n")
    print(f"kernel {conevo.Rollout(world_of(CASES[0][0]), n_threads=1).fingerprint}")


if __name__ == "__main__":
    main()
