"""The study of the pursuit world: its predators' individual and collective behaviours.

Nitschke 2009, sections 4.6.4 to 4.6.6. Castes are individual behaviours.

- Choice: in clones' scenarios predators start close together around the prey (4.6.5), all teams in
  the same places; at random if obstacles are in the way or if their range is below their width.
  This also applies to composed teams except spiders-fly, whose prey is in infrared range of a wall.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from conevo.rng import stream
from conevo.terms import S_SCALE
from conevo.worlds.pursuit.study.behaviours import BEHAVIOURS, Rules, executed
from conevo.worlds.pursuit.study.captures import COLLECTIVES, composition, most_frequent
from conevo.worlds.pursuit.study.composed import COMPOSED, roles_of
from conevo.worlds.pursuit.study.observation import Observation, record_team
from conevo.worlds.pursuit.study.reproduction import place_together, reproduce_individuals
from conevo.worlds.study import Account, AccountPart, Composed, StudyWords

if TYPE_CHECKING:
    from conevo.worlds.protocol import Scenarios, Simulator

__all__ = ["BEHAVIOURS", "COLLECTIVES", "WORDS", "Predators", "account", "observe"]

WORDS = StudyWords(
    robots="predators", events="captures", done="captures so", undone="captured nothing"
)


def observe(
    simulator: Simulator,
    genes: npt.NDArray[np.float32],
    team: npt.NDArray[np.int32],
    keys: Sequence[int],
    seed: int,
    rules: Rules | None = None,
) -> Predators:
    """Record a team of predators and return its observed behaviour."""
    return Predators(record_team(simulator, genes, team, keys, seed, rules))


@dataclass(frozen=True)
class Predators:
    """An observation in the form for studies (``worlds.study.Seen``)."""

    seen: Observation

    @property
    def executed(self) -> list[npt.NDArray[np.int64]]:
        """Each predator's behaviour in the windows that count."""
        return executed(self.seen.conducts)

    @property
    def collectives(self) -> tuple[str, dict[str, int]]:
        """The most frequent collective behaviour, and the captures of each."""
        return most_frequent(self.seen.all_captures)

    def composition(self, labels: Sequence[str]) -> dict[str, int | None]:
        """Return the number of predators that belong to each collective behaviour, and to none."""
        return composition(labels, self.seen.all_captures)

    def details(self, lifetimes: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """Return all further observations, as plain data.

        rules, capture_time; predators, each one's shares, windows, switches, specialization and
        label; collective (the most frequent) and captures (of each name); sensors (averages and
        profiles) and reproduction (behaviour of each with its sensors held at the averages).
        """
        collective, captures = self.collectives
        return {
            "rules": asdict(self.seen.rules),
            "capture_time": self.seen.capture_time,
            "predators": list(lifetimes),
            "collective": collective,
            "captures": captures,
            "sensors": self.seen.sensor_table(),
            "reproduction": reproduce_individuals(self.seen),
        }

    def together(self, keys: Sequence[int]) -> Scenarios:
        """Return scenarios in which predators start around the prey, at random if none fits."""
        return self._placed(keys, at_wall=False)

    def compositions(self, keys: Sequence[int]) -> list[Composed]:
        """Return the teams of figure 4.12, for one prey only; spiders-fly starts at a wall."""
        world = self.seen.world
        if world.n_prey > 1:
            return []
        return [
            Composed(
                name,
                roles_of(name, world.n_robots),
                self._placed(keys, at_wall=name == "spiders-fly"),
            )
            for name in COMPOSED
        ]

    def _placed(self, keys: Sequence[int], *, at_wall: bool) -> Scenarios:
        seen = self.seen
        if not self._fits_together:
            return seen.world.scenarios(keys)
        roles = [""] * seen.world.n_robots
        poses = np.stack(
            [place_together(stream(key, "places"), seen, roles, at_wall=at_wall) for key in keys]
        )
        x, y, heading = (np.ascontiguousarray(poses[..., k]) for k in range(3))
        return replace(seen.world.scenarios(keys), x=x, y=y, heading=heading)

    @property
    def _fits_together(self) -> bool:
        """Return whether all predators find room in sight of one prey."""
        sizes, params = self.seen.sizes, self.seen.world.params
        return sizes.range_cm >= 2 * sizes.radius_cm and not params.n_obstacles


def account(found: Mapping[str, Any]) -> Account:
    """Return the contents of ``Predators.details``, to be printed."""
    lives = found["predators"]
    names = list(lives[0]["shares"])
    seen = ", ".join(f"{name} {n}" for name, n in found["captures"].items() if n)
    parts = [
        AccountPart(
            f"Shares of the windows in which a predator interacts or idles (S: {S_SCALE})",
            ("", *names, "S", "label"),
            [
                (
                    f"predator {k}",
                    *_two(one["shares"].values()),
                    one["specialization"],
                    one["label"],
                )
                for k, one in enumerate(lives)
            ],
        ),
        AccountPart(f"Captures: {seen or 'none'}; most frequent: {found['collective']}"),
        AccountPart(
            "Averages of the sensors, from the front counter-clockwise",
            ("", "", *map(str, range(8))),
            [
                (row["behaviour"], kind, *_two(row[kind]))
                for row in found["sensors"]
                for kind in ("proximity", "light")
            ],
        ),
        AccountPart(
            "With the sensors held at a predator's own averages (portion of trials)",
            ("", "behaviour", "reproduced", "primitive", "left", "right", "result"),
            [
                (
                    f"predator {row['predator']}",
                    row["behaviour"],
                    *_two([row["reproduced"]]),
                    row["primitive"],
                    *_two([row["left"], row["right"]]),
                    row["result"],
                )
                for row in found["reproduction"]
            ],
        ),
    ]
    return Account({"capture time": found["capture_time"]}, parts)


def _two(values: Any) -> list[str]:
    return [f"{value:.2f}" for value in values]
