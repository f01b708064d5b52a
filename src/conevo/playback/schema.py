"""The playback of an epoch: the description of its drawing that viewer and films share.

A playback does not depend on the world. ``conevo.replay.playback`` makes one of a trajectory. The
viewer gets it as JSON with the channels next to it, and its types are generated from these classes
(``viewer/make_playback.py``). Lengths are in the world's unit, angles in rad counter-clockwise from
+x, y points up, colours are "#rrggbb". Frame t, from 0 to T - 1, is the state after iteration t;
actions and sensor values of frame t are those of iteration t.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np

from conevo.playback.quantized import Channel

__all__ = [
    "Backdrop",
    "BodyKind",
    "Event",
    "Gauge",
    "Kind",
    "Curve",
    "Pool",
    "PlanRow",
    "Ring",
    "Robot",
    "SensorGroup",
    "Playback",
    "Things",
]

Body = Literal["disc", "square"]


@dataclass(frozen=True)
class Kind:
    """A name with a colour: an action, a caste, a type of thing, a kind of event."""

    name: str
    colour: str


@dataclass(frozen=True)
class Backdrop:
    """An area that does not change.

    shape "rect": numbers x0, y0, x1, y1. "disc": x, y, radius. "raster": x0, y0, x1, y1, and
    ``cells`` [rows, columns], drawn where it is not 0; row 0 is at y0. An empty fill or line is not
    drawn.
    """

    shape: Literal["rect", "disc", "raster"]
    numbers: tuple[float, ...]
    fill: str = ""
    line: str = ""
    label: str = ""
    cells: Channel | None = None


@dataclass(frozen=True)
class BodyKind:
    """The look of some bodies: "robot" bodies have the colour of their action or caste.

    shape: "disc", or "square" for bodies that are not of the team. colour: "" for the team's
    robots.
    """

    name: str
    radius: float
    shape: Body = "disc"
    colour: str = ""


@dataclass(frozen=True)
class Things:
    """Rocks or objects.

    kinds: of them; kind [K]: index of each. x, y: [K], or [T, K] if they can be moved. size: half a
    side or the radius. shape: "square" or "disc". gone [K]: iteration in which each was detected or
    taken away, T if it never was; it fades during ``fade`` frames, to a faint mark. state [T, K]:
    index into ``states``, names with a colour for the rim ("" for none).
    """

    name: str
    kinds: tuple[Kind, ...]
    kind: Channel
    x: Channel
    y: Channel
    size: float
    shape: Body
    gone: Channel | None = None
    fade: int = 60
    state: Channel | None = None
    states: tuple[Kind, ...] = ()


@dataclass(frozen=True)
class Ring:
    """A range around the team's robots: [A] radius by the current action, 0 for none.

    when: "action": drawn for all robots, filled faintly in the colour of the action. "selected":
    an outline around the selected robot; around all if the reader turns ranges on. of "others": the
    same around the other bodies.
    """

    name: str
    radius: tuple[float, ...]
    when: Literal["action", "selected"]
    of: Literal["robots", "others"] = "robots"


@dataclass(frozen=True)
class SensorGroup:
    """Sensors that belong together: ``count`` of them from number ``first`` on.

    angles [count]: direction of each, relative to the heading if ``turns``; empty for sensors
    without direction. half: half of its angle of view, reach: its range from the robot's centre.
    Around a selected robot each is a wedge, as opaque as its value. names [count].
    """

    name: str
    first: int
    count: int
    names: tuple[str, ...]
    angles: tuple[float, ...] = ()
    half: float = 0.0
    reach: float = 0.0
    turns: bool = False


@dataclass(frozen=True)
class Robot:
    """A robot over the whole epoch.

    caste: index into the playback's castes. specialization: S. fitness. heuristic: its heuristic
    controller, "" for its network. neurons: slots in which it has hidden neurons. favourite: the
    setting that it used most, "" if none is known; share: of it in all settings that it used.
    """

    caste: int
    specialization: float
    fitness: float
    heuristic: str = ""
    neurons: tuple[int, ...] = ()
    favourite: str = ""
    share: float = 0.0


@dataclass(frozen=True)
class Event:
    """An event to jump to. kind: index into the playback's event kinds; robots: numbers."""

    t: int
    kind: int
    text: str
    robots: tuple[int, ...] = ()


