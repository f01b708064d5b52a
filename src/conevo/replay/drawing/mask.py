"""Shapes with smooth edges on a picture: a colour is painted through a mask drawn larger."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

__all__ = ["Mask"]


class Mask:
    """Opacity of a colour on a part of a picture. Coordinates are the picture's, in px.

    A later shape replaces earlier ones below it, so a disc of opacity 0 is a hole.

    Args:
        image: the picture, in mode "RGB".
        box: corners x0, y0, x1, y1 around all shapes.
    """

    def __init__(self, image: Image.Image, box: Iterable[float]) -> None:
        self._image = image
        x0, y0, x1, y1 = box
        side = max(x1 - x0, y1 - y0)
        self._times = 4 if side <= 48 else 2 if side <= 600 else 1
        width, height = image.size
        left, right = _cut(x0, x1, width)
        top, below = _cut(y0, y1, height)
        self._box = (left, top, right, below)
        self._mask = Image.new("L", ((right - left) * self._times, (below - top) * self._times))
        self._draw = ImageDraw.Draw(self._mask)

    def disc(self, x: float, y: float, radius: float, opacity: float = 1.0) -> Mask:
        """Draw a disc; return the mask."""
        self._draw.ellipse(self._corners(x, y, radius), fill=round(255 * opacity))
        return self

    def square(self, x: float, y: float, half: float, opacity: float = 1.0) -> Mask:
        """Draw an upright square; ``half`` is half its side."""
        self._draw.rectangle(self._corners(x, y, half), fill=round(255 * opacity))
        return self

    def polygon(self, points: npt.ArrayLike) -> Mask:
        """Draw a polygon with corners [n, 2]."""
        self._draw.polygon(self._places(points), fill=255)
        return self

    def line(self, points: npt.ArrayLike, width: float, opacity: float = 1.0) -> Mask:
        """Draw a line through points [n, 2]."""
        wide = max(round(width * self._times), 1)
        self._draw.line(self._places(points), fill=round(255 * opacity), width=wide)
        return self

    def paint(self, colour: str) -> None:
        """Paint the picture with a colour."""
        self._image.paste(colour, self._box, self._mask.reduce(self._times))

    def _places(self, points: npt.ArrayLike) -> list[float]:
        corner = np.array(self._box[:2])
        scaled = np.rint(np.asarray(points) * self._times) - corner * self._times
        places: list[float] = scaled.ravel().tolist()
        return places

    def _corners(self, x: float, y: float, size: float) -> tuple[Any, ...]:
        # Whole numbers: a part cut off at the left does not move the rest.
        times, (left, top) = self._times, self._box[:2]
        x, y = round(x * times) - left * times, round(y * times) - top * times
        reach = size * times
        return (x - reach, y - reach, max(x + reach - 1, x - reach), max(y + reach - 1, y - reach))


def _cut(low: float, high: float, n: int) -> tuple[int, int]:
    """Return the range of pixels from low to high, with a margin of one: at least one of n."""
    first = min(max(math.floor(low) - 1, 0), n - 1)
    return first, max(min(math.ceil(high) + 1, n), first + 1)
