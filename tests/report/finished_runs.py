"""Made-up campaigns: tables of any size with known means."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

import duckdb
import numpy as np

from conevo.campaigns.schema import SCHEMA
from conevo.evolution.methods.registry import title_of

METHODS = ("homcne", "hetcne", "ccga", "mesp", "cone")
ROBOTS = 20
SCENARIOS = 20


class Task(NamedTuple):
    """The entries of a world in the tables."""

    world: str
    measures: tuple[str, ...]
    optimum: float | None
    castes: tuple[str, ...]


TASKS = {
    "rover": Task("rover-v2", ("value", "area"), 5000.0, ("low", "med", "hi", "move")),
    "pursuit": Task(
        "pursuit-v2",
        ("capture_time", "first_capture", "captures"),
        1000.0,
        ("pursuer", "blocker", "flanker", "knocker", "idle"),
    ),
    "gacc": Task(
        "gacc-v2",
        ("delivered", "completed", "delivered_share"),
        None,
        (*(f"{kind}-{what}" for kind in "ABC" for what in ("detector", "gatherer")), "move"),
    ),
}
METRICS = (
    "specialization",
    "activity_entropy",
    "division_by_action",
    "hierarchic_social_entropy",
)
COLLECTIVES = ("entrapment", "pursuer-blocker", "spiders-fly", "role-switcher", "none")


class Cell(NamedTuple):
    """Runs that differ in their seed only."""

    world: str  # a key of TASKS
    environment: str
    method: str
    variant: str = ""
    preset: str = "smoke"
    budget: int = 1000
    stage: int = 0
    planned: int | None = None  # budget; the field above is the number that a run spends
    reliability: float | None = None  # of fitness in generation 0; None without a study of it


def cells(
    environments: Iterable[str], methods: Sequence[str] = METHODS, **further: Any
) -> list[Cell]:
    """Return a cell per environment, as in "rover/complex-5", and method."""
    return [
        Cell(*name.split("/"), method, **further) for name in environments for method in methods
    ]


def mean_of(cell: Cell) -> float:
    """Return the main measure of a cell's runs, out of 1000: CONE has the highest."""
    rank = METHODS.index(cell.method) if cell.method in METHODS else len(METHODS)
    return 300.0 + 80.0 * rank + 10.0 * _number(cell)


def write_campaign(
    root: Path,
    of: Sequence[Cell],
    seeds: int = 4,
    generations: int = 12,
    *,
    mean: Callable[[Cell], float] = mean_of,
    spread: float = 30.0,
    failed: Sequence[str] = (),
    without: Sequence[str] = (),
) -> Path:
    """Write the directory of a finished campaign and return it.

    Args:
        root: directory.
        of: its cells.
        seeds: runs per cell.
        generations: of every run.
        mean: of a cell's runs in the main measure.
        spread: standard deviation of the runs around it.
        failed: messages of failed runs.
        without: tables that the campaign does not have.
    """
    rng = np.random.default_rng(20090)
    columns: dict[str, list[dict[str, Any]]] = {name: [] for name in SCHEMA}
    labels = []
    for cell in of:
        for seed in range(1, seeds + 1):
            label = f"{cell.world}-{cell.environment}-{cell.method}-{cell.variant}-{cell.preset}"
            run = f"{label}-{cell.budget}-s{seed}" + (f"/stage-{cell.stage}" if cell.stage else "")
            labels.append((run.split("/")[0], cell, seed))
            level = rng.normal(mean(cell), spread)
            for name, rows in _run(run, cell, seed, level, generations, rng).items():
                columns[name].append(rows)
    (root / "tables").mkdir(parents=True)
    for name, parts in columns.items():
        if name not in without:
            _write(root / "tables" / f"{name}.parquet", SCHEMA[name], parts)
    (root / "plan.toml").write_text(
        '[campaign]\nname = "made"\ntitle = "Made-up runs"\nproduces = ["figure 5.6"]\n\n'
        '[factors]\nworld = ["rover/complex-1"]\nmethod = ["cone"]\n'
    )
    with (root / "runs.jsonl").open("w") as file:
        for label, cell, seed in [
            *labels,
            *((f"failed-{k}", of[0], k) for k in range(len(failed))),
        ]:
            about = {"label": label, "method": cell.method, "seed": seed, "preset": cell.preset}
            about |= {"world": f"{cell.world}/{cell.environment}", "variant": cell.variant}
            about |= {"overrides": {}, "shape": False, "studies": [], "run_ids": ["0" * 12]}
            file.write(json.dumps(about) + "\n")
    (root / "ended").mkdir()
    for k, message in enumerate(failed):
        ended = {"status": "failed", "origin": "machine", "message": message, "core_seconds": 0.0}
        (root / "ended" / f"failed-{k}.json").write_text(json.dumps(ended))
    return root


