"""``conevo test``: re-execute a run's fittest team in fresh scenarios."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from conevo.cli.run_to_end import device_option, seed_option, threads_option
from conevo.errors import UsageError

if TYPE_CHECKING:
    from conevo.runs.run import Run

__all__ = ["test"]


@click.command()
@click.argument("run")
@click.option(
    "--scenarios",
    type=click.IntRange(1, 10_000),
    help="Number of scenarios (default: that of the run's own test).",
)
@seed_option
@threads_option
@device_option
@click.option("--stages", is_flag=True, help="For a shaping: test in every stage's environment.")
@click.option(
    "--on", metavar="ENVIRONMENT",
    help="Also test in another environment: ENVIRONMENT of its world, or WORLD/ENVIRONMENT.",
)  # fmt: skip
@click.option(
    "--set", "settings", metavar="world.KEY=VALUE", multiple=True,
    help="Also test with this setting of the world; may be repeated.",
)  # fmt: skip
@click.option(
    "--robots", type=click.IntRange(1, 64),
    help="Also test a team of N robots: the first N, or all of them repeated.",
)  # fmt: skip
@click.option(
    "--rotate", metavar="K", type=click.IntRange(1, 63), default=None,
    help="Also test with the controller of robot r in robot r + K.",
)  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print one JSON value.")
def test(
    run: str,
    scenarios: int | None,
    seed: int | None,
    threads: int | None,
    device: str | None,
    stages: bool,
    on: str | None,
    settings: tuple[str, ...],
    robots: int | None,
    rotate: int | None,
    as_json: bool,
) -> None:
    """Test the fittest team of RUN (finished or not) in fresh scenarios; nothing is written.

    Of a shaping, it tests the team of the last stage that has one, in that stage's environment.
    With --on, --set, --robots or --rotate it also tests under changed conditions and prints the
    difference. A team of castes loses by --rotate; one whose robots are alike does not.

    Try: conevo test runs/first --set world.iterations=500 --robots 10
    """
    from conevo.cli.lookup import find, find_run
    from conevo.cli.testing_text import conditions_text, stages_test_text, test_text
    from conevo.runs.run import Run

    is_changed = on is not None or bool(settings) or robots is not None or rotate is not None
    if stages:
        if is_changed:
            raise UsageError(
                "--stages and --on, --set, --robots or --rotate exclude each other: leave one out"
            )
        shaping = find(run)
        if isinstance(shaping, Run):
            raise UsageError(f"{shaping.path} is a run; only a shaping has stages")
        for stage in shaping.stages[-1:]:
            note_other_code(stage)
        results = shaping.test(scenarios, seed, threads=threads, device=device)
        click.echo(json.dumps(results) if as_json else stages_test_text(results))
        return
    found = find_run(run)
    note_other_code(found)
    if is_changed:
        from conevo.runs.assignments import parse_assignments

        world = parse_assignments(settings)
        both = found.test_under(
            on, world, robots, scenarios, seed, rotate=rotate or 0, threads=threads, device=device
        )
        click.echo(json.dumps(both) if as_json else conditions_text(found, both))
        return
    result = found.test(scenarios, seed, threads=threads, device=device)
    click.echo(json.dumps(result) if as_json else test_text({"champion": result}))


def note_other_code(run: Run) -> None:
    """Print a note if other code made a run; refuse a world of an earlier version."""
    from conevo.runs.code import last_code, other_code
    from conevo.worlds.registry import refuse_earlier

    refuse_earlier(run.outline.task, run.path)
    if problem := other_code(run.path, last_code(run.provenance)):
        click.echo(f"conevo: note: {problem}", err=True)
