"""The counter-based random numbers of the kernels, in plain integers."""

MASK = 2**64 - 1


def uniform(seed: int, t: int, a: int, b: int) -> float:
    """The top 24 bits as a fraction."""
    return (bits(seed, t, a, b) >> 40) / 2**24


def bits(seed: int, t: int, a: int, b: int) -> int:
    """Splitmix64 of seed and counter: 64 bits."""
    counter = (t << 40) | (a << 20) | b
    z = (seed + 0x9E3779B97F4A7C15 * (counter + 1)) & MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
    return z ^ (z >> 31)
