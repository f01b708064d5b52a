"""Positions of the robots and things of a VMAS scenario, and their drawing."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from vmas.simulator.core import Box, Line, Sphere
from vmas.simulator.environment import Environment

from conevo.playback.drawn import Drawn, Objects

__all__ = ["drawn_of", "places_of", "scenario_text"]

ALONG = 25  # discs with which a line or a box that is not square is drawn
LINE = 0.015
ZOOM = 1.2  # VMAS' own, where a scenario has no ends


def scenario_text(env: Environment) -> str:
    """Return the text of a scenario's file."""
    return Path(type(env.scenario).make_world.__code__.co_filename).read_text("utf-8")


def things_of(env: Environment) -> list[Any]:
    """Return what is drawn next to the robots: landmarks, and agents that the scenario moves."""
    return [*env.world.scripted_agents, *env.world.landmarks]


def places_of(env: Environment) -> dict[str, npt.NDArray[np.float32]]:
    """Return positions in the first environment.

    Returns:
        x and y of robots [R]; of all discs and squares of things their positions things_x and
        things_y, and things_taken, 1 where VMAS does not show the thing any more.
    """
    robots = np.stack([agent.state.pos[0].numpy() for agent in env.agents])
    found = {"x": robots[:, 0].copy(), "y": robots[:, 1].copy()}
    if things := things_of(env):
        parts = [_points(one) for one in things]
        points = np.concatenate(parts)
        found |= {"things_x": points[:, 0].copy(), "things_y": points[:, 1].copy()}
        taken = [
            [not bool(one.is_rendering[0])] * len(part)
            for one, part in zip(things, parts, strict=True)
        ]
        found["things_taken"] = np.concatenate(taken).astype(np.float32)
    return found


def _points(thing: Any) -> npt.NDArray[np.float32]:
    """Return where a thing is drawn [K, 2]: at its centre, or along its longer side."""
    centre: npt.NDArray[np.float32] = thing.state.pos[0].numpy()
    half, angle = _half_length(thing.shape), float(thing.state.rot[0, 0])
    if not half:
        return centre[None]
    upright = isinstance(thing.shape, Box) and thing.shape.width > thing.shape.length
    angle += math.pi / 2 * upright
    way = np.array([math.cos(angle), math.sin(angle)])
    points: npt.NDArray[np.float32] = centre + np.linspace(-half, half, ALONG)[:, None] * way
    return points.astype(np.float32)


def _half_length(shape: Any) -> float:
    """Return how far discs reach along a shape, 0 for one disc or square."""
    if isinstance(shape, Line):
        return float(shape.length) / 2
    if isinstance(shape, Box):
        long, short = _sides(shape)
        return (long - short) / 2 if long > 1.5 * short else 0.0
    return 0.0


def _sides(shape: Any) -> tuple[float, float]:
    """Return the longer and the shorter side of a box."""
    return max(shape.length, shape.width), min(shape.length, shape.width)


def _size(shape: Any) -> float:
    """Return the radius of a disc, or half the side of a square."""
    if isinstance(shape, Sphere):
        return float(shape.radius)
    if isinstance(shape, Line):
        return LINE  # its width is in pixels
    if isinstance(shape, Box):
        return max(_sides(shape)[1] / 2, 0.01)
    return float(shape.circumscribed_radius())


def drawn_of(env: Environment) -> Drawn:
    """Return the drawing of a scenario: things of one name and look together."""
    takes = "is_rendering" in scenario_text(env)  # it has things that are taken away
    objects, first = [], 0
    for (name, shape, size, colour), group in itertools.groupby(things_of(env), _look):
        things = list(group)
        n = sum(ALONG if _half_length(one.shape) else 1 for one in things)
        place = f"[{first}:{first + n}]"
        first += n
        objects.append(
            Objects(
                name,
                f"things_x{place}",
                f"things_y{place}",
                size=size,
                shape="square" if shape == "square" else "disc",
                colours=(colour,),
                state=f"things_taken{place}" if takes else "",
                states=("there", "taken") if takes else (),
            )
        )
    world, radius = env.world, max(_size(agent.shape) for agent in env.agents)
    x, y = (
        radius + (float(end) if end is not None else ZOOM * float(env.scenario.viewer_zoom))
        for end in (world.x_semidim, world.y_semidim)
    )
    return Drawn(
        objects=tuple(objects),
        seconds=float(world.dt),
        bounds=(-x, -y, x, y),
        radius=radius,
    )


def _look(thing: Any) -> tuple[str, str, float, str]:
    """Return name without number, shape, size and colour of a thing."""
    words = [word for word in thing.name.replace("_", " ").split() if not word.isdigit()]
    is_square = isinstance(thing.shape, Box) and not _half_length(thing.shape)
    colour = np.asarray(getattr(thing.color, "value", thing.color), np.float64)
    own = colour if colour.ndim == 1 else colour[0]  # or one for each environment
    red, green, blue = (round(255 * min(max(part, 0.0), 1.0)) for part in own[:3].tolist())
    shape = "square" if is_square else "disc"
    return " ".join(words) or "thing", shape, _size(thing.shape), f"#{red:02x}{green:02x}{blue:02x}"
