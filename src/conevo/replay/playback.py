"""What is to be drawn of a trajectory: ``playback_of`` tells it, for the viewer and for films."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from conevo.playback.check import DAMAGE, checked, refusal
from conevo.playback.schema import Playback
from conevo.replay.captions import facts, subtitle, title
from conevo.worlds.drawing import drawing

if TYPE_CHECKING:
    from conevo.replay.trajectory import Trajectory

__all__ = ["playback_of"]


def playback_of(trajectory: Trajectory) -> Playback:
    """Return what is to be drawn of a trajectory.

    Raises:
        UsageError: it lacks what its world needs, or what it says cannot be.
    """
    about = trajectory.about
    try:
        made = drawing(about, trajectory.channels)
        return checked(
            replace(made, title=title(about), subtitle=subtitle(about), facts=facts(about))
        )
    except DAMAGE as error:
        raise refusal(error) from error
