"""The progress of a run or a shaping and the time left, the same wherever they are shown."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import TYPE_CHECKING, NamedTuple

from conevo.runs.outline import Outline
from conevo.typing import Record

if TYPE_CHECKING:
    from conevo.runs.run import Run

__all__ = ["Done", "Pace", "seconds_left", "share_of"]

RECENT = 10  # generations that determine the pace


class Done(NamedTuple):
    """Finished generations of a run or of a stage of a shaping, and their team evaluations."""

    generations: int
    evaluations: int


def share_of(planned: Sequence[Outline], done: Sequence[Done]) -> float:
    """Return the finished share, in [0, 1]: of each stage's generations, or of its budget.

    Args:
        planned: the run, or every stage; empty if unknown.
        done: of the stages that have begun; all but the last of them are finished.
    """
    shares = [0.0] * len(planned)
    for k, (outline, one) in enumerate(zip(planned, done, strict=False)):
        over = one.generations / outline.generations
        if outline.budget_evaluations:
            over = max(over, one.evaluations / outline.budget_evaluations)
        shares[k] = 1.0 if k + 1 < len(done) else min(over, 1.0)
    return fmean(shares) if shares else 0.0


def seconds_left(
    planned: Sequence[Outline],
    done: Sequence[Done],
    seconds: Sequence[float],
    evaluations: Sequence[float],
) -> float:
    """Return the seconds from the end of the last generation to the planned end.

    Later generations and stages are assumed to be as fast as the last ten generations.

    Args:
        planned, done: as for ``share_of``; the last stage in ``done`` has a generation.
        seconds: of every generation of that stage.
        evaluations: team evaluations of that stage at the end of every generation.
    """
    recent = seconds[-RECENT:]
    if not recent:
        return 0.0
    cost = (evaluations[-1] - [0.0, *evaluations][-1 - len(recent)]) / len(recent)
    left = 0.0
    for k in range(len(done) - 1, len(planned)):
        finished, spent = done[k] if k < len(done) else Done(0, 0)
        more = float(planned[k].generations - finished)
        if planned[k].budget_evaluations and cost > 0:
            # No generation begins that the budget cannot pay for.
            more = min(more, (planned[k].budget_evaluations - spent) // cost)
        left += max(more, 0.0)
    return left * fmean(recent)


class Pace:
    """The progress of a run while it evolves, its speed and the time left."""

    def __init__(self, run: Run) -> None:
        self.outline, self.records = run.outline, run.generations()

    def add(self, record: Record) -> None:
        """Add a finished generation; after a resume it may replace earlier ones."""
        self.records[record["generation"] :] = [record]

    @property
    def done(self) -> Done:
        """Generations and team evaluations so far."""
        spent = self.records[-1]["team_evaluations"] if self.records else 0
        return Done(len(self.records), spent)

    @property
    def share(self) -> float:
        """The finished share of the run, by generations or by budget."""
        return share_of([self.outline], [self.done])

    @property
    def rate(self) -> float:
        """Team evaluations per second over the last generations."""
        seconds = sum(record["seconds"] for record in self.records[-RECENT:])
        before = self.records[-RECENT - 1]["team_evaluations"] if self.records[RECENT:] else 0
        return (self.done.evaluations - before) / seconds if seconds else 0.0

    @property
    def seconds_left(self) -> float:
        """The seconds until the last generation, or until the budget is spent."""
        seconds = [record["seconds"] for record in self.records]
        evaluations = [record["team_evaluations"] for record in self.records]
        return seconds_left([self.outline], [self.done], seconds, evaluations)
