"""Ask and tell by hand: cooperative co-evolution for your own function, without a world.

Four agents must spread over four places of a plane. An agent's position is the sum of its three
neurons' genes. The value of a team is minus the summed distances from each place to its nearest
agent. No place is assigned to an agent: the populations must divide the places among themselves.

Run it with: python examples/own_function.py [METHOD]
"""

from __future__ import annotations

import sys

import numpy as np

from conevo import Layout, Scores, Trials, method

PLACES = np.array([[1.5, 1.5], [-1.5, 1.5], [-1.5, -1.5], [1.5, -1.5]])


def positions(trials: Trials) -> np.ndarray:
    """Return the position of each agent of each team, [N, R, 2]."""
    return trials.networks().sum(axis=2)


def evaluate(trials: Trials) -> Scores:
    """Return the value of each team [N], credited to all its agents, [N, R]."""
    gaps = np.linalg.norm(positions(trials)[:, :, None] - PLACES, axis=-1)  # [N, R, places]
    worth = -gaps.min(axis=1).sum(axis=1)
    fitness = np.repeat(worth[:, None], gaps.shape[1], axis=1)
    return Scores(fitness=fitness, specialization=np.zeros_like(fitness))


def main(name: str = "cone") -> None:
    """Evolve for 60 generations and print the progress of the fittest team."""
    chosen = method(name, genotypes=20)
    state = chosen.init(Layout(n_robots=4, n_hidden=3, max_hidden=3, n_genes=2), root=1)
    while state.progress.generation < 60:
        trials = chosen.ask(state)
        if trials.portrait and trials.generation % 10 == 9:
            worth = evaluate(trials).fitness[0, 0]
            number = trials.generation + 1
            print(f"generation {number}: the fittest team is worth {worth:.3f}")
            last = positions(trials)[0]
        state = chosen.tell(state, trials, evaluate(trials))
    print(f"after {state.progress.team_evaluations} team evaluations the agents stand at")
    print(last.round(2))


if __name__ == "__main__":
    main(*sys.argv[1:])
