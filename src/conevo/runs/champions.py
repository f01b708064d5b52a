"""Teams worth keeping: the fittest of the run so far and of some generations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from conevo.evolution.protocol import State

__all__ = ["Team", "fittest_team", "sampled_generations"]


@dataclass(frozen=True)
class Team:
    """The controllers of one team, as genotypes.

    Attributes:
        generation: in which it was the fittest team.
        genes: [R, U, G] float32, neuron genotypes; zero in empty slots.
        active: [R, U] bool, whether a slot holds a neuron.
        fitness: [R] float64, credit of each robot when the team was evaluated.
        specialization: [R] float64, degree of specialization S of each robot then.
    """

    generation: int
    genes: npt.NDArray[np.float32]
    active: npt.NDArray[np.bool_]
    fitness: npt.NDArray[np.float64]
    specialization: npt.NDArray[np.float64]

    @property
    def mean_fitness(self) -> float:
        """Mean credit of the robots."""
        return float(self.fitness.mean())

    def as_trial(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
        """Return a genotype pool [R * U, G] and the one team [1, R, U] that uses all of it."""
        rows = np.arange(self.active.size, dtype=np.int32).reshape(self.active.shape)
        pool = self.genes.reshape(-1, self.genes.shape[-1])
        return pool, np.where(self.active, rows, np.int32(-1))[None]

    def is_fitter_than(self, other: Team | None) -> bool:
        """Whether this team replaces ``other`` as the champion of a run.

        Choice: the champion is the fittest team of any generation by its robots' mean credit (what
        methods select on; task performance is never selected on), the earlier one if equal.
        """
        if not np.isfinite(self.mean_fitness):
            return other is None
        return (
            other is None
            or not np.isfinite(other.mean_fitness)
            or self.mean_fitness > other.mean_fitness
        )


def fittest_team(state: State, generation: int) -> Team:
    """Return the fittest team of the generation that ``state`` has just finished."""
    active = np.asarray(state.fittest_active, dtype=np.bool_)
    genes = np.where(active[..., None], state.fittest_genes, 0).astype(np.float32)
    return Team(
        generation=generation,
        genes=genes,
        active=active,
        fitness=np.asarray(state.fittest_fitness, dtype=np.float64),
        specialization=np.asarray(state.fittest_specialization, dtype=np.float64),
    )


def sampled_generations(n_generations: int, n_samples: int = 10) -> set[int]:
    """Return about ``n_samples`` evenly spaced generations, the first always among them."""
    return set(range(0, n_generations, max(1, n_generations // n_samples)))
