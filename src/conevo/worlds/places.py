"""Random places in the unit square, apart from each other and from what is in the way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError

__all__ = ["draw_places"]

Place = npt.NDArray[np.float32]


def draw_places(
    rng: np.random.Generator, n: int, separation: float, is_free: Callable[[Place], bool]
) -> Place:
    """Return places [n, 2] float32, in sides of the square.

    Args:
        rng: source of the places.
        n: how many.
        separation: least distance of two of them.
        is_free: whether a place [2] may be taken.

    Raises:
        UsageError: there is no room for so many, so far apart.
    """
    places = np.empty((n, 2), dtype=np.float32)
    found = 0
    for _ in range(100_000):
        if found == n:
            return places
        place = rng.random(2, dtype=np.float32)
        gaps = np.sum((places[:found] - place) ** 2, axis=1)
        if is_free(place) and np.all(gaps >= separation**2):
            places[found] = place
            found += 1
    raise UsageError(f"the square has no room for {n} places, {separation:g} apart")
