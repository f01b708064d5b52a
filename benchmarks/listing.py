"""How long it takes to look at results: show, list and campaign status with many runs there.

One smoke run is made and copied. Copies differ in what looking reads: the run's id and seed, its
generations, and how it is: finished, interrupted, running or damaged. Each time is that of a whole
process, from the start of Python to its end.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import tomli_w

import conevo
from conevo.campaigns.campaign import create
from conevo.campaigns.plan import Plan
from conevo.runs.outline import identify
from machine import machine, table

LARGE = (".npz",)  # linked, not copied: looking does not read them
METHODS = ("homcne", "hetcne", "ccga", "mesp", "cone")


def copy(run: Path, target: Path, changes: dict[str, object], generations: int) -> None:
    """Make another run of the files of one."""

    def take(source: str, place: str) -> None:
        (os.link if source.endswith(LARGE) else shutil.copyfile)(source, place)

    shutil.copytree(run, target, copy_function=take)
    tables = tomllib.loads((run / "config.toml").read_text())
    tables["run"] |= changes | {"generations": generations}
    (target / "config.toml").write_text(tomli_w.dumps(tables))
    about = json.loads((run / "provenance.json").read_text())
    about["run_id"] = identify(tables, tables["run"]["world"])
    del about["config_digest"]  # as in runs of conevo 0.1.0: the slower case
    (target / "provenance.json").write_text(json.dumps(about))
    line = json.loads((run / "generations.jsonl").read_text().splitlines()[-1])
    lines = [json.dumps(line | {"generation": k}) + "\n" for k in range(generations)]
    (target / "generations.jsonl").write_text("".join(lines))


def make_runs(run: Path, folder: Path, n_runs: int, generations: int) -> Path:
    """Return a run of a folder of many: of ten, two are interrupted and one is damaged."""
    for k in range(n_runs):
        copy(run, folder / f"run-{k:04d}", {"seed": k, "method": METHODS[k % 5]}, generations)
        if k % 10 in (1, 2):
            (folder / f"run-{k:04d}" / "DONE").unlink()
        if k % 10 == 3:
            (folder / f"run-{k:04d}" / "provenance.json").write_text("{")
    return folder / "run-0000"


def make_campaign(run: Path, folder: Path, n_runs: int, generations: int) -> Path:
    """Return a campaign whose runs are finished, but for one of ten that has not begun."""
    plan = Plan(
        name="many",
        title="",
        produces=(),
        seeds=tuple(range(n_runs // len(METHODS))),
        preset="smoke",
        shape=False,
        studies=(),
        factors={"world": ("rover/complex-1",), "method": METHODS},
        settings={},
    )
    campaign = create(plan, folder)
    (folder / "runs").mkdir()
    for k, label in enumerate(campaign.planned):
        if k % 10:
            copy(run, campaign.places.run(label), {"seed": k}, generations)
    return folder


def seconds(command: list[str], repeats: int) -> list[float]:
    """Return the wall time of a command, again and again."""
    found = []
    for _ in range(repeats):
        began = time.perf_counter()
        subprocess.run([sys.executable, "-m", "conevo", *command], check=True, capture_output=True)
        found.append(time.perf_counter() - began)
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--generations", type=int, nargs="+", default=[5, 250])
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    print(machine())
    rows = []
    for generations in options.generations:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            run = conevo.evolve("rover/complex-1", preset="smoke", out=folder / "one").path
            shown = make_runs(run, folder / "runs", options.runs, generations)
            campaign = make_campaign(run, folder / "campaign", options.runs, generations)
            for command in (
                ["show", str(shown)],
                ["list", "runs", str(folder / "runs")],
                ["campaign", "status", str(campaign)],
            ):
                times = seconds(command, options.repeats)
                spread = f"{min(times):.2f} - {max(times):.2f}"
                what = " ".join(command[: 1 + (len(command) > 2)])
                rows.append([what, generations, f"{statistics.median(times):.2f}", spread])
    print(f"\n{options.runs} runs\n")
    print(table(["command", "generations of a run", "seconds, median", "range"], rows))


if __name__ == "__main__":
    main()
