"""What a followed run's provenance declares: measures, origin and code; no world is loaded."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from conevo.errors import ConevoError
from conevo.evolution.methods.registry import remember_title
from conevo.reading import parse_json
from conevo.watch.tail import Whole, readable
from conevo.worlds.measures import Measure

__all__ = ["Declared", "Declaration"]


class Declaration(NamedTuple):
    """What is declared.

    measures: by name; none of a run that conevo 0.1.0 made. origin: the run whose populations or
    champion it began with, and their digest; empty without. codes: every conevo that evolved it.
    """

    measures: dict[str, Measure]
    origin: str
    codes: str


NOTHING = Declaration({}, "", "")


class Declared:
    """What a run's ``provenance.json`` declares.

    A page that follows a run shows it without that: what is damaged there declares nothing.

    Args:
        folder: of the run.
    """

    def __init__(self, folder: Path) -> None:
        self._file = Whole(folder / "provenance.json", _declared)

    def read(self) -> Declaration:
        """Return what is declared now."""
        try:
            return self._file.read() or NOTHING
        except (ConevoError, OSError):
            return NOTHING


def _declared(content: bytes) -> Declaration:
    about = parse_json(content, "provenance.json")
    sessions, method = about.get("sessions"), about.get("method")
    if isinstance(method, dict):
        remember_title(readable(str(method.get("name"))), readable(str(method.get("title"))))
    codes = [
        f"{one.get('conevo')} ({one.get('code')})"
        for one in (sessions if isinstance(sessions, list) else [])
        if isinstance(one, dict) and "code" in one
    ]
    return Declaration(_measures(about), _origin(about), readable(" + ".join(dict.fromkeys(codes))))


def _measures(about: Mapping[str, Any]) -> dict[str, Measure]:
    world = about.get("world")
    listed = world.get("measures") if isinstance(world, dict) else None
    if not isinstance(listed, list):
        return {}
    found = [Measure(**one) for one in listed]
    return {
        readable(one.name): Measure(one.name, readable(one.unit), one.larger_is_better)
        for one in found
    }


def _origin(about: Mapping[str, Any]) -> str:
    origin = about.get("origin")
    if not isinstance(origin, dict):
        return ""
    whose = "champion of " if origin.get("of") == "champion" else ""
    name = PurePath(str(origin.get("path"))).name
    return readable(f"{whose}{name} ({str(origin.get('checkpoint'))[:6]})")
