"""A shaping as text: its stages, with the performance of their champions."""

from __future__ import annotations

from typing import Any

from conevo.cli.format import progress, table
from conevo.cli.run_text import controlled, generations_table, seal_text, spaced, title
from conevo.cli.testing_text import measures_of, spreads
from conevo.evolution.methods.registry import title_of
from conevo.numbers import duration, number
from conevo.runs.code import changes_text
from conevo.runs.outline import span
from conevo.runs.run import Run
from conevo.runs.shaping import Shaping
from conevo.terms import counted, quoted

__all__ = ["shaping_text", "stage_summary"]


def shaping_text(shaping: Shaping, n_rows: int = 0) -> str:
    """Return a finished or unfinished shaping as text.

    Args:
        shaping: of any status.
        n_rows: number of generations listed, but at least the first and the last of every stage; 0:
            none.
    """
    stages, first, last = shaping.stages, shaping.methods[0], shaping.methods[-1]
    state = shaping.status + seal_text(shaping)
    records = shaping.generations()
    seconds = sum(record["seconds"] for record in records)
    parts = [
        title(shaping.outlines[-1]).replace(shaping.outlines[-1].task, span(shaping.tasks))
        + (f", begun by {title_of(first)}" if first != last else "")
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


def stage_summary(run: Run) -> dict[str, Any]:
    """Return a summary of a stage as JSON has it."""
    return {
        "run": str(run.path),
        "task": run.outline.task,
        "method": run.outline.method,
        "status": run.status,
        "generations": len(run.generations()),
        "test": run.test_result,
    }


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
    measures = measures_of(tests)
    is_mixed = len({run.outline.method for run in stages}) > 1
    rows = []
    for stage, (run, tested) in enumerate(zip(stages, tests, strict=True), start=1):
        records, champion, outline = run.generations(), run.champion, run.outline
        spent = records[-1]["team_evaluations"] if records else 0
        rows.append(
            [
                str(stage),
                outline.task,
                *([title_of(outline.method)] if is_mixed else []),
                run.status,
                progress(len(records), outline.generations, spent, outline.budget_evaluations),
                number(spent),
                "-" if champion is None else str(champion.generation),
                *spreads(tested, measures),
            ]
        )
    head = ["stage", "task", *(["method"] if is_mixed else []), "status", "done", "evaluations"]
    head += ["champion of", *measures]
    return table(head, rows)
