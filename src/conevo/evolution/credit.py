"""Credit: the fitness of genotypes from the scores of teams."""

from __future__ import annotations

import numpy as np

from conevo.evolution.protocol import FloatArray, IntArray

__all__ = ["mean_of_trials", "of_clones", "of_robot", "overwrite"]


def of_robot(fitness: FloatArray, robot: IntArray | int) -> FloatArray:
    """Return each team's credit [N] of the robot that has the genotype on trial.

    Nitschke 2009, eqs 3.7, 5.4 and 6.8. The team's scores already decide whether credit is the
    robot's own or the team's.

    Args:
        fitness: [N, R] credit of each robot.
        robot: [N] the robot on trial in each team, or one for all.
    """
    credit: FloatArray = fitness[np.arange(len(fitness)), robot]
    return credit


def of_clones(fitness: FloatArray) -> FloatArray:
    """Return the mean credit [N] over a team of clones, which try one genotype R times."""
    credit: FloatArray = fitness.mean(axis=1)
    return credit


def mean_of_trials(teams: IntArray, fitness: FloatArray, n_rows: int) -> FloatArray:
    """Return the mean credit [n_rows] of every pool row over the robots that had it.

    NaN for a row that never played. One score that is not finite makes the mean non-finite, so its
    genotypes rank last.

    Args:
        teams: [N, R, U] rows of the pool, -1 = empty slot.
        fitness: [N, R] credit of each robot.
        n_rows: rows of the pool.
    """
    played = teams >= 0
    row = teams[played]
    credit = np.broadcast_to(fitness[:, :, None], teams.shape)[played]
    count = np.bincount(row, minlength=n_rows)
    total = np.bincount(row, weights=credit, minlength=n_rows)
    mean = np.full(n_rows, np.nan)
    np.divide(total, count, out=mean, where=count > 0)
    return mean


def overwrite(fitness: FloatArray, elite: IntArray, credit: FloatArray) -> FloatArray:
    """Return fitness [P, U, M] with type C in place of type A for the elite genotypes.

    Nitschke 2009, 3.3.2: rank l of population i was tried as one controller, so its neurons in all
    sub-populations get the same fitness.

    Args:
        fitness: [P, U, M] type A.
        elite: [P, U, L] elite genotypes, the fittest first.
        credit: [P, L] type C of each rank.
    """
    changed = fitness.copy()
    every_slot = np.broadcast_to(credit[:, None, :], elite.shape)
    np.put_along_axis(changed, elite.astype(np.intp), every_slot, axis=2)
    return changed
