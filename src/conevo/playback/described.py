"""The additions of a world's ``Drawn`` to a playback: objects, areas and events."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError, unknown_name
from conevo.palette import FAINT, several
from conevo.playback.check import DAMAGE, one_line
from conevo.playback.drawn import Area, Drawn, Objects, Signal
from conevo.playback.quantized import Channel
from conevo.playback.reading import Parts
from conevo.playback.schema import Backdrop, Event, Kind, Playback, Things

__all__ = ["described"]

_PLACE = re.compile(r"\s*([A-Za-z_]\w*)\s*(?:\[([-\d:,\s]+)\])?\s*")
_GROUNDS = ("#efe6c8", "#d8e6df", "#e4dcec", "#e0e0da")  # of areas without a colour, pale


def described(playback: Playback, parts: Parts, drawn: Drawn) -> Playback:
    """Return a playback with the objects, areas and signals that its world describes.

    Raises:
        UsageError: the world names an array that is not recorded, or cannot be drawn.
    """
    places = _Places(parts)
    n = len(playback.event_kinds)
    things = tuple(places.objects(one, k) for k, one in enumerate(drawn.objects))
    colours = several(8)
    return replace(
        playback,
        things=(*playback.things, *things),
        backdrop=(
            *playback.backdrop,
            *(places.area(one, k) for k, one in enumerate(drawn.areas)),
        ),
        event_kinds=(
            *playback.event_kinds,
            *(Kind(s.name, s.colour or colours[k % 8]) for k, s in enumerate(drawn.signals)),
        ),
        events=(
            *playback.events,
            *(e for k, one in enumerate(drawn.signals) for e in places.events(one, n + k)),
        ),
    )


class _Places:
    """Numbers of an epoch by texts that name their arrays, as in "ball[0]"."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._world = one_line(parts.about["world"])

    def _refuse(self, name: str, what: str) -> UsageError:
        return UsageError(f"world {self._world}: {one_line(name)} is not drawn: {one_line(what)}")

    def values(self, name: str, text: float | str) -> npt.NDArray[Any]:
        """Return the numbers that a text names, in any shape.

        Args:
            name: of the object, area or signal, for messages.
            text: as in "ball[0]"; a number is returned as it is.

        Raises:
            UsageError: it names no array or value.
        """
        if not isinstance(text, str):
            return np.asarray(text)
        parsed = _PLACE.fullmatch(text)
        if parsed is None:
            raise self._refuse(name, f"{text!r} is not a place, as in 'ball[0]' or 'places[-1, 0]'")
        recorded, scene, params = self._parts.names
        key = parsed[1]
        if key in recorded:
            found = self._parts.any_channel(key).values
        elif key in scene:
            found = self._parts.any_channel(f"scene/{key}").values
        elif key in params:
            found = np.asarray(self._parts.param(key))
        else:
            known = {*recorded, *scene, *params}
            raise self._refuse(name, str(unknown_name("array or value", key, known)))
        if parsed[2] is None:
            return found
        try:
            index = tuple(_index(part) for part in parsed[2].split(","))
            is_timed = key in recorded and self.is_timed(found)
            return np.asarray(found[(slice(None), *index) if is_timed else index])
        except DAMAGE as error:
            shape = list(found.shape[1:] if key in recorded else found.shape)
            raise self._refuse(name, f"{text!r} picks from an array {shape}") from error

    def is_timed(self, values: npt.NDArray[Any]) -> bool:
        """Return whether an array has a row for every iteration."""
        return values.ndim > 0 and values.shape[0] == self._parts.t

    def objects(self, of: Objects, number: int) -> Things:
        """Return objects as things."""
        x, y = (self._row(of, text) for text in (of.x, of.y))
        if x.shape != y.shape:
            raise self._refuse(of.name, f"x is {list(x.shape)}, y {list(y.shape)}")
        k = x.shape[-1]
        names = of.kinds or (of.name,)
        kind = Channel.of(np.zeros(k, np.int64))
        if of.kind:
            kind = self._index(of, of.kind, (k,), len(names))
        t = self._parts.t
        gone = Channel.of(self._whole(of, of.gone, (k,)).clip(0, t)) if of.gone else None
        state = self._index(of, of.state, (t, k), len(of.states)) if of.state else None
        colours = (*of.colours, *several(8)[1 + number :], *several(8))[: len(names)]
        return Things(
            of.name,
            tuple(Kind(*one) for one in zip(names, colours, strict=False)),
            kind,
            Channel.of(x),
            Channel.of(y),
            size=of.size,
            shape=of.shape,
            gone=gone,
            state=state,
            states=tuple(Kind(*one) for one in zip(of.states, ("", *several(8) * 2), strict=False)),
        )

    def _row(self, of: Objects, text: str) -> npt.NDArray[Any]:
        """Return positions [K], or [T, K] of objects that move."""
        found = self.values(of.name, text)
        key = text.partition("[")[0].strip()
        if key in self._parts.names[0] and self.is_timed(found):
            return found.reshape(self._parts.t, -1)
        return found.reshape(-1)

    def _whole(self, of: Objects, text: str, shape: tuple[int, ...]) -> npt.NDArray[np.int64]:
        found = np.rint(np.asarray(self.values(of.name, text), np.float64))
        if found.size != int(np.prod(shape)):
            raise self._refuse(of.name, f"{text!r} is {list(found.shape)}, not {list(shape)}")
        return found.astype(np.int64).reshape(shape)

    def _index(self, of: Objects, text: str, shape: tuple[int, ...], n: int) -> Channel:
        """Return whole numbers from 0 to n - 1, indices of n names, as a channel."""
        found = self._whole(of, text, shape)
        if found.size and not (found.min() >= 0 and found.max() < n):
            raise self._refuse(
                of.name, f"{text!r} is {found.min()} to {found.max()}, for {n} names"
            )
        return Channel.of(found)

    def area(self, of: Area, number: int) -> Backdrop:
        """Return an area as a part of the backdrop."""
        names = ("x", "y", "radius", "width", "height")
        found = {name: self.values(of.name, getattr(of, name)) for name in names}
        for name, value in found.items():
            if value.size != 1:
                raise self._refuse(of.name, f"{name} is {list(value.shape)}, not one number")
        x, y, radius, width, height = (float(value.reshape(-1)[0]) for value in found.values())
        fill = of.colour or _GROUNDS[number % len(_GROUNDS)]
        if radius > 0:
            return Backdrop("disc", (x, y, radius), fill, FAINT, of.name)
        if not (width > 0 and height > 0):
            raise self._refuse(of.name, "it needs a radius, or a width and a height, above 0")
        corners = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
        return Backdrop("rect", corners, fill, FAINT, of.name)

    def events(self, of: Signal, kind: int) -> list[Event]:
        """Return an event for each rise of a number; those of [T, R] are robots' events."""
        found = self.values(of.name, of.rises)
        if not self.is_timed(found):
            raise self._refuse(of.name, f"{of.rises!r} is not recorded in every iteration")
        rows = found.reshape(self._parts.t, -1)
        rises = np.argwhere(np.diff(rows.astype(np.float64), axis=0, prepend=rows[:1]) > 0)
        n = rows.shape[1]
        if n == self._parts.r:
            return [Event(t, kind, f"robot {i}: {of.name}", (i,)) for t, i in rises.tolist()]
        return [Event(t, kind, of.name if n == 1 else f"{of.name} {i}") for t, i in rises.tolist()]


def _index(text: str) -> int | slice:
    """Return an index or a slice for numpy: "-1", "4:" or "0::2"."""
    parts = [int(part) if part.strip() else None for part in text.split(":")]
    if len(parts) == 1:
        if parts[0] is None:
            raise ValueError("an index is empty")
        return parts[0]
    return slice(*parts)
