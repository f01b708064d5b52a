"""Drawing of an epoch of any world, from the facts about it."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module

from conevo.playback import any_world
from conevo.playback.about import About
from conevo.playback.check import DAMAGE, one_line
from conevo.playback.described import described
from conevo.playback.drawn import Drawn
from conevo.playback.quantized import Channel
from conevo.playback.reading import Parts
from conevo.playback.schema import Playback
from conevo.worlds.registry import entry_of

__all__ = ["drawing"]


def drawing(about: About, channels: Mapping[str, Channel]) -> Playback:
    """Return the playback of an epoch, not checked, and without a title and facts.

    Raises:
        UsageError: the epoch lacks data that its world needs, or has impossible values.
        DAMAGE: any of these exceptions, for impossible numbers and names.
    """
    parts = Parts(about, channels)
    drawn = Drawn.of(about.get("drawn", {}), one_line(about["world"]))
    return described(_robots(parts, drawn), parts, drawn)


def _robots(parts: Parts, drawn: Drawn) -> Playback:
    """Return the playback that the world's folder makes, or that of the world it inherits."""
    about = parts.about
    entry = entry_of(about.get("like", about["world"]))
    if entry is None or not entry.drawn:
        return any_world.playback(parts, drawn)
    draw = import_module(entry.drawn).playback
    try:
        made: Playback = draw(parts)
    except DAMAGE:
        if "like" not in about:
            raise
        return any_world.playback(parts, drawn)  # it has other actions, castes or arrays
    return made
