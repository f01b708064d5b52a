"""Measure how hard evolved prey are to catch: shaped, evolved directly, heuristic, random.

    python experiments/measure_prey.py --work runs/prey [--seeds 1 2 3] [--evolve 5000]

makes, for every seed, a prey that was shaped (experiments 1 to 3 in turn) and one that evolved
directly in experiment 3 from random genotypes, with the same method and the team evaluations of all
three together (and one with a third of them); and the same for less time. Then it sets two kinds of
predators on them, on the shipped prey, on heuristic prey, on random walks and on random networks:
heuristic teams, and teams that evolve against each for ``--evolve`` team evaluations. All runs are
kept in ``--work`` and used again. It writes ``docs/results/prey.csv`` and the tables between the
markers of ``docs/results/prey.md``, and takes about two hours of one core.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import conevo
import pages
from conevo.runs.shaping import Shaping, start_shaping
from conevo.worlds.pursuit.evolved import TASKS as PREY_TASKS
from conevo.worlds.pursuit.prey_sets import PreySet, load, save
from pages import Row
from teams import Numbers, champion, controlled, error, keys_of, play, random_networks

PAGE = Path(__file__).parents[1] / "docs" / "results" / "prey.md"
ENVIRONMENTS = ("team-1", "team-3", "team-5")
N_SCENARIOS = 1000
N_RANDOM = 20  # random networks as prey, each in its share of the scenarios
SHAPED, DIRECT = PREY_TASKS[:3], PREY_TASKS[2]
NAMES = {
    "shipped": "shaped, as shipped",
    "shaped": "shaped",
    "direct": "evolved directly",
    "single": "evolved directly, a third of the evaluations",
    "heuristic": "heuristic",
    "random": "random walk",
    "networks": "random networks",
}
OTHERS = ("direct", "single", "heuristic", "random", "networks")  # compared with shaped prey
Prey = tuple[str, int, str]  # kind, seed (0 if it has none), what ``world.prey`` is set to


# --- the prey -------------------------------------------------------------------------------------


def family(work: Path, preset: str, seed: int, settings: Row) -> dict[str, conevo.Run]:
    """Return the runs of a shaped prey (its last experiment) and of two evolved directly.

    They are made now unless they exist. One of the direct ones has the number of team evaluations
    of the three experiments together, the other that of the last one.
    """
    name = "".join(f"-{value}" for value in settings.values()) + f"-s{seed}"
    path = work / f"shaped{name}"
    shaping = (
        Shaping(path)
        if path.exists()
        else start_shaping(SHAPED, "cone", preset, seed, path, settings)
    )
    if shaping.status != "finished":
        shaping.resume(threads=1)
    found = {"shaped": shaping.stages[-1]}
    for kind, stages in (("direct", shaping.stages), ("single", shaping.stages[-1:])):
        budget = {"run.budget_evaluations": sum(cost(run) for run in stages)}
        endless = budget | {"run.generations": 1_000_000}
        found[kind] = evolve(work / f"{kind}{name}", DIRECT, "cone", preset, seed, endless)
    return found


def evolve(path: Path, task: str, method: str, preset: str, seed: int, settings: Row) -> conevo.Run:
    """Return a run, made now unless it exists."""
    if not path.exists():
        return conevo.evolve(task, method, preset, seed, path, overrides=settings, threads=1)
    run = conevo.Run(path)
    return run if run.status == "finished" else run.resume(threads=1)


def cost(run: conevo.Run) -> int:
    """Return the team evaluations of a run."""
    return int(run.generations()[-1]["team_evaluations"])


def cost_of_shaping(last: conevo.Run) -> int:
    """Return the team evaluations of a shaping, given its last experiment."""
    return sum(cost(run) for run in Shaping(last.path.parent).stages)


def keep(run: conevo.Run, path: Path) -> str:
    """Write a prey run's champion as a prey set (two equal ones stand for two) and return it."""
    team = run.champion
    two = np.repeat(team.genes, 2, axis=0), np.repeat(team.active, 2, axis=0)
    save(path, PreySet(one=team.genes, one_active=team.active, two=two[0], two_active=two[1]))
    return str(path)


