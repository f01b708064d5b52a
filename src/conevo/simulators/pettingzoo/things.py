"""Positions and looks of the agents and things of a PettingZoo task, where the task has them.

Particle worlds (MPE) and tasks built like them have a world with agents and landmarks, each with a
position, a size and a colour.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.simulators.particles import TaskLook, Thing, thing

__all__ = ["look_of", "places_of"]

Floats = npt.NDArray[np.float32]


def look_of(env: Any) -> TaskLook | None:
    """Return the look of a task, None if it has no positions."""
    world = _world_of(env)
    if world is None:
        return None
    agents, landmarks = (tuple(map(_thing, things)) for things in (world.agents, world.landmarks))
    return TaskLook(agents, landmarks, float(getattr(world, "dt", 0.0)))


def places_of(env: Any) -> Floats:
    """Return the positions of agents, then landmarks [K, 2]; none if unknown."""
    world = _world_of(env)
    if world is None:
        return np.zeros((0, 2), np.float32)
    things = (*world.agents, *world.landmarks)
    return np.stack([np.asarray(one.state.p_pos, np.float32) for one in things])


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
    colour = np.nan_to_num(np.resize(np.asarray(one.color, np.float64), 3))
    return thing(str(one.name), float(one.size), colour)
