"""A run in two stages of one task: another method evolves the first, the run's own the second.

The second stage starts from populations bred from the first one's champion, so clones can evolve
first and differentiate later. Both stages share the length of one run, so such a run can be
compared with any other of the same budget. It has two settings, for example in plans; they do not
belong to a component, so configuration files do not have them::

    first = "homcne"       # the method of the first stage; "none", the default: only one stage
    first_share = 0.5      # of run.budget_evaluations and run.generations
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from conevo.errors import UsageError, placed, shown
from conevo.runs.config import resolve

if TYPE_CHECKING:
    from conevo.runs.config import RunConfig

__all__ = ["FIRST", "NONE", "SHARE", "First", "resolve_stages", "take_first", "without_method"]

FIRST, SHARE = "first", "first_share"
NONE = "none"
HALF = 0.5


@dataclass(frozen=True)
class First:
    """The first of two stages.

    Attributes:
        method: address of the method that evolves it.
        share: of the length of both stages, in (0, 1).
    """

    method: str
    share: float = HALF


def take_first(settings: Mapping[str, Any], place: str) -> tuple[dict[str, Any], First | None]:
    """Return settings without those of a first stage, and the first stage, None without one.

    Args:
        settings: "run.generations" -> 5 and the like.
        place: where they are, for messages.

    Raises:
        UsageError: one of the two has a value that is not allowed.
    """
    method, share = settings.get(FIRST, NONE), settings.get(SHARE, HALF)
    if not isinstance(method, str):
        raise UsageError(f'{FIRST} = {shown(method)} {place}: must name a method, or "{NONE}"')
    if type(share) not in (int, float) or not 0 < share < 1:
        raise UsageError(f"{SHARE} = {shown(share)} {place}: must be above 0 and below 1")
    rest = {key: value for key, value in settings.items() if key not in (FIRST, SHARE)}
    return rest, None if method == NONE else First(method, share)


def without_method(settings: Mapping[str, Any], config_class: type[Any]) -> dict[str, Any]:
    """Return settings without those of a method, which another one does not have.

    Args:
        settings: "method.gst" -> 0.1 and the like; also without the section, "gst".
        config_class: of the method's parameters.
    """
    own = config_class.__dataclass_fields__
    return {
        key: value
        for key, value in settings.items()
        if not (key.startswith("method.") or key in own)
    }


def resolve_stages(
    tasks: Sequence[str],
    method: str | None,
    preset: str | None,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
    of_first: Mapping[str, Any] | None = None,
    place: str = "in overrides",
) -> list[RunConfig]:
    """Return the configuration of a run, of its two stages, or of every stage of a shaping.

    Args:
        tasks: world and environment of the run, or of every stage of a shaping.
        method, preset, seed: as for ``resolve``.
        overrides: single settings; ``first`` and ``first_share`` may be among them.
        of_first: settings of the first stage, if another method evolves it.
        place: where settings came from, for messages.

    Raises:
        UsageError: as ``resolve``; of two stages also if both have one method, if the task has
            other parameters in one of them, if there is nothing to share, or if the method of the
            second has no populations that could be bred from a champion.
    """
    from conevo.evolution.inheritance import refuse_idle
    from conevo.runs.ancestry import refuse_other_controllers
    from conevo.runs.lab import refuse_unfit

    own, first = take_first(overrides or {}, place)
    found = [resolve(task, method, preset, seed, overrides=own, place=place) for task in tasks]
    if first is None:
        return found
    if len(tasks) > 1:
        raise UsageError(
            f"{FIRST} = {shown(first.method)} {place}: a run has either a first stage of another "
            f"method or the environments before its own (shape), not both"
        )
    with placed(FIRST, place):
        before = resolve(
            tasks[0], first.method, preset, seed, overrides=of_first, place=f"{place} ({FIRST})"
        )
    config = found[0]
    if before.method == config.method:
        raise UsageError(
            f"{FIRST} = {shown(first.method)} {place}: {config.method} evolves the second stage, "
            f"so the first needs another method"
        )
    if before.tables()["world"] != config.tables()["world"]:
        raise UsageError(
            f"{FIRST} = {shown(first.method)} {place}: [world] of {before.method} is not that of "
            f"{config.method}, and both stages are of one task"
        )
    refuse_other_controllers("the first stage", before, config)
    refuse_idle(before.method_config, f"{place} in the first stage")
    stages = _shared(before, config, first.share, place)
    refuse_unfit(*stages)
    return stages


def _shared(before: RunConfig, config: RunConfig, share: float, place: str) -> list[RunConfig]:
    """Return both stages, which take as long together as the run was planned.

    Each limit is shared: so neither stage spends what the other has left over.
    """
    lengths: tuple[dict[str, Any], ...] = ({}, {})
    for name in ("generations", "budget_evaluations"):
        whole = getattr(config.run, name)
        if whole == 1:
            raise UsageError(f"run.{name} = 1 {place} cannot be shared by two stages")
        part = min(max(round(share * whole), 1), whole - 1) if whole else 0
        for length, n in zip(lengths, (part, whole - part), strict=True):
            length[name] = n
    of_first = lengths[0] | {"target": config.run.target}
    return [before.of_length(of_first), config.of_length(lengths[1])]
