"""Measures of task performance, each with its unit and whether more is better."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from conevo.errors import UsageError

if TYPE_CHECKING:
    from conevo.worlds.protocol import World

__all__ = ["Measure", "measures_of"]


@dataclass(frozen=True)
class Measure:
    """A measure of task performance, as a world declares it.

    Fitness, on which methods select, is not a measure: more fitness is always better.

    Attributes:
        name: as in records and tables, "first_capture".
        unit: of its values, "iterations"; empty if it has none.
        larger_is_better: False for a measure that a team should keep small, such as a distance, a
            time or a number of mishaps.
        low, high: smallest and largest possible value, if the world knows them: intervals in
            reports end there. For the main measure ``optimum`` serves as the high.

    Raises:
        UsageError: a name or unit that is not text, a direction that is not True or False, ends
            that are not finite numbers or not in order.
    """

    name: str
    unit: str = ""
    larger_is_better: bool = True
    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        given: dict[str, Any] = asdict(self)  # of a world file: anything
        if not isinstance(given["name"], str) or not self.name:
            raise UsageError(f"a measure's name must be text, not {self.name!r}")
        kinds = (("unit", str, "text"), ("larger_is_better", bool, "True or False"))
        for what, kind, must in kinds:
            if not isinstance(given[what], kind):
                raise UsageError(
                    f"measure {self.name!r}: its {what} must be {must}, not {given[what]!r}"
                )
        for end in ("low", "high"):
            value = given[end]
            if value is not None and not (type(value) in (int, float) and math.isfinite(value)):
                raise UsageError(f"measure {self.name!r}: its {end} must be a number: {value!r}")
        if self.low is not None and self.high is not None and not self.low < self.high:
            ends = f"low {self.low:g} and high {self.high:g}"
            raise UsageError(f"measure {self.name!r}: {ends} must be in this order")

    @property
    def title(self) -> str:
        """The name in words, "first capture"."""
        return self.name.replace("_", " ")

    @property
    def direction(self) -> str:
        """Return "larger is better" or "smaller is better"."""
        return f"{'larger' if self.larger_is_better else 'smaller'} is better"

    @property
    def about(self) -> str:
        """Unit and direction, "iterations, smaller is better"."""
        return f"{self.unit}, {self.direction}" if self.unit else self.direction

    @property
    def heading(self) -> str:
        """Title, unit and direction, "first capture (iterations, smaller is better)"."""
        return f"{self.title} ({self.about})"

    @property
    def axis(self) -> str:
        """Title and unit, "first capture, iterations"."""
        return f"{self.title}, {self.unit}" if self.unit else self.title

    def best(self, values: Iterable[float]) -> float:
        """Return the best of some values."""
        return max(values) if self.larger_is_better else min(values)

    def is_better(self, value: float, than: float) -> bool:
        """Return whether a value is better than another."""
        return value > than if self.larger_is_better else value < than

    def reaches(self, value: float, target: float) -> bool:
        """Return whether a value is as good as a target."""
        return value >= target if self.larger_is_better else value <= target

    def record(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)


def measures_of(world: World) -> tuple[Measure, ...]:
    """Return the measures of a world, the main one first.

    A measure that the world only names has no unit, and is better when larger.

    Raises:
        UsageError: it declares something else, or two measures of one name.
    """
    declared: Any = world.performance
    if not (isinstance(declared, tuple) and declared):
        raise UsageError(
            f"world {world.name}: performance must be a tuple of measures, as in ('nearness',), "
            f"not {declared!r}"
        )
    measures = tuple(one if isinstance(one, Measure) else Measure(one) for one in declared)
    names = [one.name for one in measures]
    if twice := next((name for name in names if names.count(name) > 1), ""):
        raise UsageError(f"world {world.name}: performance has two measures named {twice!r}")
    return measures
