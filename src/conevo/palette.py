"""One palette for everything that is drawn: report, live page, replay, film.

The colours are the eight of Okabe and Ito (2008), which readers with any kind of colour vision can
distinguish, with lighter and darker forms for related things: hue is the type of a thing, lightness
its state. Methods have their own colours, which also differ in lightness. A method has the same
colour everywhere, whatever else is drawn with it.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from conevo.terms import NON_SPECIALIZED

__all__ = [
    "BLUE",
    "FAINT",
    "GREEN",
    "GROUND",
    "INK",
    "METHODS",
    "MOVE",
    "ORANGE",
    "PURPLE",
    "SKY",
    "VERMILION",
    "YELLOW",
    "Look",
    "caste_colours",
    "method_looks",
    "several",
    "shade",
]

ORANGE, SKY, GREEN, YELLOW = "#e69f00", "#56b4e9", "#009e73", "#f0e442"
BLUE, VERMILION, PURPLE = "#0072b2", "#d55e00", "#cc79a7"
INK, FAINT, GROUND = "#1c1c22", "#9a9aa5", "#fbfaf7"  # text, minor things, the world's floor
MOVE = "#4a4a52"  # Choice: actions between a robot's tasks, such as moving, are dark grey

_ORDER = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION, YELLOW, INK)


def several(n: int) -> tuple[str, ...]:
    """Return n colours; from the ninth on they are darker forms of the first ones."""
    return tuple(shade(_ORDER[k % 8], -0.4 * (k // 8)) for k in range(n))


def shade(colour: str, by: float) -> str:
    """Return a colour lighter (by > 0, to white at 1) or darker (by < 0, to black at -1)."""
    goal = 255 if by > 0 else 0
    parts = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return "#" + "".join(f"{round(p + (goal - p) * min(abs(by), 1.0)):02x}" for p in parts)


class Look(NamedTuple):
    """Appearance of a method in figures.

    Attributes:
        number: of the look, for hatches, dashes and markers, which distinguish methods without
            colour.
        area: colour of bars, of bands and inside points.
        line: colour of lines, of rims, and of text about it.
    """

    number: int
    area: str
    line: str


METHODS: dict[str, Look] = {
    "homcne": Look(0, "#fbe6b4", ORANGE),
    "hetcne": Look(1, "#a9d9c8", GREEN),
    "ccga": Look(2, "#e59a70", VERMILION),
    "mesp": Look(3, "#5d98c6", BLUE),
    "cone": Look(4, "#53557a", INK),
    "cone-1": Look(5, "#dcaeca", PURPLE),
    "cone-2": Look(6, "#d8edfa", SKY),
    "cone-3": Look(7, "#8f755a", "#6b4e30"),
    "cone-es": Look(8, "#cfacfb", "#7e1c67"),
    "hom-es": Look(9, "#a5bd9c", "#7fa75c"),
    "esp": Look(10, "#bf05f3", "#810dff"),
    "cosyne": Look(11, "#22fd13", "#112699"),
    "neat": Look(12, "#9e43c9", "#b95cff"),
    "openai-es": Look(13, "#5d8e29", "#391a01"),
    "cma-es": Look(14, "#a0fd70", "#490466"),
    "novelty": Look(15, "#61d540", "#42453d"),
    "map-elites": Look(16, "#ef1c0b", "#a03407"),
    "hyb-ccea": Look(17, "#d372fc", "#9216d1"),
    "sane": Look(18, "#888780", "#736471"),
    "hyperneat": Look(19, "#f212a7", "#af149b"),
}
"""The look of every method of the registry."""

_OTHERS = (  # looks of methods from elsewhere
    ("#d9e4a0", "#8a9a2b"),
    ("#f3c1d5", "#b8487f"),
    ("#a5e0ec", "#1f93a8"),
    ("#f5c98b", "#a8661a"),
    ("#b9b6e8", "#5a52b5"),
    ("#a9d6a4", "#3c7d35"),
)


def method_looks(names: Iterable[str]) -> dict[str, Look]:
    """Return the look of each method; for those of the registry it is always the same.

    The name of a method from elsewhere determines its look, or the next free one if another method
    already has it. Colours repeat after twelve such methods, numbers never.
    """
    wanted = sorted(set(names))
    looks = {name: METHODS[name] for name in wanted if name in METHODS}
    taken: dict[int, str] = {}
    for name in (name for name in wanted if name not in METHODS):
        k = zlib.crc32(name.encode()) % len(_OTHERS)
        while k in taken:
            k += 1 if len(taken) >= len(_OTHERS) else (k + 1) % len(_OTHERS) - k
        taken[k] = name
        area, line = _OTHERS[k % len(_OTHERS)]
        darker = -0.35 * (k // len(_OTHERS) % 2)
        looks[name] = Look(len(METHODS) + k, shade(area, darker), shade(line, darker))
    return looks


def caste_colours(known: Mapping[str, str], names: Iterable[str]) -> dict[str, str]:
    """Return the colour of every caste: the world's own in its order, then others by name.

    The non-specialized are faint and come last.

    Args:
        known: colours of the world's own castes.
        names: castes that occur.
    """
    others = sorted(set(names) - known.keys() - {NON_SPECIALIZED})
    free = [c for c in several(len(others) + len(known)) if c not in known.values()]
    return {**known, **dict(zip(others, free, strict=False)), NON_SPECIALIZED: FAINT}
