"""Time and memory of ``conevo report`` on a thousand finished runs, which are made up.

Their tables have the form of a campaign's (tests/report/finished_runs.py): 100 generations a run,
20 scenarios for each of its teams, all studies. Each report is written by a separate process.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from machine import machine, table

ROOT = Path(__file__).resolve().parent.parent
LAYOUTS = {
    "10 environments of one family, 5 methods, 20 seeds": (
        [f"rover/complex-{k}" for k in range(1, 11)],
        20,
    ),
    "50 environments of five families, 5 methods, 4 seeds": (
        [
            f"{family}-{k}"
            for family in ("rover/simple", "rover/complex", "rover/extended", "pursuit/team")
            for k in range(1, 11)
        ]
        + [f"gacc/simple-{k}" for k in range(1, 11)],
        4,
    ),
}
MEASURED = """
import json, resource, sys, time
from pathlib import Path
began = time.perf_counter()
from conevo.campaigns.campaign import Campaign
from conevo.report.files import write_report
page = write_report(Campaign(Path(sys.argv[1])), Path(sys.argv[2]))
spent = resource.getrusage(resource.RUSAGE_SELF)
print(json.dumps({
    "wall": time.perf_counter() - began,
    "core": spent.ru_utime + spent.ru_stime,
    "memory": spent.ru_maxrss / 1024,
    "page": page.stat().st_size / 1e6,
    "size": sum(f.stat().st_size for f in page.parent.rglob("*") if f.is_file()) / 1e6,
}))
"""


def measure(
    folder: Path, environments: list[str], seeds: int, generations: int
) -> dict[str, float]:
    """Make the runs, write their report and return its times, memory and sizes."""
    sys.path.insert(0, str(ROOT / "tests"))
    from report.finished_runs import cells, write_campaign

    campaign = write_campaign(folder / "campaign", cells(environments), seeds, generations)
    command = [sys.executable, "-c", MEASURED, str(campaign), str(folder / "report")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    measured: dict[str, float] = json.loads(done.stdout)
    return measured


def main() -> None:
    """Measure both layouts and print a markdown table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--generations", type=int, default=100)
    options = parser.parse_args()
    print(machine("conevo", "duckdb", "matplotlib"), "\n")
    rows = []
    for name, (environments, seeds) in LAYOUTS.items():
        with tempfile.TemporaryDirectory() as folder:
            found = measure(Path(folder), environments, seeds, options.generations)
        runs = f"{len(environments) * 5 * seeds:,}"
        numbers = [f"{found[key]:.1f}" for key in ("wall", "core", "memory", "page", "size")]
        rows.append([name, runs, *numbers])
    head = ["runs of", "runs", "s", "core s", "peak MiB", "page, MB", "report, MB"]
    print(table(head, rows))
    print("\n" + machine())


if __name__ == "__main__":
    main()
