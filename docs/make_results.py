"""Turn finished runs into a results page's table, numbers (CSV) and picture.

    python docs/make_results.py RUNS_DIRECTORY docs/results/NAME

Runs are named METHOD-sSEED, or METHOD-WHAT-IS-DIFFERENT-sSEED. It writes ``NAME.csv`` (one row
per run), ``NAME-curves.csv`` (every tenth part of each run) and ``NAME.png`` (learning curves),
and puts the table between the markers of ``NAME.md``. Needs matplotlib.
"""

from __future__ import annotations

import csv
import json
import re
import sys
import tomllib
from collections import Counter
from pathlib import Path
from statistics import mean
from typing import Any

ORDER = ("homcne", "hetcne", "ccga", "mesp", "cone", "cone-1", "cone-2", "cone-3")
TITLES = {"homcne": "HomCNE", "hetcne": "HetCNE", "ccga": "CCGA", "mesp": "MESP"}
MARKERS = re.compile(r"(<!-- results -->\n).*?(<!-- end -->)", re.DOTALL)
Row = dict[str, Any]


def read_runs(folder: Path) -> list[tuple[Row, list[Row]]]:
    """Return a row of numbers and the generations of every finished run below a folder."""
    runs = []
    for path in sorted(folder.glob("*/test.json")):
        run = path.parent
        if not (run / "DONE").exists():
            continue
        config = tomllib.loads((run / "config.toml").read_text())
        about = json.loads((run / "provenance.json").read_text())
        test = json.loads(path.read_text())
        lines = (run / "generations.jsonl").read_text().splitlines()
        generations = [json.loads(line) for line in lines]
        champion, first = test["champion"], test["generation_0"]
        method = config["run"]["method"]
        label = " ".join(run.name.removeprefix(method).rsplit("-s", 1)[0].strip("-").split("-"))
        label = f"{method} {label}".strip()
        row = {
            "run": run.name,
            "method": label,
            "seed": config["run"]["seed"],
            "value": champion["performance"]["value"]["mean"],
            "value_sd": champion["performance"]["value"]["sd"],
            "area": champion["performance"]["area"]["mean"],
            "value_first": first["performance"]["value"]["mean"],
            "value_first_sd": first["performance"]["value"]["sd"],
            "area_first": first["performance"]["area"]["mean"],
            "generation": champion["generation"],
            "castes": " ".join(f"{name}:{n}" for name, n in champion["castes"].items()),
            "specialization": mean(champion["specialization"]),
            "neurons": mean(champion["n_hidden"]),
            "generations": len(generations),
            "team_evaluations": generations[-1]["team_evaluations"],
            "team_steps": generations[-1]["team_steps"],
            "recombinations": sum(g["recombinations"] for g in generations),
            "seconds": round(sum(g["seconds"] for g in generations)),
            "kernel_hash": about["kernel_hash"],
        }
        runs.append((row, generations))
    return sorted(runs, key=lambda one: (rank(one[0]["method"]), one[0]["seed"]))


def rank(label: str) -> tuple[int, str]:
    """Return the place of a method in tables."""
    return ORDER.index(label.split()[0]), label


def title(label: str) -> str:
    """Return how a method is written."""
    name, _, rest = label.partition(" ")
    return f"{TITLES.get(name, name.upper())} {rest}".strip()


def table(rows: list[Row]) -> str:
    """Return the Markdown table: one line per method, means over its runs."""
    lines = [
        "| method | runs | value, generation 0 | value | times | area | S | castes (robots, mean) "
        "| team evaluations | team-steps (million) |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for label in sorted({row["method"] for row in rows}, key=rank):
        some = [row for row in rows if row["method"] == label]
        castes: Counter[str] = Counter()
        for row in some:
            castes.update({k: int(n) for k, n in (c.split(":") for c in row["castes"].split())})
        mix = ", ".join(f"{name} {n / len(some):.3g}" for name, n in castes.most_common())
        first, last = (mean(row[key] for row in some) for key in ("value_first", "value"))
        lines.append(
            f"| {title(label)} | {len(some)} | {first:.0f} ({spread(some, 'value_first')}) "
            f"| **{last:.0f}** ({spread(some, 'value')}) | {last / first:.1f} "
            f"| {mean(row['area'] for row in some):.2f} "
            f"| {mean(row['specialization'] for row in some):.2f} | {mix} "
            f"| {mean(row['team_evaluations'] for row in some):,.0f} "
            f"| {mean(row['team_steps'] for row in some) / 1e6:.0f} |"
        )
    return "\n".join(lines) + "\n"


def spread(rows: list[Row], key: str) -> str:
    """Return the values of the single runs."""
    return ", ".join(f"{row[key]:.0f}" for row in rows)


def curves(runs: list[tuple[Row, list[Row]]]) -> list[Row]:
    """Return ten points of each run's learning curve: means of its ten parts."""
    points = []
    for row, generations in runs:
        for part in range(10):
            cut = [len(generations) * k // 10 for k in (part, part + 1)]
            some = generations[cut[0] : cut[1]]
            points.append(
                {
                    "run": row["run"],
                    "method": row["method"],
                    "seed": row["seed"],
                    "team_evaluations": some[-1]["team_evaluations"],
                    "value": round(mean(g["performance"]["value"] for g in some), 2),
                    "area": round(mean(g["performance"]["area"] for g in some), 4),
                    "specialization": round(mean(g["specialization"] for g in some), 4),
                }
            )
    return points


def draw(points: list[Row], path: Path) -> None:
    """Draw the learning curves, one line style and shade per method."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    styles = ["-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 3))]
    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    labels = sorted({point["method"] for point in points}, key=rank)
    for k, label in enumerate(labels):
        colour = plt.get_cmap("viridis")(k / max(1, len(labels) - 0.5))
        for seed in sorted({point["seed"] for point in points if point["method"] == label}):
            one = [p for p in points if p["method"] == label and p["seed"] == seed]
            axes.plot(
                [p["team_evaluations"] for p in one],
                [p["value"] for p in one],
                color=colour,
                linestyle=styles[k % len(styles)],
                marker="os^DvxP"[k % 7],
                markersize=4,
                label=title(label) if one[0]["seed"] == min(p["seed"] for p in points) else None,
            )
    axes.set_yscale("log")
    axes.set_yticks([20, 50, 100, 200, 500, 1000], ["20", "50", "100", "200", "500", "1000"])
    axes.minorticks_off()
    axes.set_xlabel("team evaluations")
    axes.set_ylabel("red rock value, fittest team of a generation\n(mean of a tenth of the run)")
    axes.legend(frameon=False, fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=130, metadata={"Software": None})


def write(rows: list[Row], path: Path) -> None:
    """Write rows of numbers as CSV."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows
        )


def main(folder: str, name: str) -> None:
    """Write everything a results page shows."""
    runs = read_runs(Path(folder))
    rows = [row for row, _ in runs]
    page = Path(f"{name}.md")
    page.parent.mkdir(parents=True, exist_ok=True)
    write(rows, Path(f"{name}.csv"))
    points = curves(runs)
    write(points, Path(f"{name}-curves.csv"))
    draw(points, Path(f"{name}.png"))
    if page.exists():
        text, n = MARKERS.subn(lambda m: m[1] + table(rows) + m[2], page.read_text())
        if n != 1:
            raise SystemExit(f"{page}: expected the markers <!-- results --> and <!-- end --> once")
        page.write_text(text)
    print(table(rows))


if __name__ == "__main__":
    main(*sys.argv[1:])
