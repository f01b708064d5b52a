"""One team in a film: titles, its world, texts next to or below it, and the timeline."""

from __future__ import annotations

import operator
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from typing import Any

import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from conevo.palette import FAINT, GROUND, INK, shade
from conevo.playback.schema import Kind, PlanRow, Playback
from conevo.replay.drawing.mask import Mask
from conevo.replay.drawing.scene import Scene
from conevo.replay.drawing.timeline import Timeline

__all__ = ["PAGE", "Panel"]

Text = str | Callable[[int], str]  # of frame t, if it changes
Key = tuple[str, str, str, str]  # of a legend: name, fill, "disc", "square" or "kite", line

PAGE = "#ffffff"
_SOFT, _EMPTY = "#62626c", "#ececea"  # minor text, a gauge
_SIDE = 224  # px, width of the texts next to a world of 720


class Panel:
    """Paints one team.

    Args:
        playback: to be painted.
        size: of the longer side of the world, px.
        colour_by: "action" or "caste".
        alone: whether texts are next to the world, else below it.

    Attributes:
        background: the part that is the same in all frames.
        world: corners x0, y0, x1, y1 of the world in px.
        timeline: below the world.
        timeline_at: its upper left corner.
    """

    def __init__(self, playback: Playback, size: int, colour_by: str, alone: bool) -> None:
        self.playback, self._colour_by = playback, colour_by
        sizes = (("large", 20, 12), ("text", 14, 10), ("small", 12, 9))
        self._points = {name: max(round(p * size / 720), least) for name, p, least in sizes}
        self._gap = gap = round(16 * size / 720)
        x0, y0, x1, y1 = playback.bounds
        longer = max(x1 - x0, y1 - y0)
        width, height = (max(round(side / longer * size), 2) for side in (x1 - x0, y1 - y0))
        left, top = gap, gap + self._line("large") + self._line("text") + gap // 2
        self.world = (left, top, left + width, top + height)
        self._scene = Scene(playback, (width, height), colour_by)
        side = round(_SIDE * self._points["text"] / 14)
        total = width + (gap + side if alone else 0)
        self._changes: list[Callable[[Image.Image, int, int], None]] = []
        sheet = self.background = Image.new("RGB", (total + 2 * gap, 4 * size + 2000), PAGE)
        self._draw = ImageDraw.Draw(sheet)
        self._draw.rectangle((left - 1, top - 1, left + width, top + height), outline=FAINT)
        self._write(left, gap - 2, playback.title, "large", INK, total)
        self._write(left, gap + self._line("large"), playback.subtitle, "text", _SOFT, total)
        if alone:
            bottom = max(self._say(left + width + gap, top, side), top + height)
        else:
            bottom = self._say(left, top + height + gap // 2, width)
        self.timeline = Timeline(playback, total, size)
        self.timeline_at = (left, min(bottom + gap, sheet.height - self.timeline.height - gap))
        below = self.timeline_at[1] + self.timeline.height + gap
        self.background = sheet.crop((0, 0, sheet.width, below))

    def paint(self, page: Image.Image, x: int, t: int) -> None:
        """Paint the panel in frame t, with its left side at x of the page."""
        page.paste(self.background, (x, 0))
        page.paste(self._scene.at(t), (x + self.world[0], self.world[1]))
        for change in self._changes:
            change(page, x, t)
        self.timeline.paint(page, x + self.timeline_at[0], self.timeline_at[1], t)

    # --- texts: each method returns its lower end -------------------------------------------------

    def _say(self, x: int, y: int, width: int) -> int:
        playback = self.playback
        y = self._say_readings(x, y, width) + self._gap // 2
        coloured = {self._colour_by: " (their colour)"}
        doing = [
            _number((playback.action.values == k).sum(axis=1))
            for k, _ in enumerate(playback.actions)
        ]
        title = "what robots do" + coloured.get("action", "")
        y = self._say_robots(title, playback.actions, doing, x, y, width)
        counts = Counter(robot.caste for robot in playback.robots)
        castes = [playback.castes[k] for k in sorted(counts)]
        numbers = [str(counts[k]) for k in sorted(counts)]
        y = self._say_robots("castes" + coloured.get("caste", ""), castes, numbers, x, y, width)
        y = self._say_keys(x, y, width)
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
        for one in playback.measures[:2]:
            is_whole = float(one.values.step).is_integer()
            readings.append((one.name, _number(one.values.values, 0 if is_whole else 3)))
        large = self._line("large")
        height = large + self._line("small") + self._gap // 4
        places, bottom = self._cells(x, y, width, len(readings), 170, height)
        for (name, value), (left, top, room) in zip(readings, places, strict=True):
            self._write(left, top + large, name, "small", _SOFT, room)
            self._write(left, top, value, "large", INK, room)
        return bottom

    def _say_robots(
        self, title: str, kinds: Sequence[Kind], counts: Sequence[Text], x: int, y: int, width: int
    ) -> int:
        """Write the names of kinds of robots, each with a number."""
        self._write(x, y, title, "small", _SOFT, width)
        y += self._line("small")
        places, bottom = self._cells(x, y, width, len(kinds), 160, self._line("text"))
        number = round(1.8 * self._points["text"])
        for kind, count, (left, top, room) in zip(kinds, counts, places, strict=True):
            self._write(left, top, count, "text", INK, number)
            key = (kind.name, kind.colour, "disc", "")
            self._draw_key(key, left + number, top, room - number)
        return bottom + self._gap // 2

    def _say_keys(self, x: int, y: int, width: int) -> int:
        """Write the names of other marks in the world."""
        keys = list(_keys(self.playback))
        places, bottom = self._cells(x, y, width, len(keys), 160, self._line("text"))
        for key, (left, top, room) in zip(keys, places, strict=True):
            self._draw_key(key, left, top, room)
        return bottom + self._gap // 2

    def _say_plan(self, row: PlanRow, x: int, y: int, width: int) -> int:
        """Draw a complex object; parts that are not built yet are pale."""
        order = "in this order" if row.is_ordered else "in any order"
        self._write(x, y, f"{row.name}, {order}", "small", _SOFT, width)
        y += self._line("small")
        side = max(min(self._points["text"], width // max(len(row.parts), 1) - 2), 2)
        for n, (kind, built) in enumerate(zip(row.parts, row.built, strict=True)):
            colour = self.playback.things[0].kinds[kind].colour
            box = (x + n * (side + 2), y, side, side)
            pale, line = shade(colour, 0.8), shade(colour, 0.4)
            self._fill(box, pale, line, colour, partial(operator.le, built))
        return y + side + self._gap // 4

    def _say_gauges(self, x: int, y: int, width: int) -> int:
        y += self._gap // 4
        label, height = 6 * self._points["text"], self._points["text"] // 2
        for gauge in self.playback.gauges:
            self._write(x, y, gauge.name, "small", _SOFT, label - 4)
            share = (gauge.values.values / gauge.most).clip(0, 1)
            box = (x + label, y + 4, min(width, 320) - label, height)
            self._fill(box, _EMPTY, _EMPTY, gauge.colour, share.__getitem__)
            y += self._line("text")
        return y

    # --- marks and letters ------------------------------------------------------------------------

    def _cells(
        self, x: int, y: int, width: int, count: int, least: int, height: int
    ) -> tuple[list[tuple[int, int, int]], int]:
        """Return positions (x, y, width) for items of one size, row by row, and their lower end."""
        n = max(min(width // round(least * self._points["text"] / 14), count), 1)
        room = width // n
        places = [(x + k % n * room, y + k // n * height, room - 6) for k in range(count)]
        return places, y + -(-count // n) * height

    def _draw_key(self, key: Key, x: int, y: int, room: int) -> None:
        name, fill, shape, line = key
        points = self._points["text"]
        half = 0.36 * points
        at = (x + half, y + 0.2 * points + half)
        if shape == "kite":
            reach = ((half, 0), (0, half), (-half, 0), (0, -half))
            tips = [(at[0] + dx, at[1] + dy) for dx, dy in reach]
            Mask(self.background, (x, y, x + points, y + points)).polygon(tips).paint(fill)
        else:
            for size, colour in ((half, line or shade(fill, -0.25)), (half - 1, fill)):
                mask = Mask(self.background, (x, y, x + points, y + points))
                (mask.disc if shape == "disc" else mask.square)(*at, size).paint(colour)
        mark = round(2 * half) + 6
        self._write(x + mark, y, name, "text", INK, room - mark)

    def _fill(
        self,
        box: tuple[int, int, int, int],
        empty: str,
        line: str,
        colour: str,
        share: Callable[[int], float],
    ) -> None:
        """Draw a box x, y, width, height; its left part is filled by the share of frame t."""
        x, y, width, height = box
        self._draw.rectangle((x, y, x + width - 1, y + height - 1), fill=empty, outline=line)

        def change(page: Image.Image, dx: int, t: int) -> None:
            end = x + dx + round(share(t) * width)
            page.paste(colour, (x + dx, y, end, y + height))

        self._changes.append(change)

    def _write(self, x: int, y: int, text: Text, letters: str, colour: str, room: int) -> None:
        """Write a text, cut to a width in px; one that depends on t is written in each frame."""
        font = _font(self._points[letters])
        if isinstance(text, str):
            self._draw.text((x, y), _fitted(text, self._points[letters], room), colour, font)
            return

        def change(page: Image.Image, dx: int, t: int) -> None:
            ImageDraw.Draw(page).text((x + dx, y), text(t), colour, font)

        self._changes.append(change)

    def _line(self, letters: str) -> int:
        """Return the height of a line of text, px."""
        return round(1.4 * self._points[letters])


def _keys(playback: Playback) -> Iterator[Key]:
    """Yield the entries of the legend in addition to actions and castes."""
    for n, body in enumerate(playback.body_kinds):
        if body.shape == "square" and n in playback.body:
            yield body.name, body.colour or INK, "kite", ""
    for things in playback.things:
        yield from (
            (k.name, k.colour, things.shape, "") for k in things.kinds if k.colour != GROUND
        )
        for rim in dict.fromkeys(state.colour for state in things.states if state.colour):
            names = [state.name for state in things.states if state.colour == rim]
            yield ", ".join(names), GROUND, things.shape, rim
    for part in playback.backdrop:
        if part.label and part.fill:
            yield part.label, part.fill, "disc" if part.shape == "disc" else "square", part.line


def _number(values: npt.NDArray[Any], digits: int = 0) -> Callable[[int], str]:
    """Return the function that gives the number of frame t, of numbers [T], as text."""
    return lambda t: f"{values[t]:,.{digits}f}"


@lru_cache(maxsize=64)
def _font(points: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(points)


def _fitted(text: str, points: int, room: int) -> str:
    """Return a text without unprintable characters, cut to a width in px."""
    font = _font(points)
    text = "".join(letter if letter.isprintable() else " " for letter in text[:300])
    shown, end = text, ""
    while shown and font.getlength(shown + end) > room:
        shown, end = shown[:-1], "..."
    return shown + end
