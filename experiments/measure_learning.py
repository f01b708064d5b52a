"""Measure the effect of type C fitness and of scenarios per round on learning.

    python experiments/measure_learning.py TASK [--part example] [--budget N] [--seeds 5]
        [--only NAME ...]

evolves TASK with the preset ``desk`` in every variant of ``VARIANTS`` at the same number of team
evaluations, and adds a row per run to ``docs/results/learning-PART.csv``: the champion's main task
performance in 100 fresh scenarios, and the cost. The table of that part on the page
``docs/results/learning.md`` is made from all its rows. The same seeds give the same numbers.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
import time
from pathlib import Path

import numpy as np

import conevo
from pages import Row, put, table, write

RESULTS = Path(__file__).parents[1] / "docs" / "results"
PAGE = RESULTS / "learning.md"
SAME: Row = {"method.fresh_rounds": False}
OWN, TEAM, ONE = {"method.type_c": "own"}, {"method.type_c": "team"}, {"method.type_c_rounds": 1}
FEWER: Row = {"method.genotypes": 20, "method.rounds": 10}
VARIANTS: dict[str, tuple[str, Row]] = {
    "HomCNE": ("homcne", {}),
    "HetCNE": ("hetcne", {}),
    "CCGA": ("ccga", {}),
    "CCGA, same scenarios in all rounds": ("ccga", SAME),
    "MESP": ("mesp", {}),
    "MESP, same scenarios in all rounds": ("mesp", SAME),
    "MESP, 20 genotypes in 10 rounds": ("mesp", FEWER),
    "CONE, type C off": ("cone", {}),
    "CONE, same scenarios in all rounds": ("cone", SAME),
    "CONE, 20 genotypes in 10 rounds": ("cone", FEWER),
    "CONE, type C own": ("cone", OWN),
    "CONE, type C team": ("cone", TEAM),
    "CONE, type C own, one round": ("cone", OWN | ONE),
    "as in 0.1.0: 20 genotypes, same scenarios, type C own, one round": (
        "cone",
        FEWER | SAME | OWN | ONE,
    ),
}


def measure(task: str, name: str, seed: int, budget: int, threads: int) -> Row:
    """Return the row of one run."""
    method, changed = VARIANTS[name]
    settings = {"run.budget_evaluations": budget, "run.n_tests": 100} | changed
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        run = conevo.evolve(
            task, method, "desk", seed, Path(folder) / "run", overrides=settings, threads=threads
        )
        records, test = run.generations(), run.test_result
    assert test is not None
    measure_name, values = next(iter(test["champion"]["performance"].items()))
    return {
        "task": task,
        "variant": name,
        "seed": seed,
        "budget": budget,
        "evaluations": records[-1]["team_evaluations"],
        "generations": len(records),
        "recombinations": sum(record["recombinations"] for record in records),
        "measure": measure_name,
        "test": values["mean"],
        "seconds": round(time.perf_counter() - started, 1),
    }


def tables(rows: list[dict[str, str]]) -> str:
    """Return a table for every task and budget."""
    text = ""
    for task, budget in dict.fromkeys((row["task"], row["budget"]) for row in rows):
        some = [row for row in rows if (row["task"], row["budget"]) == (task, budget)]
        cells = {
            name: [row for row in some if row["variant"] == name]
            for name in VARIANTS
            if any(row["variant"] == name for row in some)
        }
        base = {row["seed"]: float(row["test"]) for row in cells.get("MESP", [])}
        lines = []
        for name, found in cells.items():
            test = np.array([float(row["test"]) for row in found])
            pairs = [float(row["test"]) - base[row["seed"]] for row in found if row["seed"] in base]
            lines.append(
                [
                    name,
                    len(found),
                    f"{test.mean():.4g}",
                    f"{test.std(ddof=1):.2g}" if len(test) > 1 else "",
                    f"{test.min():.4g}",
                    f"{np.mean(pairs):+.3g} ± {error(pairs):.2g}" if name != "MESP" else "",
                    f"{np.mean([int(row['generations']) for row in found]):.0f}",
                    f"{np.mean([int(row['recombinations']) for row in found]):.1f}",
                ]
            )
        head = [some[0]["measure"], "runs", "mean", "s.d.", "least", "minus MESP, same seed"]
        head += ["generations", "pairs recombined between populations"]
        text += f"**{task}**, {int(budget):,} team evaluations\n\n{table(head, lines)}\n"
    return text


def error(values: list[float]) -> float:
    """Return the standard error of a mean."""
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else np.nan


def main() -> None:
    """Make the runs that are missing, the numbers and the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task")
    parser.add_argument("--part", choices=("example", "rover"), default="example")
    parser.add_argument("--budget", type=int, default=50_000)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--only", nargs="*", choices=VARIANTS, default=list(VARIANTS))
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    numbers = RESULTS / f"learning-{options.part}.csv"
    rows: list[Row] = []
    if numbers.exists():
        with numbers.open(newline="") as file:
            rows = list(csv.DictReader(file))
    for seed in range(1, options.seeds + 1):
        for name in options.only:
            row = measure(options.task, name, seed, options.budget, options.threads)
            print(row, flush=True)
            rows.append(row)
            write(rows, numbers)
    with numbers.open(newline="") as file:
        put(tables(list(csv.DictReader(file))), PAGE, options.part)


if __name__ == "__main__":
    main()
