"""Pictures as three planes, painted with masks: the film's brush.

A film is mostly the same from frame to frame, and turning whole pictures into video's colours would
cost more than all drawing. So a frame is painted at once as it is needed: in red, green and blue
for a picture, or in luma and two halved chroma planes (yuv420p, BT.709) for a video. Mixing colours
is the same sum in both. Corners are at even pixels, so that both fit each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

__all__ = [
    "RGB",
    "YUV",
    "Colours",
    "Mask",
    "Planes",
    "body_masks",
    "disc_mask",
    "even",
    "line_mask",
    "ring_mask",
    "square_mask",
]

_PHASES = 4  # a mask is drawn at quarters of a pixel
_KEPT = 200  # px, radius: larger masks are not kept for the next time


@dataclass(frozen=True)
class Colours:
    """What the three planes hold: value = offset + matrix @ (red, green, blue) / 255.

    halved: whether a sample of a plane stands for 2 x 2 pixels.
    """

    matrix: tuple[tuple[float, float, float], ...]
    offset: tuple[float, float, float]
    halved: tuple[bool, bool, bool]

    def of(self, colour: str) -> tuple[int, int, int]:
        """Return the three values of a colour "#rrggbb"."""
        return _values(self, colour)

    def split(self, pixels: npt.NDArray[np.uint8]) -> list[npt.NDArray[np.uint8]]:
        """Return the three values [...] of pixels [..., 3], not halved."""
        values = pixels / 255 @ np.array(self.matrix).T + np.array(self.offset)
        return [np.rint(values[..., k]).astype(np.uint8) for k in range(3)]


RGB = Colours(((255, 0, 0), (0, 255, 0), (0, 0, 255)), (0, 0, 0), (False, False, False))
_KR, _KG, _KB = 0.2126, 0.7152, 0.0722  # BT.709; luma from 16 to 235, chroma from 16 to 240
YUV = Colours(
    (
        (219 * _KR, 219 * _KG, 219 * _KB),
        (-112 * _KR / (1 - _KB), -112 * _KG / (1 - _KB), 112),
        (112, -112 * _KG / (1 - _KR), -112 * _KB / (1 - _KR)),
    ),
    (16, 128, 128),
    (False, True, True),
)


@dataclass(frozen=True)
class Mask:
    """How much of a colour goes where: ``full`` for pixels, ``half`` for halved planes.

    x, y: even pixels from the place it is painted at to its left upper corner.
    """

    full: Image.Image
    half: Image.Image
    x: int = 0
    y: int = 0

    @staticmethod
    def of(image: Image.Image, x: int = 0, y: int = 0) -> Mask:
        """Return the mask of an image in mode "L" with even sides."""
        return Mask(image, image.reduce(2), x, y)


class Planes:
    """A picture as three planes.

    Args:
        planes: images in mode "L".
        colours: what they hold.
    """

    def __init__(self, planes: Sequence[Image.Image], colours: Colours) -> None:
        self.planes = tuple(planes)
        self.colours = colours

    @staticmethod
    def of(image: Image.Image, colours: Colours) -> Planes:
        """Return the planes of a picture in mode "RGB" with even sides."""
        values = colours.split(np.asarray(image))
        planes = [Image.fromarray(value) for value in values]
        halved = zip(planes, colours.halved, strict=True)
        return Planes([plane.reduce(2) if half else plane for plane, half in halved], colours)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.planes[0].size

    def copy(self) -> Planes:
        """Return a copy."""
        return Planes([plane.copy() for plane in self.planes], self.colours)

    def crop(self, x0: int, y0: int, x1: int, y1: int) -> Planes:
        """Return a copy of a part; the corners are even."""
        boxes = ((x0 // d, y0 // d, x1 // d, y1 // d) for d in self._divisors)
        parts = [plane.crop(box) for plane, box in zip(self.planes, boxes, strict=True)]
        return Planes(parts, self.colours)

    def put(self, part: Planes, x: int, y: int) -> None:
        """Put another picture here; its corner is even."""
        for plane, piece, d in zip(self.planes, part.planes, self._divisors, strict=True):
            plane.paste(piece, (x // d, y // d))

    def paint(self, colour: str, mask: Mask, x: int = 0, y: int = 0) -> None:
        """Paint with a colour through a mask at an even place."""
        x, y = x + mask.x, y + mask.y
        for plane, value, half in zip(
            self.planes, self.colours.of(colour), self.colours.halved, strict=True
        ):
            if half:
                plane.paste(value, (x // 2, y // 2), mask.half)
            else:
                plane.paste(value, (x, y), mask.full)

    def fill(self, colour: str, x0: int, y0: int, x1: int, y1: int) -> None:
        """Fill a rectangle with even corners."""
        values = self.colours.of(colour)
        for plane, value, d in zip(self.planes, values, self._divisors, strict=True):
            plane.paste(value, (x0 // d, y0 // d, x1 // d, y1 // d))

    def picture(self) -> Image.Image:
        """Return the picture in mode "RGB"; the planes must hold red, green and blue."""
        if self.colours is not RGB:
            raise ValueError("these planes are for video")
        return Image.merge("RGB", self.planes)

    def data(self) -> bytes:
        """Return the planes one after another, as video has them."""
        return b"".join(plane.tobytes() for plane in self.planes)

    @property
    def _divisors(self) -> tuple[int, int, int]:
        first, second, third = (2 if half else 1 for half in self.colours.halved)
        return first, second, third


@cache
def _values(colours: Colours, colour: str) -> tuple[int, int, int]:
    parts = np.array([[int(colour[k : k + 2], 16) for k in (1, 3, 5)]], np.uint8)
    first, second, third = (int(plane[0]) for plane in colours.split(parts))
    return first, second, third


def even(number: float) -> int:
    """Return the smallest even whole number that is not below."""
    return 2 * math.ceil(number / 2)


def disc_mask(x: float, y: float, radius: float, opacity: float = 1.0) -> tuple[Mask, int, int]:
    """Return a disc's mask and the even place to paint it at; lengths in pixels."""
    return _placed(x, y, "disc", radius, 0.0, round(255 * opacity), 0)


