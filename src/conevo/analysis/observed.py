"""What a world observes of a team besides its actions: a hook of studies.

A world's class names it as ``observed = "module:function"``; the function takes team, lab, number
of scenarios, their seed and threads, and returns an ``Observed``.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any, Protocol

from conevo.runs.champions import Team
from conevo.runs.lab import Lab
from conevo.specialization.team import Activity
from conevo.worlds.protocol import Scenarios

__all__ = ["Observed", "observed"]


class Observed(Protocol):
    """What a team's robots were seen to do, which tells their castes in place of actions."""

    @property
    def castes(self) -> tuple[str, ...]:
        """Names of what robots can be seen to do, in the order in which they are listed."""

    @property
    def activity(self) -> Activity:
        """How often each robot did what, with its S and caste."""

    @property
    def behaviours(self) -> list[dict[str, Any]]:
        """Rows {kind, behaviour, count} of what was seen."""

    def together(self, keys: Sequence[int]) -> Scenarios:
        """Return the scenarios that clones play, one per key."""


def observed(
    team: Team, lab: Lab, scenarios: int, seed: int, threads: int | None
) -> Observed | None:
    """Return what the team's world observes of it, None if it observes nothing."""
    module, _, name = getattr(lab.world, "observed", "").partition(":")
    if not module:
        return None
    found: Observed = getattr(import_module(module), name)(team, lab, scenarios, seed, threads)
    return found
