"""The timeline below a world: the main measure, events, and every action of every robot."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from conevo.palette import FAINT, GROUND, INK
from conevo.playback.schema import Playback
from conevo.replay.drawing.planes import Colours, Planes, even

__all__ = ["Strip"]

_CURVE, _EVENTS, _MARK = 40, 8, 12  # px: height, height, width of the caste's mark and the gap
_LINE = "#55555f"
_UNDER = "#e6e3da"
_TO_COME = 0.72  # how much paler the future is
_SHARPER = 4


class Strip:
    """A strip with a playhead; what is to come is pale.

    A robot has a row; rows lie by caste, whose colour stands at their left end. Time runs from top
    to bottom within a column of a row, then on to the next column: where a row is as high as there
    are iterations to a column, each of them has a pixel, so what looks solid is a robot that keeps
    to its action and what looks like noise is one that switches.

    Args:
        playback: whose.
        colours: planes to paint.
        width: px, even.
        size: of the world, px: the strip's height goes with it.
    """

    def __init__(self, playback: Playback, colours: Colours, width: int, size: int) -> None:
        self._playback, self._width = playback, width
        n = len(playback.robots)
        self.row = int(min(max(size // 6 // n, 3), 12))
        curve = even(_CURVE * size / 720) if playback.measures else 0
        events = _EVENTS if playback.events else 0
        self._top = curve + events
        self.height = even(self._top + self.row * n)
        past = self._picture(curve, events)
        pale = Image.blend(past, Image.new("RGB", past.size, "#ffffff"), _TO_COME)
        pale.paste(past.crop((0, self._top, _MARK, self.height)), (0, self._top))
        self._past, self._pale = Planes.of(past, colours), Planes.of(pale, colours)

    @property
    def order(self) -> list[int]:
        """Numbers of the robots from the first row to the last: by caste, then by number."""
        castes = [robot.caste for robot in self._playback.robots]
        return sorted(range(len(castes)), key=lambda r: (castes[r], r))

    def head(self, t: int) -> int:
        """Return the even place of the playhead in frame t, px from the strip's left end."""
        span = self._width - _MARK - 2
        return _MARK + int((t + 1) / self._playback.iterations * span) // 2 * 2

    def paint(self, page: Planes, x: int, y: int, t: int) -> None:
        """Paint the strip as it is in frame t, its upper left corner given."""
        head = self.head(t)
        page.put(self._pale, x, y)
        page.put(self._past.crop(0, 0, head, self.height), x, y)
        page.fill(INK, x + head, y, x + head + 2, y + self.height)

    def _picture(self, curve: int, events: int) -> Image.Image:
        image = Image.new("RGB", (self._width, self.height), "#ffffff")
        if curve:
            image.paste(self._curve(self._width - _MARK, curve), (_MARK, 0))
        draw = ImageDraw.Draw(image)
        for event in self._playback.events if events else ():
            x = _MARK + (event.t + 0.5) / self._playback.iterations * (self._width - _MARK - 2)
            colour = self._playback.event_kinds[event.kind].colour
            draw.line((x, curve + 1, x, curve + events - 2), fill=colour)
        image.paste(Image.fromarray(self._rows()), (_MARK, self._top))
        for n, r in enumerate(self.order):
            caste = self._playback.castes[self._playback.robots[r].caste]
            top = self._top + n * self.row
            box = (0, top, _MARK - 5, top + self.row - 1 - (self.row > 3))
            draw.rectangle(box, fill=caste.colour)
        return image

    def _rows(self) -> npt.NDArray[np.uint8]:
        """Return the actions of all robots as pixels [height, width, 3]."""
        playback, high = self._playback, self.row - (self.row > 3)
        width = self._width - _MARK
        table = [*(action.colour for action in playback.actions), FAINT]  # -1 is the last
        colours = np.array([[int(c[k : k + 2], 16) for k in (1, 3, 5)] for c in table], np.uint8)
        ground = np.array([int(GROUND[k : k + 2], 16) for k in (1, 3, 5)], np.uint8)
        within = (np.arange(width)[None, :] + (np.arange(high)[:, None] + 0.5) / high) / (width - 2)
        when = np.minimum(within * playback.iterations, playback.iterations - 1).astype(np.int64)
        rows = np.full((len(playback.robots), self.row, width, 3), ground, np.uint8)
        actions = playback.action.values
        for n, r in enumerate(self.order):
            rows[n, :high] = colours[actions[when, r]]
        return rows.reshape(-1, width, 3)

    def _curve(self, width: int, height: int) -> Image.Image:
        """Return the main measure over time."""
        values = np.asarray(self._playback.measures[0].values.values, np.float64)
        low, high = min(float(values.min()), 0.0), float(values.max())
        part = (values - low) / ((high - low) or 1.0)
        image = Image.new("RGB", (width * _SHARPER, height * _SHARPER), "#ffffff")
        draw = ImageDraw.Draw(image)
        x = (np.arange(len(part)) + 1) / len(part) * (width - 2) * _SHARPER
        bottom = (height - 1) * _SHARPER
        y = bottom - part * (height - 5) * _SHARPER
        points = [(0.0, float(y[0])), *zip(x.tolist(), y.tolist(), strict=True)]
        draw.polygon([(0.0, bottom), *points, (points[-1][0], bottom)], fill=_UNDER)
        draw.line(points, fill=_LINE, width=round(1.3 * _SHARPER))
        return image.reduce(_SHARPER)
