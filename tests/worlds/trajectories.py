"""Trajectories written by hand: every body is a script of wheels and refusals, driven on arcs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.worlds.pursuit.study.behaviours import ArenaSizes

RADIUS, AXLE, SPEED, PREY_SPEED = 2.75, 5.3, 0.8, 0.96
Step = tuple[float, float, int]  # left wheel, right wheel, whether the move is refused

STOP: Step = (0.0, 0.0, 0)
AHEAD: Step = (1.0, 1.0, 0)
PRESS: Step = (1.0, 1.0, 1)


def sizes(n_predators: int = 2, arena: float = 200.0) -> ArenaSizes:
    """Return a wide arena."""
    return ArenaSizes(n_predators, arena, 22.0, SPEED, RADIUS, AXLE)


def body(
    x: float, y: float, degrees: float, script: Sequence[Step], speed: float = SPEED
) -> dict[str, npt.NDArray[Any]]:
    """Return the trajectory of a body with this script from this pose, [T] each."""
    heading = math.radians(degrees)
    rows = []
    for left, right, refused in script:
        if not refused:
            turn = speed * (right - left) / AXLE
            d = speed * (left + right) / 2
            if turn:
                radius = d / turn
                x += radius * (math.sin(heading + turn) - math.sin(heading))
                y += radius * (math.cos(heading) - math.cos(heading + turn))
            else:
                x, y = x + d * math.cos(heading), y + d * math.sin(heading)
            heading = (heading + turn + math.pi) % (2 * math.pi) - math.pi
        rows.append((x, y, heading, left, right, refused))
    names = ("x", "y", "heading", "left", "right", "collided")
    return dict(zip(names, np.array(rows, dtype=np.float32).T, strict=True))


def record(*bodies: dict[str, npt.NDArray[Any]], captured: Any = None) -> dict[str, Any]:
    """Return bodies, predators first, as a record [T, B]."""
    joined = {name: np.stack([one[name] for one in bodies], axis=1) for name in bodies[0]}
    joined["collided"] = joined["collided"].astype(np.int32)
    t = len(joined["x"])
    joined["captured"] = np.zeros((t, 1), dtype=np.int32) if captured is None else captured
    return joined


def around(
    prey: tuple[float, float], bearing: float, gap: float, prey_degrees: float = 0.0
) -> tuple[float, float]:
    """Return the place at a gap from a prey, at this bearing from its heading, in degrees."""
    angle = math.radians(prey_degrees + bearing)
    far = gap + 2 * RADIUS
    return prey[0] + far * math.cos(angle), prey[1] + far * math.sin(angle)
