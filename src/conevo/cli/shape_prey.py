"""``conevo shape-prey``: evolve the prey of the pursuit world."""

from __future__ import annotations

from typing import Any

import click

from conevo.cli.options import Order, setting_options
from conevo.cli.run_to_end import output_options

__all__ = ["shape_prey"]


@click.command("shape-prey")
@setting_options
@output_options
def shape_prey(**options: Any) -> None:
    """Run the six prey experiments in turn, each starting from the previous one's populations.

    Everything is written to one directory; prey.npz there holds the evolved prey. After Ctrl-C,
    continue with conevo resume.

    Try: conevo shape-prey --preset smoke
    """
    from conevo.worlds.pursuit.evolved import TASKS

    order = Order(**options)
    order.start([order.resolve(task) for task in TASKS])
