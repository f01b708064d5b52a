"""Outcomes of shipped worlds and methods: digests that must not change with the code.

``python tests/golden/outcomes.py`` prints them. Whoever changes the version of a world or a method
rewrites them, ``> tests/golden/outcomes.json``, and gives the reason.
"""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

import conevo

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
# World, and the sizes of its controllers: neurons at the start, slots for them, genes of a neuron.
WORLDS = {
    "rover/simple-3": (10, 20, 31),
    "rover/complex-5": (10, 20, 31),
    "rover/extended-10": (10, 20, 31),
    "pursuit/team-3": (6, 12, 24),
    "pursuit/team-10": (6, 12, 24),
    "prey/shaping-3": (5, 10, 10),
    "prey/shaping-6": (5, 10, 10),
    "gacc/simple-2": (10, 20, 45),
    "gacc/complex-9": (10, 20, 45),
    f"{EXAMPLES}/light.py:dark-1": (4, 8, 10),
    f"{EXAMPLES}/ball.py:far-1": (4, 8, 12),
}
METHODS = ("homcne", "hetcne", "ccga", "mesp", "cone", "cone-1", "cone-2", "cone-3")
RUNS = {
    "rover/complex-1": {
        "world.n_robots": 3,
        "world.iterations": 40,
        "world.fitness": "cumulative",
    },
    "pursuit/team-1": {"world.iterations": 40},
    "gacc/complex-1": {"world.n_robots": 3, "world.iterations": 40},
}
RESTLESS = {"stagnation_v": 1, "stagnation_w": 1, "stagnation_y": 1, "gst": 1.0, "sst": 1.0}
ITERATIONS = 120
LIKES = ("favourites", "favourite_share", "favourite_shares")  # a digest of their own


def digest(*arrays: Any) -> str:
    """Return sixteen hex digits of arrays: their types, shapes and bytes."""
    found = hashlib.blake2b(digest_size=8)
    for array in map(np.ascontiguousarray, arrays):
        found.update(f"{array.dtype.str} {array.shape}".encode() + array.tobytes())
    return found.hexdigest()


def written(table: Any) -> Any:
    """Return a table of a run as the bytes of its text."""
    return np.frombuffer(json.dumps(table, sort_keys=True).encode(), np.uint8)


def teams_of(sizes: tuple[int, int, int], robots: int, n: int) -> tuple[Any, Any]:
    """Return a pool of genotypes and teams of them, with holes in their slots."""
    hidden, slots, genes = sizes
    rng = np.random.default_rng(9)
    pool = rng.uniform(-1, 1, (n * robots * hidden, genes)).astype(np.float32)
    rows = np.full((n, robots, slots), -1, np.int32)
    for team in range(n):
        for robot in range(robots):
            used = rng.choice(slots, rng.integers(1, slots + 1), replace=False)
            rows[team, robot, used] = rng.integers(len(pool), size=len(used))
    return pool, rows


def of_world(path: str) -> Iterator[tuple[str, str]]:
    """Yield the outcomes of random teams in a world, and the record of one of them."""
    sizes, world = WORLDS[path], conevo.world(path, iterations=ITERATIONS)
    rollout = conevo.Rollout(world, n_threads=2)
    pool, teams = teams_of(sizes, world.n_robots, 6)
    kinds = np.full(teams.shape[:2], -1, np.int32)
    kinds[4] = np.arange(world.n_robots) % len(world.heuristics)
    kinds[5, 0] = 0
    scenarios = world.scenarios([3, 4, 5])
    seen = rollout.evaluate(pool, teams, scenarios, kinds)
    name = Path(path).name
    performance = [seen.performance[key] for key in sorted(seen.performance)]
    yield f"{name} evaluate", digest(seen.fitness, seen.counts, seen.switches, *performance)
    record = rollout.record(pool, teams[1], world.scenarios([3]))
    kept = [key for key in sorted(record) if key not in ("inputs", "sums", "outputs", "hidden")]
    yield f"{name} record", digest(*(record[key] for key in kept))


def of_method(task: str, method: str) -> Iterator[tuple[str, str]]:
    """Yield the results of five generations of a tiny run of a method."""
    known = conevo.METHODS[method].config_class.__dataclass_fields__
    settings = {"run.generations": 5, "run.epochs": 2, "run.fittest_epochs": 2} | RUNS[task]
    settings |= {"method.genotypes": 6, "run.n_tests": 2, "run.n_validations": 2}
    settings |= {f"method.{k}": v for k, v in RESTLESS.items() if k in known}
    with tempfile.TemporaryDirectory() as folder:
        run = conevo.evolve(task, method, "smoke", 7, f"{folder}/run", overrides=settings)
        lines = [line | {"seconds": 0} for line in run.generations()]
        team, tested = run.champion, run.test_result
    assert team is not None
    assert tested is not None
    tables = [*lines, tested["champion"], tested["generation_0"]]
    likes = [{key: table.pop(key) for key in LIKES if key in table} for table in tables]
    told = written([lines, tested])
    yield f"{task} {method}", digest(team.genes, team.active, team.fitness, told)
    yield f"{task} {method} favourites", digest(written(likes))


def outcomes() -> dict[str, str]:
    """Return the digest of everything."""
    runs = (of_method(task, method) for task in RUNS for method in METHODS)
    return dict(chain(*map(of_world, WORLDS), *runs))


if __name__ == "__main__":
    sys.stdout.write(json.dumps(outcomes(), indent=1) + "\n")
