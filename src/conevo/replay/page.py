"""The replay of one or two teams as a single page that needs neither network nor server."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Sequence
from importlib import resources
from importlib.metadata import version

from conevo.errors import UsageError
from conevo.playback.schema import Playback, Pool

__all__ = ["replay_page"]

PLACE = "<!-- conevo:data -->"  # in the viewer's page, replaced by the data
# Written as JSON escapes, since nothing inside a script element may end it.
_ESCAPED = {ord(sign): f"\\u{ord(sign):04x}" for sign in "<>&\u2028\u2029"}


def replay_page(playbacks: Sequence[Playback]) -> str:
    """Return the viewer with the data of its teams; equal playbacks give equal pages.

    Args:
        playbacks: one team, or two in the same scenario, side by side.

    Raises:
        UsageError: two teams whose epochs are not equally long.
    """
    if not 1 <= len(playbacks) <= 2:
        raise ValueError(f"a page shows one team or two, not {len(playbacks)}")
    lengths = sorted({playback.iterations for playback in playbacks})
    if len(lengths) > 1:
        raise UsageError(
            f"epochs of {lengths[0]} and {lengths[1]} iterations cannot be shown side by side"
        )
    pool = Pool()
    teams = [pool.plain(playback) for playback in playbacks]
    about = {"conevo": version("conevo"), "teams": teams}
    text = json.dumps(about, allow_nan=False, separators=(",", ":")).translate(_ESCAPED)
    data = base64.b64encode(zlib.compress(pool.data, 9)).decode()
    viewer = resources.files("conevo.replay").joinpath("replay.html").read_text("utf-8")
    before, found, after = viewer.partition(PLACE)
    if not found:
        raise RuntimeError(f"the viewer has no {PLACE}")
    return (
        f'{before}<script type="application/json" id="about">{text}</script>\n'
        f'<script type="application/octet-stream" id="data">{data}</script>{after}'
    )
