"""Measure, without evolution, which readings of the multi-rover world agree with the thesis.

    python experiments/calibration.py [--scenarios N] [--write docs/results/calibration.md]

plays heuristic, blind and random teams in the rover worlds: types mixed and starts anywhere, or
types apart and starts by robot; four ranges; all rocks in range or one for an activation; high and
low accuracies. Every reading is tested for the thesis' results (``CRITERIA``). Then castes by place
are compared with switchers, over segregation, accuracies and ranges, in five times the number of
scenarios. With ``--write`` the numbers go to two CSV files next to the page, and the tables between
its markers; ``--again`` makes the tables from the files. One thread; the same arguments give the
same numbers.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import conevo
from blind import Blind, kind
from calibration_tables import ACCURACIES, PAGE_PARTS, PARTS, RANGES, SETTINGS
from incentives import FINDING, OF_REGION, TESTING
from pages import Row, put, read, write
from teams import Teams, controlled, error, keys_of, random_networks

LENGTHS = (1250, 2500)
MOVES = (0.25, 0.5, 0.75)  # share of a blind rover's iterations
STRETCHES = (1, 10, 30)
STRAIGHT = STRETCHES[1:]  # candidates for the best: never random walkers
N_RANDOM = 3


@dataclass(frozen=True)
class Reading:
    """One reading of the multi-rover world."""

    segregation: float
    starts: str
    ranges: str
    rocks: int
    accuracies: str

    def params(self, factor: float = 1.0) -> dict[str, Any]:
        """Return parameters of the world, with ranges times a factor."""
        ranges = {
            name: of * factor if isinstance(of, float) else of
            for name, of in RANGES[self.ranges].items()
        }
        accuracies = zip(SETTINGS, ACCURACIES[self.accuracies], strict=True)
        return {
            "segregation": self.segregation,
            "starts": self.starts,
            "rocks_per_activation": self.rocks,
            **ranges,
            **{f"{setting}_accuracy": one for setting, one in accuracies},
        }


# --- who plays ------------------------------------------------------------------------------------


def by_place(n_robots: int) -> npt.NDArray[np.int_]:
    """Return the setting of each robot: one that the type of its region requires."""
    return np.array([OF_REGION[i % 4][i // 4 % 2] for i in range(n_robots)])


def clones(world: Any) -> Teams:
    """Return clones of each heuristic."""
    teams = controlled(world, world.heuristics[0], 0)
    for k, name in enumerate(world.heuristics[1:], 1):
        teams += controlled(world, name, k)
    return teams


def others(world: Any) -> Teams:
    """Return a mix of the heuristics, castes by place, and random networks."""
    robots = np.arange(world.n_robots)
    teams = controlled(world, "mixed", robots % len(world.heuristics))
    teams += controlled(world, "castes by place", by_place(world.n_robots))
    return teams + random_networks(world, N_RANDOM, 1, "calibration")


@dataclass(frozen=True)
class BlindTeams:
    """Blind teams: kinds of rover [K, G], the kind of every robot [N, R], and names."""

    genes: npt.NDArray[np.float32]
    who: npt.NDArray[np.int32]
    names: tuple[str, ...]

    def only(self, names: Sequence[str]) -> BlindTeams:
        """Return the teams with these names."""
        some = [self.names.index(name) for name in dict.fromkeys(names)]
        return BlindTeams(self.genes, self.who[some], tuple(self.names[n] for n in some))


def blind_teams(
    n_robots: int, families: Sequence[str], stretches: Sequence[int] = STRETCHES
) -> BlindTeams:
    """Return a team of every family, share of moves and stretch.

    Args:
        n_robots: R.
        families: "switchers" use all settings, "castes" that of their place, "low" and "hi" one.
        stretches: moves in one direction, on average.
    """
    genes: list[npt.NDArray[np.float32]] = []
    who: list[npt.NDArray[np.int_]] = []
    names: list[str] = []
    for family, move, stretch in itertools.product(families, MOVES, stretches):
        uses = {"switchers": [(1, 1, 1)], "low": [(1, 0, 0)], "hi": [(0, 0, 1)]}.get(
            family, np.eye(3).tolist()
        )
        kinds = np.zeros(n_robots, dtype=int) if len(uses) == 1 else by_place(n_robots)
        who.append(len(genes) + kinds)
        for use in uses:
            shares = [(1 - move) * one / sum(use) for one in use]
            genes.append(kind([*shares, move], stretch, draw=7))
        names.append(f"{family} {move:g} {stretch}")
    return BlindTeams(np.stack(genes), np.stack(who).astype(np.int32), tuple(names))


class Field:
    """One environment under one reading, and a count of all simulated steps.

    Attributes:
        team_steps: teams times iterations, of all fields so far.
    """

    team_steps = 0

    def __init__(self, environment: str, iterations: int, params: dict[str, Any]) -> None:
        self.world = conevo.world(f"rover/{environment}", iterations=iterations, **params)

    def seeing(self, teams: Teams, keys: Sequence[int]) -> dict[str, npt.NDArray[np.float64]]:
        """Return the value of each kind of heuristic or random team in each scenario."""
        rollout = conevo.Rollout(self.world, n_threads=1)
        value = self._value(rollout, teams.genes, teams.slots, keys, teams.heuristic)
        return {one: value[teams.of(one)].mean(axis=0) for one in dict.fromkeys(teams.kinds)}

    def blind(self, teams: BlindTeams, keys: Sequence[int]) -> dict[str, npt.NDArray[np.float64]]:
        """Return the value of each blind team in each scenario."""
        rollout = conevo.Rollout(self.world, Blind(), n_threads=1)
        value = self._value(rollout, teams.genes, teams.who[:, :, None], keys)
        return dict(zip(teams.names, value, strict=True))

    def _value(self, rollout: Any, genes: Any, slots: Any, keys: Any, who: Any = None) -> Any:
        found = rollout.evaluate(genes, slots, self.world.scenarios(keys), who)
        Field.team_steps += found.fitness.shape[0] * len(keys) * self.world.params.iterations
        return found.performance["value"].astype(np.float64)


# --- measurements ---------------------------------------------------------------------------------


def best_of(values: dict[str, Any], prefix: str = "") -> str:
    """Return the name of the team with the highest mean among those with a prefix."""
    return max((n for n in values if n.startswith(prefix)), key=lambda n: values[n].mean())


def simple_values(reading: Reading, iterations: int, keys: Sequence[int]) -> dict[int, float]:
    """Return the value of the best team in each simple environment."""
    best = {}
    chosen: BlindTeams | None = None
    for e in (5, 1, 2, 3, 4, 6, 7, 8, 9, 10):
        field = Field(f"simple-{e}", iterations, reading.params())
        found = field.seeing(clones(field.world), keys)
        if chosen is None:
            every = blind_teams(field.world.n_robots, ("switchers", "low", "hi"), STRAIGHT)
            grid = field.blind(every, keys)
            chosen = every.only([best_of(grid)])
        found |= field.blind(chosen, keys)
        best[e] = float(found[best_of(found)].mean())
    return best


def judged(reading: Reading, iterations: int, keys: Sequence[int], simple: dict[int, float]) -> Row:
    """Return all measurements of a reading at one length of epochs."""
    field = Field("complex-5", iterations, reading.params())
    every = blind_teams(field.world.n_robots, ("switchers", "castes"), STRAIGHT)
    found = field.seeing(clones(field.world) + others(field.world), keys)
    blind = field.blind(every, keys)
    best = {family: best_of(blind, family) for family in ("switchers", "castes")}
    chosen = every.only(list(best.values()))
    row: Row = {**vars(reading), "iterations": iterations, "n_scenarios": len(keys)}
    row |= {name: float(value.mean()) for name, value in found.items()}
    for family, name in best.items():
        row[f"blind {family}"] = float(blind[name].mean())
        row[f"blind {family} se"] = error(blind[name])
        row[f"blind {family} is"] = name.removeprefix(family).strip()
    top = best_of({name: blind[name] for name in best.values()})
    of = {"top": blind[top], "non-specialized": found["non-specialized"]}
    heuristic = controlled(field.world, "non-specialized", 3)
    for sign, factor in (("-30 %", 0.7), ("+30 %", 1.3)):
        other = Field("complex-5", iterations, reading.params(factor))
        now = {"top": other.blind(chosen.only([top]), keys)[top]}
        now |= other.seeing(heuristic, keys)
        for team, value in now.items():
            row[f"{team} {sign}"] = float(value.mean() / max(of[team].mean(), 1e-9))
    candidates = {name: blind[name] for name in chosen.names}
    candidates["non-specialized"] = found["non-specialized"]
    places = {5: float(candidates[best_of(candidates)].mean())}
    for e in (1, 2, 3, 4, 6, 7, 8, 9, 10):
        there = Field(f"complex-{e}", iterations, reading.params())
        few = keys[: max(2, len(keys) // 2)]
        some = there.seeing(heuristic, few) | there.blind(chosen, few)
        places[e] = float(some[best_of(some)].mean())
    for e in range(1, 11):
        row[f"complex-{e}"], row[f"simple-{e}"] = places[e], simple[e]
    return row


def readings() -> Iterator[Reading]:
    """Yield every reading, with types mixed and starts anywhere first."""
    for segregation, starts in ((0.0, "random"), (1.0, "by_robot")):
        for others in itertools.product(RANGES, (0, 1), ACCURACIES):
            yield Reading(segregation, starts, *others)


def measure_readings(n_scenarios: int) -> Iterator[Row]:
    """Yield a row of numbers for every reading and length."""
    every = keys_of(1, n_scenarios, "calibration")
    simple: dict[Any, dict[int, float]] = {}  # these have one type only, so nothing to segregate
    for reading in readings():
        is_large = reading.ranges in ("R*", "area")  # slower, and alike in all scenarios
        keys = every[: max(2, n_scenarios // 2)] if is_large else every
        for iterations in LENGTHS:
            plain = replace(reading, segregation=0.0, starts="random")
            if (plain, iterations) not in simple:
                simple[plain, iterations] = simple_values(plain, iterations, keys)
            yield judged(reading, iterations, keys, simple[plain, iterations])


def measure_incentives(n_scenarios: int) -> Iterator[Row]:
    """Yield castes by place against switchers in every cell of segregation, starts and settings.

    The best blind team of each family is chosen in one half of the scenarios and measured in the
    other.
    """
    keys = keys_of(1, 5 * n_scenarios, "incentives")
    half = len(keys) // 2
    cells = itertools.product(("random", "by_robot"), RANGES, ACCURACIES, LENGTHS)
    for starts, ranges, accuracies, iterations in cells:
        for segregation in sorted((*FINDING, *TESTING)):
            reading = Reading(segregation, starts, ranges, 0, accuracies)
            field = Field("complex-5", iterations, reading.params())
            some = controlled(field.world, "castes", by_place(field.world.n_robots))
            some += controlled(field.world, "switchers", 3)
            found = field.seeing(some, keys)
            row: Row = {**vars(reading), "iterations": iterations, "n_scenarios": len(keys)}
            row |= of_pair(found["castes"], found["switchers"], "")
            if iterations == LENGTHS[0]:
                every = blind_teams(field.world.n_robots, ("castes", "switchers"))
                blind = field.blind(every, keys)
                first = {name: value[:half] for name, value in blind.items()}
                best = [blind[best_of(first, f)][half:] for f in ("castes", "switchers")]
                row |= of_pair(best[0], best[1], "blind ")
            yield row


def of_pair(castes: Any, switchers: Any, prefix: str) -> Row:
    """Return both values, their ratio and the standard error of its logarithm."""
    ratio = castes.mean() / switchers.mean()
    log_se = error(castes - ratio * switchers) / castes.mean()
    numbers = {"castes": castes.mean(), "switchers": switchers.mean()}
    numbers |= {"ratio": ratio, "log ratio se": log_se}
    return {prefix + name: float(one) for name, one in numbers.items()}


# --- writing --------------------------------------------------------------------------------------


def measured(rows: Iterator[Row], title: str, path: Path | None) -> list[Row]:
    """Return all rows; print the progress, and write the rows so far to a CSV file."""
    found: list[Row] = []
    began = time.monotonic()
    for row in rows:
        found.append(row)
        if path:
            write(found, path)
        print(
            f"{title} {len(found)}: {Field.team_steps / 1e6:.1f} million team-steps, "
            f"{time.monotonic() - began:.0f} s",
            flush=True,
        )
    return found


def made_with(part: str, seconds: float) -> str:
    """Return versions, machine and time of the measurement of a part of the numbers."""
    import platform

    import warp as wp

    world = conevo.world("rover/complex-5")
    return (
        f"{part.capitalize()} measured with conevo {conevo.__version__} in `{world.name}` (kernel "
        f"{conevo.Rollout(world, n_threads=1).fingerprint}), Warp {wp.__version__}, numpy "
        f"{np.__version__}, Python {platform.python_version()}, one thread of a {machine()}: "
        f"{Field.team_steps / 1e6:.0f} million team-steps in {seconds:,.0f} seconds.\n"
    )


def machine() -> str:
    """Return the name of the processor."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text().splitlines() if about.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else "machine of unknown kind"


