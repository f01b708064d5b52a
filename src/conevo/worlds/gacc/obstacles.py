"""Obstacles of gathering and construction: rectangles at random places, for many scenarios."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError
from conevo.worlds.places import NoRoom, first_that_fits

__all__ = ["Blocks", "are_clear", "draw_obstacles"]

Blocks = npt.NDArray[np.float64]  # [E, n, 4]: left, bottom, right, top, in sides of the square


def draw_obstacles(
    keys: npt.NDArray[np.uint64], n: int, home: float, sides: tuple[float, float], gap: float
) -> Blocks:
    """Return obstacles [E, n, 4], apart from the home area, the walls and each other.

    They are drawn one after another: each is the first of its candidates that is apart from all
    previous ones.

    Args:
        keys: [E] of the scenarios.
        n: number of obstacles in each scenario.
        home: half a side of the home area.
        sides: shortest and longest side of an obstacle.
        gap: smallest distance of an obstacle from everything else.

    Raises:
        UsageError: no room for this number of obstacles.
    """
    e = len(keys)
    blocks = np.empty((e, n + 1, 4))  # the home area is the first
    blocks[:, 0] = 0.5 - home, 0.5 - home, 0.5 + home, 0.5 + home

    def block_of(u: npt.NDArray[np.float32]) -> Blocks:
        """Return the rectangles that candidates [..., 4] stand for."""
        side = sides[0] + (sides[1] - sides[0]) * u[..., :2].astype(np.float64)
        corner = gap + (1 - 2 * gap - side) * u[..., 2:]
        return np.concatenate([corner, corner + side], axis=-1)

    for k in range(1, n + 1):

        def fits(
            rest: npt.NDArray[np.intp], u: npt.NDArray[np.float32], k: int = k
        ) -> npt.NDArray[np.bool_]:
            new, old = block_of(u)[:, :, None], blocks[rest, None, :k]
            is_beyond = (new[..., :2] > old[..., 2:] + gap) | (new[..., 2:] < old[..., :2] - gap)
            return np.all(is_beyond.any(axis=-1), axis=-1)

        try:
            found = first_that_fits(keys, np.full(e, k), np.zeros(e, np.intp), 4, fits)
        except NoRoom as error:
            raise UsageError(f"the square has no room for {n} obstacles, {gap:g} apart") from error
        blocks[:, k] = block_of(found)
    return blocks[:, 1:]


def are_clear(
    e: npt.NDArray[np.intp], xy: npt.NDArray[np.float32], blocks: npt.NDArray[np.float32]
) -> npt.NDArray[np.bool_]:
    """Return whether places [Q, C, 2], C in each of the scenarios ``e`` [Q], are in no obstacle."""
    there, place = blocks[e, None], xy[:, :, None]
    is_beyond = ((place < there[..., :2]) | (place > there[..., 2:])).any(axis=-1)
    return np.all(is_beyond, axis=-1)
