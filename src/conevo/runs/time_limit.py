"""A limit on how long a process evolves: it ends after whole generations, and can be resumed."""

from __future__ import annotations

import math
import re
import time

from conevo.errors import UsageError

__all__ = ["TimeLimit", "parse_seconds"]

UNITS = {"": 1, "s": 1, "m": 60, "h": 3600, "d": 86400}


class TimeLimit:
    """Time that is left, from now on.

    Choice: a generation is begun only if there is time for one as long as the longest so far, but
    each call of a run has time for one, so that calling it again always carries it on.

    Args:
        seconds: None for no limit.

    Raises:
        UsageError: not a positive number of seconds.
    """

    def __init__(self, seconds: float | None) -> None:
        if seconds is not None and not (math.isfinite(seconds) and seconds > 0):
            raise UsageError(f"time limit {seconds}: must be a positive number of seconds")
        self.ends = math.inf if seconds is None else time.monotonic() + seconds

    @property
    def is_over(self) -> bool:
        """Whether no time is left."""
        return time.monotonic() >= self.ends

    def has_time(self, seconds: float) -> bool:
        """Whether this number of seconds is left."""
        return time.monotonic() + seconds < self.ends


def parse_seconds(text: str) -> float:
    """Return the seconds of "90", "90s", "10m", "1.5h" or "2d".

    Raises:
        UsageError: it is none of these.
    """
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([smhd]?)\s*", text)
    seconds = float(match[1]) * UNITS[match[2]] if match else 0.0
    if not (match and 0 < seconds < math.inf):
        raise UsageError(
            f"--time-limit {text!r}: expected a time above 0, for example 90s, 10m, 1.5h or 2d"
        )
    return seconds
