"""One statement of a claim and its runs: it holds, is contradicted, open, or not tested.

"Above" is contradicted by a significant difference the other way and by samples shown to be alike;
"alike" by a significant difference. Each comparison is decided twice: by the t-test, as in the
thesis, and by Mann-Whitney with Holm's correction over all comparisons of the claim.

- Choice: a share holds if its 95 % interval (Clopper-Pearson; Student's t for a mean) lies inside
  the claimed range, and is contradicted if it lies outside. Otherwise it is open.
- Choice: a statement about CONE is not tested by runs in which it hardly exchanged anything between
  its populations: without exchange it is Multi-Agent ESP with type C fitness.
- Choice: nor is a statement about a method whose fitness had next to no signal of genotypes, so
  that it selected by luck, if runs have a study of signal (``repeatability.has_signal``).
- Choice: a statement about several environments together is open until all have runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

from conevo.report.claims.evidence import Evidence, Gathered
from conevo.report.claims.quantities import QUANTITIES
from conevo.report.claims.statements import Compare, Statement
from conevo.report.statistics import (
    ALPHA,
    Comparison,
    Estimate,
    compare,
    holm,
    is_alike,
    mean_interval,
    proportion_interval,
)

__all__ = ["Answer", "Decision", "measure"]


class Decision(Enum):
    """The outcome of a statement; the first ones are shown first."""

    CONTRADICTED = 0
    OPEN = 1
    HOLDS = 2
    UNTESTED = 3
    BLIND = 4
    MISSING = 5


@dataclass(frozen=True)
class Answer:
    """One statement of a claim and its outcome.

    Attributes:
        statement: what is claimed.
        gathered: the runs.
        comparison: of two samples, with the uncorrected p-values; None of a share or without runs.
        estimate: of a share or mean; None of a comparison or without runs.
        p_holm: Mann-Whitney's, corrected over the claim.
        by_t: outcome by the t-test, as in the thesis.
        by_rank: outcome by Mann-Whitney and Holm; of a share the same as ``by_t``.
    """

    statement: Statement
    gathered: Gathered
    comparison: Comparison | None
    estimate: Estimate | None
    p_holm: float | None
    by_t: Decision
    by_rank: Decision

    @property
    def has_runs(self) -> bool:
        """Whether every sample has runs."""
        return all(self.gathered.samples)

    @property
    def is_zero(self) -> bool:
        """Whether both samples are 0 throughout."""
        one = self.comparison
        return one is not None and one.mean_a == 0 and one.mean_b == 0

    @property
    def sizes(self) -> str:
        """The number of runs of each sample."""
        return ", ".join(str(len(sample)) for sample in self.gathered.samples)

    @property
    def value(self) -> float | None:
        """The difference, share or mean."""
        if self.comparison is not None:
            return self.comparison.difference
        return self.estimate.value if self.estimate else None

    @property
    def interval(self) -> tuple[float | None, float | None]:
        """The 95 % interval of the difference, share or mean."""
        found = self.comparison or self.estimate
        return (found.low, found.high) if found else (None, None)

    @property
    def scale(self) -> float:
        """The larger of two means, 0 without them."""
        if self.comparison is None:
            return 0.0
        return max(abs(self.comparison.mean_a or 0.0), abs(self.comparison.mean_b or 0.0))

    @property
    def weight(self) -> tuple[int, float]:
        """Sorts answers for display: the worst outcome first, then the furthest from the claim."""
        return self.by_rank.value, self._slack()

    def _slack(self) -> float:
        """Return how far the interval lies inside the claimed range; negative is outside."""
        low, high = self.interval
        if low is None or high is None:
            return -math.inf
        if not isinstance(self.statement, Compare):
            least, most = self.statement.low, self.statement.high
            # Nothing is below 0 or above 1, so these bounds are never the nearest.
            return min(low - least if least > 0 else 1.0, most - high if most < 1 else 1.0)
        inside = low if self.statement.expect == "above" else -max(abs(low), abs(high))
        return inside / (self.scale or 1.0)


def measure(statements: Sequence[Statement], evidence: Evidence) -> list[Answer]:
    """Return all the statements of a claim with their numbers and outcomes."""
    gathered = [evidence.gather(statement) for statement in statements]
    made = [
        compare(*runs.samples) if isinstance(one, Compare) and all(runs.samples) else None
        for one, runs in zip(statements, gathered, strict=True)
    ]
    corrected = holm([one.p_mann_whitney if one else None for one in made])
    return list(map(_cell, statements, gathered, made, corrected))


def _cell(
    statement: Statement, runs: Gathered, comparison: Comparison | None, p: float | None
) -> Answer:
    estimate = _estimate(statement, runs)
    if runs.present != set(statement.environments):
        by_t = by_rank = Decision.MISSING
    elif runs.is_blind:
        by_t = by_rank = Decision.BLIND
    elif runs.is_idle:
        by_t = by_rank = Decision.UNTESTED
    elif isinstance(statement, Compare):
        by_t = by_rank = Decision.OPEN
        if comparison is not None:
            is_more, is_above = (comparison.difference or 0) > 0, (comparison.a12 or 0) > 0.5
            by_t = _decide(statement, comparison, comparison.p_t, is_more)
            by_rank = _decide(statement, comparison, p, is_above)
    else:
        by_t = by_rank = _place(estimate, statement.low, statement.high)
    return Answer(statement, runs, comparison, estimate, p, by_t, by_rank)


def _estimate(statement: Statement, runs: Gathered) -> Estimate | None:
    if isinstance(statement, Compare) or not all(runs.samples):
        return None
    (values,) = runs.samples
    if QUANTITIES[statement.sample.quantity].is_share:
        return proportion_interval(round(math.fsum(values)), len(values))
    return mean_interval(values)


def _decide(statement: Compare, found: Comparison, p: float | None, is_higher: bool) -> Decision:
    """Return the outcome of a comparison by one test: its p, and whether it puts a above b.

    Choice: "alike" needs no difference by this test; but "above" is contradicted only by samples
    between which none of the tests, uncorrected, finds a difference.
    """
    if p is None:
        return Decision.OPEN
    if statement.expect == "above":
        if p < ALPHA:
            return Decision.HOLDS if is_higher else Decision.CONTRADICTED
        return Decision.CONTRADICTED if is_alike(found) else Decision.OPEN
    if p < ALPHA:
        return Decision.CONTRADICTED
    alone = replace(found, p_t=p, p_welch=None, p_mann_whitney=None)
    return Decision.HOLDS if is_alike(alone) else Decision.OPEN


def _place(found: Estimate | None, low: float, high: float) -> Decision:
    """Return whether an interval lies inside a range, outside, or neither."""
    if found is None or found.low is None or found.high is None:
        return Decision.OPEN
    if low <= found.low and found.high <= high:
        return Decision.HOLDS
    return Decision.CONTRADICTED if found.high < low or found.low > high else Decision.OPEN