def make_prey(work: Path, preset: str, seeds: list[int]) -> tuple[list[Prey], list[Row]]:
    """Return all prey except random networks, and the facts about those that evolved here."""
    prey: list[Prey] = [("shipped", 0, "shaped")]
    rows = []
    for seed in seeds:
        for kind, run in family(work, preset, seed, {}).items():
            prey.append((kind, seed, keep(run, work / f"{kind}-s{seed}.npz")))
            spent = cost(run) if kind != "shaped" else cost_of_shaping(run)
            rows.append({"what": "evaluations", "prey": kind, "seed": seed, "value": spent})
            print(f"{kind} prey, seed {seed}: {spent} team evaluations", flush=True)
    prey += [("heuristic", 0, "heuristic"), ("random", 0, "random")]
    return sorted(prey, key=lambda one: list(NAMES).index(one[0])), rows


def shorter(work: Path, preset: str, generations: list[int], seeds: list[int]) -> list[Row]:
    """Return the results of heuristic predators against prey that evolved for less time."""
    rows = []
    for n in generations:
        for seed in seeds:
            for kind, run in family(work, preset, seed, {"run.generations": n}).items():
                spent = cost(run) if kind != "shaped" else cost_of_shaping(run)
                file = keep(run, work / f"{kind}-{n}-s{seed}.npz")
                for row in hunt((kind, seed, file), [file], 1, {}):
                    row["what"] += " shorter"
                    rows.append(row | {"generations": n, "evaluations": spent})
            print(f"{n} generations for each experiment, seed {seed}", flush=True)
    return rows


def networks(work: Path, seed: int) -> list[str]:
    """Return files with random networks as prey."""
    world = conevo.world(DIRECT)
    teams = random_networks(world, N_RANDOM, seed, "prey")
    files = []
    for n in range(N_RANDOM):
        slots = teams.slots[n]
        genes = np.where((slots >= 0)[..., None], teams.genes[slots], 0).astype(np.float32)
        both = np.repeat(genes, 2, axis=0), np.repeat(slots >= 0, 2, axis=0)
        path = work / f"network-{n}.npz"
        save(path, PreySet(one=genes, one_active=slots >= 0, two=both[0], two_active=both[1]))
        files.append(str(path))
    return files


# --- measure --------------------------------------------------------------------------------------


Times = dict[tuple[str, int, str], Numbers]  # by kind, seed and environment: capture times


def hunt(prey: Prey, files: list[str], seed: int, kept: Times) -> list[Row]:
    """Return the results of heuristic predators against a prey (or several in turn).

    Capture times in every scenario are put into ``kept``.
    """
    kind, number, _ = prey
    rows = []
    for environment in ENVIRONMENTS:
        keys = keys_of(seed, N_SCENARIOS, "prey")
        share = N_SCENARIOS // len(files)
        times: list[Any] = []
        for n, file in enumerate(files):
            world = conevo.world(f"pursuit/{environment}", prey=file)
            some = keys[n * share : (n + 1) * share]
            outcome = play(world, controlled(world, "heuristic", 0), some)
            times.append(outcome.performance["capture_time"][0].astype(np.float64))
        time = kept[kind, number, environment] = np.concatenate(times)
        spread = np.array([one.mean() for one in times]) if len(files) > 1 else time
        about = {"prey": kind, "seed": number, "environment": environment, "n": len(time)}
        share_caught = time > 0
        rows.append({"what": "heuristic", **about, "value": time.mean(), "se": error(spread)})
        caught = float(share_caught.mean())
        rows.append({"what": "caught", **about, "value": caught, "se": error(share_caught * 1.0)})
    return rows


def compare(kept: Times, seeds: list[int]) -> list[Row]:
    """Return by how much capture times are shorter for shaped prey, in the same scenarios.

    Every seed's shaped prey against the same seed's direct ones, and against each of the others;
    then all seeds together.
    """
    rows = []
    for environment in ENVIRONMENTS:
        for other in OTHERS:
            gaps = {
                seed: kept[other, seed if other in ("direct", "single") else 0, environment]
                - kept["shaped", seed, environment]
                for seed in seeds
            }
            gaps[0] = np.mean(list(gaps.values()), axis=0)
            for seed, gap in gaps.items():
                row = {"what": "less", "prey": other, "seed": seed, "environment": environment}
                rows.append(row | {"n": len(gap), "value": gap.mean(), "se": error(gap)})
    return rows


