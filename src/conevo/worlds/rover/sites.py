"""Which sites of a layout carry a rock, and of which type: for many scenarios at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from conevo.rng import numbers
from conevo.worlds.rover import canals
from conevo.worlds.rover.state import ROCK_CELLS

__all__ = ["RockSites", "draw_rocks", "rock_sites"]

AT_ONCE = 16  # scenarios: what is made of them stays in the processor's cache (measured)
_TYPE = np.uint32(3)  # bits of a rock's type


@dataclass(frozen=True)
class RockSites:
    """The S rock sites of a layout, sorted by the grid cell that they lie in.

    mask [rows, columns] canal raster; x, y [S] float32 in sides of the square; first [cells + 1]
    the first site of each grid cell.
    """

    mask: npt.NDArray[np.bool_]
    x: npt.NDArray[np.float32]
    y: npt.NDArray[np.float32]
    first: npt.NDArray[np.intp]


@cache
def rock_sites(layout: int) -> RockSites:
    """Return the rock sites of a canal layout."""
    mask, n = canals.load(layout), int(ROCK_CELLS)
    at = canals.sites(mask)
    column, row = np.minimum((at * np.float32(n)).astype(np.intp), n - 1).T
    order = np.argsort(row * n + column, kind="stable")
    first = np.searchsorted((row * n + column)[order], np.arange(n * n + 1), side="left")
    found = RockSites(mask, at[order, 0], at[order, 1], first)
    for array in (found.mask, found.x, found.y, found.first):
        array.flags.writeable = False
    return found


def draw_rocks(
    keys: npt.NDArray[np.uint64], sites: RockSites, counts: Sequence[int]
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Return site and type of each rock, [E, K] by site, and the first rock of each grid cell.

    Every site has a random number. Those with the smallest carry rocks of the first type, those
    with the next ones of the second, and so on.

    Args:
        keys: [E] of the scenarios.
        sites: of the layout.
        counts: rocks of each type, K in all.
    """
    n, k = len(sites.x), sum(counts)
    types = np.repeat(np.arange(len(counts), dtype=np.uint32), counts)
    bits = np.uint64(n.bit_length())  # of a site, which are the last of its random number
    drawn = np.empty((len(keys), k), dtype=np.uint32)
    cell = np.empty((len(keys), len(sites.first)), dtype=np.int32)
    for begin in range(0, len(keys), AT_ONCE):
        some = slice(begin, begin + AT_ONCE)
        order = numbers(keys[some, None], 0, np.arange(n), 0)
        order >>= bits
        order <<= bits
        order |= np.arange(n, dtype=np.uint64)
        order.sort(axis=1)
        site = (order[:, :k] & ((np.uint64(1) << bits) - np.uint64(1))).astype(np.uint32)
        drawn[some] = site << _TYPE | types
        has_rock = np.zeros((len(site), n + 1), dtype=np.bool_)
        np.put_along_axis(has_rock, site.astype(np.intp) + 1, True, axis=1)
        cell[some] = np.cumsum(has_rock, axis=1, dtype=np.int32)[:, sites.first]
    drawn.sort(axis=1)
    return drawn >> _TYPE, (drawn & np.uint32(7)).astype(np.int32), cell
