"""The playback of a world from outside the package: robots' positions and actions."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError
from conevo.palette import several
from conevo.playback.check import one_line
from conevo.playback.drawn import Drawn
from conevo.playback.reading import Parts, begun
from conevo.playback.schema import BodyKind, Playback, SensorGroup
from conevo.terms import NON_SPECIALIZED

__all__ = ["playback"]


def playback(parts: Parts, drawn: Drawn) -> Playback:
    """Return the playback of an epoch of any world that records x, y and action of its robots.

    Robots' heading and energy are shown, too, if they are recorded.

    Args:
        parts: of the trajectory.
        drawn: the world's own: unit, bounds, colours, and size of robots.

    Raises:
        UsageError: the world does not record x, y and action.
    """
    about, t, r = parts.about, parts.t, parts.r
    missing = [name for name in ("x", "y", "action") if not parts.has(name, t, r)]
    if missing:
        raise UsageError(
            f"world {one_line(about['world'])} cannot be drawn: its simulation does not record "
            f"{', '.join(missing)} of every robot (Simulation.recorded must name x, y and action)"
        )
    x, y = parts.channel("x", t, r), parts.channel("y", t, r)
    bounds = drawn.bounds or _bounds(x.values, y.values)
    side = max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    actions, castes = _colours(about["actions"], about["castes"], drawn.colours)
    n_outputs = parts.channel("outputs", t, r, -1).codes.shape[2]
    outputs = about.get("outputs", [])
    if len(outputs) != n_outputs:  # of conevo 0.1.0, which recorded no names
        outputs = [f"output {k}" for k in range(n_outputs)]
    return Playback(
        **begun(parts, actions, castes, outputs),
        unit=drawn.unit,
        seconds=drawn.seconds,
        bounds=bounds,
        # Choice: robots are drawn as large as a hundredth of the world.
        body_kinds=(BodyKind("robot", drawn.radius or 0.01 * side),),
        body=(0,) * r,
        x=x,
        y=y,
        heading=parts.channel("heading", t, r) if parts.has("heading", t, r) else None,
        energy=parts.channel("energy", t, r) if parts.has("energy", t, r) else None,
        sensor_groups=_sensors(parts),
        measures=parts.measures(*about["performance"]),
    )


def _bounds(x: npt.NDArray[Any], y: npt.NDArray[Any]) -> tuple[float, float, float, float]:
    """Return x0, y0, x1, y1: of the unit square if all robots are in it, else around them."""
    low, high = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
    if low.min() >= 0 and high.max() <= 1:
        return (0.0, 0.0, 1.0, 1.0)
    margin = 0.05 * float((high - low).max()) or 0.5
    (x0, y0), (x1, y1) = (low - margin).tolist(), (high + margin).tolist()
    return (x0, y0, x1, y1)


def _colours(
    actions: list[str], castes: list[str], given: Mapping[str, str]
) -> tuple[dict[str, str], dict[str, str]]:
    """Return a colour for every action and caste; a caste named like an action has its colour."""
    own = [name for name in castes if name not in (*actions, NON_SPECIALIZED)]
    names = [*actions, *own]
    free = [c for c in several(len(names) + len(given)) if c not in given.values()]
    rest = [name for name in names if name not in given]
    colours = {**given, **dict(zip(rest, free, strict=False))}
    return (
        {name: colours[name] for name in actions},
        {name: colours[name] for name in castes if name != NON_SPECIALIZED},
    )


def _sensors(parts: Parts) -> tuple[SensorGroup, ...]:
    """Return groups of sensors whose names differ in the number only: "light 0", "light 1"."""
    n = parts.channel("sensors", parts.t, parts.r, -1).codes.shape[2]
    names = parts.about.get("inputs", [])
    if len(names) != n:  # of conevo 0.1.0
        names = [str(k) for k in range(n)]
    cut = [re.fullmatch(r"(.*\S) (\d+)", name) for name in names]
    owners = [found[1] if found else "" for found in cut]
    starts = [k for k in range(n) if k == 0 or owners[k] != owners[k - 1]]
    groups = []
    for first, end in zip(starts, [*starts[1:], n], strict=True):
        own = tuple(found[2] if found else names[k] for k, found in enumerate(cut))[first:end]
        groups.append(SensorGroup(owners[first] or "sensors", first, end - first, own))
    return tuple(groups)