def flee(prey: Prey, seed: int) -> list[Row]:
    """Return path and collisions of a prey in shaping experiment 3."""
    kind, number, name = prey
    world = conevo.world(DIRECT)
    if kind in world.heuristics:
        teams = controlled(world, kind, world.heuristics.index(kind))
    else:
        found = load(None if kind == "shipped" else name)
        slots = np.where(found.one_active, np.arange(found.one_active.size)[None], -1)
        teams = controlled(world, kind, -1)
        wide = teams.slots.copy()
        wide[0, :, : slots.shape[1]] = slots
        teams = type(teams)(found.one[0], wide, teams.heuristic, teams.kinds)
    outcome = play(world, teams, keys_of(seed, N_SCENARIOS, "flee"))
    rows = []
    for what in outcome.performance:
        values = outcome.performance[what][0].astype(np.float64)
        row = {"what": what, "prey": kind, "seed": number, "environment": world.environment}
        rows.append(row | {"n": len(values), "value": values.mean(), "se": error(values)})
    return rows


def chase(prey: Prey, work: Path, method: str, evaluations: int, seeds: list[int]) -> list[Row]:
    """Return the results of predators of team-3 that evolve against a prey.

    A prey that was made with a seed meets predators of the same seed; others meet those of all
    seeds.
    """
    kind, number, name = prey
    rows = []
    for seed in [number] if number else seeds:
        path = work / f"against-{kind}-s{seed}-{method}-{evaluations}"
        settings = {
            "run.budget_evaluations": evaluations,
            "run.generations": 1_000_000,
            "run.n_tests": 200,
            "world.prey": name,
        }
        run = evolve(path, "pursuit/team-3", method, "desk", seed, settings)
        test = run.test_result
        row = {"what": "evolved", "prey": kind, "seed": seed, "environment": "team-3"}
        for who in ("champion", "generation_0"):
            values = np.array(test[who]["performance"]["capture_time"]["values"])
            row[who], row[f"{who}_se"] = values.mean(), error(values)
        world = conevo.world("pursuit/team-3")
        keys = keys_of(1, N_SCENARIOS, "prey")
        outcome = play(world, champion(run, kind), keys)  # against the shipped prey
        against = outcome.performance["capture_time"][0].astype(np.float64)
        row["against_shipped"], row["against_shipped_se"] = against.mean(), error(against)
        rows.append(row | {"value": row["champion"], "n": 200, "evaluations": cost(run)})
        print(f"evolved against {kind}, seed {seed}: {row['champion']:.1f}", flush=True)
    return rows


# --- tables ---------------------------------------------------------------------------------------


def title(kind: str, seed: int) -> str:
    """Return the name of a prey in tables."""
    return f"{NAMES[kind]}, seed {seed}" if seed else NAMES[kind]


def tables(rows: list[Row]) -> str:
    """Return all tables of the page."""
    found = {(r["what"], r["prey"], r["seed"], r.get("environment")): r for r in rows}
    prey = list(dict.fromkeys((r["prey"], r["seed"]) for r in rows if r["what"] == "heuristic"))
    text = f"**Heuristic predators, {N_SCENARIOS} scenarios: capture time (epochs with a capture)**"
    lines = []
    for one in prey:
        cells = []
        for environment in ENVIRONMENTS:
            time, caught = (found[what, *one, environment] for what in ("heuristic", "caught"))
            cells.append(f"{time['value']:.1f} ± {time['se']:.1f} ({caught['value']:.0%})")
        lines.append([title(*one), *(cell.replace("%", " %") for cell in cells)])
    text += "\n\n" + pages.table(["prey", *ENVIRONMENTS], lines)
    text += "\n**How much less than others shaped prey are captured by them, scenario by scenario**"
    text += "\n\nMean over the seeds of shaped prey, in brackets each seed.\n\n"
    lines = []
    for other in OTHERS:
        cells = []
        for environment in ENVIRONMENTS:
            some = [
                f"{row['value']:.1f} ± {row['se']:.1f}"
                for row in rows
                if (row["what"], row["prey"]) == ("less", other)
                and row["environment"] == environment
            ]
            cells.append(f"**{some[-1]}** ({', '.join(some[:-1])})")
        lines.append([NAMES[other], *cells])
    text += pages.table(["than", *ENVIRONMENTS], lines)
    text += less_evolution(rows)
    grown = [row for row in rows if row["what"] == "evolved"]
    if grown:
        text += f"\n**Predators evolved against each prey, team-3, {grown[0]['method']}, "
        text += f"{max(row['evaluations'] for row in grown):,} team evaluations: capture time**\n\n"
        lines = []
        for kind in dict.fromkeys(row["prey"] for row in grown):
            some = [row for row in grown if row["prey"] == kind]
            cells = []
            for who in ("generation_0", "champion", "against_shipped"):
                mean = np.mean([row[who] for row in some])
                each = ", ".join(f"{row[who]:.0f} ± {row[f'{who}_se']:.0f}" for row in some)
                cells.append(f"{mean:.0f} ({each})")
            lines.append([NAMES[kind], *cells])
        head = ["prey", "generation 0", "champion", "the same champions against the shipped prey"]
        text += pages.table(head, lines)
    text += f"\n**The prey in shaping experiment 3, {N_SCENARIOS} scenarios**\n\n"
    lines = []
    for one in prey:
        if ("path", *one, "shaping-3") in found:
            path, collided = (found[what, *one, "shaping-3"] for what in ("path", "collided"))
            spent = found.get(("evaluations", *one, None), {}).get("value")
            line = [title(*one), f"{path['value']:.0f} ± {path['se']:.0f}"]
            line += [f"{collided['value']:.0%}".replace("%", " %"), f"{spent:,}" if spent else "–"]
            lines.append(line)
    text += pages.table(["prey", "path, cm", "collided", "team evaluations"], lines)
    return text


