"""The contents of files in ``studies/``, as models that validate them when they are read."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from annotated_types import Ge
from typing_extensions import TypedDict

__all__ = ["SignalStudy", "Study"]

Count = Annotated[int, Ge(0)]


class ScoreRow(TypedDict):
    """The performance of a team of a comparison in one scenario."""

    study: str
    team: str
    measure: str
    scenario: Count
    value: float | None


class RobotRow(TypedDict):
    """A robot of the fittest team, see ``studies.study``; the first versions wrote five columns."""

    robot: Count
    caste: str
    specialization: float | None
    fitness: float | None
    hidden: Count
    favourite_setting: NotRequired[str | None]
    setting_share: NotRequired[float | None]
    affinity: NotRequired[float | None]
    favourite_action: NotRequired[str | None]
    action_share: NotRequired[float | None]
    independent: NotRequired[float | None]
    relative: NotRequired[float | None]


class ActionRow(TypedDict):
    """How often a robot executed an action."""

    robot: Count
    action: str
    count: Count


class BehaviourRow(TypedDict):
    """How many predators or captures are of a kind."""

    kind: str
    behaviour: str
    count: Count


class Study(TypedDict):
    """See ``studies.study``."""

    scores: list[ScoreRow]
    robots: list[RobotRow]
    actions: list[ActionRow]
    metrics: dict[str, float | None]
    behaviours: list[BehaviourRow]


class SignalRow(TypedDict):
    """The signal of populations, at first or at last."""

    unit: str
    generation: Literal["first", "last"]
    number: Count
    populations: Count
    slots: Count
    genotypes: Count
    of: Count
    trials: Count
    icc: float | None
    standard_error: float | None
    low: float | None
    high: float | None
    scheme: Count
    icc_of_scheme: float | None
    low_of_scheme: float | None
    high_of_scheme: float | None
    rounds_for_half: float | None
    left_out: Count


class SignalStudy(TypedDict):
    """See ``signal.signal_study``."""

    task: str
    method: str
    credit: str
    signal: list[SignalRow]
    not_measured: str
