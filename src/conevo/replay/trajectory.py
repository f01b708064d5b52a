"""A recorded epoch of one team in one file, small, versioned and readable with numpy alone.

::

    import json, numpy
    file = numpy.load("epoch.npz")
    about = json.loads(file["about"].tobytes())
    kept = about["channels"]["x"]
    x = kept["low"] + kept["step"] * file["x"]          # [T, bodies]

Whole numbers are exact; other values have 16 bits between the least and the largest, activations of
neurons 8. Row t is the state after iteration t; actions, sensors and activations of row t are those
of iteration t.

=====================  =============================================================================
channel                contents
=====================  =============================================================================
the world's own        every array of its ``Simulation.recorded`` [T, ...] and ``recorded_at_end``
``performance/NAME``   [T] each task performance measure as if the epoch ended there
``sensors``            [T, R, S] sensor values of every robot
``hidden``             [T, R, U] activation of the part in each slot, 0 in an empty one
``outputs``            [T, R, O] activations of the output units; the highest wins
``scene/NAME``         the scenario: initial positions and the like
=====================  =============================================================================
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from conevo.errors import UsageError
from conevo.playback.about import About
from conevo.playback.quantized import Channel
from conevo.reading import check, packed, parse_json, read_arrays
from conevo.runs.durable import write_new
from conevo.terms import NON_SPECIALIZED

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["FORMAT", "Trajectory"]

FORMAT = 1
MOST_BYTES = 2**30  # of an unpacked file: limits the memory that a small file can take
FARTHEST = 2.0**53  # the largest number that is exact everywhere
MOST_CHARACTERS = 2_000  # of a text: a fact may name every robot's caste
_CODES = {np.dtype(kind) for kind in (np.uint8, np.uint16, np.uint32)}


@dataclass(frozen=True, repr=False)
class Trajectory:
    """A recorded epoch of one team.

    Attributes:
        about: its description.
        channels: the recorded arrays, by name.
    """

    about: About
    channels: dict[str, Channel]

    def to_bytes(self) -> bytes:
        """Return the file; equal trajectories give equal bytes."""
        kept = {name: {"low": c.low, "step": c.step} for name, c in self.channels.items()}
        about = json.dumps(self.about | {"channels": kept}, allow_nan=False)
        # Time runs fastest: values of neighbouring iterations are similar and compress better.
        arrays = {name: np.asarray(c.codes, order="F") for name, c in self.channels.items()}
        return packed(about, arrays, is_compressed=True)

    def frame(self, *arrays: str) -> DataFrame:
        """Return a row per iteration and robot as a pandas DataFrame; see ``replay.frame``.

        Args:
            arrays: further arrays of the world over robots, such as "energy".

        Raises:
            UsageError: no such array, or one that is not of robots.
            EnvironmentFailure: pandas is not installed.
        """
        from conevo.replay.frame import frame_of

        return frame_of(self, *arrays)

    def __repr__(self) -> str:
        about = self.about
        text = f"{about['task']}, generation {about['generation']}, epoch {about['epoch']}"
        return f"Trajectory({text!r})"

    def _repr_html_(self) -> str:
        from conevo.replay.page import replay_card

        return replay_card(self)

    def save(self, path: Path) -> None:
        """Write the file, all at once.

        Raises:
            UsageError: ``path`` exists.
            EnvironmentFailure: it cannot be written.
        """
        write_new({path: self.to_bytes()})

    @staticmethod
    def load(path: Path) -> Trajectory:
        """Return the trajectory in a file, which is checked here, and only here.

        Raises:
            UsageError: it is damaged, or not a trajectory.
            EnvironmentFailure: it cannot be read.
        """
        arrays = read_arrays(path, MOST_BYTES, "a trajectory")
        try:
            about = parse_json(arrays.pop("about").tobytes(), "about")
            version = about.get("format")
            if version != FORMAT:
                raise ValueError(f"its format is {version!r}, not {FORMAT}")
            kept = about.pop("channels")
            if set(kept) != set(arrays):
                raise ValueError("it has other channels than it lists")
            channels = {name: _channel(name, arrays[name], kept[name]) for name in arrays}
            return Trajectory(_validated(about), channels)
        except Exception as error:  # a damaged or hostile file can cause any
            reason = " ".join(str(error).split())[:200] or type(error).__name__
            raise UsageError(f"{path} is damaged or not a trajectory ({reason})") from error


def _channel(name: str, codes: Any, kept: Any) -> Channel:
    """Return a channel from its codes, and the numbers that a file has for it.

    Raises:
        ValueError, TypeError, KeyError: the numbers are not possible.
    """
    if codes.dtype not in _CODES:
        raise ValueError(f"{name} has codes of type {codes.dtype}")
    low, step = kept["low"], kept["step"]
    for number in (low, step):
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise TypeError(f"{name}: {number!r} is not a number")
    top = low + step * np.iinfo(codes.dtype).max
    if not (math.isfinite(top) and math.isfinite(low) and step >= 0):
        raise ValueError(f"{name} has values from {low} in steps of {step}")
    top = low + step * int(codes.max(initial=0))
    if max(abs(low), abs(top)) > FARTHEST:
        raise ValueError(f"{name} has values from {low} to {top}")
    return Channel(codes, low, step)


def _validated(about: Any) -> About:
    """Return the description in a file.

    Raises:
        DamagedFile: it has other fields or kinds of values.
        ValueError: it has texts that cannot be shown, or numbers that contradict each other.
    """
    checked: About = check(about, About, "about", is_closed=True)
    _check_texts(checked)
    r, castes = checked["n_robots"], (*checked["castes"], NON_SPECIALIZED)
    if not (r >= 1 and checked["iterations"] >= 1 and checked["actions"]):
        raise ValueError("no robots, no iterations or no actions")
    for name in ("labels", "specialization", "fitness", "heuristic", "neurons"):
        if len(checked[name]) != r:
            raise ValueError(f"{name} of {len(checked[name])} robots, not {r}")
    liked, shares = checked.get("favourites", []), checked.get("favourite_shares", [])
    if not len(liked) == len(shares) in (0, r):
        raise ValueError(f"{len(liked)} favourites and {len(shares)} shares of {r} robots")
    if not all(0 <= share <= 1 for share in shares):
        raise ValueError(f"a favourite's share is {min(shares)} to {max(shares)}, not 0 to 1")
    if unknown := (set(checked["labels"]) - set(castes)) | (set(liked) - {*castes, ""}):
        raise ValueError(f"castes that the world does not have: {', '.join(sorted(unknown))}")
    return checked


def _check_texts(thing: Any) -> None:
    """Raise ValueError if a text anywhere in a description cannot be shown."""
    if isinstance(thing, str):
        if not (len(thing) <= MOST_CHARACTERS and thing.isprintable()):
            raise ValueError(f"the text {thing[:40]!r} cannot be shown")
    elif isinstance(thing, Mapping):
        for pair in thing.items():
            _check_texts(pair)
    elif isinstance(thing, list | tuple):
        for part in thing:
            _check_texts(part)
