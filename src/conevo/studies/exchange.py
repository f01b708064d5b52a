"""The exchange of CONE's populations: without it CONE is MESP with type C fitness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

__all__ = ["FEW_PAIRS", "FEW_SHARE", "exchanged", "has_exchange", "is_idle", "per_generation"]

FEW_PAIRS, FEW_SHARE = 1.0, 0.1


def exchanged(records: Sequence[Mapping[str, Any]]) -> tuple[float | None, float | None]:
    """Return the mean number of recombined pairs per generation, and their share of possible pairs.

    A sub-population recombines with one other at most, so that half of them could be pairs. None
    for methods without thresholds for it, which never exchange.

    Args:
        records: of the generations of a run.
    """
    if not has_exchange(records):
        return None, None
    made = sum(record["recombinations"] for record in records)
    possible = sum(sum(record["n_hidden"]) // 2 for record in records)
    return made / len(records), made / possible if possible else 0.0


def has_exchange(records: Sequence[Mapping[str, Any]]) -> bool:
    """Return whether the method of these generations has thresholds for an exchange."""
    return any(record["sst"] is not None or record["gst"] is not None for record in records)


def is_idle(exchanges: float | None, share: float | None) -> bool:
    """Return whether an exchange between populations hardly ran; False for methods without one.

    Choice: if in the mean of a generation fewer than one pair of sub-populations recombined, and
    fewer than a tenth of the pairs that could have; in a team of twenty rovers a hundred could.

    Args:
        exchanges: pairs of sub-populations per generation, None of methods that never exchange.
        share: of the pairs that could have recombined.
    """
    if exchanges is None or share is None:
        return False
    return exchanges < FEW_PAIRS and share < FEW_SHARE


def per_generation(exchanges: float | None, share: float | None) -> str:
    """Return "0.3 pairs (0.3 %)"; empty for methods that never exchange."""
    if exchanges is None or share is None:
        return ""
    return f"{exchanges:.3g} pairs ({100 * share:.2g} %)"
