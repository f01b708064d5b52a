"""The world of a playback as films show it, frame by frame."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from conevo.palette import FAINT, GROUND, INK
from conevo.playback.schema import Playback, Things
from conevo.replay.drawing.planes import (
    Colours,
    Mask,
    Planes,
    body_masks,
    disc_mask,
    line_mask,
    ring_mask,
    square_mask,
)
from conevo.replay.drawing.trails import Trails

__all__ = ["Scene", "colours_of"]

Floats = npt.NDArray[np.float64]
_LEAST_RADIUS = 3.5  # px, of a body
_RING_FRAMES = 15  # a ring says so long, at most until it has faded, that something is gone
_SETTLED = 0.12  # opacity of what has been gone for long
_ORDINARY, _FADING, _FAINT = range(3)


def colours_of(playback: Playback, colour_by: str) -> list[list[str]]:
    """Return the colours [T][R] that robots have, by "action" or by "caste"."""
    if colour_by == "caste":
        own = [playback.castes[robot.caste].colour for robot in playback.robots]
        return [own] * playback.iterations
    known = [*(action.colour for action in playback.actions), FAINT]  # -1 is the last
    return [[known[a] for a in row] for row in playback.action.values.tolist()]


class Scene:
    """Paints the world of a playback.

    Order: backdrop, what stands still, trails, what moves, rings, bodies, what robots hold.

    Args:
        playback: to be painted.
        width: of the picture in px, even.
        height: in px, even; both follow from the playback's bounds.
        colours: planes to paint.
        colour_by: "action" or "caste".
    """

    def __init__(
        self, playback: Playback, width: int, height: int, colours: Colours, colour_by: str
    ) -> None:
        self.playback = playback
        self._size = (width, height)
        x0, y0, x1, y1 = playback.bounds
        self._scale = max(width, height) / max(x1 - x0, y1 - y0)
        self._own = colours_of(playback, colour_by)
        self._others = [
            playback.body_kinds[k].colour or INK for k in playback.body[len(playback.robots) :]
        ]
        self._places = self._pixels(playback.x.values, playback.y.values)  # [T, B, 2]
        self._heading = playback.heading.values if playback.heading is not None else None
        self._action = playback.action.values
        self._held = playback.held.values if playback.held is not None else None
        self._groups = [
            _Group(
                things, self._pixels(things.x.values, things.y.values), self._length(things.size)
            )
            for things in playback.things
        ]
        floor = Planes.of(self._floor(), colours)
        still = [group for group in self._groups if group.stands]
        self._standing = _Standing(still[:1], floor)
        self._trails = Trails(self._places, self._size, colours)

    def at(self, t: int) -> Planes:
        """Return the world after iteration t."""
        planes = self._standing.at(t).copy()
        colours = [*self._own[t], *self._others]
        self._trails.paint(planes, colours, t)
        for group in self._groups:
            group.paint_moving(planes, t, has_standing=group is self._standing.group)
        self._paint_rings(planes, t)
        self._paint_bodies(planes, colours, t)
        self._paint_held(planes, t)
        return planes

    def _pixels(self, x: Floats, y: Floats) -> Floats:
        """Return places in px [..., 2] from the upper left corner, at most a world outside."""
        left, top = self.playback.bounds[0], self.playback.bounds[3]
        places = np.stack([(x - left) * self._scale, (top - y) * self._scale], axis=-1)
        longer = max(self._size)
        return places.clip(-longer, 2 * longer)

    def _length(self, length: float) -> float:
        """Return a length in px; more than the world is as good as the world."""
        return min(length * self._scale, float(max(self._size)))

    def _floor(self) -> Image.Image:
        """Return what never changes."""
        sharper = 4 if max(self._size) <= 1080 else 2  # drawn larger, then reduced
        size = (self._size[0] * sharper, self._size[1] * sharper)
        image = Image.new("RGB", size, GROUND)
        draw = ImageDraw.Draw(image)
        for part in self.playback.backdrop:
            fill, line = part.fill or None, part.line or None
            if part.shape == "disc":
                ((x, y),) = self._pixels(*np.array(part.numbers[:2])[:, None]) * sharper
                radius = self._length(part.numbers[2]) * sharper
                box = (x - radius, y - radius, x + radius, y + radius)
                draw.ellipse(box, fill=fill, outline=line, width=sharper)
                continue
            corners = np.array(part.numbers).reshape(2, 2)
            (x0, y1), (x1, y0) = self._pixels(*corners.T) * sharper
            if part.cells is None:
                box = (x0, y0, max(x1 - 1, x0), max(y1 - 1, y0))
                draw.rectangle(box, fill=fill, outline=line, width=sharper)
            elif fill:
                cells = Image.fromarray(np.where(part.cells.values[::-1], 255, 0).astype(np.uint8))
                at = (round(x0), round(y0))
                goal = (max(round(x1) - at[0], 1), max(round(y1) - at[1], 1))
                mask = cells.resize(goal, Image.Resampling.NEAREST)
                image.paste(fill, (*at, at[0] + goal[0], at[1] + goal[1]), mask)
        return image.reduce(sharper)

    def _paint_rings(self, planes: Planes, t: int) -> None:
        for ring in self.playback.rings:
            if ring.when != "action" or ring.of != "robots":
                continue
            for r, a in enumerate(self._action[t].tolist()):
                radius = self._length(ring.radius[a]) if a >= 0 else 0.0
                if radius > 0:
                    colour = self.playback.actions[a].colour
                    x, y = self._places[t, r]
                    planes.paint(colour, *ring_mask(x, y, radius, 1.2, line=0.4, fill=0.1))

    def _paint_bodies(self, planes: Planes, colours: list[str], t: int) -> None:
        kinds = self.playback.body_kinds
        # The team's robots come last, above all others.
        for b in reversed(range(len(colours))):
            kind = kinds[self.playback.body[b]]
            radius = max(self._length(kind.radius), _LEAST_RADIUS)
            heading = None if self._heading is None else float(self._heading[t, b])
            x, y = self._places[t, b]
            surface, rim, at_x, at_y = body_masks(x, y, radius, kind.shape, heading)
            planes.paint(colours[b], surface, at_x, at_y)
            planes.paint(INK, rim, at_x, at_y)

    def _paint_held(self, planes: Planes, t: int) -> None:
        """Paint what robots hold above them, with a line to it if it is elsewhere."""
        if self._held is None or not self._groups:
            return
        group = self._groups[0]
        for r, k in enumerate(self._held[t].tolist()):
            if k >= 0:
                x0, y0 = self._places[t, r]
                x1, y1 = group.place(t, k)
                if math.hypot(x1 - x0, y1 - y0) > _LEAST_RADIUS:
                    planes.paint(INK, *line_mask(x0, y0, x1, y1, 1.2))
        for k in sorted({k for k in self._held[t].tolist() if k >= 0}):
            group.paint(planes, t, k)


class _Group:
    """Things of one kind, ready to be painted; places in px."""

    def __init__(self, things: Things, places: Floats, size: float) -> None:
        self.things = things
        self.stands = places.ndim == 2 and things.state is None
        self.size = max(size, 0.8)
        self.colours = [things.kinds[k].colour for k in things.kind.values.tolist()]
        self._places = places
        self._state = things.state.values if things.state is not None else None
        if things.gone is not None:
            self.gone = things.gone.values
        else:
            self.gone = np.full(len(self.colours), np.iinfo(np.int64).max)

    def place(self, t: int, k: int) -> tuple[float, float]:
        """Return where thing k is."""
        x, y = self._places[k] if self._places.ndim == 2 else self._places[t, k]
        return float(x), float(y)

    def phase(self, t: int) -> npt.NDArray[np.int8]:
        """Return whether things [K] are there, fade away or have left a faint mark."""
        age = t - self.gone
        return np.where(
            age < 0, _ORDINARY, np.where(age < self.things.fade, _FADING, _FAINT)
        ).astype(np.int8)

    def mask(self, t: int, k: int, opacity: float, larger: float = 0.0) -> tuple[Mask, int, int]:
        """Return thing k's mask and where to paint it."""
        form = square_mask if self.things.shape == "square" else disc_mask
        return form(*self.place(t, k), self.size + larger, opacity)

    def paint(self, planes: Planes, t: int, k: int) -> None:
        """Paint thing k, as faint as it is."""
        age = t - int(self.gone[k])
        part = min(max(age, 0) / self.things.fade, 1.0)
        opacity = round((1.0 + (_SETTLED - 1.0) * part) * 32) / 32 if age >= 0 else 1.0
        if age >= self.things.fade:
            opacity = _SETTLED
        if self._state is not None and age < 0:
            rim = self.things.states[int(self._state[t, k])].colour
            if rim:
                planes.paint(rim, *self.mask(t, k, 1.0, larger=2.0))
        planes.paint(self.colours[k], *self.mask(t, k, opacity))
        if 0 <= age < _RING_FRAMES:
            shown = 1 - age / _RING_FRAMES
            radius = self.size + 2 + 1.2 * age
            planes.paint(self.colours[k], *ring_mask(*self.place(t, k), radius, 1.5, line=shown))

    def paint_moving(self, planes: Planes, t: int, has_standing: bool) -> None:
        """Paint all things, or those that fade if the others are there already."""
        phase = self.phase(t)
        wanted = np.flatnonzero(phase == _FADING) if has_standing else range(len(phase))
        for k in wanted:
            self.paint(planes, t, int(k))


