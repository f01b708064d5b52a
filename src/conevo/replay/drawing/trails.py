"""Where robots have been lately, as smooth lines that cost little to draw."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from PIL import Image

from conevo.replay.drawing.planes import Colours, Planes

__all__ = ["Trails"]


class Trails:
    """Where robots have been lately, as smooth lines.

    Args:
        paths: [T, R, 2] float, pixels.
        size: width and height of the picture they are drawn into, in pixels.
        colours: planes they are drawn in.
        length: positions of a trail.
        opacity: of a line.
        width: of a line, px.
    """

    def __init__(
        self,
        paths: npt.NDArray[np.float64],
        size: tuple[int, int],
        colours: Colours,
        length: int = 120,
        opacity: float = 0.4,
        width: float = 1.4,
    ) -> None:
        self.length, self.opacity, self._colours = length, opacity, colours
        divisors = {2 if half else 1 for half in colours.halved}
        self._dots = {
            d: _Dots(paths / d, (size[0] // d, size[1] // d), width / d) for d in divisors
        }

    def paint(self, planes: Planes, colours: Sequence[str], t: int) -> None:
        """Paint all trails up to frame t, each in its robot's colour [R]."""
        arrays = [np.array(plane).ravel() for plane in planes.planes]
        halved = self._colours.halved
        for colour in dict.fromkeys(colours):
            robots = [r for r, own in enumerate(colours) if own == colour]
            values = self._colours.of(colour)
            found = {d: dots.of(robots, t - self.length, t) for d, dots in self._dots.items()}
            for array, value, half in zip(arrays, values, halved, strict=True):
                where, cover = found[2 if half else 1]
                old = array[where].astype(np.float32)
                array[where] = np.rint(old + (value - old) * (self.opacity * cover))
        planes.planes = tuple(
            Image.frombytes("L", plane.size, array.tobytes())
            for plane, array in zip(planes.planes, arrays, strict=True)
        )


class _Dots:
    """Lines as dots of at most a pixel each, spread over the four pixels around them."""

    def __init__(self, paths: npt.NDArray[np.float64], size: tuple[int, int], width: float) -> None:
        steps = np.diff(paths, axis=0).transpose(1, 0, 2)  # [R, T - 1, 2]
        lengths = np.hypot(steps[..., 0], steps[..., 1])
        lengths[lengths > max(size) / 10] = 0.0  # a jump, not a way
        counts = np.ceil(lengths).astype(np.int64)
        flat = counts.ravel()
        number = np.repeat(np.arange(flat.size), flat)
        within = np.arange(flat.sum()) - np.repeat(np.cumsum(flat) - flat, flat)
        part = (within + 0.5) / flat[number]
        begin = paths[:-1].transpose(1, 0, 2).reshape(-1, 2)
        place = begin[number] + part[:, None] * steps.reshape(-1, 2)[number] - 0.5
        weight = lengths.ravel()[number] / flat[number] * width
        corner = np.floor(place).astype(np.int64)
        share = place - corner
        where, cover = [], []
        for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
            x, y = corner[:, 0] + dx, corner[:, 1] + dy
            inside = (x >= 0) & (x < size[0]) & (y >= 0) & (y < size[1])
            near = np.where(dx, share[:, 0], 1 - share[:, 0])
            near = near * np.where(dy, share[:, 1], 1 - share[:, 1]) * weight
            where.append(np.where(inside, x + size[0] * y, 0))
            cover.append(np.where(inside, near, 0.0))
        self._where = np.stack(where, 1).astype(np.int32).reshape(-1)
        self._cover = np.stack(cover, 1).astype(np.float32).reshape(-1)
        ends = 4 * np.concatenate([[0], np.cumsum(flat)])
        self._n_steps = counts.shape[1]
        self._ends = ends
        self._sums = np.zeros(size[0] * size[1], np.float32)

    def of(
        self, robots: Sequence[int], first: int, last: int
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float32]]:
        """Return pixels and how much of each is covered, of steps first to last - 1 of robots."""
        first, last = max(first, 0), min(last, self._n_steps)
        cuts = []
        for r in robots:
            base = r * self._n_steps
            cuts.append(slice(self._ends[base + first], self._ends[base + last]))
        where = np.concatenate([self._where[cut] for cut in cuts])
        np.add.at(self._sums, where, np.concatenate([self._cover[cut] for cut in cuts]))
        cover = np.minimum(self._sums[where], 1.0)
        self._sums[where] = 0.0
        return where, cover
