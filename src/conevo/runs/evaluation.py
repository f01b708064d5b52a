"""From the trials of methods to scores, by the outcomes of worlds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from conevo.evolution.protocol import FloatArray, Scores, Trials
from conevo.rng import fold
from conevo.specialization import activity, individual
from conevo.specialization.favourite import favourite, favourite_share
from conevo.worlds.protocol import Outcome, Scenarios, Simulator, World, setting_columns

__all__ = ["Evaluation", "Portrait", "describe", "make_evaluator", "play", "score", "without"]


@dataclass(frozen=True)
class Portrait:
    """The performance and behaviour of one team, averaged over its epochs.

    Attributes:
        performance: task performance measures.
        specialization: degree of specialization S of each robot.
        labels: caste of each robot: its most frequent action, or "non-specialized".
        castes: number of robots per caste, largest first.
        independent: the S of each robot if its actions were drawn independently, with their shares
            in each epoch.
        favourites: the setting (``World.settings``) that each robot used most, None without any.
        favourite_shares: its share in all settings that the robot used, NaN without any.
    """

    performance: dict[str, float]
    specialization: list[float]
    labels: list[str]
    castes: dict[str, int]
    independent: list[float]
    favourites: list[str | None]
    favourite_shares: list[float]


@dataclass(frozen=True)
class Evaluation:
    """Scores of a batch of trials, with their outcome.

    steps: iterations that teams were played, in all; None: those of whole epochs.
    """

    scores: Scores
    outcome: Outcome
    steps: int | None = None


Evaluate = Callable[[Trials], Evaluation]


def make_evaluator(
    simulator: Simulator,
    world: World,
    *,
    seed: int,
    epochs: int,
    fittest_epochs: int,
    credit: str,
    scenarios: str = "fresh",
) -> Evaluate:
    """Return a function that evaluates trials in a world.

    All trials of a generation meet the same ``epochs`` scenarios, addressed by seed, generation
    and epoch, so a score depends neither on the batch nor on when it is computed; each round of
    trials has ``epochs`` more. With ``scenarios`` "fixed", all generations meet the scenarios of
    generation 0. Trials that ask for fixed scenarios meet the same ``fittest_epochs`` of them in
    all generations. Scenarios of all generations are drawn once.
    """

    def keys(trials: Trials) -> list[int]:
        if trials.scenarios == "fixed":
            return [fold(seed, "fittest", epoch) for epoch in range(fittest_epochs)]
        generation = 0 if scenarios == "fixed" else trials.generation
        return [fold(seed, "epoch", generation, epoch) for epoch in range(trials.rounds * epochs)]

    drawn: dict[tuple[str, int], Scenarios] = {}  # of all generations: kind of scenarios, rounds

    def met(trials: Trials) -> Scenarios:
        if "fixed" not in (scenarios, trials.scenarios):
            return world.scenarios(keys(trials))
        which = trials.scenarios, trials.rounds
        if which not in drawn:
            drawn[which] = world.scenarios(keys(trials))
        return drawn[which]

    def evaluate(trials: Trials) -> Evaluation:
        genes = np.asarray(trials.genes, dtype=np.float32)
        teams = np.asarray(trials.teams, dtype=np.int32)
        return play(simulator, genes, teams, met(trials), trials.rounds, credit)

    return evaluate


def play(
    simulator: Simulator,
    genes: npt.NDArray[np.float32],
    teams: npt.NDArray[np.int32],
    scenarios: Scenarios,
    rounds: int,
    credit: str,
) -> Evaluation:
    """Evaluate teams and give each robot its credit.

    With the credit "difference", every team is evaluated in the same scenarios once more for each
    robot, which then has an empty network. Choice: an empty network, not a missing robot, which not
    every world can have; it is an obstacle, and acts as any robot whose outputs are all equal.

    Args:
        simulator: of the world.
        genes, teams, scenarios, rounds: as for ``Simulator.evaluate``.
        credit: as in ``RunSettings``.
    """
    outcome = simulator.evaluate(genes, teams, scenarios, rounds=rounds)
    if credit != "difference":
        return Evaluation(score(outcome, credit), outcome, _steps(outcome))
    steps, rest = _steps(outcome), []
    for robot in range(teams.shape[1]):
        played = simulator.evaluate(genes, without(teams, robot), scenarios, rounds=rounds)
        rest.append(_value(played))
        more = _steps(played)
        steps = None if steps is None or more is None else steps + more
    fitness = _value(outcome)[:, None] - np.stack(rest, axis=1)
    scores = replace(score(outcome), fitness=fitness, plays=1 + len(rest))
    return Evaluation(scores, outcome, steps)


def without(teams: npt.NDArray[np.int32], robot: int) -> npt.NDArray[np.int32]:
    """Return teams [N, R, U] in which one robot has an empty network."""
    rest = teams.copy()
    rest[:, robot] = -1
    return rest


def _steps(outcome: Outcome) -> int | None:
    """Return the iterations that all teams were played, None if all epochs are whole."""
    return None if outcome.steps is None else int(outcome.steps.sum())


def _value(outcome: Outcome) -> FloatArray:
    """Return the value [N] of teams: the sum of their robots' mean fitness (eq. 5.5)."""
    value: FloatArray = outcome.fitness.astype(np.float64).mean(axis=1).sum(axis=1)
    return value


def score(outcome: Outcome, credit: str = "robot") -> Scores:
    """Average an outcome over epochs and give each robot its credit.

    Args:
        outcome: fitness [N, E, R], switches [N, E, R], counts [N, E, R, C].
        credit: "robot": its own fitness (Nitschke 2009, eq. 5.4, 6.8); "team": the sum over the
            team, the same for all its robots (eq. 5.5).
    """
    fitness = outcome.fitness.astype(np.float64).mean(axis=1)
    if credit == "team":
        fitness = np.repeat(fitness.sum(axis=1, keepdims=True), fitness.shape[1], axis=1)
    specialization = individual.degree(outcome.switches, outcome.counts).mean(axis=1)
    return Scores(fitness, specialization, _mean_shares(outcome.counts))


def _mean_shares(counts: npt.NDArray[np.int32]) -> npt.NDArray[np.float64]:
    """Return the shares [N, R, C] of counts [N, E, R, C]; one epoch at a time, to save memory."""
    n_teams, n_epochs, n_robots, n_castes = counts.shape
    total = np.zeros((n_teams, n_robots, n_castes))
    for epoch in range(n_epochs):
        total += activity.shares(counts[:, epoch])
    total /= n_epochs
    return total


def describe(outcome: Outcome, world: World, team: int = 0) -> Portrait:
    """Return the portrait of one team of an outcome."""
    chosen = setting_columns(world)
    settings = [world.castes[column] for column in chosen]
    counts: npt.NDArray[np.int64] = outcome.counts[team].astype(np.int64).sum(axis=0)
    specialization = individual.degree(outcome.switches[team], outcome.counts[team]).mean(axis=0)
    independent = individual.independent_degree(outcome.counts[team]).mean(axis=0)
    work = counts[:, chosen]
    labels = [
        individual.label(float(s), robot, world.castes)
        for s, robot in zip(specialization, counts, strict=True)
    ]
    return Portrait(
        performance={
            name: float(values[team].astype(np.float64).mean())
            for name, values in outcome.performance.items()
        },
        specialization=[float(value) for value in specialization],
        labels=labels,
        castes=individual.castes(labels),
        independent=[float(value) for value in independent],
        favourites=[favourite(robot, settings) for robot in work],
        favourite_shares=[float(value) for value in favourite_share(work)],
    )
