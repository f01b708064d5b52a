"""Tables, castes, spreads and series of numbers as plain text."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from conevo.numbers import number
from conevo.terms import counted

__all__ = [
    "bars",
    "castes",
    "favourites",
    "neurons",
    "mean",
    "n_finite",
    "progress",
    "spread",
    "table",
]

NUMBER = re.compile(r"[-+.,/\de]+( (\+-|\().*)?")


def spread(found: Mapping[str, Any] | None, n_scenarios: int) -> str:
    """Return mean and standard deviation of a measure: "0.9 +- 0.1", "0.8 (1 of 5)" if 4 have none.

    Args:
        found: "mean", "sd", "values"; None, shown as "-", if the world has no such measure.
        n_scenarios: of the test.
    """
    if found is None:
        return "-"
    deviation = f" +- {number(found['sd'])}" if n_finite(found) > 1 else ""
    return f"{number(found['mean'])}{deviation}{_share(found, n_scenarios)}"


def mean(found: Mapping[str, Any], n_scenarios: int) -> str:
    """Return the mean of a measure, without its standard deviation."""
    return f"{number(found['mean'])}{_share(found, n_scenarios)}"


def _share(found: Mapping[str, Any], n_scenarios: int) -> str:
    """Return the number of scenarios with a finite value as text, empty if all have one."""
    n = n_finite(found)
    return "" if n == n_scenarios else f" ({n} of {n_scenarios})"


def n_finite(found: Mapping[str, Any]) -> int:
    """Return the number of finite values of a measure; conevo 0.1.0 recorded no others."""
    return int(found.get("n", len(found["values"])))


def progress(done: int, planned: int, spent: int, budget: int) -> str:
    """Return a run's progress in generations, or in its budget if that ends it sooner.

    "5 of 30 generations", "13 generations, 49,920 of 50,000 evaluations".

    Args:
        done: finished generations.
        planned: generations at most.
        spent: team evaluations.
        budget: team evaluations at most, 0 for any number.
    """
    if budget and spent / budget > done / planned:
        return f"{counted(done, 'generation')}, {spent:,} of {budget:,} evaluations"
    return f"{done:,} of {counted(planned, 'generation')}"


def castes(sizes: Mapping[str, int]) -> str:
    """Return castes with their numbers of robots: "low 12, non-specialized 8"."""
    return ", ".join(f"{name} {size}" for name, size in sizes.items())


def favourites(sizes: Mapping[str, int], share: float | None) -> str:
    """Return favourite settings with their numbers of robots: "low 12, hi 7 (share 0.62)".

    Args:
        sizes: robots by favourite, largest first.
        share: of the favourite in the settings that a robot used, mean.
    """
    return f"{castes(sizes)} (share {number(share)})" if sizes else "none"


def neurons(n_hidden: Sequence[int]) -> str:
    """Return controller sizes: "10" or "8-12"."""
    low, high = min(n_hidden), max(n_hidden)
    return str(low) if low == high else f"{low}-{high}"


def bars(values: Sequence[float], width: int) -> str:
    """Return a series as a line of bars, averaged into at most ``width`` of them."""
    if not values:
        return ""
    n = min(width, len(values))
    edges = [len(values) * k // n for k in range(n + 1)]
    means = [sum(values[a:b]) / (b - a) for a, b in pairwise(edges)]
    low, span = min(means), (max(means) - min(means)) or 1.0
    return "".join("▁▂▃▄▅▆▇█"[round(7 * (mean - low) / span)] for mean in means)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return an aligned table: numbers to the right, words to the left."""
    columns = list(zip(head, *rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    is_number = [all(map(NUMBER.fullmatch, column[1:])) for column in columns]
    lines = []
    for row in (head, *rows):
        cells = (
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, is_number, strict=True)
        )
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)
