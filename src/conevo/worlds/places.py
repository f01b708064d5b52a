"""Random places in the unit square, apart from each other and from obstacles.

Places are drawn for many scenarios at once. Every candidate has its own random number, so the
places for a key do not depend on the other keys.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError
from conevo.rng import uniforms

__all__ = ["NoRoom", "draw_places", "first_that_fits", "sectors"]

MOST = 10_000  # candidates for a place

Ints = npt.NDArray[np.intp]
Bools = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.float32]
Keys = npt.NDArray[np.uint64]


class NoRoom(UsageError):
    """None of the candidates fits."""


def first_that_fits(
    keys: Keys,
    places: Ints,
    tried: Ints,
    n_numbers: int,
    fits: Callable[[Ints, Floats], Bools],
) -> Floats:
    """Return the first candidate of each of P places that fits: numbers in [0, 1) [P, N] float32.

    Args:
        keys: [P] of the scenarios.
        places: [P] number of each place within its scenario.
        tried: [P] number of candidates of each place to leave out; raised to the returned one.
        n_numbers: N, random numbers of a candidate.
        fits: whether each of C candidates [Q, C, N] for the places with some indices [Q] fits.

    Raises:
        NoRoom: no candidate fits.
    """
    found = np.empty((len(keys), n_numbers), dtype=np.float32)
    rest, n = np.arange(len(keys)), 1
    while len(rest):
        candidates = tried[rest, None, None] + np.arange(n)[:, None]
        if candidates.max() >= MOST:
            raise NoRoom(f"none of {MOST} candidates fits")
        u = uniforms(
            keys[rest, None, None], candidates, places[rest, None, None], np.arange(n_numbers)
        )
        is_right = fits(rest, u)
        first = is_right.argmax(axis=1)
        is_found = is_right[np.arange(len(rest)), first]
        found[rest] = u[np.arange(len(rest)), first]
        tried[rest] += np.where(is_found, first + 1, n)
        rest, n = rest[~is_found], min(2 * n, 1024)  # more at once, where few fit
    return found


def sectors(xy: Floats, n: int) -> Ints:
    """Return the sector, 0 to n - 1, in which each of places [..., 2] of the unit square lies.

    Sectors start at the lower left corner and go round the middle counter-clockwise. All have the
    same area, and so have their parts of any frame around the middle.

    Choice: regions around a middle are sectors of equal area, not of equal angle.
    """
    dx, dy = np.moveaxis(xy - np.float32(0.5), -1, 0)
    half = np.maximum(np.maximum(np.abs(dx), np.abs(dy)), np.float32(1e-12))  # a side's, there
    way = np.select(
        [dy == -half, dx == half, dy == half],
        [half + dx, 3 * half + dy, 5 * half - dx],
        7 * half - dy,
    )
    return np.minimum((way / half * np.float32(n / 8)).astype(np.intp), n - 1)


def draw_places(
    keys: Keys,
    n: int,
    separation: float,
    is_free: Callable[[Ints, Ints, Floats], Bools] | None = None,
    is_there: Bools | None = None,
) -> Floats:
    """Return places [E, n, 2] float32, in sides of the square.

    They are drawn one after another: each is the first of its candidates that is free and far
    enough from all previous places.

    Args:
        keys: [E] of the scenarios.
        n: number of places in each scenario.
        separation: smallest distance between two of them.
        is_free: whether candidates [Q, C, 2], C for each of places with some indices [Q] in the
            scenarios with some indices [Q], may be taken; all may by default.
        is_there: [E, n] whether the scenario has this place, which is at 0 otherwise; by default it
            has all.

    Raises:
        NoRoom: there is no room for this number of places at this distance.
    """
    there = np.ones((len(keys), n), dtype=np.bool_) if is_there is None else is_there
    places = np.zeros((len(keys), n, 2), dtype=np.float32)
    tried = np.zeros((len(keys), n), dtype=np.intp)
    before = np.tri(n, k=-1, dtype=np.bool_)  # [place, previous places]

    def is_close(e: Ints, k: Any, xy: Floats) -> Bools:
        """Return whether candidates [Q, C, 2] for places ``k`` are too close to a previous one."""
        gaps = ((xy[:, :, None] - places[e, None]) ** 2).sum(axis=3)
        return ((gaps < separation**2) & (there[e, None] & before[k])).any(axis=2)

    def draw(e: Ints, k: Ints, is_apart: bool) -> None:
        """Draw the next candidates that fit for places ``k`` [Q] of scenarios ``e`` [Q]."""

        def fits(rest: Ints, xy: Floats) -> Bools:
            free = np.ones(xy.shape[:2], np.bool_)
            good = free if is_free is None else is_free(e[rest], k[rest], xy)
            return good & ~is_close(e[rest], k[rest, None], xy) if is_apart else good

        begun = tried[e, k]
        places[e, k] = first_that_fits(keys[e], k, begun, 2, fits)
        tried[e, k] = begun

    try:
        e, k = np.nonzero(there)
        draw(e, k, is_apart=False)
        e = np.arange(len(keys) if n and separation > 0 else 0)
        while len(e):  # the first of each scenario that is too close is drawn again, then the next
            close = is_close(e, np.arange(n), places[e]) & there[e]
            e, close = e[close.any(axis=1)], close[close.any(axis=1)]
            draw(e, close.argmax(axis=1), is_apart=True)
    except NoRoom as error:
        why = f"the square has no room for {n} places, {separation:g} apart"
        raise NoRoom(why) from error
    return places
