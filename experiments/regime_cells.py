"""The cells of the regime map: runs of two methods in one regime, and the rule's prediction."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from conevo.report.statistics import Comparison, Estimate, compare, holm
from contrasts import contrast
from incentives import FINDING, Regime, incentive
from pages import Row

__all__ = [
    "CLONES",
    "INDIVIDUAL",
    "MARGIN",
    "REGIONS",
    "Cell",
    "Judged",
    "Trend",
    "apart",
    "cells_of",
    "judge",
    "of_region",
    "threshold",
    "trends_of",
    "used",
]

INDIVIDUAL, CLONES = "cone-es", "hom-es"
REGIONS = "ABCD"  # named by the type that lies there; robot i starts in region i mod 4
SETTINGS = ("low", "med", "hi")
MARGIN = 0.02  # of the clones' value: a difference that matters


def used(region: str, setting: str) -> str:
    """Return the column with the number of uses of a setting by the robots of a region."""
    return f"{region} {setting}"


@dataclass(frozen=True)
class Cell:
    """Runs in one regime.

    Attributes:
        ranges, accuracies: names of the levels.
        regime: in the form for the rule.
        runs: rows of each method.
        value: of CONE-ES minus HomES, champions in the testing phase.
        p: Welch's, corrected by Holm for all cells.
    """

    ranges: str
    accuracies: str
    regime: Regime
    runs: dict[str, list[Row]] = field(repr=False)
    value: Comparison
    p: float | None = None

    @property
    def incentive(self) -> float:
        """Castes by place over switchers, by the rule."""
        return incentive(self.regime)

    @property
    def is_for_finding(self) -> bool:
        """Whether it may be used to find a threshold."""
        return self.regime.segregation in FINDING

    @property
    def is_clear(self) -> bool:
        """Whether the interval of the difference excludes 0."""
        low, high = self.value.low, self.value.high
        return low is not None and high is not None and low * high > 0

    def share(self, difference: float | None) -> float | None:
        """Return a difference as a share of the clones' mean value, taken as exact."""
        clones = self.value.mean_b
        return None if difference is None or not clones else difference / clones

    @property
    def verdict(self) -> str:
        """The interval compared with +-2 % of the clones' value: decided, or "open"."""
        low, high = self.share(self.value.low), self.share(self.value.high)
        if low is None or high is None:
            return "open"
        if low > MARGIN:
            return "individual"
        if high < -MARGIN:
            return "clones"
        return "alike" if low > -MARGIN and high < MARGIN else "open"

    def mean(self, method: str, of: str | Callable[[Row], float]) -> float | None:
        """Return the mean over a method's runs of a column, or of a function of a run.

        None if no run has it.
        """
        found = self.each(method, of)
        return float(np.mean(found)) if found else None

    def each(self, method: str, of: str | Callable[[Row], float]) -> list[float]:
        """Return the value of every run that has it."""
        if callable(of):
            found = [of(row) for row in self.runs[method] if used("A", "low") in row]
        else:
            found = [float(row[of]) for row in self.runs[method] if row.get(of) is not None]
        return [one for one in found if not math.isnan(one)]


def cells_of(rows: Sequence[Row]) -> list[Cell]:
    """Return the cells of rows of runs: shorter ranges first, then low accuracies, then mixed."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        key = (row["ranges"], row["accuracies"], _regime(row))
        groups.setdefault(key, []).append(row)
    cells = []
    for (ranges, accuracies, regime), some in groups.items():
        runs = {m: [row for row in some if row["method"] == m] for m in (INDIVIDUAL, CLONES)}
        values = {m: [float(row["value"]) for row in of] for m, of in runs.items()}
        value = compare(values[INDIVIDUAL], values[CLONES])
        cells.append(Cell(ranges, accuracies, regime, runs, value))
    corrected = holm([cell.value.p_welch for cell in cells])
    cells = [Cell(**vars(cell) | {"p": p}) for cell, p in zip(cells, corrected, strict=True)]
    return sorted(cells, key=lambda c: (c.regime.ranges, c.regime.accuracies, c.regime.segregation))


def _regime(row: Row) -> Regime:
    ranges = tuple(float(row[f"{one}_range"]) for one in SETTINGS)
    accuracies = tuple(float(row[f"{one}_accuracy"]) for one in SETTINGS)
    return Regime(
        segregation=float(row["segregation"]),
        starts=str(row["starts"]),
        ranges=(ranges[0], ranges[1], ranges[2]),
        accuracies=(accuracies[0], accuracies[1], accuracies[2]),
        iterations=int(row["iterations"]),
    )


def of_region(row: Row, region: str) -> np.ndarray:
    """Return the share of each setting in the detections of a region's robots [3]; NaN if none."""
    counts = np.array([float(row[used(region, s)]) for s in SETTINGS])
    return counts / counts.sum() if counts.sum() else np.full(3, np.nan)


