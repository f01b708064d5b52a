"""The number of CPU threads: available, and requested. Warp is not loaded."""

import os
from typing import Any

from conevo.errors import UsageError

__all__ = ["threads_of", "usable_cores"]

MOST_THREADS = 4096


def usable_cores() -> int:
    """Return the number of hardware threads this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads_of(given: Any) -> int:
    """Return the number of CPU threads to use: the given one, or that of all usable ones.

    Raises:
        UsageError: not a number of threads.
    """
    if given is None:
        return usable_cores()
    if isinstance(given, bool) or not isinstance(given, int) or not 1 <= given <= MOST_THREADS:
        raise UsageError(f"threads = {given!r}: must be an integer from 1 to {MOST_THREADS}")
    return given
