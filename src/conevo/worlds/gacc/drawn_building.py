"""Events of the objects of the gathering world: gripped, helped with, let go, built in."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from conevo.numbers import enumerated
from conevo.palette import BLUE, FAINT, GREEN, INK, ORANGE, VERMILION
from conevo.playback.reading import Parts
from conevo.playback.schema import Event, Kind
from conevo.terms import counted
from conevo.worlds.gacc.plans import TYPES

__all__ = ["EVENT_KINDS", "Building"]

Ints = npt.NDArray[np.int64]

EVENT_KINDS = (
    Kind("grip", BLUE),
    Kind("let go", FAINT),
    Kind("wait for help", VERMILION),
    Kind("help", ORANGE),
    Kind("delivery", GREEN),
    Kind("completion", INK),
)
GRIP, LET_GO, WAIT, HELP, DELIVERY, COMPLETION = range(len(EVENT_KINDS))
FIRST_GRIP = 4  # actions from here on grip, one for each type
GRIPPED, CARRIED, WAITING, HELPED = 1, 2, 3, 4  # states of an object's life
NOT_NEEDED = 4  # situation of section 6.2.8 in which robots let go


class Building:
    """The history of the objects in a recording.

    Args:
        parts: of the trajectory.

    Raises:
        ValueError: it is damaged.
    """

    def __init__(self, parts: Parts) -> None:
        t, r = parts.t, parts.r
        self._parts = parts
        self._kind = parts.whole("scene/object_type", -1)
        k = len(self._kind)
        self._rows, self._steps = parts.channel("scene/plan", -1, -1).codes.shape
        self._held = parts.index("held", k, t, r, least=-1).values
        self._held_before = _before(self._held, -1)
        self._life = parts.whole("life", t, k)
        self._part = parts.index("part", self._rows * self._steps, t, k, least=-1).values
        self._part_before = _before(self._part, -1)

    @cached_property
    def _built(self) -> list[tuple[int, int]]:
        """Iteration and object of every part built in, in the order of places."""
        at = np.argwhere((self._part >= 0) & (self._part_before < 0)).tolist()
        return sorted(((t, k) for t, k in at), key=lambda one: int(self._part[one]))

    @property
    def delivered(self) -> Ints:
        """Objects delivered so far [T]."""
        total: Ints = (self._part >= 0).sum(axis=1)
        return total

    @property
    def rows(self) -> list[list[tuple[int, int]]]:
        """Type, and iteration of building, of each part of each complex object.

        Raises:
            ValueError: a part is built twice, or before its predecessor.
        """
        found: list[list[tuple[int, int]]] = [[] for _ in range(self._rows)]
        for t, k in self._built:
            row, step = divmod(int(self._part[t, k]), self._steps)
            if step != len(found[row]) or (step and found[row][-1][1] > t):
                raise ValueError(f"part {step + 1} of complex object {row + 1} is out of turn")
            found[row].append((int(self._kind[k]), t))
        return found

    def events(self) -> tuple[Event, ...]:
        """Return all events of objects."""
        return (*self._grips(), *self._openings(), *self._arrivals(), *self._deliveries())

    def _letter(self, k: int) -> str:
        return TYPES[self._kind[k]]

    def _holders(self, t: int, k: int) -> list[int]:
        return [int(i) for i in np.flatnonzero(self._held[t] == k)]

    def _grips(self) -> list[Event]:
        """Return grips, alone or as help; those of several robots at once are one event."""
        is_new = (self._held != self._held_before) & (self._held >= 0)
        pairs = {(t, int(self._held[t, i])) for t, i in np.argwhere(is_new).tolist()}
        events = []
        for t, k in sorted(pairs):
            holders = self._holders(t, k)
            new = [i for i in holders if is_new[t, i]]
            others = [i for i in holders if not is_new[t, i]]
            who, s = enumerated("robot", new), "s" * (len(new) == 1)
            if others:
                text = f"{who} help{s} {enumerated('robot', others)} with {self._letter(k)}"
                events.append(Event(t, HELP, text, tuple(new)))
                continue
            where = " in the home area" if self._life[t, k] in (WAITING, HELPED) else ""
            text = f"{who} grip{s} {self._letter(k)}{where}"
            events.append(Event(t, GRIP, text, tuple(new)))
        return events

    def _openings(self) -> list[Event]:
        """Return the events in which a robot lets go of an object that is not delivered."""
        wait = int(self._parts.param("wait"))
        waited = _before(self._parts.whole("waited", *self._held.shape), 0)
        situation = self._parts.whole("situation", *self._held.shape)
        events = []
        is_gone = (self._held != self._held_before) & (self._held_before >= 0)
        for t, i in np.argwhere(is_gone).tolist():
            k = int(self._held_before[t, i])
            if self._part[t, k] != self._part_before[t, k]:
                continue
            why = ""
            if situation[t, i] == NOT_NEEDED:
                why = ", which is not needed now"
            elif waited[t, i] + 1 >= wait:
                why = f" after waiting for {counted(wait, 'iteration')}"
            events.append(Event(t, LET_GO, f"robot {i} lets go of {self._letter(k)}{why}", (i,)))
        return events

    def _arrivals(self) -> list[Event]:
        """Return arrivals in the home area with an object, from which on robots wait."""
        came = (self._life == WAITING) & np.isin(_before(self._life, 0), (GRIPPED, CARRIED))
        events = []
        for t, k in np.argwhere(came).tolist():
            who = self._holders(t, k)
            text = f"{enumerated('robot', who)} is home with {self._letter(k)} and waits for help"
            events.append(Event(t, WAIT, text, tuple(who)))
        return events

    def _deliveries(self) -> list[Event]:
        """Return the parts built in, with their builders, and the completed complex objects."""
        events = []
        for t, k in self._built:
            row, step = divmod(int(self._part[t, k]), self._steps)
            who = self._builders(t, k)
            by = f", by {enumerated('robot', who)}" if who else ""
            what = f"{self._letter(k)} is part {step + 1} of complex object {row + 1}{by}"
            events.append(Event(t, DELIVERY, what, tuple(who)))
            if step + 1 == self._steps:
                text = f"complex object {row + 1} is complete"
                events.append(Event(t, COMPLETION, text, tuple(who)))
        return events

    def _builders(self, t: int, k: int) -> list[int]:
        """Return the robots that are credited with building in an object.

        They have held it, or gripped it in the same iteration, after which they hold nothing.
        Choice: if several objects of its type are built in at once, the latter belong to the
        closest one.
        """
        shape = self._held.shape
        before = _before(self._parts.whole("fitness", *shape), 0)
        is_paid = self._parts.whole("fitness", *shape)[t] > before[t]
        fresh = is_paid & (self._held_before[t] < 0)
        fresh &= self._parts.whole("action", *shape)[t] == FIRST_GRIP + self._kind[k]
        rivals = [j for s, j in self._built if s == t and self._kind[j] == self._kind[k]]
        if len(rivals) > 1:
            fresh &= self._closest(t, rivals) == k
        return [int(i) for i in np.flatnonzero(fresh | (is_paid & (self._held_before[t] == k)))]

    def _closest(self, t: int, objects: list[int]) -> Ints:
        """Return which of some objects lay closest to each robot [R] that did not move in t."""
        gap = np.zeros((self._held.shape[1], len(objects)))
        for of_robot, of_object in (("x", "object_x"), ("y", "object_y")):
            robot = self._parts.floats(of_robot, *self._held.shape)[t]
            at_first = self._parts.floats(f"scene/{of_object}", len(self._kind))
            lay = self._parts.floats(of_object, *self._part.shape)[t - 1] if t else at_first
            gap += (robot[:, None] - lay[objects]) ** 2
        found: Ints = np.array(objects)[gap.argmin(axis=1)]
        return found


def _before(values: Ints, first: int) -> Ints:
    """Return the values of the previous iteration [T, n]; ``first`` for the first one."""
    return np.concatenate([np.full_like(values[:1], first), values[:-1]])
