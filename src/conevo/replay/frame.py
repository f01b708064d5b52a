"""A recorded epoch as a pandas DataFrame: a row per iteration and robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError, unknown_name
from conevo.runs.frames import pandas

if TYPE_CHECKING:
    from pandas import DataFrame

    from conevo.replay.trajectory import Trajectory

__all__ = ["frame_of"]

EVERY_WORLD = ("x", "y", "action", "fitness")  # [T, R], or the robots' come first


def frame_of(trajectory: Trajectory, *arrays: str) -> DataFrame:
    """Return a row for every iteration and robot, in this order.

    ====================  ==========================================================================
    iteration, robot      from 0
    caste                 of the robot in this epoch
    x, y, fitness         its position and its fitness so far
    action                name of the action it executed, missing if there was none
    sensors.X, outputs.X  its sensor values, and the outputs of its controller, by their names
    hidden.0 ...          activation of the part in each slot, 0 in an empty one
    performance.X         the team's, as if the epoch ended there: the same for all robots
    ====================  ==========================================================================

    Args:
        trajectory: the epoch.
        arrays: further arrays of the world, with robots as their second dimension.

    Raises:
        UsageError: no such array, or one that is not of robots.
        EnvironmentFailure: pandas is not installed.
    """
    about, frames = trajectory.about, pandas()
    n, robots = about["iterations"], about["n_robots"]
    found: dict[str, npt.NDArray[np.generic]] = {
        "iteration": np.repeat(np.arange(n), robots),
        "robot": np.tile(np.arange(robots), n),
        "caste": np.tile(np.array(about["labels"], object), n),
    }
    for name in dict.fromkeys((*EVERY_WORLD, *arrays)):
        found[name] = _of_robots(trajectory, name)
    names = np.array([*about["actions"], None], object)
    action = found["action"].astype(np.int64)
    is_action = (action >= 0) & (action < len(about["actions"]))
    found["action"] = names[np.where(is_action, action, -1)]
    for name, columns in (
        ("sensors", about.get("inputs", [])),
        ("outputs", about.get("outputs", [])),
        ("hidden", []),
    ):
        values = trajectory.channels[name].values.reshape(n * robots, -1)
        width = values.shape[1]
        ends = columns if len(columns) == width else range(width)
        found |= {f"{name}.{end}": values[:, k] for k, end in enumerate(ends)}
    for name in about["performance"]:
        values = trajectory.channels[f"performance/{name}"].values
        found[f"performance.{name}"] = np.repeat(values, robots)
    for name in ("caste", "action"):
        found[name] = frames.Series(found[name], dtype="str")
    return frames.DataFrame(found)


def _of_robots(trajectory: Trajectory, name: str) -> npt.NDArray[np.generic]:
    """Return the robots' part [T * R] of an array [T, R] or [T, bodies], the robots first.

    Raises:
        UsageError: no such array, or one that is not of robots.
    """
    channels, robots = trajectory.channels, trajectory.about["n_robots"]
    if name not in channels:
        raise unknown_name("array", name, channels, "of this recording")
    shape = channels[name].codes.shape
    if len(shape) != 2 or shape[1] not in (robots, channels["x"].codes.shape[1]):
        raise UsageError(
            f"array {name!r} is {list(shape)}, not [iterations, robots]; "
            f"its values are recording.channels[{name!r}].values"
        )
    return channels[name].values[:, :robots].reshape(-1)
