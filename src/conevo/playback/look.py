"""How a playback looks, the same in films and in the viewer: sizes, opacities, what is a jump.

The viewer reads a generated copy, ``viewer/replay/playback.ts``. Colours are in ``palette``.
"""

from __future__ import annotations

SPEED = 60  # Choice: iterations per second, of MP4 films and as the viewer begins
LEAST_BODY = 3.5  # px, radius of the smallest body drawn
LEAST_THING = 1.0  # px, radius or half a side of the smallest thing drawn
KITE_TIP, KITE_SIDE = 1.35, 0.95  # radii: how far a body that is not of the team reaches
TRAIL = 120  # positions that a trail shows
TRAIL_PIECES = 4  # of a trail, each fainter than the one after it
TRAIL_OPACITY = 0.5  # of the newest piece
JUMP = 0.5  # of the world's width or height: who moves farther leaves no trail there
GONE_OPACITY = 0.12  # of what has been gone for long
RING_FRAMES = 15  # a ring shows so long that something has just gone
RING_GROWTH = 14  # px, by which it has grown when it ends
RANGE_FILL, RANGE_LINE = 0.1, 0.35  # opacities of the range of an action
