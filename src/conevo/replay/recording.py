"""Recording: one more epoch of a run's team, with the kernels that it evolved with."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError
from conevo.playback.about import About
from conevo.playback.quantized import Channel
from conevo.replay.trajectory import FORMAT, Trajectory
from conevo.rng import fold
from conevo.runs.evaluation import describe
from conevo.runs.run import Run
from conevo.studies.observation import equip
from conevo.worlds.protocol import Simulator, World
from conevo.worlds.recorded import params_of, recorded

__all__ = ["record", "record_epoch"]


def record(
    run: Run,
    generation: int | None = None,
    epoch: int = 0,
    *,
    threads: int | None = None,
    device: str | None = None,
    like: Trajectory | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Trajectory:
    """Record one epoch of a run's team.

    Args:
        run: finished or not.
        generation: of the fittest team; by default the champion.
        epoch: number of the scenario among those that the run's testing phase draws, from 0.
        threads, device: as for ``Run.resume``; they change no result.
        like: another run's trajectory of the same task, whose scenario is used instead.
        progress: called with the finished and all generations while the run is evolved again.

    Raises:
        UsageError: no generation has finished yet, no such generation, made with other kernels, or
            the other trajectory is of another task.
    """
    champion, lab = equip(run, threads, device)
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
    here = {"world": world.name, "environment": world.environment, "params": params_of(world)}
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
        simulator, genes, team, scenario: as for ``worlds.recorded.recorded``.
        heuristic: [R] index of a heuristic controller, -1 for the network; None for networks only.

    Returns:
        Its description, without a run; and the channels.
    """
    world = simulator.world
    modes = np.full(world.n_robots, -1, np.int32) if heuristic is None else heuristic
    known, channels, outcome = recorded(simulator, genes, team, scenario, modes)
    portrait = describe(outcome, world)
    of_no_run = {"method": "", "label": "", "run_id": "", "seed": 0, "generation": 0, "epoch": 0}
    about = {
        "format": FORMAT,
        "conevo": version("conevo"),
        **known,
        **of_no_run,
        "labels": portrait.labels,
        "specialization": portrait.specialization,
        "favourites": [name or "" for name in portrait.favourites],
        "favourite_shares": np.nan_to_num(portrait.favourite_shares).tolist(),
    }
    in_order = {name: about[name] for name in About.__annotations__ if name in about}
    return cast("About", in_order), channels  # in the order that a file is read in
