"""Red rock canals: ten pre-drawn layouts from joined meanders (1) to scattered pieces (10).

Nitschke 2009, section 5.1.4 and figures 5.1-5.5: canals contain the red rocks, rovers cannot enter
them, and ten environments range from "a high degree of structure" (joined, canal-like) to "a low
degree of structure" (disjoint pieces, generally not canal-like). The figures are lost.

Choice: a layout is a raster of 200 x 200 cells of side 0.005 over the unit square. A canal cell is
impassable and the site of at most one rock, at its centre. A canal is a brush of six cells (0.03)
drawn along a sine-generated curve, the classic shape of a river meander (Langbein and Leopold
1966). With less structure the same area (5500 cells, 13.75 %) is cut into more pieces of shorter,
straighter strokes. Every layout has these properties (tests/worlds/test_canals.py):

* 5000 to 6000 canal cells, so that each of the 5000 rocks of a simple environment has a site;
* no canal cell is further than 4.5 cells from a free cell (width at most 0.04), so that the
  shortest sensor range, 0.03, reaches the middle of every canal;
* every canal cell lies in a canal block of 4 x 4 cells (0.02), so that no step of 0.01 jumps over
  it;
* the free cells are connected (4 neighbours) and a margin of 8 cells along the border is free, so
  that no rover is walled in.

``python -m conevo.worlds.rover.canals`` draws all ten again and writes ``canals-v1.npz``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from conevo.errors import unknown_name
from conevo.rng import stream

__all__ = ["CELL", "N_CELLS", "N_LAYOUTS", "generate", "load", "sites"]

N_LAYOUTS = 10
N_CELLS = 200  # per side
CELL = 1.0 / N_CELLS  # side of a cell, 0.005

BoolArray = npt.NDArray[np.bool_]
FloatArray = npt.NDArray[np.float64]

_DATA = Path(__file__).with_name("canals-v1.npz")
_SEED = 2009
_AREA = 5500  # canal cells aimed at
_WIDTH = 6  # of the brush, in cells
_MARGIN = 8  # free cells along the border
_CLEAR = 11.0  # smallest distance between the middles of two strokes, in cells
_REACH = 4.5  # largest distance from a canal cell to a free cell, in cells
_QUARTER = 0.18  # smallest share of the canal cells in each quarter of the square
_PIECES = (1, 2, 3, 5, 7, 11, 16, 24, 34, 46)  # aimed at, layouts 1..10


def load(environment: int) -> BoolArray:
    """Return the canal raster of one layout.

    Args:
        environment: number of the layout, 1 (joined meanders) to 10 (scattered pieces).

    Returns:
        mask [200, 200], True where a cell is canal; row = floor(y / 0.005), column =
        floor(x / 0.005).

    Raises:
        UsageError: no layout has this number.
    """
    _check(environment)
    with np.load(_DATA, allow_pickle=False) as data:
        packed = data["layouts"][environment - 1]
    return np.unpackbits(packed, axis=1, count=N_CELLS).astype(np.bool_)


def sites(mask: BoolArray) -> npt.NDArray[np.float32]:
    """Return the rock sites of a layout, the centres of its canal cells.

    Args:
        mask: [200, 200] canal raster.

    Returns:
        xy [n, 2] in the unit square, in row-major order of the raster.
    """
    row, column = np.nonzero(mask)
    return ((np.stack([column, row], axis=1) + 0.5) * CELL).astype(np.float32)


def generate(environment: int) -> BoolArray:
    """Draw one layout from scratch; deterministic, equal to that of ``load``.

    Args:
        environment: number of the layout, 1 to 10.

    Returns:
        mask [200, 200], True where a cell is canal.
    """
    _check(environment)
    for attempt in range(1000):
        drawing = _Drawing(environment, attempt)
        if drawing.finish():
            return drawing.mask
    raise RuntimeError(f"no drawing of layout {environment} succeeded")  # a changed constant


def _check(environment: int) -> None:
    if environment not in range(1, N_LAYOUTS + 1):
        raise unknown_name("canal layout", str(environment), map(str, range(1, N_LAYOUTS + 1)))


class _Drawing:
    """One attempt at a layout: pieces drawn one after another, each a tree of strokes.

    A stroke ends before it comes near another one, so pieces stay apart and never close a ring.
    """

    def __init__(self, environment: int, attempt: int) -> None:
        self.structure = (N_LAYOUTS - environment) / (N_LAYOUTS - 1)
        self.n_pieces = _PIECES[environment - 1]
        self.longest = 20.0 * 10.0**self.structure  # mean stroke in cells: 200 down to 20
        self.random = stream(_SEED, "canals-v1", environment, attempt).random
        self.mask: BoolArray = np.zeros((N_CELLS, N_CELLS), np.bool_)
        self.others: FloatArray = np.empty((0, 2))  # points of all finished pieces, in cells

    def finish(self) -> bool:
        """Draw all pieces; return False if the drawing must be discarded.

        Reasons are a piece without room, a nearly empty quarter or an enclosed free cell.
        """
        for left in range(self.n_pieces, 0, -1):
            goal = int(self.mask.sum()) + (_AREA - int(self.mask.sum())) // left
            if not self._piece(goal):
                return False
        half = N_CELLS // 2
        quarters = self.mask.reshape(2, half, 2, half).sum(axis=(1, 3))
        return bool(quarters.min() >= _QUARTER * quarters.sum()) and _connected(~self.mask)

    def _piece(self, goal: int) -> bool:
        """Draw strokes until ``goal`` cells are canal: the first anywhere, the others joined."""
        piece: FloatArray = np.empty((0, 3))  # x, y, heading
        for _ in range(400):
            missing = (goal - int(self.mask.sum())) / _WIDTH
            if missing <= 0.15 * self.longest:  # the next pieces get the rest
                self.others = np.concatenate([self.others, piece[:, :2]])
                return True
            stroke = self._stroke(piece, missing)
            if stroke is None:
                continue
            mask = self.mask.copy()
            _brush(mask, stroke)
            if _deep(mask):
                continue
            self.mask = mask
            piece = np.concatenate([piece, stroke])
        return False

    def _stroke(self, piece: FloatArray, missing: float) -> FloatArray | None:
        """Return a new stroke [n, 3], or None if it would be blocked too early."""
        length = min(missing, self.longest * (0.7 + 0.6 * self.random()))
        if len(piece):
            x, y, along = piece[int(self.random() * len(piece))]
            heading = along + math.copysign(math.pi / 2, self.random() - 0.5)
        else:
            x, y = self._empty_place()
            heading = 2 * math.pi * self.random()
        points = list(self._walk(x, y, heading, length, piece[:, :2]))
        shortest = min(length, 0.4 * self.longest) - 2.0
        return np.array(points) if len(points) >= max(2.0, shortest) else None

    def _empty_place(self) -> tuple[float, float]:
        """Return the one of eight random places that is furthest from all finished pieces."""
        low = _MARGIN + _WIDTH / 2
        span = N_CELLS - 2 * low
        places = [(low + span * self.random(), low + span * self.random()) for _ in range(8)]
        if not len(self.others):
            return places[0]
        room = [((self.others - place) ** 2).sum(axis=1).min() for place in places]
        return places[int(np.argmax(room))]

    def _walk(
        self, x: float, y: float, heading: float, length: float, piece: FloatArray
    ) -> Iterator[tuple[float, float, float]]:
        """Yield x, y, heading at every cell of length, up to the first blocked point."""
        start, path = np.array([x, y]), np.empty((0, 2))
        swing = (0.3 + 0.9 * self.structure) * (0.8 + 0.4 * self.random())  # rad
        period = 55.0 + 25.0 * self.random()  # cells of arc
        side = 1.0 if self.random() < 0.5 else -1.0
        # A joined stroke starts at a right angle, a free one anywhere on the wave.
        phase = 0.0 if len(piece) else 2 * math.pi * self.random()
        drift = (self.random() - 0.5) * 0.012
        piece = piece[((piece - start) ** 2).sum(axis=1) > (_CLEAR + 3) ** 2]
        others = np.concatenate([self.others, piece])
        for step in range(int(length) + 1):
            wave = math.sin(2 * math.pi * step / period + phase) - math.sin(phase)
            angle = heading + side * swing * wave + drift * step
            here = np.array([x, y])
            if not _inside(here) or _near(here, others) or _near(here, path[:-16]):
                return
            yield x, y, angle
            path = np.vstack([path, here])
            # Rounded, so that the last bit of another machine's sine cannot change a layout.
            x, y = round(x + math.cos(angle), 6), round(y + math.sin(angle), 6)


def _inside(point: FloatArray) -> bool:
    low = _MARGIN + _WIDTH / 2
    return bool(np.all(point >= low) and np.all(point <= N_CELLS - low))


def _near(point: FloatArray, others: FloatArray) -> bool:
    return bool(np.any(((others - point) ** 2).sum(axis=1) < _CLEAR**2))


def _brush(mask: BoolArray, stroke: FloatArray) -> None:
    """Mark a round brush of _WIDTH cells (a square without its corners) at every point."""
    half = _WIDTH // 2
    for x, y, _ in stroke:
        column, row = round(x), round(y)
        mask[row - half + 1 : row + half - 1, column - half : column + half] = True
        mask[row - half : row + half, column - half + 1 : column + half - 1] = True


def _deep(mask: BoolArray) -> bool:
    """Return whether a canal cell is further than _REACH from every free cell (margin is free)."""
    reach = int(_REACH)
    free = np.zeros_like(mask)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if math.hypot(dx, dy) <= _REACH:
                free |= np.roll(~mask, (dy, dx), axis=(0, 1))
    return bool(np.any(mask & ~free))


def _connected(free: BoolArray) -> bool:
    """Return whether all free cells are connected by their sides; cell [0, 0] must be free."""
    found = np.zeros_like(free)
    found[0, 0] = True
    size = 0
    while size < (size := int(found.sum())):
        grown = found.copy()
        grown[1:] |= found[:-1]
        grown[:-1] |= found[1:]
        grown[:, 1:] |= found[:, :-1]
        grown[:, :-1] |= found[:, 1:]
        found = grown & free
    return size == int(free.sum())


if __name__ == "__main__":
    layouts = np.stack([generate(e) for e in range(1, N_LAYOUTS + 1)])
    _DATA.parent.mkdir(exist_ok=True)
    np.savez_compressed(_DATA, layouts=np.packbits(layouts, axis=2))
    print(f"{_DATA.name}: {layouts.sum(axis=(1, 2)).tolist()} canal cells")  # noqa: T201
