"""Collective behaviours: how predators together capture a prey.

Nitschke 2009, section 4.6.3. A capture is named by the roles of its predators:

===============  =============================================================================
entrapment       3 or 4 pursuers
pursuer-blocker  1 to 3 pursuers, 1 to 3 blockers
spiders-fly      1 to 3 pursuers, 1 or 2 blockers, the prey at a wall (figure 4.6)
role-switcher    1 to 3 flankers, 1 to 3 knockers, up to 3 idle; they switch these roles
===============  =============================================================================

Choice: one blocker is enough for pursuer-blocker, as in figure 4.5 and 4.6.6; 4.6.3 requires two.
Choice: the most demanding is tried first: role-switcher, spiders-fly, pursuer-blocker, entrapment;
if none fits, the capture is none of them. Choice: idle predators are tolerated in all (4.5.3,
4.5.5); any other role that is not listed excludes the name. In the first three a predator counts
for its longest role; in the role-switcher for all its roles.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.terms import NON_SPECIALIZED
from conevo.worlds.pursuit.study.behaviours import (
    BEHAVIOURS,
    FLANKER,
    IDLE,
    KNOCKER,
    ArenaSizes,
    Conduct,
    Rules,
    spells,
)

__all__ = [
    "COLLECTIVES",
    "COMPOSITIONS",
    "Capture",
    "composition",
    "find_captures",
    "most_frequent",
    "name",
]

COLLECTIVES = ("entrapment", "pursuer-blocker", "spiders-fly", "role-switcher", "none")
# Smallest and largest number of predators of each role.
COMPOSITIONS = {
    "entrapment": {"pursuer": (3, 4)},
    "pursuer-blocker": {"pursuer": (1, 3), "blocker": (1, 3)},
    "spiders-fly": {"pursuer": (1, 3), "blocker": (1, 2)},
    "role-switcher": {"flanker": (1, 3), "knocker": (1, 3), "idle": (0, 3)},
}
Roles = Sequence[Sequence[str]]


@dataclass(frozen=True)
class Capture:
    """One capture of one prey.

    Attributes:
        prey: number of the prey.
        start: first iteration of the approach.
        first: first iteration in which the prey is captured.
        stop: first iteration in which it no longer is.
        roles: of each predator, the longest first; none if it took no part.
        at_wall: whether the prey was captured at a wall.
        switches: how often a predator changed between flanker, knocker and idle.
        collective: its name.
    """

    prey: int
    start: int
    first: int
    stop: int
    roles: tuple[tuple[str, ...], ...]
    at_wall: bool
    switches: int
    collective: str


def find_captures(
    record: Mapping[str, npt.NDArray[Any]],
    one: Conduct,
    sizes: ArenaSizes,
    rules: Rules | None = None,
) -> list[Capture]:
    """Return the captures of a recorded epoch, in the order of their prey and time.

    Args:
        record: x, y [T, B] and captured [T, Q].
        one: behaviour of the predators in it.
        sizes: the arena and the robots.
        rules: length of an approach, and so on.
    """
    rules = rules or Rules()
    found = []
    for q in range(record["captured"].shape[1]):
        body = sizes.n_predators + q
        walls = [record[axis][:, body] for axis in "xy"]
        walls += [sizes.arena_cm - values for values in walls]
        at_wall = np.min(walls, axis=0) - sizes.radius_cm <= rules.wall_cm
        before = 0
        for first, stop in _joined(spells(record["captured"][:, q] > 0), rules.pause):
            start = max(first - rules.approach, before)
            doing = np.where(
                one.interacts[start:stop] & (one.prey[start:stop] == q),
                one.behaviour[start:stop],
                len(BEHAVIOURS),
            )
            roles = tuple(_roles(column, rules) for column in doing.T)
            switches = sum(_switches(column) for column in doing.T)
            held = bool(at_wall[first:stop].mean() >= rules.share)
            collective = name(roles, at_wall=held, switches=switches)
            found.append(Capture(q, start, first, stop, roles, held, switches, collective))
            before = stop
    return found


def name(roles: Roles, *, at_wall: bool, switches: int) -> str:
    """Return the collective behaviour that predators with these roles form, or "none".

    Args:
        roles: of each predator, the longest first.
        at_wall: whether the prey is at a wall.
        switches: how often predators changed between flanker, knocker and idle.
    """
    taking = [own for own in roles if own]
    switchers = COMPOSITIONS["role-switcher"]
    if (
        switches > 0
        and sum(bool({"flanker", "knocker"} & set(own)) for own in taking) >= 2
        and all(set(own) & set(switchers) for own in taking)
        and _fits(Counter(role for own in taking for role in own), switchers)
    ):
        return "role-switcher"
    longest = Counter(own[0] for own in taking)
    for collective in ("spiders-fly", "pursuer-blocker", "entrapment"):
        listed = COMPOSITIONS[collective]
        if collective == "spiders-fly" and not at_wall:
            continue
        if set(longest) <= {*listed, "idle"} and _fits(longest, listed):
            return collective
    return "none"


def most_frequent(captures: Iterable[Capture]) -> tuple[str, dict[str, int]]:
    """Return the most frequent collective behaviour (ties by the order of ``COLLECTIVES``).

    It also returns how often each was observed; "none" if nothing was captured.
    """
    seen = Counter(one.collective for one in captures)
    counts = {collective: seen[collective] for collective in COLLECTIVES}
    if not seen:
        return "none", counts
    return max(COLLECTIVES, key=lambda collective: counts[collective]), counts


def composition(labels: Sequence[str], captures: Sequence[Capture]) -> dict[str, int | None]:
    """Return the number of predators that belong to each collective behaviour, and to none.

    Choice: a predator specialized to an individual behaviour belongs to the collective behaviour
    in which it took part most often in that role (4.6.3). If it never did, it belongs to none and
    is counted as non-specialized.

    Args:
        labels: of each predator, an individual behaviour or "non-specialized".
        captures: of its team.
    """
    occurs = most_frequent(captures)[1]
    table: dict[str, int | None] = {
        name: 0 if occurs[name] else None for name in COLLECTIVES if name != "none"
    }
    table[NON_SPECIALIZED] = 0
    for predator, label in enumerate(labels):
        parts = Counter(
            one.collective
            for one in captures
            if label in one.roles[predator] and label in COMPOSITIONS.get(one.collective, ())
        )
        most = max(COMPOSITIONS, key=lambda name: parts[name])
        belongs = most if parts else NON_SPECIALIZED
        table[belongs] = (table[belongs] or 0) + 1
    return table


def _fits(counts: Mapping[str, int], listed: Mapping[str, tuple[int, int]]) -> bool:
    return all(low <= counts.get(role, 0) <= high for role, (low, high) in listed.items())


def _joined(intervals: list[tuple[int, int]], pause: int) -> list[tuple[int, int]]:
    """Join intervals that are separated by less than ``pause`` iterations."""
    joined: list[tuple[int, int]] = []
    for start, stop in intervals:
        if joined and start - joined[-1][1] < pause:
            joined[-1] = (joined[-1][0], stop)
        else:
            joined.append((start, stop))
    return joined


def _roles(doing: npt.NDArray[np.int64], rules: Rules) -> tuple[str, ...]:
    """Return the roles that last long enough, the longest first."""
    counts = [int((doing == k).sum()) for k in range(len(BEHAVIOURS))]
    order = sorted(range(len(BEHAVIOURS)), key=lambda k: -counts[k])
    least = rules.role_share * len(doing)
    return tuple(BEHAVIOURS[k] for k in order if counts[k] >= max(least, 1))


def _switches(doing: npt.NDArray[np.int64]) -> int:
    """Return the changes between flanker, knocker and idle, whatever is between them."""
    roles = doing[np.isin(doing, (FLANKER, KNOCKER, IDLE))]
    return int((roles[1:] != roles[:-1]).sum())
