"""Teams composed of the fittest robots of several castes (Nitschke 2009, figure 4.12).

In section 4.6.5 individual behaviours were reproduced by fixed sensor inputs, then put together.
Choice: here the robots are the fittest specialists of the run's own team, with their sensors, as in
its teams of clones; a composition of which the team lacks a behaviour is not played.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from conevo.runs.champions import Team
from conevo.studies.lesions import Compared, fittest_of
from conevo.worlds.protocol import Simulator
from conevo.worlds.study import Composed

__all__ = ["compose"]


def compose(
    simulator: Simulator,
    team: Team,
    labels: Sequence[str],
    fitness: npt.ArrayLike,
    compositions: Sequence[Composed],
) -> list[Compared]:
    """Play each composition that a team has the robots for, in scenarios of its own.

    Args:
        simulator: of the team's world.
        team: R controllers.
        labels: [R] caste of each robot.
        fitness: [R] of each robot, as for ``lesions.clone``.
        compositions: with a role per robot of the composed team.
    """
    genes, teams = team.as_trial()
    played = []
    for one in compositions:
        if not one.roles or not set(one.roles) <= set(labels):
            continue
        robots = [fittest_of(role, labels, fitness) for role in one.roles]
        rows = np.ascontiguousarray(teams[:, robots])
        outcome = simulator.evaluate(genes, rows, one.scenarios)
        played.append(Compared((one.name,), outcome.performance))
    return played
