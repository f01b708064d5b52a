"""Ask and tell by hand: cooperative co-evolution of a function of your own, no world needed.

Four agents shall spread over four places of a plane. An agent stands where its three neurons'
genes, summed, put it; a team is worth minus the summed distances from each place to its nearest
agent. Nobody is told which place is whose: the populations have to divide the places among them.

Run it with: python examples/own_function.py [METHOD]
"""

from __future__ import annotations

import sys

import numpy as np

from conevo import Layout, Scores, Trials, method

PLACES = np.array([[1.5, 1.5], [-1.5, 1.5], [-1.5, -1.5], [1.5, -1.5]])


def positions(trials: Trials) -> np.ndarray:
    """Return where each agent of each team stands, [N, R, 2]."""
    return trials.networks().sum(axis=2)


def evaluate(trials: Trials) -> Scores:
    """Return the worth of each team [N], given to all its agents, [N, R]."""
    gaps = np.linalg.norm(positions(trials)[:, :, None] - PLACES, axis=-1)  # [N, R, places]
    worth = -gaps.min(axis=1).sum(axis=1)
    fitness = np.repeat(worth[:, None], gaps.shape[1], axis=1)
    return Scores(fitness=fitness, specialization=np.zeros_like(fitness))


def main(name: str = "cone") -> None:
    """Evolve for 60 generations and print how the fittest team comes along."""
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
