"""Turn finished runs of one task into a results page's tables, numbers (CSV) and picture.

    python docs/make_results.py RUNS_DIRECTORY docs/results/NAME

Runs are named METHOD-sSEED, or METHOD-WHAT-IS-DIFFERENT-sSEED, if need be with the task before
it. Writes ``NAME.csv`` (one row per run), ``NAME-curves.csv`` (every tenth part of each run) and
``NAME.png`` (learning curves), and puts the tables between the markers of ``NAME.md``. Where the
world has teams to compare with (heuristic ones, random networks), they play the same test
scenarios; what predators do is in ``NAME-behaviours.csv``. Shapings in the same directory, in
environments of the same world, get a table and a picture of their own (``shaped_tables.py``).
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from typing import Any

import numpy as np

import conevo
import pages
from conevo.rng import fold
from conevo.runs.evaluation import describe
from conevo.runs.shaping import Shaping
from mixes import best, team_of
from pages import Row
from shaped_tables import draw as draw_shaped
from shaped_tables import finished_shapings, rows_of
from shaped_tables import table as shaped_table
from teams import controlled, error, play, random_networks

ORDER = ("homcne", "hetcne", "ccga", "mesp", "cone", "cone-1", "cone-2", "cone-3")
TITLES = {"homcne": "HomCNE", "hetcne": "HetCNE", "ccga": "CCGA", "mesp": "MESP"}
N_RANDOM = 20  # teams of random networks


@dataclass(frozen=True)
class Sheet:
    """How runs in a world are reported.

    Attributes:
        measures: task performance measures (name, title, format); the first one is compared.
        axis: what the learning curves show.
        ticks: of a logarithmic axis; none makes it linear.
        others: teams to compare with, and how they are written: heuristic controllers of the
            world, the "best mix" of them that a search finds, and "random" networks.
        is_ratio: whether generation 0 is compared by a ratio, else by a difference.
        has_behaviours: whether ``behaviour_tables`` knows what the robots do.
    """

    measures: tuple[tuple[str, str, str], ...]
    axis: str
    ticks: tuple[int, ...] = ()
    others: tuple[tuple[str, str], ...] = ()
    is_ratio: bool = True
    has_behaviours: bool = False

    @property
    def main(self) -> str:
        """The measure that is compared."""
        return self.measures[0][0]


SHEETS = {
    "rover-v2": Sheet(
        measures=(("value", "value", ".0f"), ("area", "area", ".2f")),
        axis="red rock value, fittest team of a generation",
        ticks=(20, 50, 100, 200, 500, 1000),
    ),
    "pursuit-v2": Sheet(
        measures=(
            ("capture_time", "capture time", ".1f"),
            ("first_capture", "first capture", ".0f"),
            ("captures", "captures", ".1f"),
            ("collisions", "collisions", ".0f"),
        ),
        axis="capture time, fittest team of a generation",
        others=(("heuristic", "heuristic predators"), ("random", "random networks")),
        is_ratio=False,
        has_behaviours=True,
    ),
    "gacc-v2": Sheet(
        measures=(
            ("delivered", "delivered", ".2f"),
            ("delivered_share", "of the optimum, %", ".1f"),
            ("completed", "completed", ".2f"),
        ),
        axis="objects delivered by the fittest team",
        others=(
            ("best mix", "best mix of heuristic robots"),
            ("non-specialized", "non-specialized heuristic robots"),
            ("random", "random networks"),
        ),
        is_ratio=False,
    ),
}
Read = tuple[Row, list[Row], list[float]]  # numbers of a run, its generations, its test scenarios


def read_runs(folder: Path) -> list[Read]:
    """Return the numbers of every finished run below a folder, generations and test values."""
    runs = []
    for path in sorted(folder.glob("*/test.json")):
        run = path.parent
        if not (run / "DONE").exists():  # nor is a shaping
            continue
        config = tomllib.loads((run / "config.toml").read_text())
        about = json.loads((run / "provenance.json").read_text())
        test = json.loads(path.read_text())
        lines = (run / "generations.jsonl").read_text().splitlines()
        generations = [json.loads(line) for line in lines]
        champion, first = test["champion"], test["generation_0"]
        method = config["run"]["method"]
        rest = re.sub(rf"^{prefix(config['run']['world'])}|-s?\d+$", "", run.name)
        label = f"{method} {rest.removeprefix(method).replace('-', ' ').strip()}".strip()
        sheet = sheet_of(config["run"]["world"])
        row = {
            "run": run.name,
            "method": label,
            "seed": config["run"]["seed"],
            **measured(sheet, champion["performance"], ""),
            **measured(sheet, first["performance"], "_first"),
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
        runs.append((row, generations, champion["performance"][sheet.main]["values"]))
    return sorted(runs, key=lambda one: (rank(one[0]["method"]), one[0]["seed"]))


def prefix(task: str) -> str:
    """Return a pattern of what names of runs may begin with, of "pursuit-team-3-", "team-3-"."""
    world, _, environment = task.partition("/")
    return f"({world.rpartition('-v')[0]}-)?{environment}-"


def measured(sheet: Sheet, performance: Row, suffix: str) -> Row:
    """Return the means of a testing phase, for the main measure with its standard deviation."""
    found: Row = {}
    for name, _, _ in sheet.measures:
        found[f"{name}{suffix}"] = performance[name]["mean"]
        if name == sheet.main:
            found[f"{name}{suffix}_sd"] = performance[name]["sd"]
    return found


def sheet_of(task: str) -> Sheet:
    """Return how runs of a task like "rover-v2/complex-5" are reported."""
    return SHEETS[task.partition("/")[0]]


def task_of(folder: Path) -> tuple[conevo.Run, str]:
    """Return one finished run of a folder and the task that all of them have in common.

    Raises:
        SystemExit: runs of different worlds or with different parameters of the world.
    """
    runs = [conevo.Run(path.parent) for path in sorted(folder.glob("*/test.json"))]
    runs = [run for run in runs if run.status == "finished"]
    if not runs or len({(run.config.task, run.config.world_params) for run in runs}) > 1:
        raise SystemExit(f"{folder}: expected finished runs of one task with one set of parameters")
    return runs[0], runs[0].config.task


def rank(label: str) -> tuple[int, str]:
    """Return the place of a method in tables."""
    return ORDER.index(label.split()[0]), label


def title(label: str) -> str:
    """Return how a method is written."""
    name, _, rest = label.partition(" ")
    return f"{TITLES.get(name, name.upper())} {rest}".strip()


# --- teams to compare with ------------------------------------------------------------------------


def compare(run: conevo.Run, sheet: Sheet, seeds: list[int]) -> tuple[list[Row], dict[int, Any]]:
    """Play the teams to compare with in the test scenarios of each seed.

    Returns:
        A row of numbers for each kind of team and seed, and for each seed the main measure of the
        first kind in each scenario.
    """
    config = run.config
    world = config.build_world()
    rows, first = [], {}
    for seed in seeds:
        keys = [fold(seed, "test", k) for k in range(config.run.n_tests)]
        for kind, _ in sheet.others:
            if kind == "random":
                teams = random_networks(world, N_RANDOM, seed, "results")
            elif kind == "best mix":
                teams = team_of(world, best(world))
            else:
                teams = controlled(world, kind, world.heuristics.index(kind))
            outcome = play(world, teams, keys)
            if kind == sheet.others[0][0]:
                first[seed] = outcome.performance[sheet.main][0].astype(np.float64)
            portraits = [describe(outcome, world, team=n) for n in range(len(teams.kinds))]
            castes = sum((Counter(p.castes) for p in portraits), Counter())
            rows.append(
                {
                    "run": f"{kind}-s{seed}",
                    "method": kind,
                    "seed": seed,
                    **{
                        name: mean(one.performance[name] for one in portraits)
                        for name, _, _ in sheet.measures
                    },
                    f"{sheet.main}_sd": outcome.performance[sheet.main].std(ddof=1),
                    "castes": " ".join(f"{k}:{n / len(portraits):g}" for k, n in castes.items()),
                    "specialization": mean(mean(p.specialization) for p in portraits),
                }
            )
    return rows, first


# --- tables ---------------------------------------------------------------------------------------


def table(sheet: Sheet, runs: list[Read], others: list[Row], first: dict[int, Any]) -> str:
    """Return the Markdown table: one line per method, means over its runs, then other teams."""
    (main, name, form), *rest = sheet.measures
    head = ["method", "runs", f"{name}, generation 0", name]
    head += ["times"] if sheet.is_ratio else ["gained"]
    head += [f"more than {sheet.others[0][1]} (± se)"] if sheet.others else []
    head += [title for _, title, _ in rest]
    head += ["S", "castes (robots, mean)", "team evaluations", "team-steps (million)"]
    lines = []
    rows = [row for row, _, _ in runs]
    for label in sorted({row["method"] for row in rows}, key=rank):
        some = [row for row in rows if row["method"] == label]
        before, after = (mean(row[key] for row in some) for key in (f"{main}_first", main))
        line = [title(label), len(some), f"{before:{form}} ({spread(some, f'{main}_first', form)})"]
        line += [f"**{after:{form}}** ({spread(some, main, form)})"]
        line += [f"{after / before:.1f}" if sheet.is_ratio else f"{after - before:{form}}"]
        if sheet.others:
            line += [difference([one for one in runs if one[0]["method"] == label], first, form)]
        line += [f"{mean(row[key] for row in some):{f}}" for key, _, f in rest]
        line += [f"{mean(row['specialization'] for row in some):.2f}", mix(some)]
        line += [f"{mean(row['team_evaluations'] for row in some):,.0f}"]
        line += [f"{mean(row['team_steps'] for row in some) / 1e6:.0f}"]
        lines.append(line)
    for kind, written in sheet.others:
        some = [row for row in others if row["method"] == kind]
        line = [written, "–", "–", f"{mean(row[main] for row in some):{form}}"]
        line[-1] += f" ({spread(some, main, form)})"
        line += ["–", "–", *(f"{mean(row[key] for row in some):{f}}" for key, _, f in rest)]
        line += [f"{mean(row['specialization'] for row in some):.2f}", mix(some), "–", "–"]
        lines.append(line)
    return pages.table(head, lines)


def difference(runs: list[Read], first: dict[int, Any], form: str) -> str:
    """Return how much more runs reach than other teams in the same scenarios: mean, error."""
    pairs = np.concatenate([np.array(values) - first[row["seed"]] for row, _, values in runs])
    return f"{pairs.mean():{form}} ± {error(pairs):{form}}"


def mix(rows: list[Row]) -> str:
    """Return how many robots of a team belong to each caste, mean over teams."""
    castes: Counter[str] = Counter()
    for row in rows:
        castes.update({k: float(n) for k, n in (c.split(":") for c in row["castes"].split())})
    return ", ".join(f"{name} {n / len(rows):.3g}" for name, n in castes.most_common())


def spread(rows: list[Row], key: str, form: str) -> str:
    """Return the values of the single runs."""
    return ", ".join(f"{row[key]:{form}}" for row in rows)


# --- learning curves ------------------------------------------------------------------------------


def curves(sheet: Sheet, runs: list[Read]) -> list[Row]:
    """Return ten points of each run's learning curve: means of its ten parts."""
    points = []
    for row, generations, _ in runs:
        for part in range(10):
            cut = [len(generations) * k // 10 for k in (part, part + 1)]
            some = generations[cut[0] : cut[1]]
            if not some:
                continue
            points.append(
                {
                    "run": row["run"],
                    "method": row["method"],
                    "seed": row["seed"],
                    "team_evaluations": some[-1]["team_evaluations"],
                    **{
                        name: round(mean(g["performance"][name] for g in some), 2 + 2 * (k > 0))
                        for k, (name, _, _) in enumerate(sheet.measures)
                    },
                    "specialization": round(mean(g["specialization"] for g in some), 4),
                }
            )
    return points


def draw(sheet: Sheet, points: list[Row], path: Path, lines: dict[str, float]) -> None:
    """Draw the learning curves, one line style and shade per method, and lines to compare with."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    styles = ["-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 3))]
    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    labels = sorted({point["method"] for point in points}, key=rank)
    for k, label in enumerate(labels):
        colour = plt.get_cmap("viridis")(k / max(1, len(labels) - 0.5))
        seeds = sorted({point["seed"] for point in points if point["method"] == label})
        for seed in seeds:
            one = [p for p in points if p["method"] == label and p["seed"] == seed]
            axes.plot(
                [p["team_evaluations"] for p in one],
                [p[sheet.main] for p in one],
                color=colour,
                linestyle=styles[k % len(styles)],
                marker="os^DvxP"[k % 7],
                markersize=4,
                label=title(label) if seed == seeds[0] else None,
            )
    for k, (name, height) in enumerate(lines.items()):
        axes.axhline(height, color="0.4", linewidth=0.9, linestyle=(0, (6, 2 + 4 * k)), label=name)
    if sheet.ticks:
        axes.set_yscale("log")
        axes.set_yticks(sheet.ticks, list(map(str, sheet.ticks)))
        axes.minorticks_off()
    axes.set_xlabel("team evaluations")
    axes.set_ylabel(f"{sheet.axis}\n(mean of a tenth of the run)")
    axes.legend(frameon=False, fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=130, metadata={"Software": None})


def write_shaped(sheet: Sheet, shapings: list[Shaping], name: str) -> None:
    """Write what a results page shows of shapings."""
    measures = [key for key, _, _ in sheet.measures]
    has_mix = ("best mix", sheet.others[0][1]) in sheet.others if sheet.others else False
    bar = (lambda world: team_of(world, best(world))) if has_mix else None
    rows, text = [], ""
    for shaping in shapings:
        some = rows_of(shaping, measures, bar)
        heading = f"**{title(shaping.configs[0].method)}, seed {shaping.configs[0].run.seed}**"
        text += f"{heading}\n\n{shaped_table(some, sheet.measures, 'best mix' if bar else '')}\n"
        rows += some
    pages.write(rows, Path(f"{name}-shaped.csv"))
    draw_shaped(shapings, sheet.main, sheet.measures[0][1], Path(f"{name}-shaped.png"))
    pages.put(text, Path(f"{name}.md"), "shaped")
    print(text)


def main(folder: str, name: str) -> None:
    """Write everything a results page shows."""
    run, task = task_of(Path(folder))
    sheet, runs = sheet_of(task), read_runs(Path(folder))
    others, first = compare(run, sheet, sorted({row["seed"] for row, _, _ in runs}))
    page = Path(f"{name}.md")
    page.parent.mkdir(parents=True, exist_ok=True)
    pages.write([row for row, _, _ in runs] + others, Path(f"{name}.csv"))
    points = curves(sheet, runs)
    pages.write(points, Path(f"{name}-curves.csv"))
    lines = {
        written: mean(row[sheet.main] for row in others if row["method"] == kind)
        for kind, written in sheet.others
    }
    draw(sheet, points, Path(f"{name}.png"), lines)
    text = table(sheet, runs, others, first)
    pages.put(text, page)
    print(text)
    if shapings := finished_shapings(Path(folder)):
        write_shaped(sheet, shapings, name)
    if sheet.has_behaviours:
        from behaviour_tables import tables

        made: dict[str, list[conevo.Run]] = {}
        for row, _, _ in runs:
            if row["method"] in ORDER:  # as they are, without changed settings
                made.setdefault(row["method"], []).append(conevo.Run(Path(folder) / row["run"]))
        found, rows = tables(made, title)
        pages.write(rows, Path(f"{name}-behaviours.csv"))
        for marker, text in found.items():
            pages.put(text, page, marker)
            print(text)


if __name__ == "__main__":
    main(*sys.argv[1:])
