"""Frames of a film: one or two teams in their worlds, what they do and what they have reached.

Nothing of the machine is needed: the letters are those that Pillow brings along.
"""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image

from conevo.errors import UsageError
from conevo.playback.schema import Playback
from conevo.replay.drawing.panel import PAGE, Panel
from conevo.replay.drawing.planes import RGB, YUV, Colours, Planes, even

__all__ = ["Painter"]

_SIZES = (120, 2160)  # px, of a world's longer side


class Painter:
    """Paints frames of one team, or of two teams side by side.

    A frame is a function of its number alone: painting others before changes no bit of it.

    Args:
        playbacks: one or two; an epoch that is shorter than the other stays at its end.
        size: of the longer side of each world, px; all else follows from it.
        colour_by: "action" or "caste".

    Attributes:
        size: (width, height) of a frame in px, both even.

    Raises:
        UsageError: no playback or more than two, a size that is out of range, an unknown colouring.
    """

    def __init__(
        self, playbacks: Sequence[Playback], size: int = 720, colour_by: str = "action"
    ) -> None:
        if not 1 <= len(playbacks) <= 2:
            raise UsageError(f"a film shows one or two teams, not {len(playbacks)}")
        if not _SIZES[0] <= size <= _SIZES[1]:
            raise UsageError(f"size {size} is not between {_SIZES[0]} and {_SIZES[1]}")
        if colour_by not in ("action", "caste"):
            raise UsageError(f"robots are coloured by action or by caste, not by {colour_by}")
        self._playbacks, self._px, self._colour_by = tuple(playbacks), even(size), colour_by
        self._panels: dict[Colours, list[Panel]] = {}
        self._pages: dict[Colours, Planes] = {}
        sizes = [panel.size for panel in self._panels_in(RGB)]
        self.size = (sum(width for width, _ in sizes), max(height for _, height in sizes))

    @property
    def iterations(self) -> int:
        """How many frames there are: the iterations of the longer epoch."""
        return max(playback.iterations for playback in self._playbacks)

    def frame(self, t: int) -> Image.Image:
        """Return the picture after iteration t, from 0, in mode "RGB".

        Raises:
            UsageError: no such iteration.
        """
        return self._paint(RGB, t).picture()

    def video(self, t: int) -> bytes:
        """Return the same frame as yuv420p, BT.709: luma, then the two halved chroma planes."""
        return self._paint(YUV, t).data()

    def _paint(self, colours: Colours, t: int) -> Planes:
        if not 0 <= t < self.iterations:
            raise UsageError(f"no iteration {t}: the epoch has 0 to {self.iterations - 1}")
        panels = self._panels_in(colours)
        if colours not in self._pages:
            self._pages[colours] = Planes.of(self._background(panels), colours)
        page = self._pages[colours].copy()
        x = 0
        for panel in panels:
            panel.paint(page, x, min(t, panel.playback.iterations - 1))
            x += panel.size[0]
        return page

    def _panels_in(self, colours: Colours) -> list[Panel]:
        """Return the panels that paint into such planes, made when they are first needed."""
        if colours not in self._panels:
            alone = len(self._playbacks) == 1
            self._panels[colours] = [
                Panel(playback, self._px, colours, self._colour_by, alone)
                for playback in self._playbacks
            ]
        return self._panels[colours]

    def _background(self, panels: list[Panel]) -> Image.Image:
        """Return what is the same in all frames."""
        page = Image.new("RGB", self.size, PAGE)
        x = 0
        for panel in panels:
            page.paste(panel.background(), (x, 0))
            x += panel.size[0]
        return page