class _Standing:
    """Things that cannot be moved, on the floor: only what changes is painted again.

    A pixel is the floor and the things over it in order of number, whatever was painted before.
    """

    def __init__(self, groups: list[_Group], floor: Planes) -> None:
        self.group = groups[0] if groups else None
        self._floor = floor
        self._planes = floor.copy()
        self._shown: npt.NDArray[np.int8] | None = None
        if self.group is not None:
            width, height = floor.size
            masks = (self.group.mask(0, k, 1.0) for k in range(len(self.group.colours)))
            corners = np.array([(x + m.x, y + m.y, *m.full.size) for m, x, y in masks])
            corners = corners.reshape(-1, 4)
            corners[:, 2:] += corners[:, :2]
            self._boxes = np.clip(corners, 0, (width, height, width, height))

    def at(self, t: int) -> Planes:
        """Return floor and things after iteration t; not to be changed."""
        if self.group is None:
            return self._floor
        wanted = self.group.phase(t)
        shown, self._shown = self._shown, wanted
        if shown is None:
            width, height = self._floor.size
            self._paint_again(t, (0, 0, width, height))
        else:
            for k in np.flatnonzero(shown != wanted):
                x0, y0, x1, y1 = self._boxes[k].tolist()
                if x0 < x1 and y0 < y1:
                    self._paint_again(t, (x0, y0, x1, y1))
        return self._planes

    def _paint_again(self, t: int, box: tuple[int, int, int, int]) -> None:
        """Paint all that is inside a box."""
        assert self.group is not None
        assert self._shown is not None
        x0, y0, x1, y1 = box
        piece = self._floor.crop(*box)
        boxes = self._boxes
        inside = (boxes[:, 0] < x1) & (boxes[:, 2] > x0) & (boxes[:, 1] < y1) & (boxes[:, 3] > y0)
        for k in np.flatnonzero(inside & (self._shown != _FADING)).tolist():
            opacity = 1.0 if self._shown[k] == _ORDINARY else _SETTLED
            mask, x, y = self.group.mask(t, k, opacity)
            piece.paint(self.group.colours[k], mask, x - x0, y - y0)
        self._planes.put(piece, x0, y0)
