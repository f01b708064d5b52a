"""How far a run or a shaping is and how long it will still take, wherever that is shown."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import TYPE_CHECKING, NamedTuple

from conevo.runs.outline import Outline
from conevo.typing import Record

if TYPE_CHECKING:
    from conevo.runs.run import Run

__all__ = ["Done", "Pace", "seconds_left", "share_of"]

RECENT = 10  # generations by which the pace is judged


class Done(NamedTuple):
    """What a run, or a stage of a shaping, has finished: generations and team evaluations."""

    generations: int
    evaluations: int


def share_of(planned: Sequence[Outline], done: Sequence[Done]) -> float:
    """Return the share that is over, in [0, 1]: of each stage's generations, or of its budget.

    Args:
        planned: the run, or every stage; none if that is not known.
        done: of the stages that have begun. One after which another has begun is over.
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
    """Return the seconds from the end of the last generation to that of the last one planned.

    By the pace of the last ten generations; stages to come are taken to be as fast.

    Args:
        planned, done: as for ``share_of``; of the stages done the last one has a generation.
        seconds: of every generation of that stage.
        evaluations: of teams that the stage had spent at the end of every generation.
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
            # What the budget cannot pay is not begun.
            more = min(more, (planned[k].budget_evaluations - spent) // cost)
        left += max(more, 0.0)
    return left * fmean(recent)


class Pace:
    """How far a run is while it evolves, how fast it is, and how long it will still take."""

    def __init__(self, run: Run) -> None:
        self.outline, self.records = run.outline, run.generations()

    def add(self, record: Record) -> None:
        """Add a finished generation; one that was there before it was made again."""
        self.records[record["generation"] :] = [record]

    @property
    def done(self) -> Done:
        """Generations and team evaluations so far."""
        spent = self.records[-1]["team_evaluations"] if self.records else 0
        return Done(len(self.records), spent)

    @property
    def share(self) -> float:
        """The share of the run that is over, by generations or by budget."""
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
