"""The prey that the six experiments of prey shaping end with, in one file.

Nitschke 2009, section 4.3: experiments 1 to 3 shape one prey, 4 to 6 two. The champions of the
third and of the sixth are what the predators of the pursuit world are then set on.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from conevo.errors import UsageError

if TYPE_CHECKING:
    from conevo.runs.config import RunConfig
    from conevo.runs.run import Run

__all__ = ["PREY", "PREY_TASKS", "refuse_other_prey", "save_prey"]

PREY = "prey.npz"
PREY_TASKS = tuple(f"prey-v1/shaping-{number}" for number in range(1, 7))


def refuse_other_prey(stages: Sequence[RunConfig]) -> None:
    """Raise UsageError unless the prey are networks such as a prey file holds."""
    from conevo.worlds.pursuit.prey_sets import WEIGHT_SCALE

    right = {"name": "srn", "recurrent": False, "bias": False, "weight_scale": WEIGHT_SCALE}
    for stage in stages:
        table = stage.tables()["controller"]
        for key, value in right.items():
            if table.get(key) != value:
                raise UsageError(
                    f"controller.{key} = {table.get(key)!r}: prey of the pursuit world are "
                    f"feed-forward networks with controller.{key} = {value!r}"
                )


def save_prey(stages: Sequence[Run], path: Path) -> None:
    """Write the evolved prey of six finished stages.

    The file says what made it, but neither when nor on which machine, so that the same command
    writes the same bytes.
    """
    from conevo.worlds.pursuit.prey_sets import PreySet, save

    one, two = (stages[k].champion for k in (2, 5))
    if one is None or two is None:
        raise RuntimeError("a stage is not finished")
    made_with, config = stages[5].provenance, stages[5].config
    about: dict[str, Any] = {
        "command": made_with["command"],
        "method": config.method,
        "preset": config.preset,
        "seed": config.run.seed,
        "run_ids": [stage.config.run_id for stage in stages],
        "generations": [one.generation, two.generation],
    }
    about |= {key: made_with[key] for key in ("conevo", "python", "numpy", "warp", "kernel_hash")}
    prey = PreySet(
        one=one.genes,
        one_active=one.active,
        two=two.genes,
        two_active=two.active,
        about=about,
    )
    save(path, prey)
