"""Addressed randomness: the only place where (root seed, path) becomes a stream.

Nothing in conevo consumes a shared generator. Every random decision names where it stands
("epoch", generation, 3) and gets its own stream, so results do not depend on batch size, thread
count, order of work or the point at which a run was resumed.
"""

from __future__ import annotations

import hashlib

import numpy as np

__all__ = ["fold", "stream"]


def fold(root: int, *path: int | str) -> int:
    """Return the 64-bit key of the place ``path`` below ``root``.

    Args:
        root: any non-negative integer below 2**64 (a run's seed, or a key made by ``fold``).
        path: names and non-negative integers; ``1`` and ``"1"`` are different places.

    Returns:
        An unsigned integer below 2**64, the same on every machine and Python version.

    Raises:
        ValueError: a negative or oversized integer.
    """
    digest = hashlib.blake2b(_word(root), digest_size=8)
    for part in path:
        if isinstance(part, str):
            text = part.encode()
            digest.update(b"s" + _word(len(text)) + text)
        else:
            digest.update(b"i" + _word(part))
    return int.from_bytes(digest.digest(), "little")


def stream(root: int, *path: int | str) -> np.random.Generator:
    """Return a fresh numpy generator for the place ``path`` below ``root`` (Philox, counter 0)."""
    return np.random.Generator(np.random.Philox(key=fold(root, *path)))


def _word(value: int) -> bytes:
    if not 0 <= int(value) < 2**64:
        raise ValueError(f"a seed or path number must lie in [0, 2**64), got {value}")
    return int(value).to_bytes(8, "little")
