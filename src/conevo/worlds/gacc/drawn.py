"""The playback of gathering and construction: objects, home area, complex objects."""

from __future__ import annotations

from collections import Counter

from conevo.palette import BLUE, FAINT, GREEN, INK, MOVE, ORANGE, SKY, VERMILION, shade
from conevo.playback.quantized import Channel
from conevo.playback.reading import Parts, begun, columns, octants
from conevo.playback.schema import (
    Backdrop,
    BodyKind,
    Curve,
    Gauge,
    Kind,
    PlanRow,
    Playback,
    Ring,
    SensorGroup,
    Things,
)
from conevo.worlds.gacc.drawn_building import EVENT_KINDS, Building
from conevo.worlds.gacc.plans import TYPES, plan

__all__ = ["CASTES", "playback"]

# Choice: hue is the type of object, lightness the action: detecting is light, gripping and
# gathering are as light as the objects themselves, constructing is dark.
OBJECTS = {"A": ORANGE, "B": SKY, "C": GREEN}
_DETECT, _GRIP, _CONSTRUCT = 0.5, 0.0, -0.35
ACTIONS = {
    **{f"detect {kind}": shade(hue, _DETECT) for kind, hue in OBJECTS.items()},
    "move": MOVE,
    **{f"grip {kind}": shade(hue, _GRIP) for kind, hue in OBJECTS.items()},
}
CASTES = {
    f"{kind}-{agent}": shade(hue, by)
    for agent, by in (("detector", _DETECT), ("gatherer", _GRIP), ("constructor", _CONSTRUCT))
    for kind, hue in OBJECTS.items()
}
OUTPUTS = (
    *(f"detect {kind}" for kind in TYPES),
    *("move: dx", "move: dy"),
    *(f"grip {kind}" for kind in TYPES),
)
LIFE = (  # in the order of its numbers
    Kind("lying", ""),
    Kind("gripped", INK),
    Kind("carried", INK),
    Kind("waiting for help", VERMILION),
    Kind("helped", BLUE),
    Kind("delivered", FAINT),
    Kind("dropped", ""),
)
RADIUS = 0.009  # Choice: a robot is a point in its world, and drawn in this size
OBJECT = 0.006  # Choice: half a side of an object, which is a point as well
HOME_REACH = 0.12  # Choice: home is sensed from everywhere; its sensors are drawn this long


def playback(parts: Parts) -> Playback:
    """Return the playback of an epoch of ``gacc``."""
    t, r = parts.t, parts.r
    objects, building = _objects(parts), Building(parts)
    see, near = parts.param("object_range"), parts.param("robot_range")
    grip = parts.param("grip_distance")
    return Playback(
        **begun(parts, ACTIONS, CASTES, OUTPUTS),
        unit="sides",
        seconds=0.0,
        bounds=(0.0, 0.0, 1.0, 1.0),
        body_kinds=(BodyKind("robot", RADIUS),),
        body=(0,) * r,
        x=parts.channel("x", t, r),
        y=parts.channel("y", t, r),
        energy=parts.channel("energy", t, r),
        held=parts.index("held", objects.kind.codes.size, t, r, least=-1),
        sensor_groups=(
            octants("objects and obstacles", 0, see),
            octants("robots", 8, near),
            octants("home area", 16, min(parts.param("home_range"), HOME_REACH)),
            SensorGroup("demand", 24, 3, tuple(TYPES)),
        ),
        backdrop=_backdrop(parts),
        things=(objects,),
        rings=(
            Ring("object detection range", (*(see,) * 3, 0.0, *(0.0,) * 3), "action"),
            Ring("grip distance", (*(0.0,) * 3, 0.0, *(grip,) * 3), "action"),
            Ring("robot sensor range", (near,) * len(ACTIONS), "selected"),
        ),
        events=building.events(),
        event_kinds=EVENT_KINDS,
        plan=_plan(parts, building),
        gauges=_demand(parts),
        measures=(Curve("objects delivered", Channel.of(building.delivered)),),
    )


def _objects(parts: Parts) -> Things:
    kind = parts.index("scene/object_type", len(TYPES), -1)
    k = kind.codes.size
    return Things(
        "objects",
        tuple(Kind(f"object {n}", colour) for n, colour in OBJECTS.items()),
        kind,
        parts.channel("object_x", parts.t, k),
        parts.channel("object_y", parts.t, k),
        size=OBJECT,
        shape="square",
        state=parts.index("life", len(LIFE), parts.t, k),
        states=LIFE,
    )


def _backdrop(parts: Parts) -> tuple[Backdrop, ...]:
    names = ("left", "bottom", "right", "top")
    sides = zip(*(parts.floats(f"scene/{name}", -1).tolist() for name in names), strict=True)
    home, zone = parts.param("home_side") / 2, parts.param("zone_side") / 2
    return (
        Backdrop("rect", _square(home), fill="#f3efe4", line="#c9c2ae", label="home area"),
        Backdrop("rect", _square(zone), fill="#e3dcc8", line=FAINT, label="construction zone"),
        *(
            Backdrop("rect", (*one,), "#bdbbb4", FAINT, label="" if k else "obstacles")
            for k, one in enumerate(sides)
        ),
    )


def _square(half: float) -> tuple[float, float, float, float]:
    """Return a square in the middle of the world."""
    return 0.5 - half, 0.5 - half, 0.5 + half, 0.5 + half


def _demand(parts: Parts) -> tuple[Gauge, ...]:
    """Return the demand for each type, which is at most 1."""
    demand = parts.channel("demand", parts.t, len(TYPES))
    return tuple(
        Gauge(f"demand {kind}", values, 1.0, OBJECTS[kind])
        for kind, values in zip(TYPES, columns(demand), strict=True)
    )


def _plan(parts: Parts, building: Building) -> tuple[PlanRow, ...]:
    """Return the plan; parts without a prescribed order in the order of building, then the rest.

    Raises:
        ValueError: the plan was not followed.
    """
    wanted = parts.index("scene/plan", len(TYPES), -1, -1).values.tolist()
    ordered = plan(parts.about["environment"]).is_ordered
    rows = []
    for c, (is_ordered, kinds, built) in enumerate(
        zip(ordered, wanted, building.rows, strict=True), 1
    ):
        came = [kind for kind, _ in built]
        lacks = Counter(kinds)
        lacks.subtract(came)
        if min(lacks.values()) < 0 or (is_ordered and kinds[: len(came)] != came):
            raise ValueError(f"complex object {c} is not built as it was planned")
        shown = kinds if is_ordered else [*came, *sorted(lacks.elements())]
        when = [t for _, t in built] + [parts.t] * (len(kinds) - len(came))
        rows.append(PlanRow(f"complex object {c}", is_ordered, (*shown,), (*when,)))
    return tuple(rows)