def apart(row: Row) -> float:
    """Return how much a run's robots of different regions differ, from 0 (alike) to 0.62.

    Half the absolute difference between a region's shares of settings and the mean of the four,
    averaged over regions: the portion of a region's activations that would have to change.
    """
    shares = np.array([of_region(row, region) for region in REGIONS])
    shares = shares[~np.isnan(shares).any(axis=1)]
    if not len(shares):
        return math.nan
    return float(np.abs(shares - shares.mean(axis=0)).sum(axis=1).mean() / 2)


@dataclass(frozen=True)
class Trend:
    """The trend over cells of the same ranges and accuracies.

    Attributes:
        cells: with at least two runs of each method, mixed first.
        mean: difference of the methods, mean over cells.
        slope: its growth from segregation 0 to 1, on a line of least squares; None below two cells.
    """

    cells: list[Cell]
    mean: Estimate
    slope: Estimate | None


def trends_of(cells: Sequence[Cell]) -> list[Trend]:
    """Return the trend of each pair of ranges and accuracies that has a cell with an interval."""
    groups: dict[tuple[str, str], list[Cell]] = {}
    for cell in cells:
        if cell.value.low is not None:
            groups.setdefault((cell.ranges, cell.accuracies), []).append(cell)
    found = []
    for some in groups.values():
        mean = contrast([(1 / len(some), cell.value) for cell in some])
        at = np.array([cell.regime.segregation for cell in some])
        far = at - at.mean()
        slope = None
        if len(some) > 1:
            weights = (far / (far**2).sum()).tolist()
            slope = contrast([(w, cell.value) for w, cell in zip(weights, some, strict=True)])
        found.append(Trend(some, mean, slope))
    return found


# --- predictions ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Judged:
    """A way to predict the sign of a difference, found with some cells and tested on others.

    Attributes:
        name: of the number that is compared with the threshold.
        threshold: above it individual controllers are predicted to be better.
        found, tested: cells with the predicted sign and all cells, of each kind.
        right, wrong: cells for testing whose interval excludes 0, with the predicted sign and
            with the opposite one.
    """

    name: str
    threshold: float
    found: tuple[int, int]
    tested: tuple[int, int]
    right: tuple[Cell, ...]
    wrong: tuple[Cell, ...]


def threshold(cells: Sequence[tuple[float, float]], near: float = 1.0) -> float:
    """Return the threshold with the fewest wrong signs.

    Choice: halfway between two neighbours, below all (minus infinity) or above all (infinity). Ties
    go to the one nearest to ``near``: 1 for the rule, above which it predicts a gain by itself. NaN
    without any cell.

    Args:
        cells: the number to compare and the difference, for each cell.
        near: the expected threshold.
    """
    if not cells:
        return math.nan
    numbers = sorted({number for number, _ in cells})
    between = [(a + b) / 2 for a, b in itertools.pairwise(numbers)]

    def wrong(at: float) -> int:
        return sum((number > at) != (difference > 0) for number, difference in cells)

    return min((*between, -math.inf, math.inf), key=lambda at: (wrong(at), abs(at - near)))


def judge(
    cells: Sequence[Cell],
    name: str,
    number: Callable[[Cell], float],
    at: float | None = None,
    near: float = 1.0,
) -> Judged:
    """Return how well a number of a regime predicts the sign of the difference.

    Args:
        cells: all cells; those without runs of both methods do not count.
        name: of the number.
        number: of a cell.
        at: a fixed threshold; None: it is found.
        near: the expected threshold, if it is found.
    """
    counted = [(cell, cell.value.difference) for cell in cells if cell.value.difference is not None]
    known = [(number(cell), of) for cell, of in counted if cell.is_for_finding]
    limit = threshold(known, near) if at is None else at

    def is_right(cell: Cell, difference: float) -> bool:
        return (number(cell) > limit) == (difference > 0)

    signs: dict[bool, list[bool]] = {True: [], False: []}
    for cell, difference in counted:
        signs[cell.is_for_finding].append(is_right(cell, difference))
    clear = [(cell, of) for cell, of in counted if cell.is_clear and not cell.is_for_finding]
    return Judged(
        name=name,
        threshold=limit,
        found=(sum(signs[True]), len(signs[True])),
        tested=(sum(signs[False]), len(signs[False])),
        right=tuple(cell for cell, of in clear if is_right(cell, of)),
        wrong=tuple(cell for cell, of in clear if not is_right(cell, of)),
    )
