"""Playbacks without a world: every part of a playback once, and crowds of any size."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo import palette
from conevo.playback.quantized import Channel
from conevo.playback.schema import (
    Backdrop,
    BodyKind,
    Curve,
    Event,
    Gauge,
    Kind,
    PlanRow,
    Playback,
    Ring,
    Robot,
    SensorGroup,
    Things,
)
from conevo.rng import stream

__all__ = ["BUILT_AT", "DETECTED", "HELD", "PHASE", "T", "crowd", "made_up", "renamed"]

T = 200
R = 4
PHASE = 20  # iterations for which a robot repeats an action
HELD = range(50, 100)  # robot 0 carries object 1
DETECTED = (60, T, 120)  # iteration in which each rock is
BUILT_AT = 150

# Places in a world of 12 by 6: the robots' rows, 1 apart, and the rocks' above them.
BOUNDS = (-2.0, 1.0, 10.0, 7.0)
ROCKS_X, ROCKS_Y = (1.0, 4.0, 7.0), (6.5, 6.5, 6.5)


def made_up(title: str = "Made-up team", shift: float = 0.0, **changes: Any) -> Playback:
    """Return a playback with known contents: four robots drive along parallel lines.

    shift: added to all their places and activations, so that another team has other numbers.
    """
    t, r = np.arange(T)[:, None], np.arange(R)[None]
    x = 0.5 * r + 0.015 * t + 0.2 * shift
    y = np.broadcast_to(1.5 + 1.0 * r, (T, R)) + 0.1 * shift
    other = np.full((T, 1), 8.5), np.linspace(2.0, 5.0, T)[:, None]
    action = (t // PHASE + r + round(10 * shift)) % 4
    action[100:120, 3] = -1
    held = np.full((T, R), -1)
    held[HELD, 0] = 1
    playback = Playback(
        title=title,
        subtitle="made-up world",
        facts=(("run", "none"), ("performance", "12.5")),
        unit="m",
        seconds=0.1,
        bounds=BOUNDS,
        iterations=T,
        actions=tuple(map(Kind, ("look", "walk", "grip", "rest"), palette.several(4))),
        castes=(Kind("scout", palette.SKY), Kind("non-specialized", palette.FAINT)),
        robots=tuple(
            Robot(
                caste=k % 2,
                specialization=0.1 + 0.2 * k,
                fitness=10.5 * k,
                neurons=(0, 2, 1)[: 3 - k % 2],
            )
            for k in range(R)
        ),
        body_kinds=(BodyKind("robot", 0.15), BodyKind("prey", 0.15, "square", palette.VERMILION)),
        body=(0, 0, 0, 0, 1),
        x=Channel.of(np.hstack([x, other[0]])),
        y=Channel.of(np.hstack([y, other[1]])),
        action=Channel.of(action),
        heading=Channel.of(np.hstack([0.03 * t - 3 + 0 * r, np.zeros((T, 1))])),
        energy=Channel.of(100 - 0.1 * (r + 1) * t),
        held=Channel.of(held),
        sensors=Channel.of(_wave(6, shift)),
        hidden=Channel.of(_wave(3, shift + 0.3), bits=8),
        outputs=Channel.of(_wave(4, shift + 0.6), bits=8),
        sensor_groups=(
            SensorGroup(
                "light",
                first=0,
                count=4,
                names=("front", "left", "back", "right"),
                angles=(0.0, 1.57, 3.14, -1.57),
                half=0.78,
                reach=1.0,
                turns=True,
            ),
            SensorGroup("demand", first=4, count=2, names=("A", "B")),
        ),
        output_names=("look", "walk", "grip", "rest"),
        backdrop=(
            Backdrop("rect", (-1.5, 1.2, 9.5, 6.8), fill="#f0eee6", label="home"),
            Backdrop("disc", (9.0, 6.0, 0.5), line=palette.INK, label="lamp"),
            Backdrop(
                "raster",
                (-2.0, 1.0, 0.0, 2.0),
                fill="#e0ddd0",
                cells=Channel.of(np.eye(8, dtype=np.uint8)),
            ),
        ),
        things=(_objects(x[:, 0], y[:, 0], shift), _rocks()),
        rings=(
            Ring("reach", (0.3, 0.0, 0.2, 0.0), "action"),
            Ring("sight", (0.6, 0.6, 0.6, 0.6), "selected"),
            Ring("light", (0.4, 0.4, 0.4, 0.4), "selected", of="others"),
        ),
        events=(
            Event(60, 0, "rock 0 detected", (1, 2)),
            Event(120, 0, "rock 2 detected", (2, 3)),
            Event(BUILT_AT, 1, "object 1 delivered", (0,)),
        ),
        event_kinds=(Kind("detection", palette.GREEN), Kind("delivery", palette.ORANGE)),
        plan=(
            PlanRow("first", True, (0, 1), (T, BUILT_AT)),
            PlanRow("second", False, (1, 1, 0), (T, T, T)),
        ),
        gauges=(Gauge("demand for A", Channel.of(np.linspace(0, 2, T)), 2.0, palette.BLUE),),
        measures=(Curve("value", Channel.of(np.linspace(0, 12.5, T))),),
    )
    return replace(playback, **changes)


def _wave(n: int, shift: float) -> npt.NDArray[np.float64]:
    """Return activations [T, R, n] between 0 and 1, no two near each other alike."""
    t, r, k = np.ix_(np.arange(T), np.arange(R), np.arange(n))
    return 0.5 + 0.5 * np.sin(0.37 * t + 1.3 * r + 2.1 * k + shift)


def _objects(x: npt.NDArray[Any], y: npt.NDArray[Any], shift: float) -> Things:
    """Two objects: one stays in place, the other is carried by robot 0, and built in later."""
    places_x, places_y = np.full((T, 2), 9.0), np.full((T, 2), 1.7)
    places_x[:, 1], places_y[:, 1] = x[HELD[0]], y[HELD[0]] + 0.5
    places_x[HELD, 1], places_y[HELD, 1] = x[HELD], y[HELD] + 0.5
    places_x[HELD[-1] :, 1], places_y[HELD[-1] :, 1] = x[HELD[-1]], y[HELD[-1]] + 0.5
    life = np.zeros((T, 2), np.int64)
    life[HELD, 1] = 1
    life[BUILT_AT:, 1] = 2
    return Things(
        "objects",
        kinds=(Kind("A", palette.BLUE), Kind("B", palette.ORANGE)),
        kind=Channel.of([0, 1]),
        x=Channel.of(places_x),
        y=Channel.of(places_y),
        size=0.12,
        shape="square",
        state=Channel.of(life),
        states=(Kind("lying", ""), Kind("held", palette.INK), Kind("built in", palette.GREEN)),
    )


def _rocks() -> Things:
    """Three rocks: one is never detected."""
    return Things(
        "rocks",
        kinds=(Kind("low", palette.SKY), Kind("high", palette.VERMILION)),
        kind=Channel.of([0, 1, 1]),
        x=Channel.of(ROCKS_X),
        y=Channel.of(ROCKS_Y),
        size=0.12,
        shape="disc",
        gone=Channel.of(DETECTED),
        fade=20,
    )


def crowd(robots: int = 30, rocks: int = 2000, iterations: int = 2500) -> Playback:
    """Return a playback as full as a large rover epoch: all robots move, half of the rocks fade."""
    rng = stream(6, "crowd")
    steps = rng.uniform(-0.004, 0.004, (2, iterations, robots)).cumsum(axis=1)
    x, y = 0.5 + 0.5 * np.sin(steps + rng.uniform(0, 6, (2, 1, robots)))
    switches = rng.random((iterations, robots)) < 0.05
    action = (switches.cumsum(axis=0) + np.arange(robots)) % 4
    gone = rng.integers(0, 2 * iterations, rocks).clip(max=iterations)
    cells = (rng.random((200, 200)) < 0.3).astype(np.uint8)
    found = [k for k in np.argsort(gone, kind="stable") if gone[k] < iterations]
    events = [Event(int(gone[k]), 0, f"rock {k}", (int(k) % robots,)) for k in found]
    groups = tuple(
        SensorGroup(
            name,
            first,
            8,
            tuple(f"octant {k}" for k in range(8)),
            tuple(0.785 * k for k in range(8)),
            0.393,
            0.05,
        )
        for name, first in (("rovers", 0), ("rocks", 8))
    )
    return made_up(
        title="Crowd",
        unit="side",
        seconds=0.0,
        bounds=(0.0, 0.0, 1.0, 1.0),
        iterations=iterations,
        robots=tuple(Robot(k % 2, 0.5, float(k), neurons=tuple(range(10))) for k in range(robots)),
        body_kinds=(BodyKind("rover", 0.004),),
        body=(0,) * robots,
        x=Channel.of(x),
        y=Channel.of(y),
        action=Channel.of(action),
        heading=None,
        energy=Channel.of(np.linspace(1000, 0, iterations)[:, None] + np.arange(robots)),
        held=None,
        sensors=Channel.of(rng.random((iterations, robots, 16)), bits=8),
        hidden=Channel.of(rng.random((iterations, robots, 10)), bits=8),
        outputs=Channel.of(rng.random((iterations, robots, 4)), bits=8),
        sensor_groups=groups,
        backdrop=(Backdrop("raster", (0, 0, 1, 1), fill="#ece9df", cells=Channel.of(cells)),),
        things=(
            Things(
                "rocks",
                kinds=tuple(map(Kind, "ABCDE", palette.several(5))),
                kind=Channel.of(rng.integers(0, 5, rocks)),
                x=Channel.of(rng.random(rocks)),
                y=Channel.of(rng.random(rocks)),
                size=0.0025,
                shape="square",
                gone=Channel.of(gone),
            ),
        ),
        rings=(Ring("reach", (0.07, 0.05, 0.03, 0.0), "action"),),
        events=tuple(events),
        plan=(),
        gauges=(),
        measures=(Curve("value", Channel.of(np.linspace(0, 5000, iterations))),),
    )


def renamed(playback: Playback, text: str) -> Playback:
    """Return a playback with a given text in place of every text."""

    def kinds(given: tuple[Kind, ...]) -> tuple[Kind, ...]:
        return tuple(replace(kind, name=text) for kind in given)

    return replace(
        playback,
        title=text,
        subtitle=text,
        facts=tuple((text, text) for _ in playback.facts),
        unit=text,
        actions=kinds(playback.actions),
        castes=kinds(playback.castes),
        robots=tuple(replace(robot, heuristic=text) for robot in playback.robots),
        body_kinds=tuple(replace(kind, name=text) for kind in playback.body_kinds),
        sensor_groups=tuple(
            replace(group, name=text, names=(text,) * group.count)
            for group in playback.sensor_groups
        ),
        output_names=(text,) * len(playback.output_names),
        backdrop=tuple(replace(part, label=text) for part in playback.backdrop),
        things=tuple(
            replace(some, name=text, kinds=kinds(some.kinds), states=kinds(some.states))
            for some in playback.things
        ),
        rings=tuple(replace(ring, name=text) for ring in playback.rings),
        events=tuple(replace(event, text=text) for event in playback.events),
        event_kinds=kinds(playback.event_kinds),
        plan=tuple(replace(row, name=text) for row in playback.plan),
        gauges=tuple(replace(gauge, name=text) for gauge in playback.gauges),
        measures=tuple(replace(measure, name=text) for measure in playback.measures),
    )