def main() -> None:
    """Measure and write everything."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--scenarios", type=int, default=4, help="of every team (default 4)")
    parser.add_argument("--write", type=Path, help="page whose tables are replaced")
    parser.add_argument("--part", choices=PARTS, help="measure one of the two parts only")
    parser.add_argument("--again", action="store_true", help="only the tables, from the CSV files")
    args = parser.parse_args()
    if args.scenarios < 2:
        parser.error(f"--scenarios {args.scenarios}: must be 2 or more")
    if args.again and not args.write:
        parser.error("--again needs --write PAGE, whose CSV files it reads")
    measures = {"readings": measure_readings, "incentives": measure_incentives}
    rows: dict[str, list[Row]] = {}
    for part, ending in PARTS.items():
        path = args.write and args.write.with_name(f"{args.write.stem}{ending}.csv")
        if args.again or args.part not in (None, part):
            rows[part] = read(path) if path and path.exists() else []
            continue
        began, Field.team_steps = time.monotonic(), 0
        rows[part] = measured(measures[part](args.scenarios), part, path)
        about = made_with(part, time.monotonic() - began)
        print(about)
        if args.write:
            put(about, args.write, f"machine-{part}")
    for name, (part, make) in PAGE_PARTS.items():
        if rows[part]:
            text = make(rows[part])
            print(text)
            if args.write:
                put(text, args.write, name)


if __name__ == "__main__":
    main()
