"""Behaviour of whole teams: a few numbers from their scores, and a map of the best team for each.

Novelty search and MAP-Elites look for teams that behave differently. They know a world only by the
scores of its robots: shares of actions and the degree of specialization S.

Choice: the axes of a map are the two parts of a division of labour (after Gorelick et al. 2004):
how evenly a team divides its work among actions, and how differently its robots do so. A team of
specialists is high in both, a team of generalists in the first alone, and a team that always does
one thing in neither. Parts of this plane are out of reach in any world: for instance, robots that
differ cannot all do the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from conevo.errors import UsageError
from conevo.evolution.protocol import FloatArray, IntArray, Scores
from conevo.evolution.whole import TeamConfig
from conevo.parameters import parameters

__all__ = ["MapConfig", "TeamMap", "describe", "evenness"]


@parameters("method")
class MapConfig(TeamConfig):
    """Genotypes of teams, and the map. Robots of a whole team can differ more than clones."""

    bins: Annotated[int, Ge(2), Le(64)] = 16
    """sections of each of the two axes of the map, which has bins x bins cells. Choice: 16, so that
    256 teams of 20 robots are 6 to 13 MB in a checkpoint."""


def describe(scores: Scores, behaviour: str) -> FloatArray:
    """Return numbers in [0, 1] that describe the behaviour of teams, [N, B].

    - "division", B = 2: the evenness of the team's actions (the entropy of its mean shares over
      that of equal ones), and the mean difference of two robots (the total variation of their
      shares; system neural diversity, Bettini et al. 2023).
    - "switching", B = 2: the mean S, and the mean difference of S between two robots.
    - "shares", B = A + 1: the mean share of each action, and the mean difference of two robots.

    Raises:
        UsageError: it needs shares of actions, and the scores have none.
    """
    if behaviour == "switching":
        s = np.clip(scores.specialization, 0.0, 1.0)
        return np.stack([s.mean(axis=1), _difference(s[:, :, None])], axis=1)
    if scores.shares is None:
        raise UsageError(
            f"method.behaviour = {behaviour!r} needs scores.shares, the activity of each robot"
        )
    nothing = np.clip(1 - scores.shares.sum(axis=2, keepdims=True), 0.0, 1.0)
    difference = _difference(np.concatenate([scores.shares, nothing], axis=2)) / 2
    mean = scores.shares.mean(axis=1)
    if behaviour == "shares":
        return np.concatenate([mean, difference[:, None]], axis=1)
    return np.stack([evenness(mean), difference], axis=1)


def _difference(described: FloatArray) -> FloatArray:
    """Return the mean distance [N], a sum over B, of two different robots of teams [N, R, B]."""
    n_robots = described.shape[1]
    total = np.zeros(len(described))
    for robot in range(1, n_robots):  # one at a time, to save memory
        total += np.abs(described[:, :robot] - described[:, robot, None]).sum(axis=(1, 2))
    distance: FloatArray = total / max(n_robots * (n_robots - 1) / 2, 1)
    return distance


def evenness(shares: FloatArray) -> FloatArray:
    """Return the entropy [N] of shares [N, A] as a portion of that of equal ones.

    0 for A = 1, and where nothing was done. Shares are divided by their sum first.
    """
    total = shares.sum(axis=1, keepdims=True)
    part = np.divide(shares, total, out=np.zeros_like(shares), where=total > 0)
    bits = np.log2(part, out=np.zeros_like(part), where=part > 0)
    entropy: FloatArray = -(part * bits).sum(axis=1) / np.log2(max(shares.shape[1], 2))
    return np.clip(entropy, 0.0, 1.0)


@dataclass(frozen=True)
class TeamMap:
    """The best fitness of a team found in each cell.

    Attributes:
        fitness: [C] float64 mean fitness of its robots; NaN in a cell without a team.
    """

    fitness: FloatArray

    @staticmethod
    def empty(bins: int) -> TeamMap:
        """Return a map without teams."""
        return TeamMap(np.full(bins * bins, np.nan))

    def cells(self, described: FloatArray) -> IntArray:
        """Return the cell [N] of descriptions [N, 2] in [0, 1]; the second axis changes fastest."""
        bins = round(len(self.fitness) ** 0.5)
        section = np.minimum((described * bins).astype(np.int64), bins - 1)
        cell: IntArray = section[:, 0] * bins + section[:, 1]
        return cell

    def candidates(self, cell: IntArray, fitness: FloatArray) -> IntArray:
        """Return the rows [K] of the best team of each cell; ties go to the first.

        Args:
            cell: [N] of each team.
            fitness: [N]; teams whose fitness is not finite are left out.
        """
        finite = np.flatnonzero(np.isfinite(fitness))
        order = finite[np.lexsort((finite, -fitness[finite], cell[finite]))]
        _, first = np.unique(cell[order], return_index=True)
        rows: IntArray = order[first]
        return rows

    def with_teams(self, cell: IntArray, fitness: FloatArray) -> TeamMap:
        """Return the map with the best of some teams, given their cells [N] and fitness [N]."""
        best = self.fitness.copy()
        rows = self.candidates(cell, fitness)
        best[cell[rows]] = np.fmax(best[cell[rows]], fitness[rows])
        return TeamMap(best)

    def numbers(self) -> dict[str, float]:
        """Return the columns of the log.

        ``coverage`` is the portion of the cells with a team. ``qd_score`` is the sum of the best
        fitness over all cells (Pugh, Soros and Stanley 2016). Choice: a negative fitness counts as
        0, so that no further cell lowers it.
        """
        filled = np.isfinite(self.fitness)
        score = np.maximum(self.fitness[filled], 0.0).sum()
        return {"coverage": float(filled.mean()), "qd_score": float(score)}

    def problem(self, first: TeamMap) -> str:
        """Return the field that is not valid in a checkpoint, if any."""
        wrong = self.fitness.shape != first.fitness.shape or np.isinf(self.fitness).any()
        return "fitness" if wrong else ""
