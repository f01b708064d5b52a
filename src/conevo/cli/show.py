"""``conevo show``: print a finished or running run."""

from __future__ import annotations

import json

import click

__all__ = ["show"]


@click.command(short_help="Print a finished or running run.")
@click.argument("run")
@click.option("--rows", type=click.IntRange(2), default=12, show_default=True, help="Generations.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def show(run: str, rows: int, as_json: bool) -> None:
    """Print RUN: state, generations, castes, thresholds and testing phase."""
    from conevo.cli.find import find_run
    from conevo.cli.summary import run_text

    found = find_run(run)
    if not as_json:
        click.echo(run_text(found, rows))
        return
    everything = {
        "run": str(found.path),
        "status": found.status,
        "changed_files": found.changed_files,
        "config": found.config.tables(),
        "provenance": found.provenance,
        "generations": found.generations(),
        "test": found.test_result,
    }
    click.echo(json.dumps(everything))
