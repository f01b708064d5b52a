"""Settings as they are written on a command line: "run.generations=5"."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from conevo.errors import UsageError
from conevo.reading import DamagedFile, parse_toml

__all__ = ["parse_assignment", "parse_assignments"]


def parse_assignment(text: str) -> tuple[str, Any]:
    """Return key and value of "key=value"; the value is TOML, a number as .5, or else plain text.

    Raises:
        UsageError: there is no "=".
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise UsageError(f"--set {text!r}: expected key=value, for example run.generations=5")
    try:
        return key.strip(), parse_toml(f"value = {value}", "a value")["value"]
    except DamagedFile:
        value = value.strip()
        return key.strip(), float(value) if re.fullmatch(r"[+-]?\.\d+", value) else value


def parse_assignments(texts: Iterable[str]) -> dict[str, Any]:
    """Return the settings of several "key=value".

    Raises:
        UsageError: one has no "=", or two set the same key.
    """
    found: dict[str, Any] = {}
    for text in texts:
        key, value = parse_assignment(text)
        if key in found:
            raise UsageError(f"--set {text!r}: {key} is set twice")
        found[key] = value
    return found
