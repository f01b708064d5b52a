"""The simple rule: where in the multi-rover world individual controllers can pay.

``incentive`` is the value of castes by place over that of switchers, derived from segregation,
starts, accuracies, ranges and the length of an epoch. Above 1 a team of specialists that stay in
their places beats a team of clones that use every setting, so that individual controllers have
something to gain. Below 1 no robot gains by being different, however good the method is.

**Cells for finding, cells for testing.** The constant below was fitted to measured ratios of
heuristic teams with segregation 0, 0.5 and 1 (``FINDING``). Those with 0.25 and 0.75 (``TESTING``)
were not used, and evolved teams were not used at all. A threshold for evolved teams, if it is not
1, must be found on the same three and tested on the same two.

**Derivation.** A rover draws its own action in every iteration, senses nothing, and walks at
random. Castes spend 0.7 on the setting that their region's type requires (half of the rovers on
each, if it requires two) and move otherwise. Switchers spend 0.25 on each action (table 5.3).

1. A rock of type k needs settings u and v. While two rovers are both in range of it, it is detected
   with the chance ``q = p_u p_v (a_u b_v + a_v b_u)`` in an iteration, where p are accuracies and
   a, b the two rovers' shares of the settings (``p_u p_v a_u b_v`` if u = v).
2. Their contact ends when one walks off. A walker with steps of length s in a share m of iterations
   has D = m s^2 / 4, and leaves a disc of radius r after r^2 / 8 D, on average over its start.
   So a contact lasts ``tau = CONTACT / (8 D (1/r_u^2 + 1/r_v^2))``, but never longer than the
   epoch, T. The constant accounts for walkers that come back.
3. Both are there at once in a share ``(d_i pi r_u^2) (d_j pi r_v^2)`` of the time; d is a rover's
   density at the rock: 4 rho in its own region, 4 (1 - rho) / 3 in another. With random starts rho
   is a quarter. With starts by robot it is the mean share of time that a walker, started anywhere
   in its quarter of a square, is still there (two reflecting walls: a sum of cosines, squared).
4. A pair has T times that share over tau contacts, and a contact finds the rock with the chance
   ``1 - exp(-q tau)``: more time than 1/q is useless, so that castes are idle (saturation). Summed
   over pairs to Z, the rock is found with the chance ``1 - exp(-Z)``.
5. A share ``segregation`` of each type's value lies in its region, the rest anywhere:
   ``V = sum over k of v_k [s F(k, own) + (1 - s) mean of F(k, .)]``. Blind rovers do not react to
   places of rocks, so that the value of each team is exactly linear in the segregation.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

__all__ = ["FINDING", "OF_REGION", "TESTING", "Regime", "fitted", "incentive", "value"]

FINDING = (0.0, 0.5, 1.0)  # segregation of the cells for finding the constants
TESTING = (0.25, 0.75)
CONTACT = 2.2  # factor by which a contact lasts longer, as walkers come back (fitted)

OF_REGION = ((0, 0), (0, 1), (1, 2), (2, 2))  # the two settings that detect the type of a region
VALUES = (500, 1000, 1500, 2000)  # of all rocks of a type in a complex environment
STEP = 0.01
Team = Literal["castes", "switchers"]


@dataclass(frozen=True)
class Regime:
    """The variables of the rule.

    Attributes:
        segregation: share of the rocks of each type in its region.
        starts: "random" or "by_robot".
        ranges: radius of a detection with each setting.
        accuracies: chance of success with each setting.
        iterations: length of an epoch, T.
        n_robots: rovers.
    """

    segregation: float
    starts: str
    ranges: tuple[float, float, float]
    accuracies: tuple[float, float, float]
    iterations: int
    n_robots: int = 20


def incentive(regime: Regime, contact: float = CONTACT) -> float:
    """Return the value of castes by place over that of switchers."""
    castes = value(regime, "castes", contact)
    return castes / value(regime, "switchers", contact)


def value(regime: Regime, team: Team, contact: float = CONTACT) -> float:
    """Return the value of the rocks that a heuristic team detects, of 5,000."""
    r = regime
    key = (r.starts, r.ranges, r.accuracies, r.iterations, r.n_robots)
    found = _found(team, *key, contact)
    s = r.segregation
    own, mean = np.diagonal(found), found.mean(axis=1)
    return float(np.dot(VALUES, s * own + (1 - s) * mean))


@cache
def _found(
    team: Team,
    starts: str,
    ranges: tuple[float, float, float],
    accuracies: tuple[float, float, float],
    iterations: int,
    n_robots: int,
    contact: float,
) -> np.ndarray:
    """Return the chance that a rock is found, by its type and its region [4, 4]."""
    robots = np.arange(n_robots)
    shares, moves = np.full((n_robots, 3), 0.25), 0.25
    if team == "castes":
        shares, moves = np.zeros((n_robots, 3)), 0.3
        shares[robots, [OF_REGION[i % 4][i // 4 % 2] for i in robots]] = 0.7
    rho = 0.25 if starts == "random" else residence(moves, iterations)
    first, second = np.triu_indices(n_robots, 1)  # pairs
    found = np.empty((4, 4))
    for k, (u, v) in enumerate(OF_REGION):
        q = shares[first, u] * shares[second, v]
        q = (
            accuracies[u]
            * accuracies[v]
            * (q if u == v else q + shares[first, v] * shares[second, u])
        )
        exit_rate = 2 * moves * STEP**2 * (ranges[u] ** -2 + ranges[v] ** -2)
        tau = min(contact / exit_rate, iterations)
        for region in range(4):
            near = np.where(robots % 4 == region, 4 * rho, 4 * (1 - rho) / 3) * math.pi
            reached = [np.minimum(near * ranges[s] ** 2, 1) for s in (u, v)]
            both = reached[0][first] * reached[1][second]
            contacts = both * iterations / tau
            found[k, region] = 1 - math.exp(-float((contacts * (1 - np.exp(-q * tau))).sum()))
    return found


def residence(moves: float, iterations: int) -> float:
    """Return the share of an epoch that a random walker spends in the quarter of its start.

    Along an axis it starts anywhere in half of an interval of length 1 with reflecting ends. At
    time t it is there with the chance 1/2 + sum over odd n of 4 / (n pi)^2 exp(-D (n pi)^2 t),
    squared for two axes.
    """
    t = np.linspace(0, iterations, 101)
    n_pi = np.arange(1, 40, 2)[:, None] * math.pi
    half = 0.5 + (4 / n_pi**2 * np.exp(-moves * STEP**2 / 4 * n_pi**2 * t)).sum(axis=0)
    return float((half**2).mean())


def fitted(cells: Iterable[tuple[Regime, float]]) -> float:
    """Return the constant ``CONTACT``, a multiple of 0.1, with the least error of the log ratio.

    Args:
        cells: regimes with measured ratios; those with a segregation for testing do not count.
    """
    known = [(r, math.log(ratio)) for r, ratio in cells if r.segregation in FINDING]

    def error(contact: float) -> float:
        return sum((math.log(incentive(r, contact)) - measured) ** 2 for r, measured in known)

    return min((k / 10 for k in range(10, 101)), key=error)
