"""The results of treatments, and every two of them compared: samples of runs, one value per run.

A treatment is a method with the levels of a campaign's further factors. Runs are compared within a
task and a budget only (``tables.Tables``); tasks of one family and budget make a ``Group``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from conevo.campaigns.plan import levels_of
from conevo.campaigns.tables import RunValue
from conevo.evolution.methods.registry import METHODS, title_of
from conevo.report.bootstrap import iqm_interval, probability_of_improvement
from conevo.report.statistics import (
    ALPHA,
    Comparison,
    Estimate,
    Normality,
    compare,
    holm,
    is_alike,
    mean_interval,
    moments,
    normality,
)

__all__ = [
    "Aggregate",
    "Cell",
    "Group",
    "Pair",
    "Summary",
    "Treatment",
    "aggregate",
    "agree",
    "compare_all",
    "group_values",
    "summarize",
    "treatments_of",
]


class Treatment(NamedTuple):
    """A method, and the levels of further factors ("" without any)."""

    method: str
    variant: str

    @property
    def title(self) -> str:
        """Name as published, and the levels."""
        name = title_of(self.method)
        return f"{name}, {self.variant}" if self.variant else name


def agree(a: str, b: str) -> bool:
    """Whether two variants have the same level of every factor that both have.

    A factor may apply to some methods only; the others' runs go with each of its levels.
    """
    one, other = levels_of(a), levels_of(b)
    return all(one[factor] == other[factor] for factor in one.keys() & other.keys())


class Group(NamedTuple):
    """Tasks of one family, run at one budget, which may share a table."""

    world: str
    family: str
    budget: str

    @property
    def condition(self) -> str:
        """Its rows among the runs with their budgets, as a condition in SQL."""
        world, family, budget = (part.replace("'", "''") for part in self)
        return f"world = '{world}' AND family = '{family}' AND budget = '{budget}'"


class Cell(NamedTuple):
    """Runs that differ in their seed only."""

    environment: str
    treatment: Treatment


@dataclass(frozen=True)
class Summary:
    """The results of the runs of a cell in one measure.

    Attributes:
        values: of the runs, by seed.
        mean: with Student's 95 % interval.
        sd: standard deviation of the runs (n - 1); None below two.
        normal: tests of normality.
    """

    values: tuple[float, ...]
    mean: Estimate
    sd: float | None
    normal: Normality

    @property
    def range(self) -> tuple[float, float]:
        """The lowest and the highest run."""
        return min(self.values), max(self.values)


@dataclass(frozen=True)
class Pair:
    """Two treatments in one environment.

    Attributes:
        environment: of both.
        a, b: the treatments.
        result: ``statistics.compare`` of a's runs and b's.
        p_holm: Mann-Whitney's p, corrected for all ``n_tests`` pairs of the group.
        n_tests: pairs in the family.
        larger_is_better: direction of the measure.
        samples: the runs of a and of b.
    """

    environment: str
    a: Treatment
    b: Treatment
    result: Comparison
    p_holm: float | None
    n_tests: int
    larger_is_better: bool = True
    samples: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())

    @property
    def gain(self) -> float:
        """The advantage of the first over the second, below 0 if it is worse."""
        difference = self.result.difference or 0.0
        return difference if self.larger_is_better else -difference

    @property
    def a12(self) -> float | None:
        """The probability that a run of the first is better than one of the second."""
        above = self.result.a12
        return above if above is None or self.larger_is_better else 1 - above

    @property
    def by_thesis(self) -> bool:
        """Whether the t-test is below 0.05, uncorrected."""
        return self.result.p_t is not None and self.result.p_t < ALPHA

    @property
    def by_ranks(self) -> bool:
        """Whether Mann-Whitney is below 0.05 after Holm's correction."""
        return self.p_holm is not None and self.p_holm < ALPHA

    @property
    def too_few(self) -> bool:
        """Whether Mann-Whitney could not get below 0.05 with any values of these few runs."""
        least = self.result.smallest_p
        return least is None or least * self.n_tests >= ALPHA

    @property
    def verdict(self) -> str:
        """The result for the first: better, worse, alike or undecided."""
        side = "better" if self.gain > 0 else "worse"
        if self.by_thesis and self.by_ranks:
            return side
        if self.by_thesis:
            return f"{side} (t-test only)"
        if self.by_ranks:
            return f"{side} (ranks only)"
        return "alike" if is_alike(self.result) else "undecided"


