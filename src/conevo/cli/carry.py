"""What the verbs that evolve share: carry on while someone watches, and end clearly."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from conevo.errors import EnvironmentFailure, UsageError

if TYPE_CHECKING:
    from conevo.runs.run import Run
    from conevo.runs.shaping import Shaping

__all__ = ["accept_option", "carry_on", "output_options", "style_of"]

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


def accept_option(function: Function) -> Function:
    """Add --accept-other-code to a command that continues something."""
    return click.option(
        "--accept-other-code",
        is_flag=True,
        help="Continue what another version of conevo began; it is recorded and shown.",
    )(function)


def style_of(as_json: bool, quiet: bool, verbose: bool) -> str:
    """Return how to report: "json", "quiet", "verbose", "live" (a terminal) or "plain"."""
    if as_json + quiet + verbose > 1:
        raise UsageError("--json, --quiet and --verbose exclude each other")
    if as_json or quiet or verbose:
        return "json" if as_json else "quiet" if quiet else "verbose"
    return "live" if sys.stdout.isatty() else "plain"


def carry_on(
    found: Run | Shaping, threads: int | None, style: str, accept_other_code: bool = False
) -> None:
    """Carry a run or a shaping on to its end, then print a summary and what can be done next."""
    from conevo.cli.progress import watching
    from conevo.cli.stages import print_shaping_end
    from conevo.cli.summary import print_end
    from conevo.runs.run import Run

    def remark(text: str) -> None:
        click.echo(f"conevo: note: {text}", err=True)

    def carry(run: Run, stage: int = 0) -> None:
        of = before = 0
        if not isinstance(found, Run):
            of, before = len(found.outlines), len(found.generations()) - len(run.generations())
        with watching(run, style, stage, of, before) as watch:
            run.resume(
                threads=threads,
                watch=watch,
                remark=remark,
                accept_other_code=accept_other_code,
            )

    found.refuse_finished()
    if not accept_other_code:
        found.refuse_other_code()
    advice = f"conevo resume {found.path}"
    try:
        if isinstance(found, Run):
            carry(found)
        else:
            found.carry_on(carry, threads, accept_other_code)
    except KeyboardInterrupt:
        runs = [found] if isinstance(found, Run) else found.stages
        count = sum(len(run.generations()) for run in runs)
        click.echo(f"interrupted after {count} generations; continue with: {advice}", err=True)
        sys.exit(130)
    except EnvironmentFailure as error:
        raise EnvironmentFailure(f"{error}; when that is mended: {advice}") from error
    if isinstance(found, Run):
        print_end(found, style)
    else:
        print_shaping_end(found, style)
