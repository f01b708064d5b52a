"""``conevo run``: evolve a team and test it."""

from __future__ import annotations

from typing import Any

import click

from conevo.cli.options import Order, setting_options
from conevo.cli.run_to_end import output_options
from conevo.errors import UsageError

__all__ = ["run"]


@click.command()
@click.argument("world", metavar="WORLD/ENVIRONMENT", required=False)
@setting_options
@click.option(
    "--prey", metavar="NAME|FILE",
    help="Prey of the pursuit world: shaped (default), heuristic, random, or a file of shape-prey.",
)  # fmt: skip
@click.option(
    "--shape", is_flag=True,
    help="Evolve in stages: the environments of its family from number 1 up to this one.",
)  # fmt: skip
@click.option(
    "--first", metavar="NAME",
    help="Evolve a first stage by this method; --method begins with its champion, budget shared.",
)  # fmt: skip
@click.option("--from", "origin", metavar="RUN", help="Start from the final populations of RUN.")
@click.option(
    "--from-champion", "champion", metavar="RUN",
    help="Start from populations bred from the champion of RUN.",
)  # fmt: skip
@click.option("--dry-run", is_flag=True, help="Print all settings and their cost; start nothing.")
@click.option(
    "--seeds", type=click.IntRange(1, 10_000), metavar="N",
    help="Compare: N runs of each method (--method cone,mesp), as a campaign on all cores.",
)  # fmt: skip
@click.option(
    "--track", metavar="TRACKER",
    help="Start conevo track --follow for it: tensorboard, wandb or mlflow; does not change "
    "results.",
)  # fmt: skip
@output_options
def run(
    world: str | None,
    prey: str | None,
    shape: bool,
    first: str | None,
    origin: str | None,
    champion: str | None,
    dry_run: bool,
    seeds: int | None,
    **options: Any,
) -> int | None:
    """Evolve a team for WORLD/ENVIRONMENT (see: conevo list worlds) and test it.

    Everything is written to one directory. After Ctrl-C, continue with conevo resume. With --shape,
    every stage is a run of its own and all settings apply to each stage. With --first there are
    two, and settings of the method apply to the second (--set first_share=0.5: the first's share of
    the budget). With --seeds, the runs form a campaign in campaigns/; conevo campaign start
    continues it and conevo report reports it.

    Try: conevo run rover/complex-1 --method cone,homcne --seeds 3
    """
    if origin is not None and champion is not None:
        raise UsageError("--from and --from-champion are mutually exclusive: give one of them")
    if (origin or champion) and (shape or seeds is not None):
        raise UsageError("--from and --from-champion start one run: leave out --shape and --seeds")
    if first is not None and (shape or origin or champion or seeds is not None):
        raise UsageError(
            "--first starts one run of two stages: leave out --shape, --from, --from-champion and "
            "--seeds (a plan compares such runs: docs/campaigns.md)"
        )
    order = Order(**options, comparing=seeds is not None)
    if prey is not None and world is not None:
        from conevo.worlds.registry import resolve

        entry, _ = resolve(world)
        if not hasattr(entry.params_class, "prey"):
            raise UsageError(f"--prey {prey!r}: {entry.name} has no prey to choose")
    order.take("world.prey", "--prey", prey)
    stages = [] if first is None else order.resolve_both(world, first)
    config = stages[-1] if stages else order.resolve(world)
    if not dry_run and config.entry.files:
        from conevo.worlds.checking import refuse_wild_indices

        refuse_wild_indices(config.entry, config.environment, config.world_params)
    if seeds is not None:
        from conevo.cli.comparison import compare, plan_of

        return compare(order, plan_of(order, config, seeds, shape), dry_run)
    if shape:
        from conevo.runs.shaping import tasks_up_to

        stages = [order.resolve(task) for task in tasks_up_to(config.address)]
    act = order.print_only if dry_run else order.start
    act(stages or [config], origin or champion, of_champion=champion is not None)
    return None
