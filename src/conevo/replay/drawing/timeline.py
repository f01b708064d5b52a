"""The timeline below a world: the main measure, events, and every action of every robot."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageColor, ImageDraw

from conevo.palette import FAINT, GROUND, INK
from conevo.playback.schema import Playback

__all__ = ["Timeline"]

_CURVE, _EVENTS, _MARK = 40, 8, 12  # px: height, height, width of the caste's mark and the gap
_LINE, _UNDER = "#55555f", "#e6e3da"
_TO_COME = 0.72  # share of white in the future
_SHARPER = 4


class Timeline:
    """A strip with a playhead; the future is pale.

    Each robot has a row. Rows are sorted by caste, with its colour at their left end. Time runs
    from top to bottom within a column of a row, then on to the next column. If a row is high enough
    for the iterations of a column, each has a pixel. Then a solid area is a robot that keeps to its
    action, and noise is one that switches.

    Args:
        playback: to be painted.
        width: px.
        size: of the world, px; the strip's height depends on it.

    Attributes:
        height: px.
        row: height of a robot's row, px.
        order: numbers of the robots from the first row to the last: by caste, then by number.
    """

    def __init__(self, playback: Playback, width: int, size: int) -> None:
        self._playback, self._width = playback, width
        n = len(playback.robots)
        self.row = int(min(max(size // 6 // n, 3), 12))
        self.order = sorted(range(n), key=lambda r: (playback.robots[r].caste, r))
        curve = round(_CURVE * size / 720) if playback.measures else 0
        top = curve + (_EVENTS if playback.events else 0)
        self.height = top + self.row * n
        self._past = self._picture(curve, top)
        self._pale = Image.blend(self._past, Image.new("RGB", self._past.size, "#fff"), _TO_COME)
        self._pale.paste(self._past.crop((0, top, _MARK, self.height)), (0, top))

    def head(self, t: int) -> int:
        """Return the position of the playhead in frame t, px from the strip's left end."""
        return _MARK + int((t + 1) / self._playback.iterations * (self._width - _MARK - 2))

    def paint(self, page: Image.Image, x: int, y: int, t: int) -> None:
        """Paint the strip in frame t, with its upper left corner at x, y."""
        head = self.head(t)
        page.paste(self._pale, (x, y))
        page.paste(self._past.crop((0, 0, head, self.height)), (x, y))
        page.paste(INK, (x + head, y, x + head + 2, y + self.height))

    def _picture(self, curve: int, top: int) -> Image.Image:
        playback = self._playback
        image = Image.new("RGB", (self._width, self.height), "#fff")
        if curve:
            image.paste(self._curve(self._width - _MARK, curve), (_MARK, 0))
        draw = ImageDraw.Draw(image)
        for event in playback.events:
            x = _MARK + (event.t + 0.5) / playback.iterations * (self._width - _MARK - 2)
            draw.line((x, curve + 1, x, top - 2), fill=playback.event_kinds[event.kind].colour)
        image.paste(Image.fromarray(self._rows()), (_MARK, top))
        for n, r in enumerate(self.order):
            at = top + n * self.row
            box = (0, at, _MARK - 5, at + self.row - 1 - (self.row > 3))
            draw.rectangle(box, fill=playback.castes[playback.robots[r].caste].colour)
        return image

    def _rows(self) -> npt.NDArray[np.uint8]:
        """Return the actions of all robots as pixels [height, width, 3]."""
        playback, high, width = self._playback, self.row - (self.row > 3), self._width - _MARK
        table = [*(action.colour for action in playback.actions), FAINT]  # -1 is the last
        colours = np.array([ImageColor.getrgb(colour) for colour in table], np.uint8)
        within = (np.arange(width)[None, :] + (np.arange(high)[:, None] + 0.5) / high) / (width - 2)
        when = np.minimum(within * playback.iterations, playback.iterations - 1).astype(np.int64)
        rows = np.full((len(self.order), self.row, width, 3), ImageColor.getrgb(GROUND), np.uint8)
        for n, r in enumerate(self.order):
            rows[n, :high] = colours[playback.action.values[when, r]]
        return rows.reshape(-1, width, 3)

    def _curve(self, width: int, height: int) -> Image.Image:
        """Return the main measure over time."""
        values = np.asarray(self._playback.measures[0].values.values, np.float64)
        low, high = min(float(values.min()), 0.0), float(values.max())
        part = (values - low) / ((high - low) or 1.0)
        image = Image.new("RGB", (width * _SHARPER, height * _SHARPER), "#fff")
        draw = ImageDraw.Draw(image)
        x = (np.arange(len(part)) + 1) / len(part) * (width - 2) * _SHARPER
        bottom = (height - 1) * _SHARPER
        y = bottom - part * (height - 5) * _SHARPER
        points = [(0.0, float(y[0])), *zip(x.tolist(), y.tolist(), strict=True)]
        draw.polygon([(0.0, bottom), *points, (points[-1][0], bottom)], fill=_UNDER)
        draw.line(points, fill=_LINE, width=round(1.3 * _SHARPER))
        return image.reduce(_SHARPER)
