"""``conevo show``: print a finished or running run."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from conevo.runs.run import Run

__all__ = ["show"]


@click.command()
@click.argument("run")
@click.option(
    "--rows",
    type=click.IntRange(2, 1_000_000),
    default=12,
    show_default=True,
    help="Number of generations listed.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def show(run: str, rows: int, as_json: bool) -> None:
    """Print RUN: state, generations, castes, thresholds and testing phase.

    Of a shaping, it prints the stages, and the generations with the environment of each. A stage is
    a run of its own: DIR/stage-1.

    Try: conevo show runs/first --rows 20
    """
    from conevo.cli.lookup import find
    from conevo.cli.run_text import run_text
    from conevo.cli.shaping_text import shaping_text
    from conevo.runs.run import Run

    found = find(run)
    if isinstance(found, Run):
        click.echo(json.dumps(_everything(found)) if as_json else run_text(found, rows))
    elif as_json:
        shaping = {
            "shaping": str(found.path),
            "status": found.status,
            "tasks": found.tasks,
            "changed_files": found.changed_files,
            "generations": found.generations(),
            "stages": [_everything(stage) for stage in found.stages],
        }
        click.echo(json.dumps(shaping))
    else:
        click.echo(shaping_text(found, rows))


def _everything(run: Run) -> dict[str, Any]:
    return {
        "run": str(run.path),
        "status": run.status,
        "changed_files": run.changed_files,
        "config": run.tables(),
        "provenance": run.provenance,
        "generations": run.generations(),
        "test": run.test_result,
    }
