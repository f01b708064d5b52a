"""One look over a whole playback, so that whoever draws it can trust every number in it."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import fields, is_dataclass, replace
from typing import Any

from conevo.playback.channel import Channel
from conevo.playback.refusals import DAMAGE, refusal
from conevo.playback.schema import Backdrop, Event, Kind, Playback, Things

__all__ = ["MOST_EVENTS", "checked"]

MOST_EVENTS = 5_000
FARTHEST = 2.0**53  # the largest number that is exact everywhere
MOST_CHARACTERS = 2_000  # of a text: a fact may name every robot's caste
_SHAPES = {"rect": 4, "disc": 3, "raster": 4}
_COLOUR = re.compile(r"#[0-9a-f]{6}")


def checked(playback: Playback) -> Playback:
    """Return a playback whose parts fit together, its events in order of time.

    Choice: of more than 5,000 events the rarest kinds are kept, and of the kind that does not fit
    any more the first ones; a fact says so.

    Raises:
        UsageError: something does not fit.
    """
    try:
        _check_texts(playback)
        words = (*playback.output_names, *(word for fact in playback.facts for word in fact))
        _require(all(isinstance(word, str) for word in words), "a word is none")
        _check_team(playback)
        _check_activations(playback)
        for backdrop in playback.backdrop:
            _check_backdrop(backdrop)
        for things in playback.things:
            _check_things(things, playback.iterations)
        _check_surroundings(playback)
        _check_events(playback)
    except DAMAGE as error:
        raise refusal(error) from error
    return _with_fewer_events(playback)


def _check_texts(thing: Any) -> None:
    """Raise ValueError if anywhere in a thing a text is none, or none that can be shown."""
    if isinstance(thing, str):
        is_short = len(thing) <= MOST_CHARACTERS
        _require(is_short and thing.isprintable(), f"the text {thing[:40]!r} cannot be shown")
    elif isinstance(thing, tuple):
        for part in thing:
            _check_texts(part)
    elif is_dataclass(thing) and not isinstance(thing, Channel):
        for field in fields(thing):
            value = getattr(thing, field.name)
            _require(field.type != "str" or isinstance(value, str), f"{field.name} is {value!r}")
            _check_texts(value)


def _check_team(playback: Playback) -> None:
    t, r, b = playback.iterations, len(playback.robots), len(playback.body)
    _require(t >= 1 and 1 <= r <= b, f"{t} iterations, {r} robots, {b} bodies")
    x0, y0, x1, y1 = playback.bounds
    _finite("bounds", playback.bounds)
    _require(x0 < x1 and y0 < y1, f"bounds {playback.bounds}")
    _require(
        math.isfinite(playback.seconds) and playback.seconds >= 0, f"seconds {playback.seconds}"
    )
    _kinds("action", playback.actions)
    _kinds("caste", playback.castes)
    _indices("body", playback.body, len(playback.body_kinds))
    for kind in playback.body_kinds:
        _require(kind.shape in ("disc", "square"), f"a body is a {kind.shape}")
        _positive("radius of a body", kind.radius)
        _colour(kind.colour, or_none=True)
    _indices("caste", [robot.caste for robot in playback.robots], len(playback.castes))
    for robot in playback.robots:
        _finite("a robot", (robot.specialization, robot.fitness, robot.share))
        if playback.hidden is not None and not robot.heuristic:
            _indices("neuron", robot.neurons, playback.hidden.codes.shape[2])
    _channel("x", playback.x, (t, b))
    _channel("y", playback.y, (t, b))
    _channel("heading", playback.heading, (t, b))
    _channel("energy", playback.energy, (t, r))
    _channel("action", playback.action, (t, r), (-1, len(playback.actions)))
    if playback.held is not None:
        n = playback.things[0].kind.codes.size if playback.things else 0
        _channel("held", playback.held, (t, r), (-1, n))


def _check_activations(playback: Playback) -> None:
    t, r = playback.iterations, len(playback.robots)
    for name in ("sensors", "hidden", "outputs"):
        channel: Channel | None = getattr(playback, name)
        if channel is not None:
            _channel(name, channel, (t, r, channel.codes.shape[-1]))
    if playback.outputs is not None:
        n = playback.outputs.codes.shape[2]
        _require(
            n == len(playback.output_names), f"{n} outputs, {len(playback.output_names)} names"
        )
    n = playback.sensors.codes.shape[2] if playback.sensors is not None else 0
    for group in playback.sensor_groups:
        last = group.first + group.count
        _require(0 <= group.first < last <= n, f"{group.name} are {last} of {n} sensors")
        _require(len(group.names) == group.count, f"{group.name} without names")
        _require(len(group.angles) in (0, group.count), f"{group.name} without directions")
        _finite(group.name, (*group.angles, group.half, group.reach))
        _require(group.reach >= 0 and group.half >= 0, f"{group.name} reach {group.reach}")


def _check_backdrop(backdrop: Backdrop) -> None:
    shape = backdrop.shape
    _require(_SHAPES.get(shape) == len(backdrop.numbers), f"{shape} of {backdrop.numbers}")
    _finite(shape, backdrop.numbers)
    if shape == "disc":
        _positive("radius", backdrop.numbers[2])
    else:
        x0, y0, x1, y1 = backdrop.numbers
        _require(x0 <= x1 and y0 <= y1, f"{shape} of {backdrop.numbers}")
    _colour(backdrop.fill, or_none=True)
    _colour(backdrop.line, or_none=True)
    _require((shape == "raster") == (backdrop.cells is not None), f"{shape}, cells or not")
    if backdrop.cells is not None:
        _require(backdrop.cells.codes.ndim == 2 and backdrop.cells.codes.size > 0, "no cells")
        _channel("cells", backdrop.cells, backdrop.cells.codes.shape)


def _check_things(things: Things, t: int) -> None:
    name, k = things.name, things.kind.codes.size
    _kinds(name, things.kinds)
    _channel(name, things.kind, (k,), (0, len(things.kinds)))
    for places in (things.x, things.y):
        _channel(name, places, (k,) if places.codes.ndim == 1 else (t, k))
    _require(things.x.codes.shape == things.y.codes.shape, f"{name} with other x than y")
    _positive(f"size of {name}", things.size)
    _require(things.shape in ("disc", "square"), f"{name} are {things.shape}, not disc or square")
    _require(things.fade >= 1, f"{name} fade in {things.fade} frames")
    _channel(name, things.gone, (k,), (0, t + 1))
    _channel(name, things.state, (t, k), (0, len(things.states)))
    for state in things.states:
        _colour(state.colour, or_none=True)


def _check_surroundings(playback: Playback) -> None:
    t = playback.iterations
    for ring in playback.rings:
        _require(len(ring.radius) == len(playback.actions), f"{ring.name} of {ring.radius}")
        _finite(ring.name, ring.radius)
        _require(min(ring.radius) >= 0, f"{ring.name} of {ring.radius}")
        _require(ring.when in ("action", "selected"), f"{ring.name} when {ring.when}")
        _require(ring.of in ("robots", "others"), f"{ring.name} of {ring.of}")
    n = len(playback.things[0].kinds) if playback.things else 0
    for row in playback.plan:
        _indices(row.name, row.parts, n)
        _indices(row.name, row.built, t + 1)
        _require(len(row.parts) == len(row.built), f"{row.name} has other parts than built")
    for gauge in playback.gauges:
        _channel(gauge.name, gauge.values, (t,))
        _positive(gauge.name, gauge.most)
        _colour(gauge.colour)
    for measure in playback.measures:
        _channel(measure.name, measure.values, (t,))


def _check_events(playback: Playback) -> None:
    for kind in playback.event_kinds:
        _colour(kind.colour)
    for event in playback.events:
        _indices("iteration of an event", [event.t], playback.iterations)
        _indices("kind of an event", [event.kind], len(playback.event_kinds))
        _indices("robot of an event", event.robots, len(playback.robots))


def _with_fewer_events(playback: Playback) -> Playback:
    """Return a playback with its events in order of time, and no more of them than can be shown."""
    events = sorted(playback.events, key=lambda event: (event.t, event.kind))
    if len(events) <= MOST_EVENTS:
        return replace(playback, events=tuple(events))
    counts = Counter(event.kind for event in events)
    by_rarity = sorted(events, key=lambda event: (counts[event.kind], event.kind))
    kept: set[int] = {id(event) for event in by_rarity[:MOST_EVENTS]}
    shown: list[Event] = [event for event in events if id(event) in kept]
    note = ("events", f"{MOST_EVENTS:,} of {len(events):,} shown, the rarest kinds first")
    return replace(playback, events=tuple(shown), facts=(*playback.facts, note))


# --- what can be wrong ----------------------------------------------------------------------------


def _require(is_right: bool, what: str) -> None:
    if not is_right:
        raise ValueError(what)


def _channel(
    name: str,
    channel: Channel | None,
    shape: tuple[int, ...],
    between: tuple[int, int] | None = None,
) -> None:
    """Raise ValueError if a channel has another shape, or numbers that cannot be.

    Args:
        name: of it.
        channel: None is right.
        shape: that it must have.
        between: of whole numbers, the first one allowed and the first one not allowed.
    """
    if channel is None:
        return
    actual = channel.codes.shape
    _require(actual == shape, f"{name} is {list(actual)}, not {list(shape)}")
    top = channel.low + channel.step * int(channel.codes.max(initial=0))
    _finite(name, (channel.low, channel.step, top))
    _require(max(abs(channel.low), abs(top)) <= FARTHEST, f"{name} holds {top}")
    if between is not None and channel.codes.size:
        values = channel.values
        _require(values.dtype.kind == "i", f"{name} is not of whole numbers")
        _indices(name, (int(values.min()), int(values.max())), between[1], between[0])


def _indices(name: str, found: Iterable[int], n: int, least: int = 0) -> None:
    for k in found:
        _require(least <= k < n, f"{name} is {k}, not {least}..{n - 1}")


def _finite(name: str, values: Iterable[Any]) -> None:
    for value in values:
        _require(math.isfinite(value), f"{name} is {value}")


def _positive(name: str, value: float) -> None:
    _require(math.isfinite(value) and value > 0, f"{name} is {value}")


def _kinds(name: str, kinds: tuple[Kind, ...]) -> None:
    _require(len(kinds) > 0, f"no kind of {name}")
    for kind in kinds:
        _colour(kind.colour)


def _colour(colour: str, or_none: bool = False) -> None:
    is_right = (or_none and not colour) or _COLOUR.fullmatch(colour) is not None
    _require(is_right, f"{colour!r} is not a colour, as in '#d55e00'")
