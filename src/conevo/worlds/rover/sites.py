"""Random rocks at the sites of a layout, with their types, for many scenarios at once.

Choice: the four regions for types and rovers have equal numbers of sites, except for sites on the
lines between them: a vertical line halves the sites of a layout, and a horizontal one each half.
Region 0 is at the lower left, 1 at the lower right, 2 at the upper left, 3 at the upper right. A,
B, C, D have 0, 1, 2, 3; E has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import numpy.typing as npt

from conevo.rng import numbers
from conevo.worlds.rover import canals
from conevo.worlds.rover.state import ROCK_CELLS

__all__ = ["N_REGIONS", "RockSites", "draw_rocks", "rock_sites"]

AT_ONCE = 16  # scenarios: their arrays fit into the processor's cache (measured)
N_REGIONS = 4
_TYPE = np.uint32(3)  # bits of a rock's type

Ints = npt.NDArray[np.intp]


@dataclass(frozen=True)
class RockSites:
    """The S rock sites of a layout, sorted by grid cell.

    mask [rows, columns] canal raster; x, y [S] float32 in sides of the square; first [cells + 1]
    the first site of each grid cell; cuts: the lines between regions, the x of the vertical one and
    the y of the horizontal ones left and right of it.
    """

    mask: npt.NDArray[np.bool_]
    x: npt.NDArray[np.float32]
    y: npt.NDArray[np.float32]
    first: Ints
    cuts: tuple[np.float32, np.float32, np.float32]

    def region(self, xy: npt.NDArray[np.float32]) -> Ints:
        """Return the region, 0 to 3, in which each of places [..., 2] lies."""
        is_right = xy[..., 0] > self.cuts[0]
        is_above = xy[..., 1] > np.where(is_right, self.cuts[2], self.cuts[1])
        return is_right + 2 * is_above.astype(np.intp)

    @cached_property
    def of_region(self) -> list[Ints]:
        """The sites of each region."""
        regions = self.region(np.stack([self.x, self.y], axis=1))
        return [np.flatnonzero(regions == region) for region in range(N_REGIONS)]


@cache
def rock_sites(layout: int) -> RockSites:
    """Return the rock sites of a canal layout."""
    mask, n = canals.load(layout), int(ROCK_CELLS)
    at = canals.sites(mask)
    column, row = np.minimum((at * np.float32(n)).astype(np.intp), n - 1).T
    order = np.argsort(row * n + column, kind="stable")
    first = np.searchsorted((row * n + column)[order], np.arange(n * n + 1), side="left")
    x, y = at[order].T.copy()
    half = np.median(x)
    cuts = half, np.median(y[x <= half]), np.median(y[x > half])
    found = RockSites(mask, x, y, first, cuts)
    for array in (found.mask, found.x, found.y, found.first):
        array.flags.writeable = False
    return found


def draw_rocks(
    keys: npt.NDArray[np.uint64],
    sites: RockSites,
    counts: Sequence[int],
    segregation: float = 0.0,
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Return site and type of each rock, [E, K] by site, and the first rock of each grid cell.

    Every site has a random number. Those with the smallest carry rocks of the first type, those
    with the next ones rocks of the second, and so on. With segregation, this applies to the rocks
    of each type that lie anywhere. The rocks that lie in their type's region then get free sites
    there, by other random numbers.

    Args:
        keys: [E] of the scenarios.
        sites: of the layout.
        counts: rocks of each type, K in all.
        segregation: share of the rocks of each type that lie in its region, rounded to whole rocks.
    """
    n, k = len(sites.x), sum(counts)
    in_region = [int(segregation * count + 0.5) for count in counts[:N_REGIONS]]
    anywhere = np.array(counts) - np.pad(in_region, (0, len(counts) - N_REGIONS))
    types = np.repeat(np.arange(len(counts), dtype=np.uint32), anywhere)
    drawn = np.empty((len(keys), k), dtype=np.uint32)
    cell = np.empty((len(keys), len(sites.first)), dtype=np.int32)
    for begin in range(0, len(keys), AT_ONCE):
        some = slice(begin, begin + AT_ONCE)
        site = _shuffled(keys[some], 0, np.arange(n), n)[:, : len(types)]
        drawn[some, : len(types)] = site.astype(np.uint32) << _TYPE | types
        has_rock = np.zeros((len(site), n + 1), dtype=np.bool_)
        np.put_along_axis(has_rock, site + 1, True, axis=1)
        end = len(types)
        for kind, few in enumerate(in_region if segregation else ()):
            site = _shuffled(keys[some], 1, sites.of_region[kind], n, has_rock[:, 1:])[:, :few]
            drawn[some, end : end + few] = site.astype(np.uint32) << _TYPE | np.uint32(kind)
            np.put_along_axis(has_rock, site + 1, True, axis=1)
            end += few
        cell[some] = np.cumsum(has_rock, axis=1, dtype=np.int32)[:, sites.first]
    drawn.sort(axis=1)
    return drawn >> _TYPE, (drawn & np.uint32(7)).astype(np.int32), cell


def _shuffled(
    keys: npt.NDArray[np.uint64],
    draw: int,
    some: Ints,
    n: int,
    is_taken: npt.NDArray[np.bool_] | None = None,
) -> Ints:
    """Return some of n sites in random order for each key, with the taken ones [E, n] last."""
    bits = np.uint64(n.bit_length())  # of a site: the last bits of its random number
    order = numbers(keys[:, None], draw, some, 0)
    if is_taken is not None:
        order[is_taken[:, some]] = np.uint64(2**64 - 1)
    order >>= bits
    order <<= bits
    order |= some.astype(np.uint64)
    order.sort(axis=1)
    return (order & ((np.uint64(1) << bits) - np.uint64(1))).astype(np.intp)
