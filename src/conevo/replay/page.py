"""The replay of one or two teams as a single page that needs neither network nor server.

A notebook shows it in a sandboxed frame.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Iterable, Sequence
from importlib import resources
from importlib.metadata import version
from typing import TYPE_CHECKING

from conevo.errors import UsageError
from conevo.playback.schema import Playback, Pool
from conevo.replay.playback import playback_of, subtitle, title
from conevo.runs.html import card, escape
from conevo.terms import counted

if TYPE_CHECKING:
    from conevo.replay.trajectory import Trajectory

__all__ = ["CARD_BYTES", "replay_card", "replay_page"]

CARD_BYTES = 8 * 2**20  # of a page in a notebook, whose file will contain it
CARD_HEIGHT = 720  # pixels
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


def replay_card(trajectory: Trajectory) -> str:
    """Return the replay in a sandboxed frame, or a hint if the page is too large."""
    about = trajectory.about

    def parts() -> Iterable[str]:
        page = replay_page([playback_of(trajectory)])
        if (size := len(page.encode())) > CARD_BYTES:
            yield (
                f"<p>The replay has {size / 2**20:.0f} MiB, more than the "
                f"{CARD_BYTES // 2**20} MiB that a notebook shows. See it with "
                f"<code>recording.save(path)</code> and <code>conevo replay FILE</code>.</p>"
            )
            return
        yield (
            f'<iframe sandbox="allow-scripts" title="{escape(title(about))}" '
            f'srcdoc="{escape(page)}" style="border: 1px solid rgba(128, 128, 128, .4); '
            f'color-scheme: light; height: {CARD_HEIGHT}px; width: 100%"></iframe>'
        )

    iterations = counted(about["iterations"], "iteration")
    return card(title(about), [subtitle(about), iterations], parts)
