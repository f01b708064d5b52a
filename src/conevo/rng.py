"""Addressed randomness: the only place where (root seed, path) becomes a stream.

Nothing in conevo consumes a shared generator. Every random decision names its place
("epoch", generation, 3) and gets its own stream, so results do not depend on batch size, thread
count, order of work or the point at which a run was resumed.

Draws for many keys at once give each key and place its own number (``fold_all``, ``numbers``,
``uniforms``), which does not depend on the other keys.
"""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["fold", "fold_all", "numbers", "stream", "uniforms"]

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)


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


def fold_all(keys: npt.NDArray[np.uint64], *path: int | str) -> npt.NDArray[np.uint64]:
    """Return the keys of the place ``path`` below every one of many keys.

    Two of them are equal only if the given keys are. They differ from those of ``fold``.
    """
    return _finalized(keys ^ np.uint64(fold(0, *path)))


def numbers(keys: npt.NDArray[np.uint64], t: Any, a: Any, b: Any) -> npt.NDArray[np.uint64]:
    """Return 64 random bits for each key and place, as arrays of integers that broadcast.

    Splitmix64's finalizer over a counter, as in ``kernels.random.uniform``.

    Args:
        keys: of one dimension at least.
        t: first number of the place, from 0 and below 2**20, like the next two.
        a: second number.
        b: third number.
    """
    t, a, b = (np.atleast_1d(number).astype(np.uint64) for number in (t, a, b))
    counter = (t << np.uint64(40)) | (a << np.uint64(20)) | b
    return _finalized(keys + _GOLDEN * (counter + np.uint64(1)))


def uniforms(keys: npt.NDArray[np.uint64], t: Any, a: Any, b: Any) -> npt.NDArray[np.float32]:
    """Return a number in [0, 1) for each key and place, equal to ``kernels.random.uniform``."""
    bits = numbers(keys, t, a, b) >> np.uint64(40)
    result: npt.NDArray[np.float32] = bits.astype(np.float32) * np.float32(2.0**-24)
    return result


def _finalized(z: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Return splitmix64's finalizer of every element, in place."""
    z ^= z >> np.uint64(30)
    z *= _MIX_1
    z ^= z >> np.uint64(27)
    z *= _MIX_2
    z ^= z >> np.uint64(31)
    return z


def _word(value: int) -> bytes:
    if not 0 <= int(value) < 2**64:
        raise ValueError(f"a seed or path number must lie in [0, 2**64), got {value}")
    return int(value).to_bytes(8, "little")
