"""A made-up epoch that is small enough to be drawn often, and the colours of its pictures."""

from dataclasses import replace

import numpy as np

from conevo import palette
from conevo.playback.quantized import Channel
from conevo.playback.schema import Backdrop, BodyKind, Kind, PlanRow, Playback, Ring, Robot, Things

T = 40
SIZE = 240
GONE = 8  # the second rock
BUILT = 20
ACTIONS = (Kind("low", palette.ORANGE), Kind("move", palette.BLUE))
CASTES = (Kind("mover", palette.GREEN), Kind("non-specialized", palette.FAINT))


def playback(**changes):
    """Two robots in a square of 10 by 10: one stays and looks, the other moves to the right."""
    t = np.arange(T)
    action = np.stack([np.where(t < 30, 0, -1), np.ones(T, int)], axis=1)
    made = Playback(
        title="somewhere",
        subtitle="CONE, seed 1",
        facts=(),
        unit="m",
        seconds=0.1,
        bounds=(0.0, 0.0, 10.0, 10.0),
        iterations=T,
        actions=ACTIONS,
        castes=CASTES,
        robots=(Robot(1, 0.9, 1.0), Robot(0, 0.0, 2.0)),
        body_kinds=(BodyKind("robot", 0.3),),
        body=(0, 0),
        x=Channel.of(np.stack([np.full(T, 3.0), 2.0 + 0.1 * t], axis=1)),
        y=Channel.of(np.stack([np.full(T, 7.0), np.full(T, 2.0)], axis=1)),
        action=Channel.of(action),
        things=(
            Things(
                "rocks",
                (Kind("rock", palette.VERMILION),),
                Channel.of(np.zeros(2, int)),
                Channel.of([8.0, 6.0]),
                Channel.of([8.0, 8.0]),
                size=0.4,
                shape="square",
                gone=Channel.of([T, GONE]),
                fade=10,
            ),
        ),
        backdrop=(Backdrop("rect", (0.0, 0.0, 10.0, 0.5), fill="#ddccbb", label="wall"),),
        rings=(Ring("range", (1.5, 0.0), "action"),),
        plan=(PlanRow("thing", True, (0, 0), (BUILT, T)),),
    )
    return replace(made, **changes)


def rgb(colour):
    return tuple(int(colour[k : k + 2], 16) for k in (1, 3, 5))


def mixed(colour, below, opacity):
    return tuple(b + (c - b) * opacity for c, b in zip(rgb(colour), rgb(below), strict=True))


def near(found, wanted, by=2):
    return max(abs(a - b) for a, b in zip(found, wanted, strict=True)) <= by
