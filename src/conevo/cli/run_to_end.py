"""Common parts of the commands that evolve: options, execution to the end, messages."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from conevo.errors import ConevoError, EnvironmentFailure, UsageError
from conevo.terms import counted, quoted

if TYPE_CHECKING:
    from conevo.runs.run import Run
    from conevo.runs.shaping import Shaping
    from conevo.runs.time_limit import TimeLimit

__all__ = [
    "accept_option",
    "all_of",
    "carry_on",
    "device_option",
    "drop_output",
    "output_options",
    "seed_option",
    "style_of",
    "threads_option",
    "time_limit_option",
]

Function = TypeVar("Function", bound=Callable[..., Any])


def all_of(*options: Callable[[Any], Any]) -> Callable[[Function], Function]:
    """Return a decorator that adds these options to a command, in their order."""

    def add(function: Function) -> Function:
        for option in reversed(options):
            function = option(function)
        return function

    return add


output_options = all_of(
    click.option("--json", "as_json", is_flag=True, help="Print one JSON line per generation."),
    click.option("--quiet", is_flag=True, help="Print only the run's directory."),
    click.option("--verbose", is_flag=True, help="Print one plain line per generation."),
)


accept_option = click.option(
    "--accept-other-code",
    is_flag=True,
    help="Continue results of another version of conevo; show and reports list both.",
)
threads_option = click.option(
    "--threads",
    type=click.IntRange(1, 4096),
    help="CPU threads (default: all); does not change results.",
)
seed_option = click.option(
    "--seed",
    type=click.IntRange(0, 2**63 - 1),
    help="Seed of other scenarios (default: those of the run's own test).",
)


def _known(ctx: click.Context, parameter: click.Parameter, name: str | None) -> str | None:
    """Return the name of a device; None if it is not given."""
    from conevo.kernels.devices import refuse_unknown_device

    if name is not None:
        refuse_unknown_device(name)
    return name


device_option = click.option(
    "--device", metavar="DEVICE", callback=_known,
    help="auto, cpu or cuda (default: that of the run's last session); does not change results.",
)  # fmt: skip


def drop_output() -> None:
    """Redirect standard output to the null device, since its reader has ended."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def style_of(as_json: bool, quiet: bool, verbose: bool) -> str:
    """Return the style of reports: "json", "quiet", "verbose", "live" (a terminal) or "plain"."""
    if as_json + quiet + verbose > 1:
        raise UsageError("--json, --quiet and --verbose are mutually exclusive: give one of them")
    if as_json or quiet or verbose:
        return "json" if as_json else "quiet" if quiet else "verbose"
    return "live" if sys.stdout.isatty() else "plain"


def _begun(ctx: click.Context, parameter: click.Parameter, text: str | None) -> TimeLimit:
    """Return the time limit, which begins now."""
    from conevo.runs.time_limit import TimeLimit, parse_seconds

    return TimeLimit(None if text is None else parse_seconds(text))


time_limit_option = click.option(
    "--time-limit", "limit", metavar="TIME", callback=_begun,
    help="Stop cleanly after a time such as 90s, 10m, 1.5h or 2d, with exit code 0.",
)  # fmt: skip


def carry_on(
    found: Run | Shaping,
    threads: int | None,
    style: str,
    limit: TimeLimit | None,
    length: dict[str, Any] | None = None,
    accept_other_code: bool = False,
    device: str | None = None,
) -> None:
    """Continue a run or a shaping to its end, then print a summary and the next commands.

    Args:
        found: the run or shaping.
        threads: CPU threads, all by default.
        style: as ``style_of`` returns it.
        limit: the time that is left.
        length: new length of a run: arguments of ``Run.extend``.
        accept_other_code: continue results of another version.
        device: by default the one of its last session.
    """
    from conevo.cli.ending import print_end
    from conevo.cli.progress import watching
    from conevo.outside import line_of
    from conevo.runs.run import Run

    plain = f"conevo resume {quoted(found.path)}"
    given = [f" --{name.replace('_', '-')} {value}" for name, value in (length or {}).items()]
    advice = plain + "".join(given)
    how: dict[str, Any] = {"threads": threads, "device": device}
    how["accept_other_code"] = accept_other_code

    def remark(text: str) -> None:
        click.echo(f"conevo: note: {text}", err=True)

    def carry(run: Run, stage: int = 0) -> None:
        nonlocal advice
        of = before = 0
        if not isinstance(found, Run):
            of, before = len(found.outlines), len(found.generations()) - len(run.generations())
        if length:
            run.extend(**length, **how)
            advice = plain  # the run has its new length
        with watching(run, style, stage, of, before) as watch:
            run.resume(time_limit=limit, watch=watch, remark=remark, **how)

    if not length:
        found.refuse_finished()
    elif not isinstance(found, Run):
        raise UsageError(
            f"{found.path} is a shaping, whose stages keep their length; start a run from the "
            f"populations of its last stage: conevo run WORLD/ENVIRONMENT "
            f"--from {quoted(found.path)}"
        )
    found.refuse_other_code(accept_other_code)
    try:
        if isinstance(found, Run):
            carry(found)
        else:
            found.carry_on(carry, **how)
    except (KeyboardInterrupt, BrokenPipeError) as error:
        if isinstance(error, BrokenPipeError):
            drop_output()
        done = counted(len(found.generations()), "generation")
        click.echo(f"interrupted after {done}; continue with: {advice}", err=True)
        sys.exit(130)
    except EnvironmentFailure as error:
        raise EnvironmentFailure(f"{error}; once fixed: {advice}") from error
    except (Exception, SystemExit) as error:
        if isinstance(error, ConevoError) or not (line := line_of(error)):
            raise
        raise UsageError(
            f"{line}; {found.path} keeps its copy of that file as it is: correct yours, and start "
            f"another run"
        ) from error
    if found.status != "finished":
        done = counted(len(found.generations()), "generation")
        click.echo(f"time limit reached after {done}; continue with: {advice}", err=True)
    print_end(found, style)
