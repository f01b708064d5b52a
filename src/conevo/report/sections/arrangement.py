"""Where the cells of a group are drawn: which panel, which place along its axis, which method.

A panel holds a bar or a point cloud per place and method. Places are environments or, of one
environment, the levels of the factor with the most of them; every combination of levels of the
other factors has its own panel. A method without a factor is in all panels of that factor.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TypeVar

from conevo.campaigns.plan import levels_of
from conevo.report.comparison import Cell, Treatment

__all__ = ["MOST", "Arrangement", "arrange", "factors_of"]

MOST = 8
"""Panels, variants or methods that a drawing may have; beyond it a table is easier to read."""

NONE = "–"  # the level of a method that does not have the factor
T = TypeVar("T")
Drawn = TypeVar("Drawn")


@dataclass(frozen=True)
class Arrangement:
    """Where cells are drawn.

    Attributes:
        axis: what the places are, under an axis.
        axis_name: what they are in a sentence.
        places: names of them, in order.
        panels: titles of them, in order; one without a name if that is enough.
        methods: in the order of the registry.
        environments: of all cells, in order.
        where: cell -> its panels and its place.
    """

    axis: str
    axis_name: str
    places: Sequence[str]
    panels: Sequence[str]
    methods: Sequence[str]
    environments: Sequence[str]
    where: Mapping[Cell, tuple[Sequence[int], int]]

    @property
    def is_drawable(self) -> bool:
        """Whether a drawing of it can be read."""
        return len(self.panels) <= MOST and len(self.methods) <= MOST

    def grid(
        self, found: Mapping[Cell, T], make: Callable[[T], Drawn]
    ) -> dict[str, dict[str, list[Drawn | None]]]:
        """Return panel -> method -> what ``make`` makes of the cell at each place, or None."""
        made: dict[str, dict[str, list[Drawn | None]]] = {
            panel: {method: [None] * len(self.places) for method in self.methods}
            for panel in self.panels
        }
        for cell, value in found.items():
            panels, place = self.where[cell]
            for panel in panels:
                made[self.panels[panel]][cell.treatment.method][place] = make(value)
        return made

    def small_panels(self) -> dict[str, list[Cell]]:
        """Return the cells of a panel per environment and panel, by its title."""
        made: dict[str, list[Cell]] = {}
        for environment, (k, panel) in product(self.environments, enumerate(self.panels)):
            named = [environment] if len(self.environments) > 1 or not panel else []
            title = ", ".join([*named, *([panel] if panel else [])])
            cells = [
                cell
                for cell, (panels, _) in self.where.items()
                if cell.environment == environment and k in panels
            ]
            if cells:
                made[title] = cells
        return made


def factors_of(treatments: Iterable[Treatment]) -> dict[str, list[str]]:
    """Return the factors in which treatments of a method differ, with their levels: numbers first.

    A factor of one level is included if a method has treatments with and without it.
    """
    listed = [(treatment.method, levels_of(treatment.variant)) for treatment in treatments]
    found: dict[str, set[str]] = defaultdict(set)
    for _, own in listed:
        for name, level in own.items():
            found[name].add(level)
    return {
        name: sorted(levels, key=_rank)
        for name, levels in found.items()
        if len(levels) > 1
        or {method for method, own in listed if name in own}
        & {method for method, own in listed if name not in own}
    }


def arrange(
    cells: Iterable[Cell],
    environments: Sequence[str],
    names: Sequence[str],
    treatments: Sequence[Treatment],
    axis: str,
    *,
    by_environment: bool = False,
) -> Arrangement:
    """Return where cells are drawn.

    Args:
        cells: all that are drawn.
        environments: of them, in order.
        names: of the environments, along an axis.
        treatments: of them, in order.
        axis: what environments are called along an axis.
        by_environment: whether places are environments even with a single one.
    """
    factors = factors_of(treatments)
    along = ""
    if len(environments) == 1 and factors and not by_environment:
        along = max(factors, key=lambda name: len(factors[name]))
    across = {name: levels for name, levels in factors.items() if name != along}
    levels = [levels_of(treatment.variant) for treatment in treatments]
    occurring = {tuple(one.get(name) for name in across) for one in levels}
    whole = {one for one in occurring if None not in one} or occurring
    combinations = [
        combination
        for combination in product(*across.values())
        if any(_agree(combination, one) for one in whole)
    ]
    if along:
        has_none = any(along not in one for one in levels)
        places = [*factors[along], *([NONE] if has_none else [])]
    else:
        places = list(names)
    where = {}
    for cell in cells:
        own = levels_of(cell.treatment.variant)
        mine = tuple(own.get(name) for name in across)
        panels = [k for k, one in enumerate(combinations) if _agree(one, mine)]
        place = (
            places.index(own.get(along, NONE)) if along else environments.index(cell.environment)
        )
        where[cell] = (panels, place)
    return Arrangement(
        axis=along.replace("_", " ") or axis,
        axis_name=along.replace("_", " ") or "environment",
        places=places,
        panels=[
            ", ".join(
                f"{name.replace('_', ' ')} = {level}"
                for name, level in zip(across, one, strict=True)
            )
            for one in combinations
        ],
        methods=list(dict.fromkeys(treatment.method for treatment in treatments)),
        environments=environments,
        where=where,
    )


def _agree(panel: Sequence[str], levels: Sequence[str | None]) -> bool:
    """Whether levels are those of a panel; a missing level fits any."""
    return all(level in (None, own) for own, level in zip(panel, levels, strict=True))


def _rank(level: str) -> tuple[bool, float, str]:
    """Return what levels are sorted by: numbers by size, before all others."""
    try:
        return False, float(level), level
    except ValueError:
        return True, 0.0, level
