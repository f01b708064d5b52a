"""Random search: a team of clones of every genotype; all but the elitists are redrawn.

Made up: the baseline that every method must beat. Use it as it is, ``conevo run
rover/complex-1 --method examples/random_search.py:random-search``, and without any world, ``python
examples/random_search.py``. The recipe *add a method* of CONTRIBUTING.md puts it into the package.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from annotated_types import Ge

from conevo.evolution import credit
from conevo.evolution.assembly import rows
from conevo.evolution.generation import Populations, advance, begin, count, crown, grade, trials
from conevo.evolution.methods.registry import MethodEntry
from conevo.evolution.population import elite_count, random_genes
from conevo.evolution.protocol import Layout, Scores, Trials
from conevo.evolution.variation import VariationConfig
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["ENTRY", "RandomSearch", "RandomSearchConfig"]


@parameters("method")
class RandomSearchConfig(VariationConfig):
    """Parameters of random search; of the elite portion only the first is kept."""

    genotypes: Annotated[int, Ge(2)] = 10_000
    """M, whole networks in the population; each costs one team evaluation."""


@dataclass(frozen=True)
class RandomSearch:
    """Random search; see the module."""

    config: RandomSearchConfig = field(default_factory=RandomSearchConfig)
    name: str = "random-search"
    title: str = "random search"

    def init(self, layout: Layout, root: int) -> Populations:
        """Return generation 0 with random genotypes."""
        genotypes = self.config.genotypes
        return begin(
            Populations, layout, root, n_populations=1, n_genotypes=genotypes, networks=True
        )

    def ask(self, state: Populations) -> Trials:
        """Return a team of clones of every genotype, then of the fittest."""
        m, robots = self.config.genotypes, state.progress.fittest_fitness.size
        chosen = np.arange(m) if state.phase == "genotypes" else state.elite[0, :1]
        clones = np.broadcast_to(chosen[:, None, None], (len(chosen), robots, 1))
        return trials(state, rows(state.active, clones, m))

    def tell(self, state: Populations, trials: Trials, scores: Scores) -> Populations:
        """Return the state after these scores."""
        state = count(state, trials, scores)
        if state.phase == "genotypes":
            fitness = credit.of_clones(scores.fitness)[None]
            n_elite = elite_count(self.config.elite_portion, self.config.genotypes)
            return grade(state, fitness, n_elite, phase="fittest")
        state = crown(state, trials, scores)
        generator = stream(state.root, "breed", state.generation)
        genes = random_genes(generator, state.genes.shape)
        genes[:, :, :1] = state.genes[:, :, state.elite[0, :1]]
        return advance(state, genes, state.active)


ENTRY = MethodEntry(
    name="random-search",
    title="random search",
    summary="a team of clones of random genotypes; the fittest survives",
    source="made up",
    config_name="RandomSearchConfig",
    method_name="RandomSearch",
)


def main() -> None:
    """Search for the places of ``own_function.py``, and with HomCNE at the same cost."""
    from own_function import evaluate

    from conevo import method

    layout = Layout(n_robots=4, n_hidden=3, max_hidden=3, n_genes=2)
    for chosen in (RandomSearch(RandomSearchConfig(genotypes=20)), method("homcne", genotypes=20)):
        state = chosen.init(layout, root=1)
        while state.generation < 60:
            asked = chosen.ask(state)
            state = chosen.tell(state, asked, evaluate(asked))
        worth, cost = state.progress.fittest_fitness[0], state.progress.team_evaluations
        print(f"{chosen.title}: {worth:.3f} after {cost} team evaluations")


if __name__ == "__main__":
    main()
