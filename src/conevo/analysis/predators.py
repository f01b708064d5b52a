"""What a study sees of predators: their individual and collective behaviours.

Nitschke 2009, sections 4.6.4 to 4.6.6. Their castes are their individual behaviours.

- Choice: predators begin clones' scenarios close together around the prey (4.6.5), all teams in the
  same places; at random if obstacles are in the way or they see less far than they are wide.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from conevo.analysis.behaviours import BEHAVIOURS
from conevo.analysis.captures import most_frequent
from conevo.analysis.pursuit import Observation, watch
from conevo.analysis.reproduction import place_together
from conevo.rng import stream
from conevo.runs.champions import Team
from conevo.runs.lab import Lab
from conevo.specialization.individual import NON_SPECIALIZED
from conevo.specialization.team import Activity
from conevo.worlds.protocol import Scenarios

__all__ = ["Predators", "predators"]


def predators(
    team: Team, lab: Lab, scenarios: int, seed: int, threads: int | None = None
) -> Predators:
    """Return what predators are seen to do in the scenarios of the testing phase."""
    return Predators(watch(team, lab, scenarios, seed, threads=threads))


@dataclass(frozen=True)
class Predators:
    """An observation as studies need it (``analysis.observed``)."""

    seen: Observation
    castes = BEHAVIOURS

    @property
    def activity(self) -> Activity:
        """Windows of each predator in each behaviour, with its S and label."""
        lives = self.seen.lifetimes
        windows = [[share * life.windows for share in life.shares.values()] for life in lives]
        return Activity(
            np.rint(windows),
            np.array([life.specialization for life in lives]),
            [life.label for life in lives],
        )

    @property
    def behaviours(self) -> list[dict[str, Any]]:
        """Rows {kind, behaviour, count}: individual, collective and the team's usual one."""
        labels = Counter(life.label for life in self.seen.lifetimes)
        usual, captures = most_frequent(self.seen.all_captures)
        counts = [
            *(("individual", name, labels[name]) for name in (*BEHAVIOURS, NON_SPECIALIZED)),
            *(("collective", name, n) for name, n in captures.items()),
            ("team", usual, len(self.seen.all_captures)),
        ]
        return [{"kind": kind, "behaviour": name, "count": n} for kind, name, n in counts]

    def together(self, keys: Sequence[int]) -> Scenarios:
        """Return scenarios in which the predators begin around the prey, at random if none fits."""
        seen = self.seen
        if not self._fits_together:
            return seen.world.scenarios(keys)
        roles = [""] * seen.world.n_robots
        poses = np.stack(
            [place_together(stream(key, "places"), seen, roles, at_wall=False) for key in keys]
        )
        x, y, heading = (np.ascontiguousarray(poses[..., k]) for k in range(3))
        return replace(seen.world.scenarios(keys), x=x, y=y, heading=heading)

    @property
    def _fits_together(self) -> bool:
        """Whether all predators find room in sight of one prey."""
        setting, params = self.seen.setting, self.seen.world.params
        return setting.range_cm >= 2 * setting.radius_cm and not params.n_obstacles
