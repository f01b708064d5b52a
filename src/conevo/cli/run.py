"""``conevo run``: evolve a team and test it."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import click

from conevo.cli.carry import carry_on, output_options, style_of

__all__ = ["run"]


@click.command(short_help="Evolve a team and test it.")
@click.argument("world", metavar="WORLD/ENVIRONMENT", required=False)
@click.option(
    "--method", metavar="NAME", help="cone (default), mesp, ccga, hetcne, homcne, cone-1..3."
)
@click.option(
    "--preset", metavar="NAME", help="smoke (seconds), desk (minutes, default), night, thesis."
)
@click.option("--seed", type=int, help="Root of all randomness (default 1).")
@click.option(
    "--set", "settings", metavar="KEY=VALUE", multiple=True,
    help="One setting, for example run.generations=5; may be repeated.",
)  # fmt: skip
@click.option(
    "--config", metavar="FILE", help="TOML file with settings, such as a run's config.toml."
)
@click.option("--budget-evaluations", type=int, help="Spend at most this many team evaluations.")
@click.option(
    "--threads", type=click.IntRange(1), help="CPU threads (default all); changes no result."
)
@click.option("--device", default="cpu", show_default=True, help="cpu or cuda.")
@click.option("--out", metavar="DIR", help="The run's directory (default: a new one in runs/).")
@output_options
def run(
    world: str | None,
    method: str | None,
    preset: str | None,
    seed: int | None,
    settings: tuple[str, ...],
    config: str | None,
    budget_evaluations: int | None,
    threads: int | None,
    device: str,
    out: str | None,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Evolve a team for WORLD/ENVIRONMENT (see: conevo list worlds) and test it.

    Everything is kept in one directory. Ctrl-C leaves a run that conevo resume continues.
    """
    from conevo.runs.config import parse_assignment, resolve
    from conevo.runs.run import start

    style = style_of(as_json, quiet, verbose)
    overrides = dict(parse_assignment(text) for text in settings)
    if budget_evaluations is not None:
        overrides["run.budget_evaluations"] = budget_evaluations
    resolved = resolve(
        world, method, preset, seed, file=config, overrides=overrides, place="on the command line"
    )
    command = shlex.join(["conevo", *sys.argv[1:]])
    path = Path(out) if out else None
    carry_on(start(resolved, path, threads=threads, device=device, command=command), threads, style)