def _number(cell: Cell) -> int:
    return int(cell.environment.rpartition("-")[2])


def _run(
    run: str, cell: Cell, seed: int, level: float, generations: int, rng: np.random.Generator
) -> dict[str, dict[str, Any]]:
    """Return the rows of one run in each table, by column."""
    task = TASKS[cell.world]
    names = (*task.castes, "non-specialized")
    is_cone = cell.method.startswith("cone")
    heterogeneous = cell.method not in ("homcne", "hetcne")
    shares = rng.dirichlet([2.0] * len(names)) if heterogeneous else np.eye(len(names))[-1]
    robots = rng.choice(len(names), ROBOTS, p=shares)
    present = np.unique(robots)
    steps = np.arange(generations)
    progress = 1 - np.exp(-4 * (steps + 1) / generations)
    evaluations = np.round(cell.budget * (steps + 1) / generations).astype(int)
    counts = [np.bincount(rng.choice(len(names), ROBOTS, p=shares), minlength=len(names))
              for _ in steps]  # fmt: skip
    castes = [(g, names[k], int(row[k])) for g, row in enumerate(counts) for k in row.nonzero()[0]]
    labels = np.array(names)[robots]
    metrics = rng.uniform(0, 1, len(METRICS))
    behaviours = []
    if cell.world == "pursuit":
        caught = rng.multinomial(12, [0.1, 0.2, 0.1, 0.1, 0.5])
        behaviours = [("collective", n, int(c)) for n, c in zip(COLLECTIVES, caught, strict=True)]
        behaviours += [("individual", n, int((labels == n).sum())) for n in task.castes]
        behaviours += [("team", COLLECTIVES[int(caught[:-1].argmax())], int(caught[:-1].max()))]
    return {
        "runs": {
            "run": [run],
            "task": [f"{task.world}/{cell.environment}"],
            "world": [task.world],
            "environment": [cell.environment],
            "family": [cell.environment.rpartition("-")[0]],
            "number": [_number(cell)],
            "method": [cell.method],
            "title": [title_of(cell.method)],
            "preset": [cell.preset],
            "seed": [seed],
            "variant": [cell.variant],
            "generations": [generations],
            "planned_evaluations": [np.nan if cell.planned is None else cell.planned],
            "evaluations": [cell.budget],
            "team_steps": [cell.budget * 500],
            "seconds": [12.5],
            "core_seconds": [20.0],
            "stopped_by": ["budget"],
            "measure": [task.measures[0]],
            "optimum": [task.optimum],
            "n_robots": [ROBOTS],
            "exchanges": [2.0 if is_cone else np.nan],
            "exchange_share": [0.02 if is_cone else np.nan],
            "run_id": [f"{crc32(run.encode()):08x}"],
            "conevo": ["0.1.0"],
            "code": ["abcabcabcabc"],
            "changes": [""],
            "numpy": ["2.4.6"],
            "warp": ["1.19.0"],
            "kernel_hash": ["0123456789abcdef"],
        },
        "measures": {
            "run": [run] * len(task.measures),
            "measure": list(task.measures),
            "unit": ["points"] * len(task.measures),
            "larger_is_better": [1.0] * len(task.measures),
            "low": [0.0] * len(task.measures),
            "high": [np.nan] * len(task.measures),
        },
        "scores": _scores(run, task, level, [names[k] for k in present], rng),
        "champions": {
            "run": [run] * 2,
            "generation": [generations - 1] * 2,
            "finalists": [3] * 2,
            "measure": ["fitness", task.measures[0]],
            "selection": [8.0, 2 * level],
            "validation": [6.0, 1.5 * level],
            "test": [2.0, level],
            "ratio": [0.25, 0.5],
        },
        "generations": {
            "run": [run] * generations,
            "generation": steps,
            "evaluations": evaluations,
            "team_steps": evaluations * 500,
            "value": np.maximum(level * progress + rng.normal(0, 15, generations), 0),
            "fitness": progress * 10,
            "specialization": 0.8 - 0.4 * progress * shares[:-1].sum(),
            "sst": 0.5 - 0.2 * progress if is_cone else np.full(generations, np.nan),
            "gst": 0.2 + 0.1 * progress if is_cone else np.full(generations, np.nan),
            "recombinations": rng.integers(0, 5, generations) * is_cone,
            "type_c_evaluations": np.zeros(generations, dtype=int),
            "hidden": np.full(generations, 10.0),
        },
        "castes": {
            "run": [run] * len(castes),
            **dict(zip(("generation", "caste", "robots"), zip(*castes, strict=True), strict=True)),
        },
        "robots": {
            "run": [run] * ROBOTS,
            "robot": np.arange(ROBOTS),
            "caste": labels,
            "specialization": rng.uniform(0.1, 0.9, ROBOTS),
            "fitness": rng.uniform(0, 10, ROBOTS),
            "hidden": np.full(ROBOTS, 10),
            "favourite_setting": rng.choice(task.castes[:3], ROBOTS),
            "setting_share": rng.uniform(1 / 3, 1, ROBOTS),
            "affinity": rng.uniform(0, 1, ROBOTS),
            "favourite_action": rng.choice(task.castes, ROBOTS),
            "action_share": rng.uniform(0.25, 1, ROBOTS),
            "independent": rng.uniform(0, 0.75, ROBOTS),
            "relative": rng.uniform(0, 2, ROBOTS),
        },
        "actions": {
            "run": [run] * (ROBOTS * len(task.castes)),
            "robot": np.repeat(np.arange(ROBOTS), len(task.castes)),
            "action": list(task.castes) * ROBOTS,
            "count": rng.integers(0, 5000, ROBOTS * len(task.castes)),
        },
        "signal": {} if cell.reliability is None else _signal(run, cell.reliability),
        "metrics": {"run": [run] * len(METRICS), "metric": list(METRICS), "value": metrics},
        "behaviours": {
            "run": [run] * len(behaviours),
            "kind": [kind for kind, _, _ in behaviours],
            "behaviour": [name for _, name, _ in behaviours],
            "count": [count for _, _, count in behaviours],
        },
    }


