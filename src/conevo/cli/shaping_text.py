"""A shaping in words: its stages with what their champions achieved, and what can be done next."""

from __future__ import annotations

import json
from typing import Any

import click

from conevo.cli.format import castes, progress, spread, table
from conevo.cli.run_text import controlled, generations_table, spaced, title
from conevo.evolution.methods.registry import title_of
from conevo.numbers import duration, number
from conevo.runs.code import changes_text
from conevo.runs.outline import span
from conevo.runs.run import Run
from conevo.runs.shaping import Shaping
from conevo.terms import S_SCALE, counted, quoted
from conevo.worlds.registry import product_of

__all__ = ["print_shaping_end", "shaping_text", "stage_summary", "stages_test_text"]


def print_shaping_end(shaping: Shaping, style: str) -> None:
    """Print how a shaping ended, in the style asked for."""
    if style == "quiet":
        click.echo(shaping.path)
    elif style == "json":
        end = {
            "shaping": str(shaping.path),
            "status": shaping.status,
            "stages": [stage_summary(run) for run in shaping.stages],
            "product": None if shaping.product is None else str(shaping.product),
        }
        click.echo(json.dumps(end))
    else:
        commands = "\n".join(f"  {command}" for command in _next_commands(shaping))
        click.echo(f"\n{shaping_text(shaping)}\n\nWhat next:\n{commands}")


def shaping_text(shaping: Shaping, n_rows: int = 0) -> str:
    """Return a finished or unfinished shaping as text.

    Args:
        shaping: of any status.
        n_rows: about so many generations, at least the first and the last of every stage; 0: none.
    """
    stages = shaping.stages
    state, changed = shaping.status, shaping.changed_files
    state += f"; modified since the run: {', '.join(changed)}" if changed else ""
    records = shaping.generations()
    seconds = sum(record["seconds"] for record in records)
    parts = [
        title(shaping.outlines[-1]).replace(shaping.outlines[-1].task, span(shaping.tasks))
        + _after(shaping)
        + (controlled(stages[0]) if stages else ""),
        f"{shaping.path}: {state}",
        f"{len(stages)} of {counted(len(shaping.outlines), 'stage')} begun, "
        f"{counted(len(records), 'generation')}, "
        f"{duration(seconds)}",
        *changes_text(shaping.sessions),
    ]
    if stages:
        parts += ["", _table(stages)]
    if records and n_rows:
        parts += ["", generations_table(_chosen(records, n_rows), "number", "stage", "task")]
    if shaping.status == "interrupted":
        parts += ["", f"Continue it with: conevo resume {quoted(shaping.path)}"]
    return "\n".join(parts)


def _after(shaping: Shaping) -> str:
    """Return what a title says of a first stage of another method, nothing if there is none."""
    first, last = shaping.methods[0], shaping.methods[-1]
    return f", begun by {title_of(first)}" if first != last else ""


def stage_summary(run: Run) -> dict[str, Any]:
    """Return a stage in one object."""
    return {
        "run": str(run.path),
        "task": run.outline.task,
        "method": run.outline.method,
        "status": run.status,
        "generations": len(run.generations()),
        "test": run.test_result,
    }


def stages_test_text(results: list[dict[str, Any]]) -> str:
    """Return the tests of one team in the environments of all stages as a table."""
    measures = list(dict.fromkeys(name for tested in results for name in tested["performance"]))
    rows = []
    for tested in results:
        spreads = [tested["performance"].get(name) for name in measures]
        mean_s = sum(tested["specialization"]) / len(tested["specialization"])
        rows.append(
            [str(tested["stage"]), tested["task"]]
            + ["-" if s is None else spread(s, tested["scenarios"]) for s in spreads]
            + [number(mean_s), castes(tested["castes"])]
        )
    last = results[0]
    return (
        f"The fittest team of stage {last['team_of']} (generation {last['generation']}), "
        f"{counted(last['scenarios'], 'fresh scenario')} of each stage "
        f"(mean +- standard deviation; S: {S_SCALE})\n"
        + table(["stage", "task", *measures, "S", "castes"], rows)
    )


def _chosen(records: list[dict[str, Any]], n: int) -> list[dict[str, Any]]:
    """Return evenly spaced generations of every stage."""
    stages: dict[int, list[dict[str, Any]]] = {}
    for record in records:
        stages.setdefault(record["stage"], []).append(record)
    each = max(2, n // len(stages))
    return [record for stage in stages.values() for record in spaced(stage, each)]


def _table(stages: list[Run]) -> str:
    """Return one line per stage; a champion's performance is that of the testing phase."""
    nothing: dict[str, Any] = {"performance": {}, "scenarios": 0}
    tests = [run.test_result["champion"] if run.test_result else nothing for run in stages]
    measures = list(dict.fromkeys(name for tested in tests for name in tested["performance"]))
    is_mixed = len({run.outline.method for run in stages}) > 1
    rows = []
    for stage, (run, tested) in enumerate(zip(stages, tests, strict=True), start=1):
        records, champion, outline = run.generations(), run.champion, run.outline
        spent = records[-1]["team_evaluations"] if records else 0
        spreads = [tested["performance"].get(name) for name in measures]
        rows.append(
            [
                str(stage),
                outline.task,
                *([title_of(outline.method)] if is_mixed else []),
                run.status,
                progress(len(records), outline.generations, spent, outline.budget_evaluations),
                number(spent),
                "-" if champion is None else str(champion.generation),
                *("-" if s is None else spread(s, tested["scenarios"]) for s in spreads),
            ]
        )
    head = ["stage", "task", *(["method"] if is_mixed else []), "status", "done", "evaluations"]
    head += ["champion of", *measures]
    return table(head, rows)


def _next_commands(shaping: Shaping) -> list[str]:
    """Return the exact commands for what can be done now, each after a comment."""
    path = quoted(shaping.path)
    commands = {
        f"conevo show {path}": "its generations, stage by stage",
        f"conevo replay {path}": "see its last team in the browser",
        f"conevo test {path} --scenarios 100": "test its last team in more scenarios",
    }
    if len({run.champion.genes.shape for run in shaping.stages if run.champion}) == 1:
        every = f"conevo test {path} --stages"
        commands[every] = "test it in the environment of every stage"
    if shaping.product is not None:
        command, why = product_of(shaping.tasks).USE
        commands[command.format(file=quoted(shaping.product))] = why
    return [line for command, what in commands.items() for line in (f"# {what}", command)]
