"""Teams with one caste replaced, of clones, of several castes, or with robots in other places.

Nitschke 2009, sections 4.6.5, 4.6.6, 5.5.3, 5.5.4, 6.5.4 and 6.5.5, and figure 4.12; the last is
ours. Nothing is adapted: the teams that are compared meet the same scenarios, and differ in whose
controllers their robots have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from conevo.runs.champions import Team
from conevo.specialization.individual import NON_SPECIALIZED
from conevo.worlds.protocol import Scenarios, Simulator, World
from conevo.worlds.study import Composed

__all__ = ["WHOLE", "Compared", "Original", "replacement"]

WHOLE = "whole"  # the team as it was evolved
MOVED = "moved"  # the same controllers, each in another robot


@dataclass(frozen=True)
class Compared:
    """Teams in the same scenarios.

    Attributes:
        teams: N names, "whole" first, then castes, or "moved".
        performance: task performance measures, each [N, E].
    """

    teams: tuple[str, ...]
    performance: dict[str, npt.NDArray[np.float32]]


@dataclass(frozen=True)
class Original:
    """A team whose changed versions are played.

    Attributes:
        simulator: of the team's world.
        team: R controllers.
        labels: [R] caste of each robot.
        fitness: [R] of each robot; ties go to the first; non-finite values rank last.
    """

    simulator: Simulator
    team: Team
    labels: Sequence[str]
    fitness: npt.ArrayLike

    def lesion(self, castes: Sequence[str], scenarios: Scenarios) -> Compared:
        """Play the team, and it with all robots of each caste replaced by a heuristic controller.

        Args:
            castes: those to replace, one at a time.
            scenarios: E scenarios for all the teams.
        """
        modes = np.full((1 + len(castes), len(self.labels)), -1, dtype=np.int32)
        for k, caste in enumerate(castes, start=1):
            modes[k, np.asarray(self.labels) == caste] = replacement(self.simulator.world, caste)
        genes, teams = self.team.as_trial()
        teams = np.repeat(teams, len(modes), axis=0)
        outcome = self.simulator.evaluate(genes, teams, scenarios, modes)
        return Compared((WHOLE, *castes), outcome.performance)

    def clone(self, castes: Sequence[str], scenarios: Scenarios) -> Compared:
        """Play the team, and for each caste a team of clones of its fittest robot.

        Choice: a team of clones has the size of the team ("cloned 20 times" of thirty robots,
        6.5.5).

        Args:
            castes: those to clone, each with a robot at least.
            scenarios: E scenarios for all the teams.
        """
        genes, teams = self.team.as_trial()
        robots = [self.fittest_of(caste) for caste in castes]
        cloned = [np.repeat(teams[:, [robot]], len(self.labels), axis=1) for robot in robots]
        outcome = self.simulator.evaluate(genes, np.concatenate([teams, *cloned]), scenarios)
        return Compared((WHOLE, *castes), outcome.performance)

    def rotate(self, scenarios: Scenarios) -> Compared:
        """Play the team, two robots or more, and it with controllers moved by 1, 2, ... robots.

        The loss shows how far robots have roles of their own, whatever these are: clones lose
        nothing. S and favourites do not detect roles of robots that do the same at different
        places.

        Returns:
            Two teams, "whole" and "moved": in each scenario the mean over all R - 1 rotations.
        """
        genes, teams = self.team.as_trial()
        moved = [np.roll(teams, k, axis=1) for k in range(teams.shape[1])]
        outcome = self.simulator.evaluate(genes, np.concatenate(moved), scenarios)
        performance = {
            name: np.stack([values[0], values[1:].mean(axis=0, dtype=np.float32)])
            for name, values in outcome.performance.items()
        }
        return Compared((WHOLE, MOVED), performance)

    def compose(self, compositions: Sequence[Composed]) -> list[Compared]:
        """Play each composition for which the team has the robots, in its own scenarios.

        In section 4.6.5 individual behaviours were reproduced by fixed sensor inputs, then put
        together. Choice: here the robots are the fittest specialists of the run's own team, with
        their sensors, as in its teams of clones; without one of a behaviour the team is not played.
        """
        genes, teams = self.team.as_trial()
        played = []
        for one in compositions:
            if one.roles and set(one.roles) <= set(self.labels):
                robots = [self.fittest_of(role) for role in one.roles]
                rows = np.ascontiguousarray(teams[:, robots])
                outcome = self.simulator.evaluate(genes, rows, one.scenarios)
                played.append(Compared((one.name,), outcome.performance))
        return played

    def fittest_of(self, caste: str) -> int:
        """Return the fittest robot of a caste."""
        credit = np.asarray(self.fitness, dtype=np.float64)
        credit = np.where(np.isfinite(credit), credit, -np.inf)
        own = np.flatnonzero(np.asarray(self.labels) == caste)
        return int(own[credit[own].argmax()])


def replacement(world: World, caste: str) -> int:
    """Return which heuristic controller of a world stands in for a caste.

    The one with the caste's name (tables 5.3 and 6.3). Choice: without one, as for rovers
    specialized to moving, the non-specialized one; else the world's first, as for predators, whose
    only one is non-specialized (section 4.6.6).
    """
    for name in (caste, NON_SPECIALIZED):
        if name in world.heuristics:
            return world.heuristics.index(name)
    return 0
