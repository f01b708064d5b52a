"""Sets of at most 64 things, as the bits of a word; how the lanes of a block share them."""

import warp as wp

from conevo.kernels.phases import n_lanes

__all__ = ["all_below", "all_of", "has", "lowest", "one", "part_of", "parts", "without_lowest"]


@wp.func
def one(k: int) -> wp.uint64:
    """Return the set of thing ``k`` alone."""
    return wp.uint64(1) << wp.uint64(k)


@wp.func
def all_of(n: int) -> wp.uint64:
    """Return the set of the first ``n`` things, 1 to 64."""
    return ~wp.uint64(0) >> wp.uint64(64 - n)


@wp.func
def all_below(k: int) -> wp.uint64:
    """Return the set of the first ``k`` things, 0 to 63."""
    return one(k) - wp.uint64(1)


@wp.func
def has(some: wp.uint64, k: int) -> bool:
    """Return whether thing ``k`` is in a set."""
    return ((some >> wp.uint64(k)) & wp.uint64(1)) != wp.uint64(0)


@wp.func
def lowest(some: wp.uint64) -> int:
    """Return the lowest number in a set that is not empty."""
    return int(wp.bit_count(~some & (some - wp.uint64(1))))


@wp.func
def without_lowest(some: wp.uint64) -> wp.uint64:
    """Return a set without its lowest number."""
    return some & (some - wp.uint64(1))


@wp.func
def parts(n: int) -> int:
    """Return the number of parts into which a set of ``n`` things is cut: 1 for a single lane."""
    return wp.where(n_lanes() == 1, 1, n)


@wp.func
def part_of(some: wp.uint64, q: int) -> wp.uint64:
    """Return part ``q`` of a set: all of it for a single lane, else thing ``q`` if it is in it."""
    if n_lanes() == 1:
        return some
    return some & one(q)
