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

import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError
from conevo.playback.about import About
from conevo.playback.quantized import Channel
from conevo.reading import parse_json, read_arrays
from conevo.replay.validation import channel_of, validated
from conevo.runs.durable import write_new

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["FORMAT", "Trajectory"]

FORMAT = 1
MOST_BYTES = 2**30  # of an unpacked file: limits the memory that a small file can take


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
        text = np.frombuffer(about.encode(), dtype=np.uint8)
        buffer = io.BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, about=text, **arrays)
        return buffer.getvalue()

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
        from conevo.replay.html import replay_card

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
        return Trajectory.of_arrays(read_arrays(path, MOST_BYTES, "a trajectory"), path)

    @staticmethod
    def of_arrays(arrays: dict[str, npt.NDArray[Any]], path: Path) -> Trajectory:
        """Return the trajectory of a file's arrays; ``about`` is one of them.

        Raises:
            UsageError: it is damaged, or not a trajectory.
        """
        try:
            about = parse_json(arrays.pop("about").tobytes(), "about")
            version = about.get("format")
            if version != FORMAT:
                raise ValueError(f"its format is {version!r}, not {FORMAT}")
            kept = about.pop("channels")
            if set(kept) != set(arrays):
                raise ValueError("it has other channels than it lists")
            channels = {name: channel_of(name, arrays[name], kept[name]) for name in arrays}
            return Trajectory(validated(about), channels)
        except Exception as error:  # a damaged or hostile file can cause any
            raise UsageError(f"{path} is damaged or not a trajectory ({_reason(error)})") from error


def _reason(error: Exception) -> str:
    """Return what went wrong, in one line."""
    errors = getattr(error, "errors", None)
    if callable(errors):  # pydantic's, several lines
        first = errors()[0]
        return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
    return " ".join(str(error).split())[:200] or type(error).__name__
