"""Individual behaviours of predators: pursuer, blocker, flanker, knocker, idle.

Nitschke 2009, sections 4.5, 4.6 and appendix B, where an experimenter names the behaviours. Here
the same words are geometric rules over the last second of a recorded epoch:

- **idle**: does not drive; it stands, or turns on the spot.
- **knocker**: bumps into the prey again and again, while its heading turns through an arc.
- **flanker**: bumps into the prey again and again, staying close to the left or right of its rear.
- **blocker**: drives straight at a prey that faces it.
- **pursuer**: drives straight at the prey from anywhere else.

The first rule that applies gives the behaviour; without one, the predator performs none. Choice: in
this order, because a knocker is identified by its motion in any place, a flanker by its place, and
both also drive at the prey most of the time.

All but idle count only in an interaction: within infrared range of another predator and within
light range of a prey (appendix B). Choice: idle counts anywhere, since its definition names neither
prey nor other predators, and its use is to keep out of the way (section 4.5.6).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = [
    "BEHAVIOURS",
    "NONE",
    "Conduct",
    "Rules",
    "ArenaSizes",
    "conduct",
    "executed",
    "spells",
]

BEHAVIOURS = ("pursuer", "blocker", "flanker", "knocker", "idle")
NONE = -1  # no behaviour of these
PURSUER, BLOCKER, FLANKER, KNOCKER, IDLE = range(len(BEHAVIOURS))

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Rules:
    """Limits of the behaviours. The thesis gives no numbers; all are conevo's own.

    Attributes:
        window: number of last iterations that determine a behaviour. Choice: 10, one second, the
            time for which a prey must hardly move to be captured.
        idle_cm: idle below this commanded path length in a window. Choice: 0.5, a sixteenth of the
            distance that a predator can drive. One whose moves are refused is not idle but in the
            way.
        share: directions must be right in this share of a window's iterations. Choice: half.
        aim_deg: driving at the prey: largest angle from its direction, or on a line that meets it.
            Choice: 30, half of a sensor's cone; pressing on a prey is driving at it.
        arc_deg: straight below this turn of the heading in a window, an arc from it on. Choice: 45,
            a circle of 10 cm radius at full speed.
        front_deg: a prey faces others up to this angle from its heading. Choice: 45.
        rear_deg: the sides of a prey's rear start here, counted from its heading. Choice: 90, the
            axle.
        behind_deg: and end here. Choice: 165; straight behind is neither left nor right.
        near_cm: close: largest gap between the rims, in all iterations of a window. Choice: 5.5, a
            robot's diameter.
        touch_cm: a move refused within this gap, towards the prey, is a collision with the prey.
            Choice: 1.8, just above the distance by which two robots can approach in one iteration.
        bumps: "repeatedly": number of collisions that start in a window. Choice: 2; a predator that
            presses on without moving collides once.
        approach: iterations before a capture that belong to it. Choice: 30, the time in which a
            predator crosses its sensors' range.
        pause: a capture resumed before this number of iterations is still the same. Choice: 10.
        role_share: a predator has the roles that it plays for this share of a capture, including
            the approach. Choice: a fifth.
        wall_cm: a prey is at a wall if the gap between them is at most this, in half of the
            captured iterations or more. Choice: 5.5; no robot fits in between.
    """

    window: int = 10
    idle_cm: float = 0.5
    share: float = 0.5
    aim_deg: float = 30.0
    arc_deg: float = 45.0
    front_deg: float = 45.0
    rear_deg: float = 90.0
    behind_deg: float = 165.0
    near_cm: float = 5.5
    touch_cm: float = 1.8
    bumps: int = 2
    approach: int = 30
    pause: int = 10
    role_share: float = 0.2
    wall_cm: float = 5.5


@dataclass(frozen=True)
class ArenaSizes:
    """Sizes of the arena and the robots for the rules; lengths in cm.

    Attributes:
        n_predators: R, the first bodies of a record.
        arena_cm: side of the arena.
        range_cm: of infrared and light sensors, between rims.
        speed_cm: the largest distance that a predator drives in one iteration.
        radius_cm: of a body.
        axle_cm: between its wheels.
    """

    n_predators: int
    arena_cm: float
    range_cm: float
    speed_cm: float
    radius_cm: float
    axle_cm: float


@dataclass(frozen=True)
class Conduct:
    """Behaviour of the predators in one epoch.

    Attributes:
        behaviour: [T, R] index into ``BEHAVIOURS``, or ``NONE``.
        interacts: [T, R] whether within range of another predator and of a prey.
        prey: [T, R] the closest prey, to which the behaviour refers.
        start: first iteration with a whole window; earlier ones have no behaviour.
    """

    behaviour: Ints
    interacts: Bools
    prey: Ints
    start: int


def conduct(
    record: Mapping[str, npt.NDArray[Any]], sizes: ArenaSizes, rules: Rules | None = None
) -> Conduct:
    """Return the behaviour of every predator in every iteration of a recorded epoch.

    Args:
        record: x, y, heading (after each iteration), left, right, collided, each [T, B].
        sizes: the arena and the robots.
        rules: limits of the behaviours.
    """
    rules = rules or Rules()
    r, w = sizes.n_predators, rules.window
    place = np.stack([record["x"], record["y"]], axis=-1).astype(np.float64)
    heading = record["heading"].astype(np.float64)
    place_before, heading_before = _before(place), _before(heading)

    chord, direction = _commanded(record, heading_before, sizes)
    way = place_before[:, None, r:] - place_before[:, :r, None]  # [T, R, Q, 2], to the prey
    far = np.maximum(np.linalg.norm(way, axis=-1), 1e-9)
    gap = far - 2 * sizes.radius_cm
    ahead = np.einsum("trk,trqk->trq", direction, way)
    aside = np.sqrt(np.maximum(far**2 - ahead**2, 0.0))
    aims = ahead >= far * math.cos(math.radians(rules.aim_deg))
    aims |= (ahead > 0) & (aside < 2 * sizes.radius_cm)
    refused = record["collided"][:, :r, None].astype(bool)
    touches = refused & (gap <= rules.touch_cm) & (ahead > 0)
    begins = touches & ~_before(touches)
    seen_at = np.arctan2(-way[..., 1], -way[..., 0]) - heading_before[:, None, r:]
    bearing = np.degrees(np.abs(_wrap(seen_at)))  # of the predator, as seen from the prey

    turned = np.degrees(np.abs(_last(_wrap(heading - heading_before)[:, :r], w)))
    idle = _last(chord, w) < rules.idle_cm
    is_prey, is_near = _near(place, sizes)
    prey = is_prey.argmin(axis=-1)

    def towards(values: npt.NDArray[Any]) -> Floats:
        """Return the window's sum of the values for the closest prey."""
        chosen = np.take_along_axis(_last(values, w), prey[..., None], axis=-1)
        return np.asarray(chosen[..., 0], dtype=np.float64)

    most = rules.share * w
    at_prey = (towards(aims) >= most) & (turned < rules.arc_deg)
    faces = towards(bearing <= rules.front_deg) >= most
    at_rear = (bearing >= rules.rear_deg) & (bearing <= rules.behind_deg)
    beside = (towards(at_rear) >= most) & (towards(gap <= rules.near_cm) == w)
    bumps = towards(begins) >= rules.bumps

    near_prey = is_prey.min(axis=-1) <= sizes.range_cm
    interacts = near_prey & is_near
    found = np.select(
        [idle, bumps & (turned >= rules.arc_deg), bumps & beside, at_prey & faces, at_prey],
        [IDLE, KNOCKER, FLANKER, BLOCKER, PURSUER],
        NONE,
    )
    found = np.where(interacts | idle, found, NONE)
    found[:w] = NONE
    return Conduct(found.astype(np.int64), interacts, prey.astype(np.int64), w)


