"""The playback of predators and prey in their arena, for the worlds pursuit and prey."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from conevo.numbers import enumerated
from conevo.palette import (
    BLUE,
    FAINT,
    GREEN,
    GROUND,
    INK,
    MOVE,
    SKY,
    VERMILION,
    YELLOW,
    shade,
)
from conevo.playback.quantized import Channel
from conevo.playback.reading import Parts, begun
from conevo.playback.schema import (
    Backdrop,
    BodyKind,
    Curve,
    Event,
    Kind,
    Playback,
    Ring,
    SensorGroup,
    Things,
)
from conevo.terms import counted

__all__ = ["CASTES", "playback"]

ACTIONS = {"stop": MOVE, "forward": BLUE, "left": YELLOW, "right": SKY, "reverse": VERMILION}
CASTES = ACTIONS
RADIUS = 2.75  # of a Khepera and of an obstacle, cm; as in kernels.khepera, like the next
LOOK = (10, 45, 90, 180, -180, -90, -45, -10)  # directions of the sensors, degrees
SECONDS = 0.1  # of an iteration
CAPTURE, ESCAPE, COLLISION = range(3)
EVENT_KINDS = (
    Kind("capture begins", GREEN),
    Kind("capture ends", shade(GREEN, 0.5)),
    Kind("collision", FAINT),
)


def playback(parts: Parts) -> Playback:
    """Return the playback of an epoch of ``pursuit`` or ``prey``."""
    t, r = parts.t, parts.r
    is_prey = parts.about["world"].startswith("prey-v")
    n = parts.number("scene/n_bodies")
    if n < r + (not is_prey):
        raise ValueError(f"{n} bodies, of which {r} are the team's")
    x, y, heading = (_present(parts.channel(name, t, -1), n) for name in ("x", "y", "heading"))
    reach, side = parts.param("sensor_range_cm"), parts.length("arena_cm")
    team, others = ("prey", "predator") if is_prey else ("predator", "prey")
    captured = None if is_prey else parts.index("captured", 2, t, n - r)
    ranges = "infrared range" if is_prey else "infrared and light range"
    return Playback(
        **begun(parts, ACTIONS, CASTES, ("left wheel", "right wheel")),
        unit="cm",
        seconds=SECONDS,
        bounds=(0.0, 0.0, side, side),
        body_kinds=(BodyKind(team, RADIUS), BodyKind(others, RADIUS, "square", INK)),
        body=(0,) * r + (1,) * (n - r),
        x=x,
        y=y,
        heading=heading,
        sensor_groups=_sensors(parts, reach, ("infrared",) if is_prey else ("infrared", "light")),
        backdrop=_backdrop(parts, side),
        things=() if captured is None else (_halos(captured, x, y, r),),
        rings=(Ring(ranges, (RADIUS + reach,) * len(ACTIONS), "selected"),),
        events=(
            _ends(parts)
            if captured is None
            else (*_captures(captured.values, x, y, r, reach), *_collisions(parts))
        ),
        event_kinds=EVENT_KINDS,
        measures=(_path(parts) if captured is None else _capture_time(captured),),
    )


def _present(channel: Channel, n: int) -> Channel:
    """Return a channel [T, bodies] without the absent bodies."""
    if channel.codes.shape[1] < n:
        raise ValueError(f"{n} bodies, places of {channel.codes.shape[1]}")
    return Channel(channel.codes[:, :n], channel.low, channel.step)


def _sensors(parts: Parts, reach: float, names: tuple[str, ...]) -> tuple[SensorGroup, ...]:
    """Return eight sensors of each kind; they are drawn from the robot's centre, not its rim."""
    half = math.radians(parts.param("sensor_angle_deg"))
    angles = tuple(math.radians(a) for a in LOOK)
    sides = tuple(f"{abs(a)}° {'left' if a > 0 else 'right'}" for a in LOOK)
    return tuple(
        SensorGroup(name, 8 * k, 8, sides, angles, half, RADIUS + reach, turns=True)
        for k, name in enumerate(names)
    )


