"""A user's world's description of its drawing: objects and areas next to its robots.

A world's class has it as ``drawn``. It is kept with every recorded epoch, so that drawing one needs
no code of the world::

    drawn: ClassVar[Drawn] = Drawn(
        objects=(Objects("ball", "ball[0]", "ball[1]", size=0.02),),
        areas=(Area("goal", "places[-1, 0]", "places[-1, 1]", 0.03),),
    )

A text in place of a number names an array that ``simulation()`` records, else one of the scenario,
else a parameter. Indices in brackets pick from it, "places[-1, 0]" or "places[4:, 0]". Time, the
first dimension of arrays recorded in every iteration, is not among them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt

from conevo.errors import UsageError
from conevo.reading import check

__all__ = ["Area", "Drawn", "Objects", "Signal"]

_COLOUR = re.compile(r"#[0-9a-f]{6}")


@dataclass(frozen=True)
class Objects:
    """Things that lie or move in the world.

    name: of them. x, y: their positions. size: radius, or half a side. shape: "disc" or "square".
    kind: index of each thing's kind in ``kinds``. state: index of each thing's state in ``states``,
    in every iteration. gone: the iteration in which each was taken away. By default all are of one
    kind, without states, and stay to the end. colours: of the kinds.
    """

    name: str
    x: str
    y: str
    size: Annotated[float, Gt(0)] = 0.01
    shape: Literal["disc", "square"] = "disc"
    kind: str = ""
    kinds: tuple[str, ...] = ()
    state: str = ""
    states: tuple[str, ...] = ()
    gone: str = ""
    colours: tuple[str, ...] = ()


@dataclass(frozen=True)
class Area:
    """An area that does not move: a goal, a home. x, y: its centre.

    radius: of a disc. width, height: of a rectangle, which has no radius. colour: of its floor.
    """

    name: str
    x: float | str
    y: float | str
    radius: float | str = 0.0
    width: float | str = 0.0
    height: float | str = 0.0
    colour: str = ""


@dataclass(frozen=True)
class Signal:
    """A kind of event to jump to, which happens whenever a number rises.

    name: of the event. rises: an array recorded in every iteration, [T] of the world, or [T, n] of
    robots or objects. colour: of its mark.
    """

    name: str
    rises: str
    colour: str = ""


@dataclass(frozen=True)
class Drawn:
    """The drawing of a world.

    objects, areas, signals: in addition to its robots. unit: of lengths, as in "cm". seconds: of an
    iteration, 0 if it has no duration. bounds: corners x0, y0, x1, y1; None: the unit square if all
    robots stay in it, else an area around them. radius: of a robot; 0: a hundredth of the world.
    colours: "#rrggbb" of actions and castes by name; others are chosen.
    """

    objects: tuple[Objects, ...] = ()
    areas: tuple[Area, ...] = ()
    signals: tuple[Signal, ...] = ()
    unit: str = ""
    seconds: Annotated[float, Ge(0)] = 0.0
    bounds: tuple[float, float, float, float] | None = None
    radius: Annotated[float, Ge(0)] = 0.0
    colours: dict[str, str] = field(default_factory=dict)

    @property
    def plain(self) -> dict[str, Any]:
        """Its JSON form.

        Raises:
            UsageError: JSON cannot represent a part of it.
        """
        try:
            found: dict[str, Any] = json.loads(json.dumps(asdict(self), allow_nan=False))
        except (TypeError, ValueError) as error:
            raise UsageError(f"drawn must be of plain texts and numbers: {error}") from error
        return found

    @staticmethod
    def of(plain: Mapping[str, Any], world: str) -> Drawn:
        """Return the drawing of a world from its JSON form.

        Raises:
            UsageError: it is not one.
        """
        found: Drawn = check(plain, Drawn, f"world {world}: drawn", is_closed=True)
        if wrong := found._wrong():
            raise UsageError(f"world {world}: drawn: {wrong}")
        return found

    def _wrong(self) -> str:
        """Return what is wrong with values of the right types, "" if nothing."""
        x0, y0, x1, y1 = self.bounds or (0.0, 0.0, 1.0, 1.0)
        if not (x0 < x1 and y0 < y1):
            return f"bounds {self.bounds} are not x0, y0, x1, y1 with x0 < x1 and y0 < y1"
        colours = [*self.colours.values(), *(c for one in self.objects for c in one.colours)]
        colours += [area.colour for area in self.areas if area.colour]
        colours += [signal.colour for signal in self.signals if signal.colour]
        odd = [colour for colour in colours if not _COLOUR.fullmatch(colour)]
        return f"{odd[0]!r} is not a colour, as in '#d55e00'" if odd else ""
