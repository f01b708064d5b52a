"""What ``run`` and ``resume`` share: carry a run on while someone watches, and end clearly."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from conevo.errors import EnvironmentFailure, UsageError

if TYPE_CHECKING:
    from conevo.runs.run import Run

__all__ = ["carry_on", "output_options", "style_of"]

Function = TypeVar("Function", bound=Callable[..., Any])


def output_options(function: Function) -> Function:
    """Add --json, --quiet and --verbose to a command."""
    for option in (
        click.option("--verbose", is_flag=True, help="One plain line for every generation."),
        click.option("--quiet", is_flag=True, help="Print only the run's directory."),
        click.option("--json", "as_json", is_flag=True, help="One JSON object per generation."),
    ):
        function = option(function)
    return function


def style_of(as_json: bool, quiet: bool, verbose: bool) -> str:
    """Return how to report: "json", "quiet", "verbose", "live" (a terminal) or "plain"."""
    if as_json + quiet + verbose > 1:
        raise UsageError("--json, --quiet and --verbose exclude each other")
    if as_json or quiet or verbose:
        return "json" if as_json else "quiet" if quiet else "verbose"
    return "live" if sys.stdout.isatty() else "plain"


def carry_on(run: Run, threads: int | None, style: str) -> None:
    """Carry a run on to its end, then print its summary and what can be done next."""
    from conevo.cli.progress import watching
    from conevo.cli.summary import print_end

    def remark(text: str) -> None:
        click.echo(f"conevo: note: {text}", err=True)

    run.refuse_finished()
    advice = f"conevo resume {run.path}"
    try:
        with watching(run, style) as watch:
            run.resume(threads=threads, watch=watch, remark=remark)
    except KeyboardInterrupt:
        count = len(run.generations())
        click.echo(f"interrupted after {count} generations; continue with: {advice}", err=True)
        sys.exit(130)
    except EnvironmentFailure as error:
        raise EnvironmentFailure(f"{error}; when that is mended: {advice}") from error
    print_end(run, style)