@dataclass(frozen=True)
class PlanRow:
    """A complex object: kinds of its parts in order, and the iteration [parts] that built each.

    T if it never was. The kinds are those of the first group of things.
    """

    name: str
    is_ordered: bool
    parts: tuple[int, ...]
    built: tuple[int, ...]


@dataclass(frozen=True)
class Gauge:
    """A bar that moves with time: [T] between 0 and ``most``."""

    name: str
    values: Channel
    most: float
    colour: str


@dataclass(frozen=True)
class Curve:
    """A curve over the timeline: [T], the last value is that at the end of the epoch."""

    name: str
    values: Channel


@dataclass(frozen=True)
class Playback:
    """One team in one epoch, ready to be drawn. The R robots are the first of the B bodies.

    action [T, R]: index into actions, -1 for none. energy [T, R] or None. held [T, R]: number of
    the thing (of the first group) that a robot holds, -1 for none; or None. sensors [T, R, S],
    hidden [T, R, H], outputs [T, R, O]: activations; None if robots have no networks.
    output_names [O]. seconds: of an iteration, 0 if it has no duration.
    """

    title: str
    subtitle: str
    facts: tuple[tuple[str, str], ...]
    unit: str
    seconds: float
    bounds: tuple[float, float, float, float]
    iterations: int
    actions: tuple[Kind, ...]
    castes: tuple[Kind, ...]
    robots: tuple[Robot, ...]
    body_kinds: tuple[BodyKind, ...]
    body: tuple[int, ...]
    x: Channel
    y: Channel
    action: Channel
    heading: Channel | None = None
    energy: Channel | None = None
    held: Channel | None = None
    sensors: Channel | None = None
    hidden: Channel | None = None
    outputs: Channel | None = None
    sensor_groups: tuple[SensorGroup, ...] = ()
    output_names: tuple[str, ...] = ()
    backdrop: tuple[Backdrop, ...] = ()
    things: tuple[Things, ...] = ()
    rings: tuple[Ring, ...] = ()
    events: tuple[Event, ...] = ()
    event_kinds: tuple[Kind, ...] = ()
    plan: tuple[PlanRow, ...] = ()
    gauges: tuple[Gauge, ...] = ()
    measures: tuple[Curve, ...] = ()


class Pool:
    """Consecutive channels in one piece of memory, for a page.

    Time runs fastest: value [t, i, j] of a channel [T, I, J] is number t + T * (i + I * j). Every
    channel starts at a multiple of four bytes; little-endian.

    Attributes:
        data: all channels.
    """

    def __init__(self) -> None:
        self.data = bytearray()

    def add(self, channel: Channel) -> dict[str, Any]:
        """Add a channel; return its place: at, bytes (each), shape, low, step."""
        codes = channel.codes
        data = codes.astype(codes.dtype.newbyteorder("<")).tobytes(order="F")
        place = {
            "at": len(self.data),
            "bytes": codes.dtype.itemsize,
            "shape": list(codes.shape),
            "low": channel.low,
            "step": channel.step,
        }
        self.data += data + bytes(-len(data) % 4)
        return place

    def plain(self, thing: Any) -> Any:
        """Return a playback, or a part of one, as JSON has it; adds its channels to the pool."""
        if isinstance(thing, Channel):
            return self.add(thing)
        if isinstance(thing, tuple):
            return [self.plain(part) for part in thing]
        if isinstance(thing, np.generic):
            return thing.item()
        if hasattr(thing, "__dataclass_fields__"):
            return {field.name: self.plain(getattr(thing, field.name)) for field in fields(thing)}
        return thing
