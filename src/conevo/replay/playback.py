"""What is to be drawn of a trajectory: ``playback_of`` tells it, for the viewer and for films."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

from conevo.playback import plain
from conevo.playback.check import checked
from conevo.playback.described import described
from conevo.playback.drawn import Drawn
from conevo.playback.parts import Parts
from conevo.playback.refusals import DAMAGE, one_line, refusal
from conevo.playback.schema import Playback
from conevo.replay.trajectory import Trajectory
from conevo.replay.words import facts, subtitle, title
from conevo.worlds.registry import WORLDS

__all__ = ["playback_of"]


def playback_of(trajectory: Trajectory) -> Playback:
    """Return what is to be drawn of a trajectory.

    Raises:
        UsageError: it lacks what its world needs, or what it says cannot be.
    """
    about = trajectory.about
    try:
        parts = Parts(about, trajectory.channels)
        drawn = Drawn.of(about.get("drawn", {}), one_line(about["world"]))
        made = described(_robots(parts, drawn), parts, drawn)
        return checked(
            replace(made, title=title(about), subtitle=subtitle(about), facts=facts(about))
        )
    except DAMAGE as error:
        raise refusal(error) from error


def _robots(parts: Parts, drawn: Drawn) -> Playback:
    """Return the playback that the world's folder makes, or that of the world it inherits."""
    about = parts.about
    entry = WORLDS.get(about.get("like", about["world"]))
    if entry is None or not entry.drawn:
        return plain.playback(parts, drawn)
    draw = import_module(entry.drawn).playback
    try:
        made: Playback = draw(parts)
    except DAMAGE:
        if "like" not in about:
            raise
        return plain.playback(parts, drawn)  # it has other actions, castes or arrays
    return made
