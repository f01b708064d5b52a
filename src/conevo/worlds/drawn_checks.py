"""Checks whether an epoch of a world can be drawn: a line for each fault."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError, unknown_name
from conevo.playback.check import DAMAGE, DAMAGED, checked
from conevo.terms import NON_SPECIALIZED
from conevo.worlds.drawing import drawing
from conevo.worlds.protocol import Simulator, World
from conevo.worlds.recorded import recorded

__all__ = ["drawn_in_words", "of_drawing"]


def of_drawing(
    played: Simulator,
    genes: npt.NDArray[np.float32],
    team: npt.NDArray[np.int32],
    modes: npt.NDArray[np.int32],
    key: int,
) -> Iterator[str]:
    """Yield the faults in a world's declaration of its drawing.

    Args:
        played: simulator of the world.
        genes: pool of genotypes [K, G].
        team: pool rows [R, U].
        modes: [R] index of a heuristic controller, -1 for the robot's own.
        key: of the scenario.
    """
    world = played.world
    try:
        known, channels, _ = recorded(played, genes, team, key, modes)
        castes: Any = {
            "labels": [NON_SPECIALIZED] * world.n_robots,
            "specialization": [0.0] * world.n_robots,
        }
        checked(drawing(cast("Any", known | castes), channels))
    except UsageError as error:
        yield str(error).removeprefix(f"world {world.name}: ").removeprefix(DAMAGED)
        return
    except DAMAGE as error:
        yield str(error) or type(error).__name__
        return
    names = (*world.actions, *world.castes)
    for name in known.get("drawn", {}).get("colours", {}):
        if name not in names:
            yield str(unknown_name("action or caste", name, names, "in drawn.colours"))


def drawn_in_words(world: World) -> str:
    """Return the names of the drawn things, as in "robots, ball, goal"."""
    drawn: Any = getattr(world, "drawn", None)
    if drawn is None:
        return "robots"
    names = [one.name for one in (*drawn.objects, *drawn.areas, *drawn.signals)]
    return ", ".join(["robots", *names])
