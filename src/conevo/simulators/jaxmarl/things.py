"""Positions and looks of the agents and landmarks of a JaxMARL task, where the task has them."""

from __future__ import annotations

from typing import Any

import numpy as np

from conevo.simulators.particles import TaskLook, thing

__all__ = ["PARTICLES", "look_of"]

PARTICLES = "MPE_"  # the particle worlds: the first letters of their names
GREY = (0.5, 0.5, 0.5)


def look_of(env: Any, state: Any) -> TaskLook | None:
    """Return the look of a task, None if it has no positions.

    Args:
        env: the task's environment.
        state: its state, or the shapes of it.
    """
    names = [*env.agents, *getattr(env, "landmarks", ())]
    if getattr(getattr(state, "p_pos", None), "shape", None) != (len(names), 2):
        return None
    sizes = np.asarray(env.rad, np.float64).tolist()
    colours = [np.asarray(colour, np.float64) / 255 for colour in env.colour]
    if [colour.shape for colour in colours] != [(3,)] * len(names):  # those of simple_push are not
        colours = [np.array(GREY)] * len(names)
    things = [thing(*one) for one in zip(names, sizes, colours, strict=True)]
    n = len(env.agents)
    return TaskLook(tuple(things[:n]), tuple(things[n:]), float(env.dt))
