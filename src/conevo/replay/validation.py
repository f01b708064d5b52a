"""Checks of a recording in a file, made once, by ``Trajectory.load``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from conevo.playback.about import About
from conevo.playback.quantized import Channel
from conevo.terms import NON_SPECIALIZED

__all__ = ["channel_of", "validated"]

FARTHEST = 2.0**53  # the largest number that is exact everywhere
MOST_CHARACTERS = 2_000  # of a text: a fact may name every robot's caste
_CODES = {np.dtype(kind) for kind in (np.uint8, np.uint16, np.uint32)}


def channel_of(name: str, codes: Any, kept: Any) -> Channel:
    """Return a channel from its codes, and the numbers that a file has for it.

    Raises:
        ValueError, TypeError, KeyError: the numbers are not possible.
    """
    if codes.dtype not in _CODES:
        raise ValueError(f"{name} has codes of type {codes.dtype}")
    low, step = kept["low"], kept["step"]
    for number in (low, step):
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise TypeError(f"{name}: {number!r} is not a number")
    top = low + step * np.iinfo(codes.dtype).max
    if not (math.isfinite(top) and math.isfinite(low) and step >= 0):
        raise ValueError(f"{name} has values from {low} in steps of {step}")
    top = low + step * int(codes.max(initial=0))
    if max(abs(low), abs(top)) > FARTHEST:
        raise ValueError(f"{name} has values from {low} to {top}")
    return Channel(codes, low, step)


def validated(about: Any) -> About:
    """Return the description in a file.

    Raises:
        ValueError: it has other fields or kinds of values, texts that cannot be shown, or numbers
            that contradict each other.
    """
    checked: About = _checker().validate_python(about, strict=True)
    _check_texts(checked)
    r, castes = checked["n_robots"], (*checked["castes"], NON_SPECIALIZED)
    if not (r >= 1 and checked["iterations"] >= 1 and checked["actions"]):
        raise ValueError("no robots, no iterations or no actions")
    for name in ("labels", "specialization", "fitness", "heuristic", "neurons"):
        if len(checked[name]) != r:
            raise ValueError(f"{name} of {len(checked[name])} robots, not {r}")
    liked, shares = checked.get("favourites", []), checked.get("favourite_shares", [])
    if not len(liked) == len(shares) in (0, r):
        raise ValueError(f"{len(liked)} favourites and {len(shares)} shares of {r} robots")
    if not all(0 <= share <= 1 for share in shares):
        raise ValueError(f"a favourite's share is {min(shares)} to {max(shares)}, not 0 to 1")
    if unknown := (set(checked["labels"]) - set(castes)) | (set(liked) - {*castes, ""}):
        raise ValueError(f"castes that the world does not have: {', '.join(sorted(unknown))}")
    return checked


def _check_texts(thing: Any) -> None:
    """Raise ValueError if a text anywhere in a description cannot be shown."""
    if isinstance(thing, str):
        if not (len(thing) <= MOST_CHARACTERS and thing.isprintable()):
            raise ValueError(f"the text {thing[:40]!r} cannot be shown")
    elif isinstance(thing, Mapping):
        for pair in thing.items():
            _check_texts(pair)
    elif isinstance(thing, list | tuple):
        for part in thing:
            _check_texts(part)


@cache
def _checker() -> Any:
    from pydantic import ConfigDict, TypeAdapter, with_config

    config = ConfigDict(extra="forbid", allow_inf_nan=False)
    return TypeAdapter(with_config(config)(About))
