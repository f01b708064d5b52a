"""Counter-based random numbers: no state, so no order in which they must be drawn."""

import warp as wp

__all__ = ["uniform"]

_GOLDEN = wp.constant(wp.uint64(0x9E3779B97F4A7C15))
_MIX_1 = wp.constant(wp.uint64(0xBF58476D1CE4E5B9))
_MIX_2 = wp.constant(wp.uint64(0x94D049BB133111EB))


@wp.func
def uniform(seed: wp.uint64, t: int, a: int, b: int) -> float:
    """Return the number in [0, 1) that belongs to iteration ``t`` and the pair ``(a, b)``.

    Splitmix64's finalizer over the counter; the top 24 bits make an exact float32. ``t`` and ``a``
    must be below 2**20 and ``b`` below 2**20, all of them non-negative.
    """
    counter = (wp.uint64(t) << wp.uint64(40)) | (wp.uint64(a) << wp.uint64(20)) | wp.uint64(b)
    z = seed + _GOLDEN * (counter + wp.uint64(1))
    z = (z ^ (z >> wp.uint64(30))) * _MIX_1
    z = (z ^ (z >> wp.uint64(27))) * _MIX_2
    z = z ^ (z >> wp.uint64(31))
    return float(z >> wp.uint64(40)) * 5.9604644775390625e-08
