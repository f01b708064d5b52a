"""A team taken out of its run: its networks, and the facts that its file states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError, without_team
from conevo.export.arithmetic import Floats, NumpyArithmetic
from conevo.export.networks import ExportedNetwork, network_of
from conevo.reading import DamagedFile
from conevo.runs.champions import Team
from conevo.runs.code import last_code
from conevo.runs.config import RunConfig
from conevo.runs.lab import layout_of
from conevo.runs.run import Run
from conevo.terms import counted
from conevo.typing import Record
from conevo.worlds.protocol import World
from conevo.worlds.registry import refuse_earlier

__all__ = ["FORMAT", "EvolvedTeam", "evolved_team"]

FORMAT = "conevo-team-1"
"""Name of the format of exported files; it changes with their arrays or their facts."""


@dataclass(frozen=True)
class EvolvedTeam:
    """The networks of a team, or of one of its robots, and where they come from.

    Attributes:
        about: the facts that a file states: format, conevo (version and code that evolved it),
            task, method, run (its directory's name), run_id, seed, generation, n_robots (of
            the team), robots (numbers of those in the file), sensors [S], outputs [O] (names),
            context (C), controller (name and settings).
        network: computes their outputs.
    """

    about: dict[str, Any]
    network: ExportedNetwork

    @property
    def title(self) -> str:
        """One line: the robots, and how they were evolved."""
        about = self.about
        robots, size = about["robots"], counted(about["n_robots"], "robot")
        whose = f"robot {robots[0]} of {size}" if len(robots) < about["n_robots"] else size
        return f"Controllers of {whose}, evolved by {about['method']} in {about['task']}."

    @property
    def first_context(self) -> Floats:
        """Return the context at the start of an epoch, [R, C] zeros."""
        return np.zeros((self.network.n_robots, self.network.n_context), np.float32)

    def step(self, observations: npt.ArrayLike, context: Floats) -> tuple[Floats, Floats]:
        """Return the outputs [R, O], and the next context [R, C]; bit for bit as in the world.

        Args:
            observations: [R, S], the values of the robots' sensors.
            context: [R, C], from the previous iteration.

        Raises:
            UsageError: arrays of other shapes.
        """
        net, seen = self.network, np.asarray(observations, np.float32)
        for name, array, columns in (
            ("observations", seen, net.n_inputs),
            ("context", context, net.n_context),
        ):
            if array.shape != (net.n_robots, columns):
                raise UsageError(
                    f"{name} have the shape {array.shape}, not {(net.n_robots, columns)}"
                )
        outputs, after = net.equations(NumpyArithmetic(net.weights), seen, context)
        return outputs, after


def evolved_team(
    run: Run,
    generation: int | None = None,
    robot: int | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> EvolvedTeam:
    """Return the team of a run, ready to be exported.

    Args:
        run: finished or not.
        generation: of the fittest team; by default the champion. A team that was not kept is
            evolved again, which needs the simulator.
        robot: one robot alone, counted from 0; by default all of them.
        progress: called with the finished and all generations while the run is evolved again.

    Raises:
        UsageError: no generation has finished yet, no such generation or robot, a controller that
            cannot be exported, or a world of an earlier version.
    """
    refuse_earlier(run.outline.task, run.path)
    champion = run.champion
    if champion is None:
        raise without_team(run.path, run.generations())
    team = champion
    if generation is not None and generation != champion.generation:
        kept = run.team(generation)
        team = kept or run.team_again(generation, run.equip(None, None), progress)
    config = run.config
    world = config.build_world()
    layout = layout_of(world, config.controller)
    if team.genes.shape != (layout.n_robots, layout.max_hidden, layout.n_genes):
        raise DamagedFile(f"{run.path}: its team of {team.genes.shape} is not of {config.task}")
    return _taken(run, config, world, team, robot)


def _taken(run: Run, config: RunConfig, world: World, team: Team, robot: int | None) -> EvolvedTeam:
    """Return a team, or one robot, with the facts about it."""
    robots = list(range(len(team.genes)))
    if robot is not None:
        if robot not in robots:
            raise UsageError(f"robot {robot}: the team of {run.path} has robots 0 to {robots[-1]}")
        robots = [robot]
    network = network_of(
        config.controller,
        team.genes[robots],
        team.active[robots],
        len(world.inputs),
        len(world.outputs),
    )
    settings: Any = config.controller
    about: Record = {
        "format": FORMAT,
        "conevo": last_code(run.provenance),
        "task": config.task,
        "method": config.method,
        "run": run.path.resolve().name,
        "run_id": config.run_id,
        "seed": config.run.seed,
        "generation": team.generation,
        "n_robots": len(team.genes),
        "robots": robots,
        "sensors": list(world.inputs),
        "outputs": list(world.outputs),
        "context": network.n_context,
        "controller": {"name": config.controller.name} | asdict(settings),
    }
    return EvolvedTeam(dict(about), network)