def _scores(
    run: str, task: Task, level: float, castes: Sequence[str], rng: np.random.Generator
) -> dict[str, Any]:
    """Return scores of the champion, generation 0, lesioned and cloned teams."""
    teams = [("test", "champion", 1.0), ("test", "generation 0", 0.1)]
    teams += [("lesion", "whole", 1.0), ("clones", "whole", 1.0)]
    teams += [("lesion", caste, 0.5 + 0.08 * k) for k, caste in enumerate(castes)]
    teams += [("clones", caste, 0.4 + 0.1 * k) for k, caste in enumerate(castes)]
    scale = [1.0] + [0.001] * (len(task.measures) - 1)
    parts = [
        (study, team, measure, rng.normal(level * factor * unit, 5 * unit, SCENARIOS))
        for study, team, factor in teams
        for measure, unit in zip(task.measures, scale, strict=True)
    ]
    return {
        "run": [run] * (len(parts) * SCENARIOS),
        "study": np.repeat([part[0] for part in parts], SCENARIOS),
        "team": np.repeat([part[1] for part in parts], SCENARIOS),
        "measure": np.repeat([part[2] for part in parts], SCENARIOS),
        "scenario": np.tile(np.arange(SCENARIOS), len(parts)),
        "value": np.maximum(np.concatenate([part[3] for part in parts]), 0),
    }


def _signal(run: str, reliability: float) -> dict[str, Any]:
    """Return the signal of a run's first populations, and of its last: half as reliable."""
    of = np.array([reliability, reliability / 2])
    return {
        "run": [run] * 2,
        "unit": ["network"] * 2,
        "generation": ["first", "last"],
        "genotypes": [20] * 2,
        "trials": [50] * 2,
        "icc": of / 10,
        "standard_error": of / 100,
        "low": of / 12,
        "high": of / 8,
        "scheme": [10] * 2,
        "icc_of_scheme": of,
        "low_of_scheme": of / 2,
        "high_of_scheme": of * 1.1,
        "rounds_for_half": 10 / of,
    }


def _write(path: Path, columns: dict[str, str], parts: Sequence[dict[str, Any]]) -> None:
    """Write one table."""
    table = {
        name: np.concatenate([np.asarray(part.get(name, []), dtype=object) for part in parts])
        for name in columns
    }
    frame = {
        name: values.astype(str) if columns[name] == "VARCHAR" else values.astype(float)
        for name, values in table.items()
    }
    listed = ", ".join(
        f'CAST(if(isnan("{name}"), NULL, "{name}") AS {kind}) AS "{name}"'
        if kind != "VARCHAR"
        else f'"{name}"'
        for name, kind in columns.items()
    )
    with duckdb.connect(":memory:") as connection:
        connection.register("frame", frame)
        connection.execute(f"COPY (SELECT {listed} FROM frame) TO '{path}' (FORMAT parquet)")
