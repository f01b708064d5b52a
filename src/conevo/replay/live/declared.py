"""The measures of a followed run, as its provenance declares them; no world is loaded for it."""

from __future__ import annotations

from pathlib import Path

from conevo.errors import ConevoError
from conevo.evolution.methods.registry import remember_title
from conevo.reading import parse_json
from conevo.replay.live.files import Whole, readable
from conevo.worlds.measures import Measure

__all__ = ["Declared"]


class Declared:
    """The measures that a run's ``provenance.json`` declares.

    A page that follows a run shows it without them: what is damaged there declares nothing.

    Args:
        folder: of the run.
    """

    def __init__(self, folder: Path) -> None:
        self._file = Whole(folder / "provenance.json", _measures)

    def read(self) -> dict[str, Measure]:
        """Return the measures by name; none of a run that conevo 0.1.0 made."""
        try:
            return self._file.read() or {}
        except (ConevoError, OSError):
            return {}


def _measures(content: bytes) -> dict[str, Measure]:
    about = parse_json(content, "provenance.json")
    world, method = about.get("world"), about.get("method")
    if isinstance(method, dict):
        remember_title(readable(str(method.get("name"))), readable(str(method.get("title"))))
    listed = world.get("measures") if isinstance(world, dict) else None
    if not isinstance(listed, list):
        return {}
    found = [Measure(**one) for one in listed]
    return {
        readable(one.name): Measure(one.name, readable(one.unit), one.larger_is_better)
        for one in found
    }