def square_mask(x: float, y: float, half: float, opacity: float = 1.0) -> tuple[Mask, int, int]:
    """Return an upright square's mask, half a side given, and where to paint it."""
    return _placed(x, y, "square", half, 0.0, round(255 * opacity), 0)


def ring_mask(
    x: float, y: float, radius: float, width: float, line: float, fill: float = 0.0
) -> tuple[Mask, int, int]:
    """Return the mask of a circle with a line and, fainter, its inside, and where to paint it."""
    return _placed(x, y, "disc", radius, width, round(255 * line), round(255 * fill))


def body_masks(
    x: float, y: float, radius: float, shape: str, heading: float | None
) -> tuple[Mask, Mask, int, int]:
    """Return the masks of a body's surface and of its rim and heading, and where to paint both.

    heading: rad counter-clockwise from +x with y pointing up, None for none.
    """
    px, cx = _phase(x)
    py, cy = _phase(y)
    step = -1 if heading is None else round(heading / math.tau * 64) % 64
    inner, rim = _body(px, py, radius, shape, step)
    return inner, rim, cx, cy


def _phase(x: float) -> tuple[int, int]:
    """Return quarters of a pixel from an even pixel, and that pixel."""
    quarters = round(x * _PHASES)
    return quarters % (2 * _PHASES), quarters // (2 * _PHASES) * 2


def _placed(
    x: float, y: float, shape: str, radius: float, width: float, line: int, fill: int
) -> tuple[Mask, int, int]:
    px, cx = _phase(x)
    py, cy = _phase(y)
    make = _mask if radius < _KEPT else _mask.__wrapped__
    return make(px, py, shape, radius, width, line, fill), cx, cy


@lru_cache(maxsize=20_000)
def _mask(px: int, py: int, shape: str, radius: float, width: float, line: int, fill: int) -> Mask:
    """Return a mask around a point px, py quarters of a pixel from an even pixel."""
    reach = even(radius + width + 1)
    times = 8 if radius < 30 else 4 if radius < _KEPT else 1
    side = 2 * reach + 2
    image = Image.new("L", (side * times, side * times))
    draw = ImageDraw.Draw(image)
    x, y = ((reach + p / _PHASES) * times for p in (px, py))
    form = draw.ellipse if shape == "disc" else draw.rectangle
    outer = (radius + width / 2) * times
    form((x - outer, y - outer, x + outer - 1, y + outer - 1), fill=line)
    if width:
        inner = (radius - width / 2) * times
        form((x - inner, y - inner, x + inner - 1, y + inner - 1), fill=fill)
    return Mask.of(image.reduce(times), -reach, -reach)


@lru_cache(maxsize=20_000)
def _body(px: int, py: int, radius: float, shape: str, step: int) -> tuple[Mask, Mask]:
    """Return surface and rim of a body that looks into the step-th of 64 directions, -1: none."""
    reach, times = even(1.45 * radius + 1), 8
    side = (2 * reach + 2) * times
    x, y = ((reach + p / _PHASES) * times for p in (px, py))
    angle = max(step, 0) / 64 * math.tau
    ahead = (math.cos(angle), -math.sin(angle))
    images = []
    for width, line in ((0.0, False), (1.0, True)):
        image = Image.new("L", (side, side))
        draw = ImageDraw.Draw(image)

        def outline(size: float, value: int, draw: ImageDraw.ImageDraw = draw) -> None:
            size *= times
            if shape == "disc":
                draw.ellipse((x - size, y - size, x + size - 1, y + size - 1), fill=value)
                return
            # A kite: it points ahead, and looks like no robot of the team.
            tips = [
                (
                    x + size * reach_ * math.cos(angle + turn),
                    y - size * reach_ * math.sin(angle + turn),
                )
                for turn, reach_ in (
                    (0.0, 1.35),
                    (math.pi / 2, 0.95),
                    (math.pi, 0.95),
                    (-math.pi / 2, 0.95),
                )
            ]
            draw.polygon(tips, fill=value)

        outline(radius, 255)
        if line:
            outline(radius - width, 0)
            if step >= 0 and shape == "disc":
                end = (x + ahead[0] * radius * times, y + ahead[1] * radius * times)
                draw.line([(x, y), end], fill=255, width=max(round(1.3 * times), 1))
        images.append(Mask.of(image.reduce(times), -reach, -reach))
    return images[0], images[1]


def line_mask(x0: float, y0: float, x1: float, y1: float, width: float) -> tuple[Mask, int, int]:
    """Return the mask of a straight line and the even place to paint it at; lengths in pixels."""
    margin, times = even(width + 1), 4
    left, top = (math.floor(min(pair) / 2) * 2 - margin for pair in ((x0, x1), (y0, y1)))
    right, bottom = (even(max(pair)) + margin for pair in ((x0, x1), (y0, y1)))
    image = Image.new("L", ((right - left) * times, (bottom - top) * times))
    ends = [((x - left) * times, (y - top) * times) for x, y in ((x0, y0), (x1, y1))]
    ImageDraw.Draw(image).line(ends, fill=255, width=round(width * times))
    return Mask.of(image.reduce(times)), left, top
