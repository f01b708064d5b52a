"""Write ``replay/playback.ts``: the types of a playback and the constants of its look.

    python viewer/make_playback.py

They are declared in ``conevo.playback.schema``, ``conevo.playback.look`` and ``conevo.palette``,
and only translated here, so that films and the viewer cannot differ.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from conevo import palette
from conevo.playback import look, schema
from conevo.playback.quantized import Channel

FILE = Path(__file__).parent / "replay" / "playback.ts"
HEAD = """\
// The drawing of one team in one epoch and its look, the same in films and here.
//
// Written by viewer/make_playback.py from conevo/playback/schema.py, conevo/playback/look.py and
// conevo/palette.py, where everything is explained. Change those, not this file.

import type { Channel } from "./data";
"""
COLOURS = ("INK", "FAINT", "GROUND")
NAMES = {str: "string", int: "number", float: "number", bool: "boolean", NoneType: "null"}


def text() -> str:
    """Return the file."""
    numbers = {name: value for name, value in vars(look).items() if name.isupper()}
    constants = numbers | {name: f'"{getattr(palette, name)}"' for name in COLOURS}
    lines = [f"export const {name} = {value};" for name, value in constants.items()]
    hues = ", ".join(f'"{colour}"' for colour in palette.several(6))
    lines.append(f"export const HUES = [{hues}] as const;")
    return "\n".join([HEAD, *lines, *interfaces()]) + "\n"


def interfaces() -> Iterator[str]:
    """Yield the schema's classes in TypeScript, in their order."""
    for name, owner in vars(schema).items():
        if is_dataclass(owner) and owner is not Channel:
            types = get_type_hints(owner)
            meaning = (inspect.getdoc(owner) or "").split("\n\n")[0].replace("\n", " ")
            yield f"\n/** {meaning} */\nexport interface {name} {{"
            yield from (f"  readonly {f.name}: {typescript(types[f.name])};" for f in fields(owner))
            yield "}"


def typescript(kind: Any) -> str:
    """Return the type of a field in TypeScript."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Literal:
        return " | ".join(f'"{part}"' for part in parts)
    if origin is UnionType:
        return " | ".join(typescript(part) for part in parts)
    if origin is tuple and parts[-1] is ...:
        one = typescript(parts[0])
        return f"readonly {f'({one})' if ' ' in one else one}[]"
    if origin is tuple:
        return f"readonly [{', '.join(typescript(part) for part in parts)}]"
    return NAMES.get(kind) or kind.__name__


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