def less_evolution(rows: list[Row]) -> str:
    """Return the table of shaped and direct prey that evolved for less time, means over seeds."""
    short = [row for row in rows if row["what"] == "heuristic shorter"]
    if not short:
        return ""
    n_seeds = len({row["seed"] for row in short})
    text = f"\n**Prey that evolved for less time, {n_seeds} seeds: capture time by heuristic "
    text += "predators; for the direct ones also how much more than for shaped ones, ± standard "
    text += "error over the seeds**\n\n"
    lines = []
    for n in dict.fromkeys(row["generations"] for row in short):
        shaped = {
            (row["environment"], row["seed"]): row["value"]
            for row in short
            if (row["generations"], row["prey"]) == (n, "shaped")
        }
        for kind in dict.fromkeys(row["prey"] for row in short):
            some = [row for row in short if (row["generations"], row["prey"]) == (n, kind)]
            cells = []
            for environment in ENVIRONMENTS:
                here = [row for row in some if row["environment"] == environment]
                times = {row["seed"]: row["value"] for row in here}
                cells.append(f"{np.mean(list(times.values())):.0f}")
                if kind != "shaped":
                    gaps = np.array([times[k] - shaped[environment, k] for k in times])
                    cells[-1] += f" ({gaps.mean():+.0f} ± {error(gaps):.0f})"
            spent = np.mean([row["evaluations"] for row in some])
            lines.append([n, NAMES[kind], f"{spent:,.0f}", *cells])
    head = ["generations of an experiment", "prey", "team evaluations", *ENVIRONMENTS]
    return text + pages.table(head, lines)


def main() -> None:
    """Measure and write everything."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--work", type=Path, default=Path("runs/prey"), help="folder for the runs")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--shorter", type=int, nargs="*", default=[5, 15], help="generations")
    parser.add_argument("--shorter-seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--preset", default="desk", help="of the prey's evolution")
    parser.add_argument(
        "--evolve", type=int, default=5000, help="evaluations of predators; 0: none"
    )
    parser.add_argument("--method", default="homcne", help="that evolves predators")
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    prey, rows = make_prey(args.work, args.preset, args.seeds)
    kept: Times = {}
    for one in prey:
        rows += hunt(one, [one[2]], 1, kept) + flee(one, seed=1)
    rows += hunt(("networks", 0, ""), networks(args.work, seed=1), 1, kept)
    rows += compare(kept, args.seeds)
    rows += shorter(args.work, args.preset, args.shorter, args.shorter_seeds)
    for one in [one for one in prey if args.evolve and one[0] != "single"]:
        made = chase(one, args.work, args.method, args.evolve, args.seeds)
        rows += [row | {"method": args.method} for row in made]
    pages.write(rows, PAGE.with_suffix(".csv"))
    pages.put(tables(rows), PAGE)
    print(tables(rows))
    rollout = conevo.Rollout(conevo.world("pursuit/team-3"), n_threads=1)
    print(f"kernel {rollout.fingerprint}")


if __name__ == "__main__":
    main()
