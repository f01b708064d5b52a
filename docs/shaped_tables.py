"""A table and a picture of finished shapings: what each stage saw, spent and reached."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import conevo
import pages
from conevo.rng import fold
from conevo.runs.shaping import Shaping
from pages import Row
from teams import Teams, error, play

Bar = Callable[[Any], Teams]  # from a world to a team to compare with


def finished_shapings(folder: Path) -> list[Shaping]:
    """Return the finished shapings in a folder, by name."""
    found = [Shaping(path.parent) for path in sorted(folder.glob("*/shaping.toml"))]
    return [one for one in found if one.status == "finished"]


def rows_of(shaping: Shaping, measures: list[str], bar: Bar | None) -> list[Row]:
    """Return a row of numbers for each stage.

    Args:
        shaping: a finished one.
        measures: task performance, of the testing phases; the first is compared.
        bar: a team that plays the same test scenarios.
    """
    rows, before = [], 0
    for run, last in zip(shaping.stages, shaping.test(threads=1), strict=True):
        config, test = run.config, run.test_result
        assert test is not None
        records, champion = run.generations(), test["champion"]
        row: Row = {
            "shaping": shaping.path.name,
            "method": config.method,
            "seed": config.run.seed,
            "stage": last["stage"],
            "environment": config.environment,
            "first_generation": before,
            "generations": len(records),
            "team_evaluations": records[-1]["team_evaluations"],
            "team_steps": records[-1]["team_steps"],
            "champion_generation": champion["generation"],
        }
        for name in measures:
            row[f"{name}_first"] = test["generation_0"]["performance"][name]["mean"]
            row[name] = champion["performance"][name]["mean"]
        row[f"{measures[0]}_sd"] = champion["performance"][measures[0]]["sd"]
        row[f"{measures[0]}_of_last"] = last["performance"][measures[0]]["mean"]
        if bar is not None:
            world = conevo.WORLDS[config.world].build(config.environment, config.world_params)
            keys = [fold(config.run.seed, "test", k) for k in range(champion["scenarios"])]
            reached = play(world, bar(world), keys).performance[measures[0]][0]
            row[f"{measures[0]}_bar"], row["bar_se"] = float(reached.mean()), error(reached)
        castes = sorted(champion["castes"].items(), key=lambda one: -one[1])
        row["castes"] = ", ".join(f"{name} {n}" for name, n in castes)
        rows.append(row)
        before += len(records)
    return rows


def table(rows: list[Row], measures: tuple[tuple[str, str, str], ...], bar: str) -> str:
    """Return one shaping's stages as a Markdown table.

    Args:
        rows: of one shaping.
        measures: name, title and format of each measure.
        bar: how the team to compare with is written, if there is one.
    """
    (main, title, form), *rest = measures
    head = ["stage", "environment", "generations", "team evaluations", f"{title}, generation 0"]
    head += [title, *([bar] if bar else []), *(name for _, name, _ in rest)]
    head += ["last stage's team", "castes of the fittest team"]
    lines = []
    for row in rows:
        last = row["first_generation"] + row["generations"] - 1
        line = [row["stage"], f"`{row['environment']}`", f"{row['first_generation']}–{last}"]
        line += [f"{row['team_evaluations']:,}", f"{row[f'{main}_first']:{form}}"]
        line += [f"**{row[main]:{form}}**"]
        line += [f"{row[f'{main}_bar']:{form}} ± {row['bar_se']:{form}}"] if bar else []
        line += [f"{row[name]:{f}}" for name, _, f in rest]
        line += [f"{row[f'{main}_of_last']:{form}}", row["castes"]]
        lines.append(line)
    return pages.table(head, lines)


def draw(shapings: list[Shaping], measure: str, axis: str, path: Path) -> None:
    """Draw a measure over the team evaluations of all stages, one panel below the other."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(
        len(shapings), squeeze=False, figsize=(8, 0.8 + 2.3 * len(shapings)), layout="constrained"
    )
    for axes, shaping in zip(panels[:, 0], shapings, strict=True):
        before = 0
        for stage, run in enumerate(shaping.stages):
            records = run.generations()
            x = [before + record["team_evaluations"] for record in records]
            y = [record["performance"][measure] for record in records]
            axes.plot(x, y, color="#0072B2" if stage % 2 else "#2B2B50", linewidth=0.9)
            if stage:
                axes.axvline(before, color="0.6", linewidth=0.8, linestyle=":")
            axes.annotate(run.config.environment, (before, 1.02), fontsize="small",
                          xycoords=("data", "axes fraction"))  # fmt: skip
            before = x[-1]
        config = shaping.configs[0]
        name = conevo.METHODS[config.method].title
        axes.set_ylabel(f"{name}, seed {config.run.seed}\n{axis}", fontsize="small")
        axes.set_ylim(bottom=0)
        axes.set_xlim(0, before)
        axes.spines[["top", "right"]].set_visible(False)
    panels[-1, 0].set_xlabel("team evaluations, through all stages")
    figure.savefig(path, dpi=110, metadata={"Software": None})
