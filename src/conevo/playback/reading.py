"""Reading of a trajectory's channels, each checked before it is used."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.palette import FAINT
from conevo.playback.about import About
from conevo.playback.quantized import Channel
from conevo.playback.schema import Curve, Kind, Robot, SensorGroup
from conevo.terms import NON_SPECIALIZED

__all__ = ["Parts", "begun", "columns", "octants"]

_FARTHEST = 2.0**32  # larger whole numbers have no code
_COMPASS = ("ENE", "NNE", "NNW", "WNW", "WSW", "SSW", "SSE", "ESE")


class Parts:
    """A trajectory whose parts are checked when they are read.

    Args:
        about: description of the trajectory.
        channels: the recorded arrays, by name.

    Attributes:
        about: description of the trajectory.
        t: iterations.
        r: robots.
    """

    def __init__(self, about: About, channels: Mapping[str, Channel]) -> None:
        self.about = about
        self._channels = channels
        self.t = self.about["iterations"]
        self.r = self.about["n_robots"]

    def has(self, name: str, *shape: int) -> bool:
        """Return whether it has a channel of this name and shape; -1 is any length."""
        if name not in self._channels:
            return False
        actual = self._channels[name].codes.shape
        return len(actual) == len(shape) and all(
            wanted in (-1, n) for n, wanted in zip(actual, shape, strict=True)
        )

    def channel(self, name: str, *shape: int) -> Channel:
        """Return a channel.

        Args:
            name: of the channel.
            shape: that it must have; -1 for any length.

        Raises:
            ValueError: it is missing, or has another shape.
        """
        if self.has(name, *shape):
            return self._channels[name]
        if name not in self._channels:
            raise ValueError(f"{name} is missing")
        actual = list(self._channels[name].codes.shape)
        wanted = ", ".join("any" if n < 0 else str(n) for n in shape)
        raise ValueError(f"{name} is {actual}, not [{wanted}]")

    def any_channel(self, name: str) -> Channel:
        """Return a channel of any shape."""
        return self._channels[name]

    @property
    def names(self) -> tuple[frozenset[str], frozenset[str], frozenset[str]]:
        """Names of recorded arrays, of the scenario's arrays, and of the world's parameters."""
        scene = {name.removeprefix("scene/") for name in self._channels if "scene/" in name}
        recorded = {name for name in self._channels if "/" not in name}
        return frozenset(recorded), frozenset(scene), frozenset(self.about["params"])

    def floats(self, name: str, *shape: int) -> npt.NDArray[np.float64]:
        """Return the values of a channel of this shape."""
        return np.asarray(self.channel(name, *shape).values, dtype=np.float64)

    def whole(self, name: str, *shape: int) -> npt.NDArray[np.int64]:
        """Return the values of a channel of this shape as whole numbers.

        A world's float32 are rounded: their error is that of the channel's step, less than a half.

        Raises:
            ValueError: as ``channel``, or the numbers are too large.
        """
        values = np.rint(self.floats(name, *shape))
        if not (np.abs(values) < _FARTHEST).all():
            raise ValueError(f"{name} has numbers that are too large")
        return values.astype(np.int64)

    def index(self, name: str, n: int, *shape: int, least: int = 0) -> Channel:
        """Return a channel of whole numbers from ``least`` to n - 1.

        Raises:
            ValueError: as ``channel``, or another number.
        """
        values = self.whole(name, *shape)
        if values.size and not (values.min() >= least and values.max() < n):
            raise ValueError(f"{name} is {values.min()}..{values.max()}, not {least}..{n - 1}")
        return Channel.of(values)

    def number(self, name: str) -> int:
        """Return the single whole number, at least 0, of a channel."""
        value = int(self.whole(name))
        if value < 0:
            raise ValueError(f"{name} is {value}")
        return value

    def param(self, name: str) -> float:
        """Return a number among the world's parameters.

        Raises:
            ValueError: it is missing, or not finite and at least 0.
        """
        value = self.about["params"].get(name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"its world has no parameter {name}")
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"world.{name} is {value}")
        return float(value)

    def length(self, name: str) -> float:
        """Return a parameter that is a length above 0.

        Raises:
            ValueError: as ``param``, or it is 0.
        """
        value = self.param(name)
        if value == 0:
            raise ValueError(f"world.{name} is 0")
        return value

    def measures(self, *names: str) -> tuple[Curve, ...]:
        """Return every task performance measure as if the epoch ended in each iteration."""
        return tuple(Curve(n, self.channel(f"performance/{n}", self.t)) for n in names)


def columns(channel: Channel) -> list[Channel]:
    """Return the columns of a channel [T, n], each as a channel [T]."""
    return [Channel(codes, channel.low, channel.step) for codes in channel.codes.T]


def begun(
    parts: Parts, actions: Mapping[str, str], castes: Mapping[str, str], outputs: Sequence[str]
) -> dict[str, Any]:
    """Return the arguments of ``Playback`` that all worlds have in common.

    Title, subtitle and facts are empty: ``conevo.replay.playback`` sets them.

    Args:
        parts: of the trajectory.
        actions: colour of every action.
        castes: colour of every caste but the non-specialized.
        outputs: names of the output units.
    """
    about, t, r = parts.about, parts.t, parts.r
    if list(actions) != about["actions"]:
        raise ValueError(f"its actions are {', '.join(about['actions'])}")
    known = {**castes, NON_SPECIALIZED: FAINT}
    is_thinking = not all(about["heuristic"])
    return {
        "title": "",
        "subtitle": "",
        "facts": (),
        "iterations": t,
        "actions": tuple(Kind(*one) for one in actions.items()),
        "castes": tuple(Kind(*one) for one in known.items()),
        "robots": _robots(parts, list(known)),
        "action": parts.index("action", len(actions), t, r, least=-1),
        "sensors": parts.channel("sensors", t, r, -1),
        "hidden": parts.channel("hidden", t, r, -1) if is_thinking else None,
        "outputs": parts.channel("outputs", t, r, len(outputs)) if is_thinking else None,
        "output_names": tuple(outputs),
    }


def _robots(parts: Parts, castes: list[str]) -> tuple[Robot, ...]:
    about = parts.about
    names = ("labels", "specialization", "fitness", "heuristic", "neurons")
    columns: list[Any] = [about[name] for name in names]  # type: ignore[literal-required]
    liked = about.get("favourites") or [""] * parts.r
    shares = about.get("favourite_shares") or [0.0] * parts.r
    return tuple(
        Robot(castes.index(label), s, fitness, heuristic, tuple(neurons), favourite, share)
        for label, s, fitness, heuristic, neurons, favourite, share in zip(
            *columns, liked, shares, strict=True
        )
    )


def octants(name: str, first: int, reach: float) -> SensorGroup:
    """Return eight sensors, one per octant, counter-clockwise from +x; they do not turn."""
    angles = tuple((k + 0.5) * math.pi / 4 for k in range(8))
    return SensorGroup(name, first, 8, _COMPASS, angles, half=math.pi / 8, reach=reach)
