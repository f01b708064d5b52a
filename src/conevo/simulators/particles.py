"""Tasks whose agents and landmarks are discs in a plane, as in the particle worlds (MPE)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.playback.drawn import Drawn, Objects

__all__ = ["TaskLook", "Thing", "drawn_of", "placed", "thing"]

REACH = 2.0  # Choice: half the side of the drawn part of a particle world, which has no end


@dataclass(frozen=True)
class Thing:
    """The look of an agent or a landmark: name, radius, and colour as "#rrggbb"."""

    name: str
    size: float
    colour: str


@dataclass(frozen=True)
class TaskLook:
    """The look of a task: its agents, its landmarks, and the seconds of an iteration."""

    agents: tuple[Thing, ...]
    landmarks: tuple[Thing, ...]
    seconds: float


def thing(name: str, size: float, colour: npt.NDArray[Any]) -> Thing:
    """Return the look of an agent or a landmark.

    Args:
        name: its name; a number in it is left out, so that alike things are drawn together.
        size: radius.
        colour: red, green and blue from 0 to 1.
    """
    words = [word for word in name.replace("_", " ").split() if not word.isdigit()]
    red, green, blue = (round(255 * min(max(part, 0.0), 1.0)) for part in colour.tolist())
    return Thing(" ".join(words) or "thing", size, f"#{red:02x}{green:02x}{blue:02x}")


def drawn_of(look: TaskLook, team: tuple[int, ...]) -> Drawn:
    """Return the drawing of a task: other agents, then landmarks, alike ones together.

    Args:
        look: of the task.
        team: places of the robots among the agents.
    """
    others = [one for k, one in enumerate(look.agents) if k not in team]
    objects, first = [], 0
    for one, alike in itertools.groupby([*others, *look.landmarks]):
        last = first + len(list(alike))
        place = f"[{first}:{last}]"
        first = last
        objects.append(
            Objects(
                one.name,
                f"things_x{place}",
                f"things_y{place}",
                size=one.size,
                colours=(one.colour,),
            )
        )
    return Drawn(
        objects=tuple(objects),
        seconds=look.seconds,
        bounds=(-REACH, -REACH, REACH, REACH),
        radius=max(look.agents[k].size for k in team),
    )


def placed(
    places: npt.NDArray[np.float32], team: tuple[int, ...]
) -> dict[str, npt.NDArray[np.float32]]:
    """Return the positions of robots and things under the names by which they are drawn.

    Args:
        places: of all agents, then of landmarks [K, 2]. If there are none, the task has no
            positions, and robots are in a row.
        team: places of the robots among the agents.
    """
    if not len(places):
        row = (np.arange(len(team), dtype=np.float32) + 1) / np.float32(len(team) + 1)
        return {"x": row, "y": np.full_like(row, 0.5)}
    robots, things = places[list(team)], np.delete(places, list(team), axis=0)
    return {
        "x": robots[:, 0].copy(),
        "y": robots[:, 1].copy(),
        "things_x": things[:, 0].copy(),
        "things_y": things[:, 1].copy(),
    }
