"""The look of a playback, the same in films and in the viewer: sizes, opacities, jumps.

The viewer reads a generated copy, ``viewer/replay/playback.ts``. Colours are in ``palette``.
"""

from __future__ import annotations

SPEED = 60  # Choice: iterations per second, of MP4 films and of the viewer at the start
LEAST_BODY = 3.5  # px, radius of the smallest body drawn
LEAST_THING = 1.0  # px, radius or half a side of the smallest thing drawn
KITE_TIP, KITE_SIDE = 1.35, 0.95  # radii: extent of a body that is not of the team
TRAIL = 120  # positions in a trail
TRAIL_PIECES = 4  # of a trail, each fainter than the one after it
TRAIL_OPACITY = 0.5  # of the newest piece
JUMP = 0.5  # of the world's width or height: a longer step leaves no trail
GONE_OPACITY = 0.12  # of things that have faded
RING_FRAMES = 15  # duration of the ring around a thing that has just gone
RING_GROWTH = 14  # px, by which it grows in that time
RANGE_FILL, RANGE_LINE = 0.1, 0.35  # opacities of the range of an action
