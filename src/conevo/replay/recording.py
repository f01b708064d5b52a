"""Recording: the team of a run plays one epoch again, with the kernels that it evolved with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from importlib.metadata import version
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from conevo.analysis.fittest import equip
from conevo.controllers.protocol import Controller
from conevo.errors import UsageError
from conevo.playback.about import About
from conevo.playback.channel import Channel
from conevo.playback.drawn import Drawn
from conevo.replay.trajectory import FORMAT, Trajectory
from conevo.rng import fold
from conevo.runs.evaluation import describe
from conevo.runs.run import Run
from conevo.worlds.measures import Measure, measures_of
from conevo.worlds.protocol import Simulator, World
from conevo.worlds.registry import inherited

__all__ = ["record", "record_epoch"]

Array = npt.NDArray[Any]


def record(
    run: Run,
    generation: int | None = None,
    epoch: int = 0,
    *,
    threads: int | None = None,
    like: Trajectory | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Trajectory:
    """Record one epoch of a run's team.

    Args:
        run: finished or not.
        generation: whose fittest team; by default the champion.
        epoch: number of the scenario among those that the run's testing phase draws, from 0.
        threads: CPU threads, all by default; changes no result.
        like: another run's trajectory of the same task: its scenario is played instead.
        progress: told the generations done and wanted while the run is evolved again.

    Raises:
        UsageError: no generation has finished yet, no such generation, made with other kernels, or
            the other trajectory is of another task.
    """
    champion, lab = equip(run, threads)
    team = champion
    if generation is not None and generation != champion.generation:
        team = run.team_again(generation, lab, progress)
        lab.refuse_other_team(team, run.path)
    scenario = fold(run.config.run.seed, "test", epoch)
    if like is not None:
        _refuse_other(run, lab.world, like)
        scenario, epoch = like.about["scenario"], like.about["epoch"]
    genes, rows = team.as_trial()
    about, channels = record_epoch(lab.simulator, genes, rows[0], scenario)
    config = run.config
    return Trajectory(
        about
        | {
            "task": config.task,
            "method": config.method,
            "label": config.label,
            "run_id": config.run_id,
            "seed": config.run.seed,
            "generation": team.generation,
            "epoch": epoch,
        },
        channels,
    )


def _refuse_other(run: Run, world: World, like: Trajectory) -> None:
    """Raise UsageError if the run's world is not the one of a trajectory."""
    there = like.about
    here = {"world": world.name, "environment": world.environment, "params": _params(world)}
    for key, value in here.items():
        if there[key] != value:  # type: ignore[literal-required]
            what = f"{there['task']} of {there['label']}"
            if key == "params":
                named: dict[str, Any] = value  # type: ignore[assignment]
                other = next(n for n in named if named[n] != there["params"].get(n))
                what += f", whose world.{other} is {there['params'].get(other)!r}"
                what += f" (here {named[other]!r})"
            raise UsageError(f"{run.path} is of {run.config.task}: it cannot play {what}")


def record_epoch(
    simulator: Simulator,
    genes: npt.NDArray[np.float32],
    team: npt.NDArray[np.int32],
    scenario: int,
    heuristic: npt.NDArray[np.int32] | None = None,
) -> tuple[About, dict[str, Channel]]:
    """Record any team in one scenario.

    Args:
        simulator: of the world.
        genes: pool of genotypes [K, G].
        team: pool rows [R, U], -1 for an empty slot.
        scenario: its key.
        heuristic: [R] index of a heuristic controller, -1 for the network; None for networks.

    Returns:
        What is known of it, of no run; and the channels.
    """
    world = simulator.world
    scenes = world.scenarios([scenario])
    modes = np.full(world.n_robots, -1, np.int32) if heuristic is None else heuristic
    seen = simulator.record(genes, team, scenes, modes)
    outcome = simulator.evaluate(genes, team[None], scenes, modes[None])
    portrait = describe(outcome, world.castes)
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
    for name in vars(scenes):
        if name not in scenes.unseen:
            is_shared = simulator.is_shared(name)
            values = getattr(scenes, name)
            channels[f"scene/{name}"] = Channel.of(values if is_shared else values[0])
    names = ("", *world.heuristics)
    about: About = {
        "format": FORMAT,
        "conevo": version("conevo"),
        "kernel_hash": simulator.fingerprint,
        "world": world.name,
        "environment": world.environment,
        "task": f"{world.name}/{world.environment}",
        "method": "",
        "label": "",
        "run_id": "",
        "seed": 0,
        "generation": 0,
        "epoch": 0,
        "scenario": scenario,
        "iterations": world.params.iterations,
        "n_robots": world.n_robots,
        "params": _params(world),
        "controller": _controller(simulator.controller),
        "inputs": list(world.inputs),
        "outputs": list(world.outputs),
        "actions": list(world.actions),
        "castes": list(world.castes),
        "labels": portrait.labels,
        "specialization": portrait.specialization,
        "fitness": [float(value) for value in outcome.fitness[0, 0]],
        "heuristic": [names[mode + 1] for mode in modes],
        "neurons": [np.flatnonzero(slots >= 0).tolist() for slots in team],
        "performance": portrait.performance,
        "units": {one.name: _worth(one) for one in measures_of(world)},
    }
    if like := inherited(type(world)):
        about["like"] = like
    drawn = getattr(world, "drawn", None)
    if drawn is not None:
        if not isinstance(drawn, Drawn):
            raise UsageError(f"world {world.name}: drawn must be a Drawn, not {drawn!r:.60}")
        about["drawn"] = drawn.plain
    return about, channels


def _worth(measure: Measure) -> str:
    """Return what follows a value of a measure: its unit, and that smaller is better if it is."""
    return f"{measure.unit}{'' if measure.larger_is_better else ' (smaller is better)'}".strip()


def _controller(controller: Controller) -> dict[str, Any]:
    """Return the name and the settings of a controller."""
    return {"name": controller.name} | asdict(cast("Any", controller))


def _sigmoid(sums: Array) -> npt.NDArray[np.float64]:
    """Return the logistic function; the kernel's differs from it by less than 1e-6."""
    return 0.5 + 0.5 * np.tanh(0.5 * sums.astype(np.float64))


def _params(world: World) -> dict[str, Any]:
    """Return the parameters of a world; a file by its digest, not by where it lies."""
    found = asdict(world.params)
    for name in found:
        if found.get(f"{name}_digest"):
            found[name] = "file"
    return found
