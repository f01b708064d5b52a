"""``conevo test``: re-execute a run's fittest team in fresh scenarios."""

from __future__ import annotations

import json

import click

__all__ = ["test"]


@click.command(short_help="Re-execute a run's fittest team in fresh scenarios.")
@click.argument("run")
@click.option(
    "--scenarios", type=click.IntRange(1, 10_000), help="How many (default: as the run's own test)."
)
@click.option(
    "--seed",
    type=click.IntRange(0, 2**63 - 1),
    help="Draw other scenarios than the run's own test.",
)
@click.option(
    "--threads", type=click.IntRange(1, 4096), help="CPU threads (default all); changes no result."
)
@click.option("--stages", is_flag=True, help="Of a shaping: in the environment of every stage.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON value.")
def test(
    run: str,
    scenarios: int | None,
    seed: int | None,
    threads: int | None,
    stages: bool,
    as_json: bool,
) -> None:
    """Re-execute the fittest team of RUN (finished or not) in fresh scenarios; writes nothing.

    Of a shaping it is the team of the last stage that has one, in that stage's environment.
    """
    from conevo.cli.find import find_run, find_shaping
    from conevo.cli.stages import stages_test_text
    from conevo.cli.summary import test_text

    if stages:
        results = find_shaping(run).test(scenarios, seed, threads=threads)
        click.echo(json.dumps(results) if as_json else stages_test_text(results))
        return
    found = find_run(run)
    result = found.test(scenarios, seed, threads=threads)
    click.echo(json.dumps(result) if as_json else test_text({"champion": result}))
