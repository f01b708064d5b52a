"""Trajectories with changes made by hand, and the contents of their playbacks."""

import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from conevo.playback.quantized import Channel
from conevo.replay.playback import playback_of
from conevo.replay.trajectory import Trajectory
from replay.epochs import TASKS

GACC, LIGHT = TASKS[3], TASKS[4]


def values(trajectory, name):
    return trajectory.channels[name].values


def changed(trajectory, **arrays):
    """The trajectory with other channels; None for none."""
    channels = {**trajectory.channels}
    for name, array in arrays.items():
        name = name.replace("scene_", "scene/")
        if array is None:
            del channels[name]
        else:
            channels[name] = array if isinstance(array, Channel) else Channel.of(array)
    return replace(trajectory, channels=channels)


def opened(trajectory):
    """The playback of a trajectory with any contents, as read from a file."""
    kept = {name: {"low": c.low, "step": c.step} for name, c in trajectory.channels.items()}
    about = json.dumps(trajectory.about | {"channels": kept})
    arrays = {name: channel.codes for name, channel in trajectory.channels.items()}
    arrays["about"] = np.frombuffer(about.encode(), np.uint8)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "epoch.npz")
        np.savez(path, **arrays)
        return playback_of(Trajectory.load(path))


def events_of(playback, kind=None):
    """The events of a kind, as (t, text, robots)."""
    return [
        (event.t, event.text, event.robots)
        for event in playback.events
        if kind in (None, playback.event_kinds[event.kind].name)
    ]


def parts_of(thing):
    """Everything in a playback, at any depth."""
    yield thing
    if isinstance(thing, tuple):
        for one in thing:
            yield from parts_of(one)
    elif hasattr(thing, "__dataclass_fields__") and not isinstance(thing, Channel):
        for name in thing.__dataclass_fields__:
            yield from parts_of(getattr(thing, name))
