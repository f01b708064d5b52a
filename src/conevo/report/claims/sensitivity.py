"""The effect of a changed setting: runs of a plan whose factors are settings.

Nitschke 2009, sections 4.2, 5.3.2 and 6.3.2. A claim about it is judged separately at each
combination of levels.

- Choice: unchanged is the middle one of a setting's levels in the campaign, by size; a factor with
  another number of levels than three, or of levels that are not numbers, has none.
- Choice: a run is compared with the run of the same seed at the unchanged levels. The change is a
  share of the unchanged runs' mean, so that the mean change is the difference of the means.
- Choice: levels changed by more than in the thesis do not count. It changes settings by a fifth,
  but in the multi-rover task generations and epochs by a quarter, and settings of the world by
  30 %.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

from conevo.campaigns.plan import levels_of
from conevo.campaigns.tables import RunValue, Tables

__all__ = ["changed"]

NEAR = 1e-9
FIFTH, QUARTER, THREE_TENTHS = 0.2, 0.25, 0.3
LEARNING = ("mutation_probability", "stagnation_v", "stagnation_w", "elite_portion", "n_hidden")
Usual = Mapping[str, float]  # factor -> its unchanged level


def changed(tables: Tables) -> dict[str, float]:
    """Return the change of each run that counts, as a share of the unchanged runs' mean."""
    groups: dict[tuple[str, ...], list[RunValue]] = defaultdict(list)
    for one in tables.values():
        groups[one.world, one.preset, one.environment, one.method].append(one)
    return {run: share for group in groups.values() for run, share in _shares(group).items()}


def _shares(group: list[RunValue]) -> dict[str, float]:
    levels = {one.variant: levels_of(one.variant) for one in group}
    usual = _usual(list(levels.values()))
    if not usual:
        return {}
    unchanged = {
        one.seed: one.value
        for one in group
        if all(_far(level, usual[name]) == 0 for name, level in levels[one.variant].items())
    }
    mean = sum(unchanged.values()) / len(unchanged) if unchanged else 0.0
    is_rover = group[0].world.startswith("rover-")
    return {
        one.run: (one.value - unchanged[one.seed]) / abs(mean)
        for one in group
        if mean and one.seed in unchanged and _counts(levels[one.variant], usual, is_rover)
    }


def _usual(every: list[dict[str, str]]) -> Usual:
    """Return the middle level of each factor, nothing unless all factors have one."""
    found: dict[str, set[float]] = defaultdict(set)
    try:
        for levels in every:
            for name, level in levels.items():
                found[name].add(float(level))
    except ValueError:
        return {}
    if any(len(of) != 3 for of in found.values()):
        return {}
    return {name: sorted(of)[1] for name, of in found.items()}


def _counts(levels: Mapping[str, str], usual: Usual, is_rover: bool) -> bool:
    """Whether something is changed, and nothing by more than in the thesis."""
    far = {name: _far(level, usual[name]) for name, level in levels.items()}
    return any(far.values()) and all(
        one <= _allowed(name, is_rover) + NEAR for name, one in far.items()
    )


def _far(level: Any, usual: float) -> float:
    return abs(float(level) - usual) / abs(usual) if usual else 0.0


def _allowed(name: str, is_rover: bool) -> float:
    if not is_rover or name in LEARNING:
        return FIFTH
    return QUARTER if name in ("generations", "epochs") else THREE_TENTHS