def _backdrop(parts: Parts, side: float) -> tuple[Backdrop, ...]:
    n = parts.number("scene/n_obstacles")
    x, y = parts.floats("scene/obstacle_x", -1), parts.floats("scene/obstacle_y", -1)
    if n > min(len(x), len(y)):
        raise ValueError(f"{n} obstacles, places of {len(x)}")
    walls = Backdrop("rect", (0.0, 0.0, side, side), line=INK, label="arena")
    return walls, *(
        Backdrop("disc", (a, b, RADIUS), "#c9c7c0", FAINT, label="" if k else "obstacles")
        for k, (a, b) in enumerate(zip(x[:n].tolist(), y[:n].tolist(), strict=True))
    )


def _halos(captured: Channel, x: Channel, y: Channel, r: int) -> Things:
    """Return a disc under every prey, of which only the rim is visible, while it is captured."""
    prey = np.zeros(captured.codes.shape[1], dtype=np.int64)
    return Things(
        "captured prey",
        (Kind("captured prey", GROUND),),
        Channel.of(prey),
        Channel(x.codes[:, r:], x.low, x.step),
        Channel(y.codes[:, r:], y.low, y.step),
        size=1.5 * RADIUS,
        shape="disc",
        state=captured,
        states=(Kind("free", ""), Kind("captured", GREEN)),
    )


def _capture_time(captured: Channel) -> Curve:
    held = captured.values.any(axis=1)
    return Curve("capture time (iterations)", Channel.of(held.cumsum()))


def _path(parts: Parts) -> Curve:
    fitness = parts.floats("fitness", parts.t, parts.r)
    return Curve("path (cm, mean of the prey)", Channel.of(fitness.mean(axis=1)))


# --- events ---------------------------------------------------------------------------------------


def _captures(
    captured: npt.NDArray[np.int64], x: Channel, y: Channel, r: int, reach: float
) -> list[Event]:
    """Return the starts of captures, with the predators in light range of the prey, and their ends.

    A predator is in range if the gap between the rims is at most the range, within the rounding
    error of recorded places.
    """
    limit = reach + 2 * RADIUS + 2 * (x.step + y.step)
    at = np.stack([x.values, y.values], axis=-1)
    events = []
    change = np.diff(captured, axis=0, prepend=0)
    for t, q in np.argwhere(change != 0).tolist():
        prey = "the prey" if captured.shape[1] == 1 else f"prey {q}"
        if change[t, q] > 0:
            apart = np.hypot(*(at[t, :r] - at[t, r + q]).T)
            near = np.flatnonzero(apart <= limit).tolist()
            text = f"{prey} is captured by {enumerated('predator', near)}"
            events.append(Event(t, CAPTURE, text, tuple(near)))
        else:
            free = np.flatnonzero(captured[:t, q] == 0)
            n = t - 1 - int(free[-1]) if len(free) else t
            text = f"{prey} is free again after {counted(n, 'iteration')}"
            events.append(Event(t, ESCAPE, f"{text} ({n * SECONDS:.1f} s)"))
    return events


def _collisions(parts: Parts) -> list[Event]:
    """Return the iterations in which moves of a predator start to be refused."""
    collided = parts.index("collided", 2, parts.t, -1).values[:, : parts.r]
    begins = np.diff(collided, axis=0, prepend=0) > 0
    return [
        Event(t, COLLISION, f"predator {i} collides", (i,)) for t, i in np.argwhere(begins).tolist()
    ]


def _ends(parts: Parts) -> tuple[Event, ...]:
    """Return the first collision of each prey of the team: the end of its epoch."""
    collided = parts.index("collided", 2, parts.t, -1).values[:, : parts.r]
    return tuple(
        Event(int(collided[:, i].argmax()), COLLISION, f"prey {i} collides: its epoch ends", (i,))
        for i in np.flatnonzero(collided.any(axis=0)).tolist()
    )
