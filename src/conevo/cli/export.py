"""``conevo export``: a run's team as a file that runs without conevo."""

from __future__ import annotations

from pathlib import Path

import click

__all__ = ["export"]


@click.command()
@click.argument("run")
@click.option(
    "--to", "to", metavar="FILE", required=True,
    help="File to write: .py (needs numpy alone), .npz, .onnx, .pt2 (PyTorch) or .h (C).",
)  # fmt: skip
@click.option(
    "--generation", type=click.IntRange(0, 2**31 - 1), metavar="G",
    help="Export the fittest team of generation G (default: the champion).",
)  # fmt: skip
@click.option(
    "--robot", type=click.IntRange(0, 2**31 - 1), metavar="I",
    help="Export the controller of one robot, counted from 0 (default: all).",
)  # fmt: skip
@click.option(
    "--fast", is_flag=True,
    help="Fewer operations in .onnx and .pt2; results differ from the simulator's.",
)  # fmt: skip
def export(run: str, to: str, generation: int | None, robot: int | None, fast: bool) -> None:
    """Write the controllers of RUN's fittest team to a file that runs without conevo.

    They map observations [robots, sensors] and a context to outputs and the next context, bit for
    bit as in the simulator. Existing files are never overwritten.

    Try: conevo export runs/first --to team.py
    """
    from conevo.cli.epoch_options import bar
    from conevo.cli.lookup import find_run
    from conevo.cli.test import note_other_code
    from conevo.export import files
    from conevo.export.team import evolved_team

    path = Path(to)
    files.format_of(path, fast)
    found = find_run(run)
    note_other_code(found)
    with bar(f"evolving {found.path.name} again") as progress:
        team = evolved_team(found, generation, robot, progress=progress)
    click.echo(files.export(team, path, fast=fast))
