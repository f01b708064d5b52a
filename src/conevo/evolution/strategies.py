"""Steps that evolution strategies share: mirrored pairs of teams, ranks, teams as trials.

An evolution strategy has a mean team and no population. It tries teams around its mean, and moves
the mean by their fitness.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from conevo.evolution.protocol import BoolArray, FloatArray, Layout, Progress, Trials
from conevo.parameters import WrongValue, parameters

__all__ = ["PairsConfig", "as_trials", "centred_ranks", "controllers_of", "gains", "mirrored"]


@parameters("method")
class PairsConfig:
    """Sizes of a generation of mirrored pairs."""

    pairs: Annotated[int, Ge(2), Le(1_000_000)] = 50
    """mirrored pairs of teams in a generation."""
    rounds: Annotated[int, Ge(1), Le(10_000)] = 5
    """rounds among which the pairs are divided evenly; each has its own scenarios, and teams are
    ranked within it."""
    spread: Annotated[float, Gt(0), Le(1)] = 0.1
    """standard deviation of a perturbation in gene units."""

    def __post_init__(self) -> None:
        """Refuse a number of rounds that does not divide the pairs evenly."""
        if self.pairs % self.rounds:
            problem = f"must divide the {self.pairs} pairs evenly"
            raise WrongValue("rounds", f"method.rounds = {self.rounds}", problem)


def mirrored(moves: FloatArray, rounds: int) -> FloatArray:
    """Return moves [pairs, ...] and their opposites, [2 * pairs, ...], in the order of trials.

    Args:
        moves: of the first team of each pair.
        rounds: K; each round has pairs / K first teams, then their mirror images.
    """
    both = np.stack([moves, -moves])
    by_round = both.reshape(2, rounds, -1, *moves.shape[1:])
    return by_round.swapaxes(0, 1).reshape(-1, *moves.shape[1:])


def gains(fitness: FloatArray, rounds: int) -> FloatArray:
    """Return the gain of the first of each pair over its mirror image, [pairs, C], in ranks.

    Args:
        fitness: [2 * pairs, C] in the order of trials.
        rounds: K; teams are ranked within their round.
    """
    by_round = fitness.reshape(rounds, -1, fitness.shape[1])
    ranks = np.stack([centred_ranks(one) for one in by_round])
    half = ranks.shape[1] // 2
    found: FloatArray = (ranks[:, :half] - ranks[:, half:]).reshape(-1, fitness.shape[1])
    return found


def centred_ranks(fitness: FloatArray) -> FloatArray:
    """Return the ranks [N, C] of each column, from -1/2 (the least) to 1/2; ties share one.

    Salimans, Ho, Chen, Sidor and Sutskever 2017. Fitness that is not finite ranks last.
    """
    order = np.where(np.isfinite(fitness), fitness, -np.inf)
    below = (order[None] < order[:, None]).sum(axis=1)
    equal = (order[None] == order[:, None]).sum(axis=1)
    ranks: FloatArray = (below + (equal - 1) / 2) / max(len(order) - 1, 1) - 0.5
    return ranks


def as_trials(
    progress: Progress, phase: str, teams: FloatArray, active: BoolArray, rounds: int = 1
) -> Trials:
    """Return teams [N, R, U, G] as trials, with genes clipped to [-1, 1].

    Args:
        progress: the header of the state that asks for them.
        phase: of the state; in "fittest" the first team is the generation's portrait.
        teams: their genes.
        active: [U] or [R, U] the slots in use.
        rounds: in which they are played; the phase "fittest" has one.
    """
    genes = np.clip(teams, -1, 1).astype(np.float32).reshape(-1, teams.shape[-1])
    rows = np.arange(len(genes), dtype=np.int32).reshape(teams.shape[:3])
    is_last = phase == "fittest"
    return Trials(
        generation=progress.generation,
        genes=genes,
        teams=np.where(active, rows, np.int32(-1)),
        scenarios="fixed" if is_last else "fresh",
        portrait=is_last,
        rounds=1 if is_last else rounds,
        purpose=phase,
    )


def controllers_of(
    layout: Layout, genes: FloatArray, active: BoolArray, *, is_clones: bool
) -> tuple[FloatArray, BoolArray]:
    """Return the controllers [P, U, G] of a team and their slots in use [P, U].

    Choice: for clones (P = 1) the mean controller, with the slots that any robot uses, which count
    as zeros in the others.

    Args:
        layout: the size of the problem; P = R if robots are not clones.
        genes: [R', U, G] the team's genes; robot r is its robot r mod R'.
        active: [R', U] its slots in use.
        is_clones: whether all robots are to have one controller.
    """
    robots = np.arange(layout.n_robots) % len(genes)
    used: BoolArray = active[robots]
    team: FloatArray = genes[robots].astype(np.float64) * used[:, :, None]
    if not is_clones:
        return team, used
    return team.mean(axis=0, keepdims=True), np.asarray(used.any(axis=0, keepdims=True))
