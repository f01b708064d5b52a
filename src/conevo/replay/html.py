"""A recorded epoch in notebooks: the replay page in a sandboxed frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from conevo.replay.page import replay_page
from conevo.replay.playback import playback_of, subtitle, title
from conevo.runs.html import card, escape
from conevo.terms import counted

if TYPE_CHECKING:
    from conevo.replay.trajectory import Trajectory

__all__ = ["MOST_BYTES", "replay_card"]

MOST_BYTES = 8 * 2**20  # of a page, which the notebook's file will contain
HEIGHT = 720  # pixels


def replay_card(trajectory: Trajectory) -> str:
    """Return the replay in a sandboxed frame, or a hint if the page is too large."""
    about = trajectory.about

    def parts() -> Iterable[str]:
        page = replay_page([playback_of(trajectory)])
        if (size := len(page.encode())) > MOST_BYTES:
            yield (
                f"<p>The replay has {size / 2**20:.0f} MiB, more than the "
                f"{MOST_BYTES // 2**20} MiB that a notebook shows. See it with "
                f"<code>recording.save(path)</code> and <code>conevo replay FILE</code>.</p>"
            )
            return
        yield (
            f'<iframe sandbox="allow-scripts" title="{escape(title(about))}" '
            f'srcdoc="{escape(page)}" style="border: 1px solid rgba(128, 128, 128, .4); '
            f'color-scheme: light; height: {HEIGHT}px; width: 100%"></iframe>'
        )

    iterations = counted(about["iterations"], "iteration")
    return card(title(about), [subtitle(about), iterations], parts)
