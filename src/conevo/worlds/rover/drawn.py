"""The playback of the multi-rover world: canals, red rocks, rovers, and their detections."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from conevo.numbers import enumerated
from conevo.palette import BLUE, INK, MOVE, SKY, YELLOW
from conevo.playback.quantized import Channel
from conevo.playback.reading import Parts, begun, octants
from conevo.playback.schema import Backdrop, BodyKind, Curve, Event, Kind, Playback, Ring, Things
from conevo.worlds.rover import rocks

__all__ = ["CASTES", "playback"]

# Choice: the shorter the range of a setting, and the more accurate, the darker its colour.
ACTIONS = {"low": YELLOW, "med": SKY, "hi": BLUE, "move": MOVE}
CASTES = ACTIONS
OUTPUTS = ("low", "med", "hi", "move: dx", "move: dy")
# Choice: all rocks are red, like their name, and darker the more they are worth. Type E, which is
# never with others, looks like A, which is worth the same.
ROCKS = ("#eb9b80", "#d2613d", "#9c2f17", "#521107", "#eb9b80")
CANAL = "#dde5ea"
RADIUS = 0.009  # Choice: a rover is a point in its world, and drawn in this size
ROCK = 0.002  # half a side; sites are 0.005 apart
LANDER = 0.012  # Choice: radius; the lander only records


def playback(parts: Parts) -> Playback:
    """Return the playback of an epoch of ``rover``."""
    t, r = parts.t, parts.r
    *ranges, near = (_radius(parts, name) for name in ("low", "med", "hi", "rover_sensor"))
    return Playback(
        **begun(parts, ACTIONS, CASTES, OUTPUTS),
        unit="sides",
        seconds=0.0,
        bounds=(0.0, 0.0, 1.0, 1.0),
        body_kinds=(BodyKind("rover", RADIUS),),
        body=(0,) * r,
        x=parts.channel("x", t, r),
        y=parts.channel("y", t, r),
        energy=parts.channel("energy", t, r),
        # Choice: rock sensors have the range of the setting in use, and are drawn with the largest.
        sensor_groups=(octants("rovers", 0, near), octants("red rocks", 8, max(ranges))),
        backdrop=_backdrop(parts),
        things=(_rocks(parts),),
        rings=(
            Ring("detection range", (*ranges, 0.0), "action"),
            Ring("rover sensor range", (near,) * len(ACTIONS), "selected"),
        ),
        events=_detections(parts),
        event_kinds=(Kind("detection", ROCKS[2]),),
        measures=(_value(parts), _area(parts)),
    )


def _radius(parts: Parts, name: str) -> float:
    """Return the radius of a range."""
    found = parts.param(f"{name}_range")
    is_area = parts.about["params"].get("range_is") == "area"
    return math.sqrt(found / math.pi) if is_area else found


def _backdrop(parts: Parts) -> tuple[Backdrop, ...]:
    x, y = parts.floats("scene/lander", 2).tolist()
    canal = parts.index("scene/canal", 2, -1, -1)
    return (
        Backdrop("raster", (0.0, 0.0, 1.0, 1.0), fill=CANAL, label="canals", cells=canal),
        Backdrop("disc", (x, y, LANDER), fill="#ffffff", line=INK, label="lander"),
    )


def _rocks(parts: Parts) -> Things:
    kind = parts.index("scene/rock_type", len(rocks.TYPES), -1).values
    gone = parts.index("detected", 2**31, len(kind)).values
    present = np.unique(kind)
    worth = [f"red rock {rocks.TYPES[n]}, worth {rocks.VALUES[n]}" for n in present]
    return Things(
        "red rocks",
        tuple(Kind(name, ROCKS[n]) for name, n in zip(worth, present, strict=True)),
        Channel.of(np.searchsorted(present, kind)),
        parts.channel("scene/rock_x", len(kind)),
        parts.channel("scene/rock_y", len(kind)),
        size=ROCK,
        shape="square",
        gone=Channel.of(np.minimum(gone, parts.t)),
    )


def _area(parts: Parts) -> Curve:
    return Curve("share of area covered", parts.channel("performance/area", parts.t))


def _value(parts: Parts) -> Curve:
    """Return the value that the lander has recorded, one iteration after each detection."""
    gone = parts.whole("detected", -1)
    value = parts.whole("scene/rock_value", len(gone))
    seen = gone < parts.t
    gains = np.bincount(gone[seen] + 1, value[seen], minlength=parts.t)[: parts.t]
    return Curve("value recorded by the lander", Channel.of(gains.cumsum().astype(np.int64)))


def _detections(parts: Parts) -> tuple[Event, ...]:
    """Return an event for every iteration with detected rocks, with the credited rovers."""
    gone = parts.whole("detected", -1)
    kind = parts.whole("scene/rock_type", len(gone))
    value = parts.whole("value", parts.t, parts.r)
    is_paid = np.diff(value, axis=0, prepend=0) > 0
    events = []
    for t in np.unique(gone[gone < parts.t]).tolist():
        rovers = np.flatnonzero(is_paid[t]).tolist()
        by = f" by {enumerated('rover', rovers)}" if rovers else ""
        events.append(Event(t, 0, _letters(kind[gone == t].tolist()) + by, tuple(rovers)))
    return tuple(events)


def _letters(kinds: list[int]) -> str:
    """Return rocks by type, "A, A, C"; many of them counted, "7 A, 2 C"."""
    letters = [rocks.TYPES[n] for n in sorted(kinds)]
    if len(letters) > 6:
        return ", ".join(f"{n} {letter}" for letter, n in Counter(letters).items())
    return ", ".join(letters)
