"""Frames of a film: one or two teams in their worlds, with their actions and performance.

The font is Pillow's own, so frames are the same on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image

from conevo.errors import UsageError
from conevo.playback.schema import Playback
from conevo.replay.drawing.panel import PAGE, Panel

__all__ = ["Painter"]

_SIZES = (120, 2160)  # px, of a world's longer side


class Painter:
    """Paints frames of one team, or of two teams side by side.

    A frame depends on its number alone, bit for bit, whatever was painted before.

    Args:
        playbacks: one or two; the shorter epoch stays at its end.
        size: of the longer side of each world, px; other sizes follow from it.
        colour_by: "action" or "caste".

    Attributes:
        size: (width, height) of a frame in px, both even, as video needs.
        iterations: number of frames: the iterations of the longer epoch.

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
        alone = len(playbacks) == 1
        self._panels = [Panel(playback, size, colour_by, alone) for playback in playbacks]
        self.iterations = max(playback.iterations for playback in playbacks)
        width = sum(panel.background.width for panel in self._panels)
        height = max(panel.background.height for panel in self._panels)
        self.size = (width + width % 2, height + height % 2)

    def frame(self, t: int) -> Image.Image:
        """Return the picture after iteration t, from 0, in mode "RGB".

        Raises:
            UsageError: no such iteration.
        """
        if not 0 <= t < self.iterations:
            raise UsageError(f"no iteration {t}: the epoch has 0 to {self.iterations - 1}")
        page, x = Image.new("RGB", self.size, PAGE), 0
        for panel in self._panels:
            panel.paint(page, x, min(t, panel.playback.iterations - 1))
            x += panel.background.width
        return page
