"""Tables of the measurements of ``calibration.py``: criteria, readings, incentives, the rule."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from incentives import CONTACT, FINDING, TESTING, Regime, fitted, incentive
from pages import Row, table

__all__ = ["ACCURACIES", "CRITERIA", "PAGE_PARTS", "PARTS", "RANGES", "SETTINGS"]

PARTS = {"readings": "", "incentives": "-incentives"}  # suffixes of the names of the CSV files
SETTINGS = ("low", "med", "hi")
RANGES: dict[str, dict[str, Any]] = {
    "R0": {"low_range": 0.07, "med_range": 0.05, "hi_range": 0.03},
    "R+": {"low_range": 0.10, "med_range": 0.08, "hi_range": 0.06},
    "R*": {"low_range": 0.20, "med_range": 0.15, "hi_range": 0.10},
    "area": {"low_range": 0.07, "med_range": 0.05, "hi_range": 0.03, "range_is": "area"},
}
ACCURACIES = {"high": (0.7, 0.8, 0.9), "low": (0.1, 0.2, 0.3)}
ENVIRONMENTS = range(1, 11)
CHANGED = ("top", "non-specialized")  # the best blind team, and heuristic switchers


def mean_of(row: Row, family: str) -> float:
    """Return the mean of the best teams of the ten environments of a family."""
    return float(np.mean([row[f"{family}-{e}"] for e in ENVIRONMENTS]))


def best_blind(row: Row) -> float:
    """Return the value of the best blind team."""
    return float(max(row["blind switchers"], row["blind castes"]))


def worst_change(row: Row, team: str) -> float:
    """Return a team's ratio furthest from 1 when all ranges are 30 % shorter or longer."""
    both = [float(row[f"{team} {sign}"]) for sign in ("-30 %", "+30 %")]
    return max(both, key=lambda ratio: abs(ratio - 1))


def rank_of_ten(row: Row) -> int:
    """Return the rank of environment 10 among the complex ones, 1 for the best."""
    return 1 + sum(row[f"complex-{e}"] > row["complex-10"] for e in ENVIRONMENTS)


CRITERIA: dict[str, Callable[[Row], bool]] = {
    "complex > simple": lambda row: mean_of(row, "complex") > mean_of(row, "simple"),
    "environment 10 best": lambda row: rank_of_ten(row) == 1,
    "±30 % < 25 %": lambda row: abs(worst_change(row, "top") - 1) < 0.25,
    "random <= 100": lambda row: row["random"] <= 100,
    "best blind >= 4000": lambda row: best_blind(row) >= 4000,
}


def criteria(readings: list[Row]) -> str:
    """Return the number of readings that meet each criterion, by ranges, and that meet several."""
    by_ranges = {name: [row for row in readings if row["ranges"] == name] for name in RANGES}
    head = ["criterion", *(f"{name}, of {len(some)}" for name, some in by_ranges.items())]
    lines = [
        [name, *(sum(map(is_met, some)) for some in by_ranges.values())]
        for name, is_met in CRITERIA.items()
    ]
    for least in (2, 3, 5):
        several = [sum(n_met(row) >= least for row in some) for some in by_ranges.values()]
        lines.append([f"at least {least} of the five", *several])
    return table(head, lines)


def n_met(row: Row) -> int:
    """Return the number of criteria that a reading meets."""
    return sum(is_met(row) for is_met in CRITERIA.values())


def by_reading(readings: list[Row]) -> str:
    """Return the values reached under every reading, and the number of criteria it meets."""
    head = [
        *("types and starts", "ranges", "accuracies", "rocks", "iterations", "random"),
        *("switchers", "best blind", "complex", "simple", "rank of 10"),
        *("±30 %, best blind", "±30 %, switchers", "met"),
    ]
    lines = []
    for row in readings:
        cells = [
            "apart" if row["segregation"] else "mixed",
            row["ranges"],
            row["accuracies"],
            "one" if row["rocks"] else "all",
            int(row["iterations"]),
        ]
        values = [row["random"], row["non-specialized"], best_blind(row)]
        values += [mean_of(row, "complex"), mean_of(row, "simple")]
        cells += [*(f"{value:.0f}" for value in values), rank_of_ten(row)]
        cells += [f"{worst_change(row, team):.2f}" for team in CHANGED]
        lines.append([*cells, n_met(row)])
    return table(head, lines)


# --- castes by place against switchers ------------------------------------------------------------


def regime_of(row: Row) -> Regime:
    """Return the regime of a row."""
    ranges = [RANGES[row["ranges"]][f"{setting}_range"] for setting in SETTINGS]
    if "range_is" in RANGES[row["ranges"]]:
        ranges = [math.sqrt(of / math.pi) for of in ranges]
    low, med, hi = ranges
    accuracies = ACCURACIES[row["accuracies"]]
    return Regime(
        row["segregation"], row["starts"], (low, med, hi), accuracies, int(row["iterations"])
    )


def ratios(cells: list[Row]) -> str:
    """Return castes over switchers: measured, by the rule, and the best blind teams' ratio."""
    shares = (*FINDING, *TESTING)
    head = ["starts", "ranges", "accuracies", *(f"{s:g}" for s in sorted(shares))]
    lines = []
    for starts in ("by_robot", "random"):
        for ranges in RANGES:
            for accuracies in ACCURACIES:
                some = [
                    row
                    for row in cells
                    if (row["starts"], row["ranges"], row["accuracies"], row["iterations"])
                    == (starts, ranges, accuracies, 1250)
                ]
                some.sort(key=lambda row: row["segregation"])
                lines.append(
                    [starts.replace("_", " "), ranges, accuracies, *(three(row) for row in some)]
                )
    return table(head, lines)


def three(row: Row) -> str:
    """Return a cell's ratios."""
    measured = f"{row['ratio']:.2f} ± {row['ratio'] * row['log ratio se']:.2f}"
    return f"{measured} / {incentive(regime_of(row)):.2f} / {row['blind ratio']:.2f}"


def rule(cells: list[Row]) -> str:
    """Return the rule's deviation from the measurements, in cells for finding and for testing."""
    head = [
        "cells",
        "starts",
        "number",
        "rms of the log ratio",
        "mean",
        "furthest",
        "same side of 1",
    ]
    lines = []
    for name, shares in (("finding", FINDING), ("testing", TESTING)):
        for starts in ("random", "by_robot"):
            some = [r for r in cells if r["segregation"] in shares and r["starts"] == starts]
            log = np.array([math.log(incentive(regime_of(row)) / row["ratio"]) for row in some])
            is_alike = [(incentive(regime_of(row)) > 1) == (row["ratio"] > 1) for row in some]
            lines.append(
                [
                    f"{name}: segregation {', '.join(f'{s:g}' for s in shares)}",
                    starts.replace("_", " "),
                    len(some),
                    f"{np.sqrt((log**2).mean()):.2f}",
                    f"{log.mean():+.2f}",
                    f"{log[np.abs(log).argmax()]:+.2f}",
                    f"{sum(is_alike)} of {len(some)}",
                ]
            )
    constant = fitted([(regime_of(row), row["ratio"]) for row in cells])
    return (
        table(head, lines)
        + f"\nLeast error in the cells for finding has the constant {constant:.1f}; "
        f"the rule has {CONTACT:.1f}.\n"
    )


PAGE_PARTS: dict[str, tuple[str, Callable[[list[Row]], str]]] = {
    "criteria": ("readings", criteria),
    "readings": ("readings", by_reading),
    "incentives": ("incentives", ratios),
    "rule": ("incentives", rule),
}
