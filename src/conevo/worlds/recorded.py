"""A recorded epoch of any world: its numbers, and the facts about them that need no run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError
from conevo.playback.drawn import Drawn
from conevo.playback.quantized import Channel
from conevo.worlds.measures import Measure, measures_of
from conevo.worlds.protocol import Outcome, Scenarios, Simulator, World
from conevo.worlds.registry import inherited

__all__ = ["facts_of", "params_of", "recorded", "scene_of"]


def recorded(
    simulator: Simulator,
    genes: npt.NDArray[np.float32],
    team: npt.NDArray[np.int32],
    scenario: int,
    modes: npt.NDArray[np.int32],
) -> tuple[dict[str, Any], dict[str, Channel], Outcome]:
    """Play a team in one scenario, and record it.

    Args:
        simulator: of the world.
        genes: pool of genotypes [K, G].
        team: pool rows [R, U], -1 for an empty slot.
        scenario: its key.
        modes: [R] index of a heuristic controller, -1 for the robot's own.

    Returns:
        The facts about world and team for a playback's ``About``, without castes and those about a
        run; the channels; and the outcome.

    Raises:
        UsageError: numbers that are not finite, or a ``drawn`` that is not a ``Drawn``.
    """
    world = simulator.world
    scenes = world.scenarios([scenario])
    seen, outcome = simulator.record_with_outcome(genes, team, scenes, modes)
    inputs, outputs, hidden = (seen.pop(name) for name in ("inputs", "outputs", "hidden"))
    measured = seen.pop("performance")
    seen.pop("counts", None)
    has_network = modes < 0
    for name, values in {**seen, "fitness": outcome.fitness, "performance": measured}.items():
        if not np.isfinite(values).all():
            raise UsageError(f"the world's {name} is not finite here: the epoch cannot be kept")
    channels = {name: Channel.of(values) for name, values in seen.items()}
    for k, one in enumerate(measures_of(world)):
        channels[f"performance/{one.name}"] = Channel.of(measured[:, k])
    channels["sensors"] = Channel.of(inputs)
    channels["hidden"] = Channel.of(hidden * has_network[:, None], bits=8)
    channels["outputs"] = Channel.of(_sigmoid(outputs) * has_network[:, None], bits=8)
    channels |= scene_of(scenes, simulator.is_shared)
    names = ("", *world.heuristics)
    about = facts_of(world) | {
        "kernel_hash": simulator.fingerprint,
        "scenario": scenario,
        "iterations": world.params.iterations,
        "controller": _controller(simulator.controller),
        "fitness": [float(value) for value in outcome.fitness[0, 0]],
        "heuristic": [names[mode + 1] for mode in modes],
        "neurons": [np.flatnonzero(slots >= 0).tolist() for slots in team],
        "performance": {name: float(v[0, 0]) for name, v in outcome.performance.items()},
    }
    return about, channels, outcome


def scene_of(scenes: Scenarios, is_shared: Callable[[str], bool]) -> dict[str, Channel]:
    """Return the channels of the first of some scenarios.

    Args:
        scenes: the scenarios.
        is_shared: whether they all have an array in common, by its name.
    """
    seen = (name for name in vars(scenes) if name not in scenes.unseen)
    values = {name: getattr(scenes, name) for name in seen}
    return {
        f"scene/{name}": Channel.of(array if is_shared(name) else array[0])
        for name, array in values.items()
    }


def facts_of(world: World) -> dict[str, Any]:
    """Return the facts about a world, the same in all of its epochs.

    Raises:
        UsageError: a ``drawn`` that is not a ``Drawn``.
    """
    about: dict[str, Any] = {
        "world": world.name,
        "environment": world.environment,
        "task": f"{world.name}/{world.environment}",
        "n_robots": world.n_robots,
        "params": params_of(world),
        "inputs": list(world.inputs),
        "outputs": list(world.outputs),
        "actions": list(world.actions),
        "castes": list(world.castes),
        "units": {one.name: _worth(one) for one in measures_of(world)},
    }
    if like := inherited(type(world)):
        about["like"] = like
    drawn = getattr(world, "drawn", None)
    if drawn is not None:
        if not isinstance(drawn, Drawn):
            raise UsageError(f"world {world.name}: drawn must be a Drawn, not {drawn!r:.60}")
        about["drawn"] = drawn.plain
    return about


def params_of(world: World) -> dict[str, Any]:
    """Return the parameters of a world; a file is represented by its digest, not by its path."""
    found = asdict(world.params)
    for name in found:
        if found.get(f"{name}_digest"):
            found[name] = "file"
    return found


def _worth(measure: Measure) -> str:
    """Return the words after a value of a measure: its unit, and whether smaller is better."""
    return f"{measure.unit}{'' if measure.larger_is_better else ' (smaller is better)'}".strip()


def _controller(controller: Any) -> dict[str, Any]:
    """Return the name and the settings of a controller."""
    return {"name": controller.name} | asdict(controller)


def _sigmoid(sums: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Return the logistic function; the kernel's differs from it by less than 1e-6."""
    return 0.5 + 0.5 * np.tanh(0.5 * sums.astype(np.float64))
