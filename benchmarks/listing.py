"""Time of commands that show results: show, list and campaign status, with many runs.

One smoke run is made and copied. Copies differ in the data that these commands read: the run's id
and seed, its generations, and its state: finished, interrupted or damaged. Each time is that of a
whole process, from the start of Python to its end. If other programs use the cores, the CPU time is
a better estimate.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
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
from conevo.runs.outline import digest_of, identify
from machine import machine, table

LARGE = (".npz",)  # linked, not copied: looking does not read them
METHODS = ("homcne", "hetcne", "ccga", "mesp", "cone")


def copy(
    run: Path, target: Path, changes: dict[str, object], generations: int, is_old: bool = False
) -> None:
    """Make another run from the files of one; conevo 0.1.0 kept no digest of the configuration."""

    def take(source: str, place: str) -> None:
        (os.link if source.endswith(LARGE) else shutil.copyfile)(source, place)

    shutil.copytree(run, target, copy_function=take)
    tables = tomllib.loads((run / "config.toml").read_text())
    tables["run"] |= changes | {"generations": generations}
    text = tomli_w.dumps(tables).encode()
    (target / "config.toml").write_bytes(text)
    about = json.loads((run / "provenance.json").read_text())
    about["run_id"] = identify(tables, tables["run"]["world"])
    about["config_digest"] = "" if is_old else digest_of(text)
    (target / "provenance.json").write_text(json.dumps(about))
    line = json.loads((run / "generations.jsonl").read_text().splitlines()[-1])
    lines = [json.dumps(line | {"generation": k}) + "\n" for k in range(generations)]
    (target / "generations.jsonl").write_text("".join(lines))


def make_runs(run: Path, folder: Path, n_runs: int, generations: int) -> Path:
    """Return a run in a folder of many; of ten, two are interrupted, one is damaged, one old."""
    for k in range(n_runs):
        changes: dict[str, object] = {"seed": k, "method": METHODS[k % 5]}
        copy(run, folder / f"run-{k:04d}", changes, generations, is_old=k % 10 == 4)
        if k % 10 in (1, 2):
            (folder / f"run-{k:04d}" / "DONE").unlink()
        if k % 10 == 3:
            (folder / f"run-{k:04d}" / "provenance.json").write_text("{")
    return folder / "run-0000"


def make_campaign(run: Path, folder: Path, n_runs: int, generations: int) -> Path:
    """Return a campaign in which nine of ten runs are finished and one has not started."""
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
            copy(run, campaign.paths.run(label), {"seed": k}, generations)
    return folder


def seconds(command: list[str], repeats: int) -> tuple[list[float], float]:
    """Return the wall times of a repeated command, and the mean of its CPU time."""
    found = []
    before = spent()
    for _ in range(repeats):
        began = time.perf_counter()
        subprocess.run([sys.executable, "-m", "conevo", *command], check=True, capture_output=True)
        found.append(time.perf_counter() - began)
    return found, (spent() - before) / repeats


def spent() -> float:
    """Return the CPU seconds of all processes that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


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
                times, cpu = seconds(command, options.repeats)
                spread = f"{min(times):.2f} - {max(times):.2f}"
                what = " ".join(command[: 1 + (len(command) > 2)])
                median = f"{statistics.median(times):.2f}"
                rows.append([what, generations, median, spread, f"{cpu:.2f}"])
    print(f"\n{options.runs} runs\n")
    print(table(["command", "generations", "seconds, median", "range", "CPU seconds"], rows))


if __name__ == "__main__":
    main()
