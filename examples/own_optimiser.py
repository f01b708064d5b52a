"""An optimiser from another library drives a world: pycma's CMA-ES evolves a team of clones.

No method of conevo takes part. The optimiser proposes vectors of genes; each is one controller,
which all robots of a team have; a rollout plays the teams in scenarios that are new in every
generation, and gives back what they reached. The best of the last generation is chosen in scenarios
of their own, and tested in others.

Run it with: python examples/own_optimiser.py (after: pip install cma)
"""

from __future__ import annotations

from pathlib import Path

import cma
import numpy as np

import conevo
from conevo.rng import fold

WORLD = f"{Path(__file__).parent / 'light.py'}:dark-1"


class Teams:
    """Vectors of genes as teams of clones in a world.

    Args:
        world: the world.
        controller: of its robots.
    """

    def __init__(self, world: conevo.World, controller: conevo.Controller) -> None:
        self.world = world
        self.rollout = conevo.Rollout(world, controller)
        self.genome = self.rollout.genome

    def play(self, vectors: np.ndarray, keys: list[int]) -> np.ndarray:
        """Return the fitness of teams of clones, [N], the mean over scenarios with these keys."""
        n, parts = len(vectors), self.genome.n_parts
        pool = vectors.reshape(n * parts, self.genome.n_genes).astype(np.float32)
        teams = np.full((n, self.world.n_robots, self.genome.max_parts), -1, np.int32)
        teams[:, :, :parts] = np.arange(n * parts).reshape(n, 1, parts)
        outcome = self.rollout.evaluate(pool, teams, self.world.scenarios(keys))
        return outcome.performance["nearness"].mean(axis=1)


def main(generations: int = 80) -> float:
    """Evolve, print the progress, and return the result's fitness in twenty fresh scenarios."""
    world = conevo.world(WORLD)
    teams = Teams(world, conevo.controller(world=world, n_hidden=4, max_hidden=4))
    size = teams.genome.n_parts * teams.genome.n_genes
    options = {"bounds": [-1, 1], "seed": 1, "popsize": 40, "verbose": -9}
    optimiser = cma.CMAEvolutionStrategy(np.zeros(size), 0.5, options)
    for generation in range(generations):
        keys = [fold(1, "scenario", generation, k) for k in range(10)]
        proposed = optimiser.ask()
        reached = teams.play(np.array(proposed), keys)
        optimiser.tell(proposed, -reached)
        if generation % 20 == 19:
            print(f"generation {generation + 1}: their mean is {reached.mean():.3f}")
    keys = [fold(1, "validation", k) for k in range(20)]
    best = proposed[int(np.argmax(teams.play(np.array(proposed), keys)))]
    keys = [fold(1, "test", k) for k in range(20)]
    result = float(teams.play(best[None], keys)[0])
    print(
        f"the best of the last {len(proposed)} reaches {result:.3f} in {len(keys)} fresh scenarios"
    )
    return result


if __name__ == "__main__":
    main()
