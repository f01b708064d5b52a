"""Positions of the agents and things of a PettingZoo task, where the task has them.

Particle worlds (MPE) and tasks built like them have a world with agents and landmarks, each with a
position, a size and a colour.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["TaskLook", "Thing", "look_of", "places_of"]

Floats = npt.NDArray[np.float32]


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


def look_of(env: Any) -> TaskLook | None:
    """Return the look of a task, None if it has no positions."""
    world = _world_of(env)
    if world is None:
        return None
    agents, landmarks = (tuple(map(_thing, things)) for things in (world.agents, world.landmarks))
    return TaskLook(agents, landmarks, float(getattr(world, "dt", 0.0)))


def places_of(env: Any) -> dict[str, Floats]:
    """Return positions: agents [agents, 2] and landmarks [K, 2]; nothing if unknown."""
    world = _world_of(env)
    if world is None:
        return {}
    return {name: _positions(getattr(world, name)) for name in ("agents", "landmarks")}


def _positions(things: list[Any]) -> Floats:
    found = [np.asarray(one.state.p_pos, np.float32) for one in things]
    return np.stack(found) if found else np.zeros((0, 2), np.float32)


def _world_of(env: Any) -> Any:
    """Return the world of an environment, None if its agents have no positions in a plane."""
    inside = getattr(getattr(env, "aec_env", env), "unwrapped", env)
    world: Any = getattr(inside, "world", None)
    try:
        agents, landmarks = list(world.agents), list(world.landmarks)
        is_plane = all(np.shape(one.state.p_pos) == (2,) for one in (*agents, *landmarks))
        is_whole = [one.name for one in agents] == list(env.possible_agents)
    except AttributeError:
        return None
    return world if is_plane and is_whole else None


def _thing(one: Any) -> Thing:
    words = [word for word in str(one.name).replace("_", " ").split() if not word.isdigit()]
    colour = np.nan_to_num(np.resize(np.asarray(one.color, np.float64), 3))
    red, green, blue = (round(255 * min(max(part, 0.0), 1.0)) for part in colour.tolist())
    return Thing(" ".join(words) or "thing", float(one.size), f"#{red:02x}{green:02x}{blue:02x}")
