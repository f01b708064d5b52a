"""The world of a playback in films, frame by frame."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from conevo.palette import FAINT, GROUND, INK
from conevo.playback import look
from conevo.playback.schema import Playback
from conevo.replay.drawing.mask import Mask
from conevo.replay.drawing.things import Heap

__all__ = ["Scene"]

Floats = npt.NDArray[np.float64]


class Scene:
    """Paints the world of a playback.

    Order: backdrop, still things, trails, moving things, ranges, bodies, things that robots hold.

    Args:
        playback: to be painted.
        size: width and height of the picture in px, in the proportion of the playback's bounds.
        colour_by: "action" or "caste".
        before: a scene of an earlier part of the same epoch, in the same size; its floor and its
            still things are not painted again.
    """

    def __init__(
        self,
        playback: Playback,
        size: tuple[int, int],
        colour_by: str,
        before: Scene | None = None,
    ) -> None:
        self.playback, self._size, self._colour_by = playback, size, colour_by
        x0, y0, x1, y1 = playback.bounds
        self._scale = max(size) / max(x1 - x0, y1 - y0)
        self._places = self._pixels(playback.x.values, playback.y.values)  # [T, B, 2]
        steps = np.abs(np.diff(self._places, axis=0)) / size
        farthest: Floats = steps.max(axis=-1)
        self._jumps = [np.flatnonzero(column > look.JUMP) + 1 for column in farthest.T]
        self._heading = playback.heading.values if playback.heading is not None else None
        self._action = playback.action.values
        self._held = playback.held.values if playback.held is not None else None
        self._groups = [
            Heap(one, self._pixels(one.x.values, one.y.values), self._length(one.size))
            for one in playback.things
        ]
        self._still = next((group for group in self._groups if group.is_still), None)
        self._floor: Image.Image = before._floor if before else self._painted_floor()
        self._ground: Image.Image = (before._ground if before else self._floor).copy()
        # Of the still things on the ground.
        self._phase: npt.NDArray[np.int64] | None = before._phase if before else None

    def at(self, t: int) -> Image.Image:
        """Return the world after iteration t."""
        image, colours = self._ground_at(t), self._colours(t)
        self._paint_trails(image, colours, t)
        for group in self._groups:
            group.paint_all(image, t, only_fading=group is self._still)
        self._paint_ranges(image, t)
        self._paint_bodies(image, colours, t)
        self._paint_held(image, t)
        return image

    def _colours(self, t: int) -> list[str]:
        """Return the colours of all bodies."""
        playback, n = self.playback, len(self.playback.robots)
        kinds = (playback.body_kinds[k] for k in playback.body[n:])
        if self._colour_by == "caste":
            own = [playback.castes[robot.caste].colour for robot in playback.robots]
        else:
            known = [*(action.colour for action in playback.actions), FAINT]  # -1 is the last
            own = [known[a] for a in self._action[t].tolist()]
        return [*own, *(kind.colour or INK for kind in kinds)]

    def _pixels(self, x: Floats, y: Floats) -> Floats:
        """Return positions in px [..., 2] from the upper left corner, at most a world outside."""
        left, top = self.playback.bounds[0], self.playback.bounds[3]
        places = np.stack([(x - left) * self._scale, (top - y) * self._scale], axis=-1)
        return places.clip(-max(self._size), 2 * max(self._size))

    def _length(self, length: float) -> float:
        """Return a length in px, at most the longer side of the world."""
        return min(length * self._scale, float(max(self._size)))

    def _painted_floor(self) -> Image.Image:
        """Return the backdrop, which never changes."""
        sharper = 4 if max(self._size) <= 1080 else 2  # drawn larger, then reduced
        image = Image.new("RGB", (self._size[0] * sharper, self._size[1] * sharper), GROUND)
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

    def _ground_at(self, t: int) -> Image.Image:
        """Return the floor with the still things on it; only changed parts are painted again.

        A pixel is the floor and the things over it by number, whatever was painted before.
        """
        if self._still is None:
            return self._floor.copy()
        before, phase = self._phase, self._still.phase(t)
        boxes = [[0, 0, *self._size]]
        if before is not None:
            boxes = self._still.boxes[before != phase].tolist()
        self._phase = phase
        for x0, y0, x1, y1 in boxes:
            if x0 < x1 and y0 < y1:
                piece = self._floor.crop((x0, y0, x1, y1))
                self._still.paint_within(piece, x0, y0, phase)
                self._ground.paste(piece, (x0, y0))
        return self._ground.copy()

    def _paint_trails(self, image: Image.Image, colours: list[str], t: int) -> None:
        """Paint the recent paths of bodies, older parts fainter."""
        first, long = max(t - look.TRAIL, 0), look.TRAIL // look.TRAIL_PIECES
        for b, colour in enumerate(colours):
            jumps = self._jumps[b]
            cuts = [first, *jumps[(jumps > first) & (jumps <= t)].tolist(), t + 1]
            for begin, end in pairwise(cuts):
                path = self._places[begin:end, b]
                low, high = path.min(axis=0), path.max(axis=0)
                if (high - low).max() < 0.5:
                    continue  # it does not move
                mask = Mask(image, (*low, *high))
                for k in reversed(range(look.TRAIL_PIECES)):
                    some = slice(
                        max(t - (k + 1) * long - begin, 0), max(t - k * long + 1 - begin, 0)
                    )
                    opacity = look.TRAIL_OPACITY * (1 - k / look.TRAIL_PIECES)
                    mask.line(path[some], 1.0, opacity)
                mask.paint(colour)

    def _paint_ranges(self, image: Image.Image, t: int) -> None:
        for ring in self.playback.rings:
            if ring.when != "action" or ring.of != "robots":
                continue
            for (x, y), a in zip(self._places[t].tolist(), self._action[t].tolist(), strict=False):
                radius = self._length(ring.radius[a]) if a >= 0 else 0.0
                if radius > 0:
                    mask = Mask(image, _around(x, y, radius + 1))
                    mask.disc(x, y, radius + 0.5, look.RANGE_LINE)
                    mask.disc(x, y, max(radius - 0.5, 0), look.RANGE_FILL)
                    mask.paint(self.playback.actions[a].colour)

    def _paint_bodies(self, image: Image.Image, colours: list[str], t: int) -> None:
        # The team's robots come last, above all others.
        for b in reversed(range(len(colours))):
            kind = self.playback.body_kinds[self.playback.body[b]]
            radius = max(self._length(kind.radius), look.LEAST_BODY)
            angle = None if self._heading is None else float(self._heading[t, b])
            x, y = self._places[t, b].tolist()
            box = _around(x, y, look.KITE_TIP * radius)
            if kind.shape == "square":
                kite = _kite(x, y, radius, angle or 0.0)
                Mask(image, box).polygon(kite).paint(colours[b])
                Mask(image, box).line([*kite, kite[0]], 1.0).paint(INK)
                continue
            Mask(image, box).disc(x, y, radius).paint(colours[b])
            rim = Mask(image, box).disc(x, y, radius).disc(x, y, radius - 1, 0.0)
            if angle is not None:
                ahead = (x + radius * math.cos(angle), y - radius * math.sin(angle))
                rim.line([(x, y), ahead], 1.0)
            rim.paint(INK)

    def _paint_held(self, image: Image.Image, t: int) -> None:
        """Paint things that robots hold over them, with a line to a thing that is elsewhere."""
        if self._held is None or not self._groups:
            return
        group, held = self._groups[0], self._held[t].tolist()
        for r, k in enumerate(held):
            if k >= 0:
                ends = np.array([self._places[t, r], group.place(t, k)])
                if math.dist(*ends) > look.LEAST_BODY:
                    Mask(image, (*ends.min(axis=0), *ends.max(axis=0))).line(ends, 1.2).paint(INK)
        for k in sorted({k for k in held if k >= 0}):
            group.paint(image, t, k)


def _around(x: float, y: float, reach: float) -> tuple[float, float, float, float]:
    return x - reach, y - reach, x + reach, y + reach


def _kite(x: float, y: float, radius: float, angle: float) -> list[tuple[float, float]]:
    """Return the corners of a body that is not of the team: it points ahead, unlike a robot."""
    reaches = (look.KITE_TIP, *(look.KITE_SIDE,) * 3)
    turns = (angle + k * math.pi / 2 for k in range(4))
    return [
        (x + radius * reach * math.cos(turn), y - radius * reach * math.sin(turn))
        for reach, turn in zip(reaches, turns, strict=True)
    ]