def executed(conducts: Sequence[Conduct]) -> list[Ints]:
    """Return each predator's behaviour in the windows that count, ``NONE`` included.

    Choice: a behaviour applies to a window, so a switch is possible from one window to the next,
    not in every iteration. Choice: epochs are joined to one life.
    """
    predators = range(conducts[0].behaviour.shape[1])
    return [np.concatenate([_windows(one, i) for one in conducts]) for i in predators]


def spells(holds: Bools) -> list[tuple[int, int]]:
    """Return the maximal intervals [start, stop) of ``holds`` [T]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], holds.astype(np.int8), [0]])))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def _windows(one: Conduct, i: int) -> Ints:
    """Return predator ``i``'s behaviour in each of the windows that count."""
    at = slice(one.start, None, one.start)
    behaviour: Ints = one.behaviour[at, i]
    counted: Ints = behaviour[one.interacts[at, i] | (behaviour != NONE)]
    return counted


def _commanded(
    record: Mapping[str, npt.NDArray[Any]], heading: Floats, sizes: ArenaSizes
) -> tuple[Floats, Floats]:
    """Return the predators' steps as commanded, refused or not: length [T, R] and direction."""
    r = sizes.n_predators
    left, right = (record[side][:, :r].astype(np.float64) for side in ("left", "right"))
    half = sizes.speed_cm * (right - left) / (2 * sizes.axle_cm)
    chord = sizes.speed_cm * (left + right) / 2 * np.sinc(half / np.pi)
    angle = heading[:, :r] + half + np.where(chord < 0, np.pi, 0.0)
    return np.abs(chord), np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _near(place: Floats, sizes: ArenaSizes) -> tuple[Floats, Bools]:
    """Return the gaps to each prey [T, R, Q] and whether another predator is in range [T, R]."""
    r, body = sizes.n_predators, 2 * sizes.radius_cm
    gaps = np.linalg.norm(place[:, :r, None] - place[:, None], axis=-1) - body
    others = gaps[:, :, :r] + np.where(np.eye(r, dtype=bool), np.inf, 0.0)
    return gaps[:, :, r:], others.min(axis=-1) <= sizes.range_cm


def _before(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the previous iteration's values for each iteration; the first has its own."""
    return np.concatenate([values[:1], values[:-1]])


def _last(values: npt.NDArray[Any], w: int) -> Floats:
    """Return sums over the last ``w`` iterations, as far as they exist."""
    total = np.cumsum(values.astype(np.float64), axis=0)
    total[w:] -= total[:-w].copy()
    return np.asarray(total, dtype=np.float64)


def _wrap(angle: Floats) -> Floats:
    """Return angles wrapped to [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
