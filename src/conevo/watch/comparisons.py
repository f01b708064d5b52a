"""Methods side by side: the curve of every run, and the median of each method."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.typing import Floats
from conevo.watch.settings import comparisons, differences
from conevo.watch.subjects import Subject
from conevo.worlds.measures import Measure

__all__ = ["CurvePanel", "panels_of"]

MOST = 300  # points of a curve
ALL = 40_000  # points of all curves together, about
FEWEST = 40
DIGITS = 5  # significant ones of the largest value of a curve
AXES = ("evaluations", "generation")
QUANTITIES = ("performance", "fitness")


class CurvePanel:
    """The runs of one environment that are compared with each other.

    Args:
        title: the environment, and other properties that the runs share.
        series: run -> its method or its variant, whichever is compared.
    """

    def __init__(self, title: Mapping[str, Any], series: Mapping[Subject, str]) -> None:
        self._title, self._series = dict(title), dict(series)
        self._key: tuple[Any, ...] = ()
        self._data: dict[str, Any] = {}

    def look(self, n_runs: int) -> dict[str, Any]:
        """Return the panel: the same object until one of its runs changes.

        Args:
            n_runs: on the whole page; curves have fewer points if it is large.
        """
        points = int(np.clip(ALL // max(n_runs, 1), FEWEST, MOST))
        key = (points, *(subject.version for subject in self._series))
        if key != self._key:
            self._key = key
            self._data = self._title | {
                "measure": self._measure.name,
                "about": self._measure.about,
                "larger_is_better": self._measure.larger_is_better,
                "rows": [self._row(name) for name in dict.fromkeys(self._series.values())],
                "over": {axis: self._curves(axis, points) for axis in AXES},
            }
        return self._data

    @property
    def _measure(self) -> Measure:
        """The main measure of task performance; without unit until a run has a value of one."""
        for one in self._series:
            if name := next(iter(one.summary["performance"]), ""):
                return one.measures.get(name, Measure(name))
        return Measure("performance")

    def _row(self, series: str) -> dict[str, Any]:
        """Return the states of a series' runs, and the medians of their last values."""
        runs = [one.summary for one, name in self._series.items() if name == series]
        sound = [run for run in runs if run["status"] != "damaged"]
        values = {
            "performance": [next(iter(run["performance"].values()), None) for run in sound],
            "fitness": [run["fitness"] for run in sound],
            "specialization": [run["specialization"] for run in sound],
            "evaluations": [run["evaluations"] or None for run in sound],
        }
        known = {key: [v for v in column if v is not None] for key, column in values.items()}
        return {
            "series": series,
            "of": len(runs),
            "status": dict(Counter(run["status"] for run in runs)),
            "lowest": min(known["performance"], default=None),
            "highest": max(known["performance"], default=None),
            **{key: median(column) if column else None for key, column in known.items()},
        }

    def _curves(self, axis: str, points: int) -> dict[str, Any]:
        """Return curves over one axis: x [G]; of every run and of every series' median, y [G]."""
        top = 0.0
        runs = [one for one in self._series if one.summary["status"] != "damaged"]
        curves = {q: [one.curve(q, axis) for one in runs] for q in QUANTITIES}
        for one, (x, _) in zip(runs, curves["fitness"], strict=True):
            budget = one.summary["budget"] if axis == "evaluations" and len(x) else 0
            top = max(top, budget, x[-1] if len(x) else 0.0)
        whole = axis == "generation" and top < points
        grid = np.arange(top + 1) if whole else np.linspace(0.0, top, points)
        found: dict[str, Any] = {"x": [float(f"{x:.6g}") for x in grid]}
        lines = {q: [_steps(x, y, grid) for x, y in curves[q]] for q in QUANTITIES}
        begun = [(k, one) for k, one in enumerate(runs) if len(curves["fitness"][k][0])]
        found["lines"] = [
            {"label": one.label, "series": self._series[one]}
            | {q: _plain(lines[q][k]) for q in QUANTITIES}
            for k, one in begun
        ]
        found["medians"] = []
        for name in dict.fromkeys(self._series.values()):
            found["medians"].append({"series": name})
            for q in QUANTITIES:
                mine = [lines[q][k] for k, one in begun if self._series[one] == name]
                values, n = _median(mine, len(grid))
                found["medians"][-1] |= {q: _plain(values), f"{q}_runs": n.tolist()}
        return found


def panels_of(subjects: Sequence[Subject], group: str) -> list[CurvePanel]:
    """Return the panels of runs that belong together, an environment each.

    Methods are compared if their settings are the same, and settings if all runs have one method.
    Runs of different presets are never compared.
    """
    by_task: dict[tuple[str, str], list[Subject]] = {}
    for one in subjects:
        about = one.summary
        if about["task"]:
            by_task.setdefault((about["task"], about["preset"]), []).append(one)
    found = []
    for (task, preset), members in by_task.items():
        title = {"group": group, "task": task, "preset": preset}
        methods = [one.summary["method"] for one in members]
        compared = comparisons(differences(methods, [one.apart for one in members]))
        if len(set(methods)) > 1:
            found += [
                CurvePanel(
                    title | {"variant": variant, "by": "method"},
                    {members[k]: methods[k] for k in some},
                )
                for variant, some in compared
            ]
        else:
            series = {members[k]: variant or methods[k] for variant, some in compared for k in some}
            by = "variant" if any(variant for variant, _ in compared) else "method"
            found.append(CurvePanel(title | {"variant": "", "by": by}, series))
    return found


def _steps(x: Floats, y: Floats, grid: Floats) -> Floats:
    """Return y [G] at each point of a grid: that of the last x up to it.

    NaN before the first x, and after the first point at or after the last x.
    """
    at = np.searchsorted(x, grid, side="right") - 1
    last = int(np.searchsorted(grid, x[-1])) if len(x) else -1
    is_within = (at >= 0) & (np.arange(len(grid)) <= last)
    return np.where(is_within, np.append(y, np.nan)[at], np.nan)


def _median(rows: Sequence[Floats], size: int) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return the median of rows [n, G], and the number of runs at each point.

    Only runs that have reached a point count there. The median is NaN where these are fewer than
    half of the runs that have begun: a run that has ended is not extended as a constant.
    """
    if not rows:
        return np.full(size, np.nan), np.zeros(size, np.int64)
    ordered = np.sort(np.stack(rows), axis=0)  # NaN last
    n = np.isfinite(ordered).sum(axis=0)
    columns = np.arange(size)
    low, high = np.maximum(n - 1, 0) // 2, n // 2
    middle = (ordered[low, columns] + ordered[np.minimum(high, len(rows) - 1), columns]) / 2
    return np.where((2 * n >= len(rows)) & (n > 0), middle, np.nan), n


def _plain(values: Floats) -> list[float | None]:
    """Return numbers as JSON has them, None if not finite."""
    finite = np.abs(values[np.isfinite(values)])
    most = float(finite.max()) if finite.size else 0.0
    places = DIGITS - 1 - int(np.floor(np.log10(most))) if most > 0 else 0
    rounded = np.round(values, min(places, 12))
    return [v if v - v == 0.0 else None for v in rounded.tolist()]