@dataclass(frozen=True)
class Aggregate:
    """A treatment over all environments that every treatment has runs of.

    Attributes:
        treatment: which.
        environments: how many.
        iqm: interquartile mean of the runs, 95 % stratified bootstrap interval.
        improvement: over each previous treatment, the probability that a run is better than one of
            that treatment.
    """

    treatment: Treatment
    environments: int
    iqm: Estimate
    improvement: Mapping[Treatment, Estimate]


def treatments_of(found: Iterable[tuple[str, str]]) -> list[Treatment]:
    """Return the treatments of (method, variant)s, in the order of the methods' registry."""
    order = {name: k for k, name in enumerate(METHODS)}
    distinct = {Treatment(method, variant) for method, variant in found}
    return sorted(distinct, key=lambda t: (order.get(t.method, len(order)), t.method, t.variant))


def group_values(values: Iterable[RunValue]) -> dict[Group, dict[Cell, list[RunValue]]]:
    """Return values by group and cell, in the order given: environments by number."""
    groups: dict[Group, dict[Cell, list[RunValue]]] = defaultdict(lambda: defaultdict(list))
    for one in values:
        cell = Cell(one.environment, Treatment(one.method, one.variant))
        groups[Group(one.world, one.family, one.budget)][cell].append(one)
    return {group: dict(cells) for group, cells in groups.items()}


def summarize(runs: Sequence[RunValue]) -> Summary:
    """Return the results of the runs of a cell."""
    values = tuple(run.value for run in runs)
    return Summary(values, mean_interval(values), moments(values)[1], normality(values))


def compare_all(cells: Mapping[Cell, Sequence[RunValue]]) -> list[Pair]:
    """Return every two treatments of each environment that differ in the method or in the levels.

    Pairs that differ in both are left out, because they would show nothing. The second of the
    registry's order comes first, so that a difference is the gain of the newer method. Choice: the
    family of Holm's correction is all pairs of the cells given.
    """
    direction = _larger_is_better(cells)
    pairs = [
        Pair(environment, a, b, compare(of[a], of[b]), None, 0, direction, (of[a], of[b]))
        for environment, of in _by_environment(cells).items()
        for b, a in combinations(of, 2)
        if a.method == b.method or agree(a.variant, b.variant)
    ]
    corrected = holm([pair.result.p_mann_whitney for pair in pairs])
    tests = sum(pair.result.p_mann_whitney is not None for pair in pairs)
    return [
        replace(pair, p_holm=p, n_tests=tests) for pair, p in zip(pairs, corrected, strict=True)
    ]


def aggregate(cells: Mapping[Cell, Sequence[RunValue]]) -> list[Aggregate]:
    """Return each treatment over the environments that all treatments have runs of.

    Shares of the optimum where the world knows it, so that environments may be pooled.
    """
    samples = _by_environment(
        {
            cell: [v._replace(value=v.value / v.optimum if v.optimum else v.value) for v in values]
            for cell, values in cells.items()
        }
    )
    treatments = treatments_of(treatment for _, treatment in cells)
    common = [of for of in samples.values() if all(treatment in of for treatment in treatments)]
    strata = {treatment: [of[treatment] for of in common] for treatment in treatments}
    if not common:
        return []
    sign = 1 if _larger_is_better(cells) else -1
    gains = {
        treatment: [np.multiply(sign, of) for of in some] for treatment, some in strata.items()
    }
    return [
        Aggregate(
            treatment=a,
            environments=len(common),
            iqm=iqm_interval(strata[a]),
            improvement={b: probability_of_improvement(gains[a], gains[b]) for b in treatments[:k]},
        )
        for k, a in enumerate(treatments)
    ]


def _larger_is_better(cells: Mapping[Cell, Sequence[RunValue]]) -> bool:
    """Return the direction of the measure of some cells, which all have the same one."""
    return all(one.measure.larger_is_better for values in cells.values() for one in values)


def _by_environment(
    cells: Mapping[Cell, Sequence[RunValue]],
) -> dict[str, dict[Treatment, tuple[float, ...]]]:
    """Return the samples of each environment, treatments in order."""
    order = treatments_of(treatment for _, treatment in cells)
    environments = dict.fromkeys(environment for environment, _ in cells)
    return {
        environment: {
            treatment: tuple(one.value for one in cells[Cell(environment, treatment)])
            for treatment in order
            if Cell(environment, treatment) in cells
        }
        for environment in environments
    }
