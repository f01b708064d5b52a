"""The evolved prey of the six experiments of prey shaping, in one file.

Nitschke 2009, section 4.3: experiments 1 to 3 shape one prey, 4 to 6 two. The champions of the
third and of the sixth are the prey of the pursuit world.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from conevo.errors import UsageError
from conevo.worlds.pursuit import prey_sets

__all__ = ["FILE", "TASKS", "USE", "refuse", "save"]

FILE = "prey.npz"
USE = ("conevo run pursuit/team-3 --prey {file}", "set predators on the evolved prey")
TASKS = tuple(f"prey-v2/shaping-{number}" for number in range(1, 7))


def refuse(stages: Sequence[Any]) -> None:
    """Raise UsageError unless the stages' configurations have networks that fit into the file."""
    right = {
        "name": "srn",
        "recurrent": False,
        "bias": False,
        "weight_scale": prey_sets.WEIGHT_SCALE,
    }
    for stage in stages:
        table = stage.tables()["controller"]
        for key, value in right.items():
            if table.get(key) != value:
                raise UsageError(
                    f"controller.{key} = {table.get(key)!r}: prey of the pursuit world are "
                    f"feed-forward networks with controller.{key} = {value!r}"
                )


def save(stages: Sequence[Any], path: Path) -> None:
    """Write the evolved prey of six finished stages, which are runs.

    The file records the command and versions that made it, but neither time nor machine, so that
    the same command writes the same bytes.
    """
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
    prey = prey_sets.PreySet(
        one=one.genes,
        one_active=one.active,
        two=two.genes,
        two_active=two.active,
        about=about,
    )
    prey_sets.save(path, prey)
