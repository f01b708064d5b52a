"""``conevo resume``: continue an interrupted run."""

from __future__ import annotations

import click

from conevo.cli.carry import accept_option, carry_on, output_options, style_of

__all__ = ["resume"]


@click.command(short_help="Continue an interrupted run, to the bit.")
@click.argument("run")
@click.option(
    "--threads", type=click.IntRange(1), help="CPU threads (default all); changes no result."
)
@accept_option
@output_options
def resume(
    run: str,
    threads: int | None,
    accept_other_code: bool,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Continue RUN (a directory, or the beginning of its name in runs/) from its last checkpoint.

    The result is the same, to the bit, as that of a run that was never interrupted.
    """
    from conevo.cli.find import find

    carry_on(find(run), threads, style_of(as_json, quiet, verbose), accept_other_code)
