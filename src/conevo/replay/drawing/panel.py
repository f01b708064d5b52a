"""One team in a film: a head, its world, what is said beside or below it, and the timeline."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from conevo.palette import FAINT, GROUND, INK, shade
from conevo.playback.schema import Curve, Kind, PlanRow, Playback
from conevo.replay.drawing.planes import Colours, Mask, Planes, even
from conevo.replay.drawing.scene import Scene
from conevo.replay.drawing.strip import Strip

__all__ = ["PAGE", "Panel"]

Text = Callable[[int], str]  # of frame t
Font = ImageFont.FreeTypeFont | ImageFont.ImageFont

PAGE = "#ffffff"
_SOFT = "#62626c"  # text of less weight
_SIDE = 224  # px beside a world of 720, for what is said about it


@dataclass(frozen=True)
class _Key:
    """An entry of a legend: shape is "disc", "square" or "kite"; an empty line follows the fill."""

    name: str
    fill: str
    shape: str
    line: str = ""


class Panel:
    """Paints one team.

    Args:
        playback: to be painted.
        size: of the longer side of the world, px.
        colours: planes to paint.
        colour_by: "action" or "caste".
        alone: what is said stands beside the world, else below it.

    Attributes:
        size: (width, height) in px, both even.
        world: corners x0, y0, x1, y1 of the world in px, even.
        strip: the timeline.
        strip_at: its upper left corner.
    """

    def __init__(
        self, playback: Playback, size: int, colours: Colours, colour_by: str, alone: bool
    ) -> None:
        self.playback, self._colour_by = playback, colour_by
        sizes = (("large", 20, 12), ("text", 14, 10), ("small", 12, 9))
        self._points = {name: max(round(p * size / 720), least) for name, p, least in sizes}
        x0, y0, x1, y1 = playback.bounds
        longer = max(x1 - x0, y1 - y0)
        width, height = (max(even(side / longer * size), 2) for side in (x1 - x0, y1 - y0))
        gap = self._gap = even(16 * size / 720)
        left, top = gap, gap + self._line("large") + self._line("text") + even(gap / 2)
        self.world = (left, top, left + width, top + height)
        self._scene = Scene(playback, width, height, colours, colour_by)
        self._drawings: list[Callable[[Image.Image], None]] = []
        self._changes: list[Callable[[Planes, int, int], None]] = []
        total = width
        if alone:
            side = even(_SIDE * self._points["text"] / 14)
            total += gap + side
            bottom = max(self._say(left + width + gap, top, side), top + height)
        else:
            bottom = self._say(left, top + height + gap // 2, width)
        self.strip = Strip(playback, colours, total, size)
        self.strip_at = (left, even(bottom + gap))
        self.size = (total + 2 * gap, self.strip_at[1] + self.strip.height + gap)
        self._write(left, gap - 2, playback.title, "large", INK, total)
        self._write(left, gap + self._line("large"), playback.subtitle, "text", _SOFT, total)

    def background(self) -> Image.Image:
        """Return what is the same in all frames."""
        image = Image.new("RGB", self.size, PAGE)
        x0, y0, x1, y1 = self.world
        ImageDraw.Draw(image).rectangle((x0 - 1, y0 - 1, x1, y1), outline=FAINT)
        for drawing in self._drawings:
            drawing(image)
        return image

    def paint(self, page: Planes, x: int, t: int) -> None:
        """Paint what changes; the panel's left side is at x of the page."""
        page.put(self._scene.at(t), x + self.world[0], self.world[1])
        for change in self._changes:
            change(page, x, t)
        self.strip.paint(page, x + self.strip_at[0], self.strip_at[1], t)

    # --- what is said: each returns where it ends -------------------------------------------------

    def _say(self, x: int, y: int, width: int) -> int:
        playback = self.playback
        y = self._say_readings(x, y, width) + self._gap // 2
        coloured = {self._colour_by: " (their colour)"}
        title = "what robots do" + coloured.get("action", "")
        y = self._say_robots(title, playback.actions, self._doing(), x, y, width)
        counts = Counter(robot.caste for robot in playback.robots)
        castes = [playback.castes[k] for k in sorted(counts)]
        numbers = [str(counts[k]) for k in sorted(counts)]
        title = "castes" + coloured.get("caste", "")
        y = self._say_robots(title, castes, numbers, x, y, width)
        y = self._say_things(x, y, width)
        for row in playback.plan if playback.things else ():
            y = self._say_plan(row, x, y, width)
        return self._say_gauges(x, y, width)

    def _say_readings(self, x: int, y: int, width: int) -> int:
        playback = self.playback
        readings: list[tuple[str, Text]] = [
            (f"iteration of {playback.iterations:,}", lambda t: f"{t:,}")
        ]
        if playback.seconds:
            readings.append(("seconds", lambda t: f"{(t + 1) * playback.seconds:.1f}"))
        readings += [(measure.name, _reading(measure)) for measure in playback.measures[:2]]
        large = self._line("large")
        height = large + self._line("small") + self._gap // 4
        places, bottom = self._cells(x, y, width, len(readings), 170, height)
        for (name, value), (left, top, room) in zip(readings, places, strict=True):
            self._write(left, top + large, name, "small", _SOFT, room)
            self._write(left, top, value, "large", INK, room)
        return bottom

    def _doing(self) -> list[Text]:
        """Return how many robots execute each action in frame t, as texts."""
        actions = self.playback.action.values
        return [_at((actions == k).sum(axis=1)) for k in range(len(self.playback.actions))]

    def _say_robots(
        self,
        title: str,
        kinds: Sequence[Kind],
        counts: Sequence[Text | str],
        x: int,
        y: int,
        width: int,
    ) -> int:
        """Name kinds of robots, each with a number."""
        self._write(x, y, title, "small", _SOFT, width)
        y += self._line("small")
        places, bottom = self._cells(x, y, width, len(kinds), 160, self._line("text"))
        number = even(1.8 * self._points["text"])
        for kind, count, (left, top, room) in zip(kinds, counts, places, strict=True):
            self._write(left, top, count, "text", INK, number)
            self._draw_key(_Key(kind.name, kind.colour, "disc"), left + number, top, room - number)
        return bottom + self._gap // 2

    def _say_things(self, x: int, y: int, width: int) -> int:
        """Name what else is to be seen."""
        playback = self.playback
        keys = [
            _Key(kind.name, kind.colour or INK, "kite")
            for n, kind in enumerate(playback.body_kinds)
            if kind.shape == "square" and n in playback.body
        ]
        for things in playback.things:
            keys += [
                _Key(k.name, k.colour, things.shape) for k in things.kinds if k.colour != GROUND
            ]
            rims = dict.fromkeys(state.colour for state in things.states if state.colour)
            for rim in rims:
                names = [state.name for state in things.states if state.colour == rim]
                keys.append(_Key(", ".join(names), GROUND, things.shape, rim))
        for part in playback.backdrop:
            if part.label and part.fill:
                shape = "disc" if part.shape == "disc" else "square"
                keys.append(_Key(part.label, part.fill, shape, part.line))
        places, bottom = self._cells(x, y, width, len(keys), 160, self._line("text"))
        for key, (left, top, room) in zip(keys, places, strict=True):
            self._draw_key(key, left, top, room)
        return bottom + self._gap // 2

    def _say_plan(self, row: PlanRow, x: int, y: int, width: int) -> int:
        """Show a complex object: pale parts are still to be built."""
        order = "in this order" if row.is_ordered else "in any order"
        self._write(x, y, f"{row.name}, {order}", "small", _SOFT, width)
        y = even(y + self._line("small"))
        side = max(min(even(self._points["text"]), width // max(len(row.parts), 1) // 2 * 2 - 2), 2)
        for n, (kind, built) in enumerate(zip(row.parts, row.built, strict=True)):
            left = even(x) + n * (side + 2)
            colour = self.playback.things[0].kinds[kind].colour
            self._draw_box(shade(colour, 0.8), shade(colour, 0.4), left, y, side, side)
            self._change_box(colour, left, y, side, side, partial(_is_built, built))
        return y + side + self._gap // 4

    def _say_gauges(self, x: int, y: int, width: int) -> int:
        y = even(y + self._gap // 4)
        label, height = even(6 * self._points["text"]), even(self._points["text"] / 2)
        for gauge in self.playback.gauges:
            self._write(x, y, gauge.name, "small", _SOFT, label - 4)
            left, top, long = even(x + label), even(y + 4), (min(width, 320) - label) // 2 * 2
            self._draw_box("#ececea", "#ececea", left, top, long, height)
            share = (gauge.values.values / gauge.most).clip(0, 1)
            self._change_box(gauge.colour, left, top, long, height, partial(_item, share))
            y += self._line("text")
        return y

    # --- marks and letters ------------------------------------------------------------------------

    def _cells(
        self, x: int, y: int, width: int, count: int, least: int, height: int
    ) -> tuple[list[tuple[int, int, int]], int]:
        """Return places (x, y, room) for things of one size, row by row, and where they end."""
        n = max(min(width // round(least * self._points["text"] / 14), count), 1)
        room = width // n
        places = [(x + k % n * room, y + k // n * height, room - 6) for k in range(count)]
        return places, y + -(-count // n) * height

    def _draw_key(self, key: _Key, x: int, y: int, room: int) -> None:
        points = self._points["text"]
        mark = _mark(key, round(0.72 * points))
        self._drawings.append(lambda image: image.paste(mark, (x, y + round(0.2 * points))))
        self._write(x + mark.width + 6, y, key.name, "text", INK, room - mark.width - 6)

    def _draw_box(self, fill: str, line: str, x: int, y: int, width: int, height: int) -> None:
        box = (x, y, x + width - 1, y + height - 1)
        self._drawings.append(
            lambda image: ImageDraw.Draw(image).rectangle(box, fill=fill, outline=line)
        )

    def _change_box(
        self, fill: str, x: int, y: int, width: int, height: int, share: Callable[[int], float]
    ) -> None:
        """Have the left share of a box filled, as large as it is in frame t."""

        def change(page: Planes, dx: int, t: int) -> None:
            end = round(share(t) * width / 2) * 2
            if end:
                page.fill(fill, x + dx, y, x + dx + end, y + height)

        self._changes.append(change)

    def _write(
        self, x: int, y: int, text: Text | str, letters: str, colour: str, room: int
    ) -> None:
        """Write a text, cut to the room that there is; one that depends on t as it changes."""
        points = self._points[letters]
        if isinstance(text, str):
            shown = _fitted(text, points, room)
            self._drawings.append(
                lambda image: ImageDraw.Draw(image).text(
                    (x, y), shown, fill=colour, font=_font(points)
                )
            )
            return
        value, left, top = text, even(x), even(y)
        self._changes.append(
            lambda page, dx, t: page.paint(colour, _text_mask(value(t), points), left + dx, top)
        )

    def _line(self, letters: str) -> int:
        """Return the height of a line of text, px."""
        return even(1.4 * self._points[letters])


def _reading(measure: Curve) -> Text:
    """Return a measure in frame t as text."""
    is_whole = float(measure.values.step).is_integer()
    return _at(measure.values.values, 0 if is_whole else 3)


def _at(values: npt.NDArray[Any], digits: int = 0) -> Text:
    """Return the number of frame t as text, of numbers [T]."""
    return lambda t: f"{values[t]:,.{digits}f}"


def _item(values: npt.NDArray[Any], t: int) -> float:
    return float(values[t])


def _is_built(built: int, t: int) -> float:
    return float(t >= built)


def _mark(key: _Key, size: int) -> Image.Image:
    """Return the mark of a legend's entry, size px wide and high."""
    times = 8
    line = key.line or shade(key.fill, -0.25)
    image = Image.new("RGB", (size * times, size * times), PAGE)
    draw = ImageDraw.Draw(image)
    last = size * times - 1
    if key.shape == "disc":
        draw.ellipse((0, 0, last, last), fill=key.fill, outline=line, width=times)
    elif key.shape == "kite":
        half = last / 2
        draw.polygon([(half, 0), (last, half), (half, last), (0, half)], fill=key.fill)
    else:
        draw.rectangle((0, 0, last, last), fill=key.fill, outline=line, width=times)
    return image.reduce(times)


@lru_cache(maxsize=64)
def _font(points: int) -> Font:
    return ImageFont.load_default(points)


@lru_cache(maxsize=4096)
def _text_mask(text: str, points: int) -> Mask:
    font = _font(points)
    image = Image.new("L", (even(font.getlength(text) + 2), even(1.4 * points)))
    ImageDraw.Draw(image).text((0, 0), text, fill=255, font=font)
    return Mask.of(image)


def _fitted(text: str, points: int, room: int) -> str:
    """Return a text without what cannot be printed, cut to the room in px."""
    font = _font(points)
    text = "".join(letter if letter.isprintable() else " " for letter in text[:300])
    shown, end = text, ""
    while shown and font.getlength(shown + end) > room:
        shown, end = shown[:-1], "..."
    return shown + end
