"""Rocks and objects in a film: they fade when they have gone, and leave a faint mark."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from PIL import Image

from conevo.playback import look
from conevo.playback.schema import Things
from conevo.replay.drawing.mask import Mask

__all__ = ["FADING", "Heap"]

_THERE, FADING, _FAINT = range(3)


class Heap:
    """Things of one kind.

    Args:
        things: to be painted.
        places: [K, 2], or [T, K, 2] if they can be moved, px.
        size: radius or half a side, px.

    Attributes:
        is_still: whether they change only when they go.
        boxes: [K, 4] corners of the area that each covers, px.
    """

    def __init__(self, things: Things, places: npt.NDArray[np.float64], size: float) -> None:
        self._things, self._places = things, places
        self._size = max(size, look.LEAST_THING)
        self.is_still = places.ndim == 2 and things.state is None
        self._colours = [things.kinds[k].colour for k in things.kind.values.tolist()]
        self._state = things.state.values if things.state is not None else None
        never = np.full(len(self._colours), np.iinfo(np.int64).max)
        self._gone = things.gone.values if things.gone is not None else never
        corners = [places - self._size - 2, places + self._size + 2]
        self.boxes = np.concatenate(corners, axis=-1).round().astype(int).clip(min=0)

    def place(self, t: int, k: int) -> npt.NDArray[np.float64]:
        """Return the position x, y of thing k."""
        found: npt.NDArray[np.float64] = self._places[k if self._places.ndim == 2 else (t, k)]
        return found

    def phase(self, t: int) -> npt.NDArray[np.int64]:
        """Return the phase [K] of things: present, fading, or a faint mark."""
        return np.searchsorted([0, self._things.fade], t - self._gone, side="right")

    def paint_within(
        self, piece: Image.Image, x: int, y: int, phase: npt.NDArray[np.int64]
    ) -> None:
        """Paint things that do not fade on a piece of a picture with upper left corner x, y."""
        low, high = self.boxes[:, :2], self.boxes[:, 2:]
        corner = np.array([x, y])
        is_near = ((low < corner + piece.size) & (high > corner)).all(axis=1)
        for k in np.flatnonzero(is_near & (phase != FADING)).tolist():
            opacity = 1.0 if phase[k] == _THERE else look.GONE_OPACITY
            self._mask(piece, self._places[k] - corner, self._size, opacity).paint(self._colours[k])

    def paint_all(self, image: Image.Image, t: int, only_fading: bool) -> None:
        """Paint all things, or only fading ones if the others are painted already."""
        phase = self.phase(t)
        for k in np.flatnonzero(phase == FADING) if only_fading else range(len(phase)):
            self.paint(image, t, int(k))

    def paint(self, image: Image.Image, t: int, k: int) -> None:
        """Paint thing k with its opacity in frame t."""
        age, place, colour = t - int(self._gone[k]), self.place(t, k), self._colours[k]
        if self._state is not None and age < 0:
            rim = self._things.states[int(self._state[t, k])].colour
            if rim:
                self._mask(image, place, self._size + 2).paint(rim)
        share = min(max(age / self._things.fade, 0.0), 1.0)
        self._mask(image, place, self._size, 1 - (1 - look.GONE_OPACITY) * share).paint(colour)
        if 0 <= age < look.RING_FRAMES:
            grown = (age + 1) / look.RING_FRAMES
            radius = self._size + look.RING_GROWTH * grown
            ring = Mask(image, (*(place - radius - 1), *(place + radius + 1)))
            x, y = place.tolist()
            ring.disc(x, y, radius + 0.75, 1 - grown).disc(x, y, radius - 0.75, 0.0).paint(colour)

    def _mask(
        self, image: Image.Image, place: npt.NDArray[np.float64], size: float, opacity: float = 1.0
    ) -> Mask:
        mask = Mask(image, (*(place - size), *(place + size)))
        draw = mask.square if self._things.shape == "square" else mask.disc
        x, y = place.tolist()
        return draw(x, y, size, opacity)
