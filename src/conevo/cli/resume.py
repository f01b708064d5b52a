"""``conevo resume``: continue an interrupted run, or a finished one beyond its end."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from conevo.cli.run_to_end import (
    accept_option,
    carry_on,
    device_option,
    output_options,
    style_of,
    threads_option,
    time_limit_option,
)
from conevo.errors import UsageError

if TYPE_CHECKING:
    from conevo.runs.time_limit import TimeLimit

__all__ = ["resume"]


@click.command()
@click.argument("run")
@click.option(
    "--generations",
    type=click.IntRange(1, 10_000_000),
    help="New length of the whole run, in generations.",
)
@click.option(
    "--budget-evaluations", type=click.IntRange(0, 2**63 - 1),
    help="New budget of the whole run, in team evaluations; 0: no limit.",
)  # fmt: skip
@click.option("--target", metavar="VALUE|none", help="New task performance at which the run ends.")
@time_limit_option
@threads_option
@device_option
@accept_option
@output_options
def resume(
    run: str,
    generations: int | None,
    budget_evaluations: int | None,
    target: str | None,
    limit: TimeLimit,
    threads: int | None,
    device: str | None,
    accept_other_code: bool,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Continue RUN (a directory, or the beginning of its name in runs/) from its last checkpoint.

    The result is the same, bit for bit, as that of a run that was never interrupted, on whatever
    device. With --generations or --budget-evaluations a finished run is extended; its result is
    then that of a run planned that long.

    Try: conevo resume runs/first --generations 100
    """
    from conevo.cli.lookup import find

    length: dict[str, Any] = {
        "generations": generations,
        "budget_evaluations": budget_evaluations,
        "target": None if target is None else _target(target),
    }
    length = {name: value for name, value in length.items() if value is not None}
    style = style_of(as_json, quiet, verbose)
    carry_on(find(run), threads, style, limit, length, accept_other_code, device)


def _target(text: str) -> float | str:
    if text == "none":
        return text
    try:
        return float(text)
    except ValueError as error:
        raise UsageError(f"--target {text!r}: expected a number, or none") from error
