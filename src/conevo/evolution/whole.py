"""One genotype for a whole team: clones of one network, or a network for each robot.

Nitschke 2009, figure 2.5, the level of collective behaviour: selection acts on the team, so all of
its members have the team's fitness, the mean credit of its robots. P is 1 for clones, else R.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from conevo.evolution.protocol import FloatArray, IntArray, Layout
from conevo.parameters import parameters

__all__ = ["TeamConfig", "credit_of_team", "filled"]


@parameters("method")
class TeamConfig:
    """The team that a genotype describes."""

    team: Literal["clones", "whole"] = "clones"
    """"clones": a genotype is one network, which all robots of a team have. "whole": it contains
    one network for each robot (figure 2.5, top)."""

    def n_networks(self, layout: Layout) -> int:
        """Return P, the networks in a genotype."""
        return layout.n_robots if self.team == "whole" else 1


def filled(teams: IntArray, n_robots: int) -> IntArray:
    """Return teams [N, R, U] in which every robot has a network.

    Args:
        teams: [N, P, U] pool rows of the networks of each genotype; P = R, or 1 for clones.
        n_robots: R.
    """
    return np.repeat(teams, n_robots // teams.shape[1], axis=1)


def credit_of_team(fitness: FloatArray) -> FloatArray:
    """Return the fitness [N] of teams, given the credit [N, R] of their robots.

    It is not finite if one of the credits is not.
    """
    with np.errstate(invalid="ignore"):
        credit: FloatArray = fitness.mean(axis=1)
    return credit
