"""Directions and discs in the plane, coverage of the unit square by discs."""

import warp as wp

__all__ = ["COVER_CELLS", "COVER_WORDS", "cover_disc", "covered_by_any", "octant"]

COVER_CELLS = wp.constant(100)  # Choice: area covered is counted on a 100 x 100 grid
COVER_WORDS = wp.constant(200)  # 64-bit words of one grid: two for each row of 100 cells


@wp.func
def octant(dx: float, dy: float) -> int:
    """Return which of eight 45-degree sectors the vector lies in, counter-clockwise from +x."""
    is_below = dy < 0.0 or (dy == 0.0 and dx < 0.0)
    x = wp.where(is_below, -dx, dx)
    y = wp.where(is_below, -dy, dy)
    is_left = x <= 0.0
    ahead = wp.where(is_left, y, x)
    aside = wp.where(is_left, -x, y)
    return 4 * int(is_below) + 2 * int(is_left) + int(aside >= ahead)


@wp.func
def _span(first: int, last: int) -> wp.uint64:
    """Return a word with bits ``first``..``last`` set (none if empty after clipping to 0..63)."""
    lo = wp.max(first, 0)
    hi = wp.min(last, 63)
    bits = wp.uint64(0)
    if lo <= hi:
        bits = (~wp.uint64(0) >> wp.uint64(63 - (hi - lo))) << wp.uint64(lo)
    return bits


@wp.func
def cover_disc(
    grid: wp.array[wp.uint64], base: int, x: float, y: float, r: float, part: int, n_parts: int
) -> int:
    """Mark the cells whose centre lies in the disc; return how many were not marked before.

    The rows of the disc may be marked in parts.

    Args:
        grid: words of one or more coverage grids, ``COVER_WORDS`` each.
        base: first word of the grid to mark.
        x: first coordinate of the disc's centre, in sides of the square.
        y: second coordinate.
        r: radius, in sides of the square.
        part: which part of the disc, from 0.
        n_parts: how many parts there are, 1 for the whole disc at once.
    """
    n = float(COVER_CELLS)
    row = int(wp.max(int(wp.ceil((y - r) * n - 0.5)), 0) + part)
    last_row = wp.min(int(wp.floor((y + r) * n - 0.5)), COVER_CELLS - 1)
    gained = int(0)
    while row <= last_row:
        dy = (float(row) + 0.5) / n - y
        rest = r * r - dy * dy
        if rest > 0.0:
            half = wp.sqrt(rest)
            first = wp.max(int(wp.ceil((x - half) * n - 0.5)), 0)
            last = wp.min(int(wp.floor((x + half) * n - 0.5)), COVER_CELLS - 1)
            for word in range(2):
                k = base + row * 2 + word
                old = grid[k]
                fresh = _span(first - word * 64, last - word * 64) & ~old
                if fresh != wp.uint64(0):
                    grid[k] = old | fresh
                    gained = gained + int(wp.bit_count(fresh))
        row += n_parts
    return gained


@wp.func
def covered_by_any(grids: wp.array[wp.uint64], n_grids: int, word: int) -> int:
    """Return how many cells of a word are marked in at least one of the first ``n_grids`` grids."""
    bits = wp.uint64(0)
    g = int(0)
    while g < n_grids:
        bits = bits | grids[g * COVER_WORDS + word]
        g += 1
    return int(wp.bit_count(bits))
