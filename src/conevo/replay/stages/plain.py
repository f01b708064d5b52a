"""The stage of a world that the package does not know: robots where they are, what they do."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError
from conevo.palette import several
from conevo.replay.stage import BodyKind, SensorGroup, Stage
from conevo.replay.stages.parts import Parts, begun
from conevo.replay.stages.refusals import one_line
from conevo.specialization.individual import NON_SPECIALIZED

__all__ = ["stage"]


def stage(parts: Parts) -> Stage:
    """Return the stage of an epoch of any world that records x, y and action of its robots.

    A heading and an energy of every robot are shown, too, if they are recorded.

    Raises:
        UsageError: it does not record what is needed.
    """
    about, t, r = parts.about, parts.t, parts.r
    missing = [name for name in ("x", "y", "action") if not parts.has(name, t, r)]
    if missing:
        raise UsageError(
            f"world {one_line(about['world'])} cannot be drawn: its simulation does not record "
            f"{', '.join(missing)} of every robot (Simulation.recorded must name x, y and action)"
        )
    x, y = parts.channel("x", t, r), parts.channel("y", t, r)
    low, high = _corners(x.values, y.values)
    actions, castes = _colours(about["actions"], about["castes"])
    n_outputs = parts.channel("outputs", t, r, -1).codes.shape[2]
    return Stage(
        **begun(parts, actions, castes, [f"output {k}" for k in range(n_outputs)]),
        unit="",
        seconds=0.0,
        bounds=(*low, *high),
        # Choice: robots are drawn as large as a hundredth of the world.
        body_kinds=(BodyKind("robot", 0.01 * max(high[0] - low[0], high[1] - low[1])),),
        body=(0,) * r,
        x=x,
        y=y,
        heading=parts.channel("heading", t, r) if parts.has("heading", t, r) else None,
        energy=parts.channel("energy", t, r) if parts.has("energy", t, r) else None,
        sensor_groups=_sensors(parts),
        measures=parts.measures(*about["performance"]),
    )


def _corners(
    x: npt.NDArray[Any], y: npt.NDArray[Any]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return two corners of the world: the unit square if all robots are in it, else around all."""
    low, high = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
    if low.min() >= 0 and high.max() <= 1:
        return (0.0, 0.0), (1.0, 1.0)
    margin = 0.05 * float((high - low).max()) or 0.5
    (x0, y0), (x1, y1) = (low - margin).tolist(), (high + margin).tolist()
    return (x0, y0), (x1, y1)


def _colours(actions: list[str], castes: list[str]) -> tuple[dict[str, str], dict[str, str]]:
    """Return a colour for every action and caste; a caste named like an action has its colour."""
    own = [name for name in castes if name not in (*actions, NON_SPECIALIZED)]
    names = [*actions, *own]
    colours = dict(zip(names, several(len(names)), strict=True))
    return (
        {name: colours[name] for name in actions},
        {name: colours[name] for name in castes if name != NON_SPECIALIZED},
    )


def _sensors(parts: Parts) -> tuple[SensorGroup, ...]:
    n = parts.channel("sensors", parts.t, parts.r, -1).codes.shape[2]
    return (SensorGroup("sensors", 0, n, tuple(str(k) for k in range(n))),) if n else ()
