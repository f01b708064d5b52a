"""``conevo behaviours``: the behaviour of a run's fittest team, of each robot and collectively."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from conevo.cli.run_to_end import device_option, seed_option, threads_option
from conevo.worlds.registry import WORLDS

if TYPE_CHECKING:
    from conevo.worlds.study import WorldStudy

__all__ = ["behaviours"]

STUDIED = " or ".join(entry.short_name for entry in WORLDS.values() if entry.studied)
HELP = f"""Classify what the fittest team of RUN does in fresh scenarios; nothing is written.

RUN must be a run of the {STUDIED} world, or of a world that inherits it.

Try: conevo behaviours runs/hunt
"""


@click.command(help=HELP)
@click.argument("run")
@click.option(
    "--scenarios",
    type=click.IntRange(1, 10_000),
    default=20,
    show_default=True,
    help="Number of scenarios.",
)
@seed_option
@threads_option
@device_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def behaviours(
    run: str,
    scenarios: int,
    seed: int | None,
    threads: int | None,
    device: str | None,
    as_json: bool,
) -> None:
    """Classify what the fittest team of a run does."""
    from conevo.cli.lookup import find_run
    from conevo.studies.observation import observe

    of = find_run(run)
    observed = observe(of, scenarios, seed, threads=threads, device=device)
    found = {"run": str(of.path)} | observed.report
    click.echo(json.dumps(found) if as_json else _text(found, observed.study))


def _text(found: dict[str, Any], study: WorldStudy) -> str:
    from conevo.cli.format import table
    from conevo.numbers import number
    from conevo.terms import counted

    measures, parts = study.account(found)
    lines = [
        f"{found['run']}: fittest team (generation {found['generation']}), "
        f"{counted(found['scenarios'], 'fresh scenario')}"
        + "".join(f", {name} {number(value)}" for name, value in measures.items())
    ]
    for line, head, rows in parts:
        lines.append(f"\n{line}")
        if head:
            cells = [[v if isinstance(v, str) else number(v) for v in row] for row in rows]
            lines.append(table(head, cells))
    return "\n".join(lines)
