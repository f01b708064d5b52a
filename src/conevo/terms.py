"""Terms of the thesis, numbers of things and paths in commands, worded the same everywhere."""

from __future__ import annotations

import shlex

__all__ = ["NON_SPECIALIZED", "S_MEANS", "SHARE_SCALE", "S_SCALE", "counted", "quoted"]

NON_SPECIALIZED = "non-specialized"
"""The caste of robots that are specialized to nothing."""

S_SCALE = "0 = always the same action, 1 = switches all the time"
"""Direction of S: the thesis calls it the degree of specialization, and 0 is a specialist."""

SHARE_SCALE = "1 = always the same one"
"""Direction of the share of a favourite."""

S_MEANS = f"degree of specialization S ({S_SCALE})"


def counted(number: int, noun: str) -> str:
    """Return a number of things in words: "1 run", "1,200 runs"."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def quoted(path: object) -> str:
    """Return a path quoted for a shell, for commands that are printed to be copied."""
    return shlex.quote(str(path))
