"""The teams that a run keeps: the fittest so far, the finalists, those of some generations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from conevo.evolution.protocol import Progress

__all__ = ["Finalists", "Team", "finalists", "fittest_team", "sampled_generations"]


@dataclass(frozen=True, repr=False)
class Team:
    """The controllers of one team, as genotypes.

    Attributes:
        generation: in which it was the fittest team.
        genes: [R, U, G] float32, neuron genotypes; zero in empty slots.
        active: [R, U] bool, whether a slot contains a neuron.
        fitness: [R] float64, credit of each robot when the team was evaluated.
        specialization: [R] float64, degree of specialization S of each robot then.
    """

    generation: int
    genes: npt.NDArray[np.float32]
    active: npt.NDArray[np.bool_]
    fitness: npt.NDArray[np.float64]
    specialization: npt.NDArray[np.float64]

    @property
    def problem(self) -> str:
        """Why this is not a valid team, empty if it is; for teams read from a file."""
        genes, active = self.genes, self.active
        n = (len(genes),)
        if genes.ndim != 3 or active.shape != genes.shape[:2] or not genes.size:
            return f"genes of shape {genes.shape} in slots of shape {active.shape}"
        if not self.fitness.shape == self.specialization.shape == n:
            return f"fitness or specialization not of {n[0]} robots"
        wanted = (np.float32, np.bool_, np.float64, np.float64)
        arrays: tuple[npt.NDArray[np.generic], ...] = (
            genes,
            active,
            self.fitness,
            self.specialization,
        )
        if any(array.dtype != kind for array, kind in zip(arrays, wanted, strict=True)):
            return "numbers of another type"
        if not (np.abs(genes) <= 1).all() or self.generation < 0:
            return "genes outside [-1, 1], or a generation below 0"
        return ""

    @property
    def mean_fitness(self) -> float:
        """Mean credit of the robots."""
        return float(self.fitness.mean())

    @property
    def rank(self) -> float:
        """The sort key of teams: the fittest first, those without a finite fitness last.

        Choice: by the robots' mean credit, what methods select on; task performance is never
        selected on. Of equal teams the earlier is first.
        """
        return -self.mean_fitness if np.isfinite(self.mean_fitness) else np.inf

    def __repr__(self) -> str:
        return f"Team(generation={self.generation}, robots={len(self.genes)})"

    def _repr_html_(self) -> str:
        from conevo.runs.html import team_card

        return team_card(self)

    def as_trial(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
        """Return a genotype pool [R * U, G] and the one team [1, R, U] that uses all of it."""
        rows = np.arange(self.active.size, dtype=np.int32).reshape(self.active.shape)
        pool = self.genes.reshape(-1, self.genes.shape[-1])
        return pool, np.where(self.active, rows, np.int32(-1))[None]


@dataclass(frozen=True)
class Finalists:
    """Teams as rows of arrays, the fittest first, as they are kept in a file.

    Attributes:
        generation: [F] int64.
        genes: [F, R, U, G] float32.
        active: [F, R, U] bool.
        fitness: [F, R] float64.
        specialization: [F, R] float64.
    """

    generation: npt.NDArray[np.int64]
    genes: npt.NDArray[np.float32]
    active: npt.NDArray[np.bool_]
    fitness: npt.NDArray[np.float64]
    specialization: npt.NDArray[np.float64]

    @staticmethod
    def of(teams: Sequence[Team]) -> Finalists:
        """Return one team or more as arrays, in their order."""
        return Finalists(
            generation=np.array([team.generation for team in teams], dtype=np.int64),
            genes=np.stack([team.genes for team in teams]),
            active=np.stack([team.active for team in teams]),
            fitness=np.stack([team.fitness for team in teams]),
            specialization=np.stack([team.specialization for team in teams]),
        )

    @property
    def problem(self) -> str:
        """Why these are not valid teams, empty if they are; for teams read from a file."""
        columns = (self.genes, self.active, self.fitness, self.specialization)
        n = self.generation.size
        if self.generation.shape != (n,) or self.generation.dtype != np.int64 or n == 0:
            return f"generations of shape {self.generation.shape}"
        if any(column.ndim == 0 or len(column) != n for column in columns):
            return f"not every array has {n} teams"
        return next((team.problem for team in self.teams() if team.problem), "")

    def teams(self) -> list[Team]:
        """Return the teams, in their order."""
        columns = (self.genes, self.active, self.fitness, self.specialization)
        return [
            Team(int(generation), *rest)
            for generation, *rest in zip(self.generation, *columns, strict=True)
        ]

    def as_trials(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
        """Return a genotype pool [F * R * U, G] and the teams [F, R, U] that use all of it."""
        rows = np.arange(self.active.size, dtype=np.int32).reshape(self.active.shape)
        pool = self.genes.reshape(-1, self.genes.shape[-1])
        return pool, np.where(self.active, rows, np.int32(-1))


def finalists(teams: Sequence[Team], newest: Team, most: int) -> list[Team]:
    """Return the fittest of some teams and one more, at most ``most``, the fittest first.

    The result depends only on the generations, not on the order or the number of times in which
    they were added. So a resumed run and the beginning of a longer run have the same finalists.
    """
    by_generation = {newest.generation: newest} | {team.generation: team for team in teams}
    ranked = sorted(by_generation.values(), key=lambda team: (team.rank, team.generation))
    return ranked[:most]


def fittest_team(progress: Progress, generation: int) -> Team:
    """Return the fittest team of the generation that has just finished."""
    active = np.asarray(progress.fittest_active, dtype=np.bool_)
    genes = np.where(active[..., None], progress.fittest_genes, 0).astype(np.float32)
    return Team(
        generation=generation,
        genes=genes,
        active=active,
        fitness=np.asarray(progress.fittest_fitness, dtype=np.float64),
        specialization=np.asarray(progress.fittest_specialization, dtype=np.float64),
    )


def sampled_generations(n_generations: int) -> set[int]:
    """Return evenly spaced generations of ``n_generations``: all up to 16, then 9 to 16 of them.

    The distance is a power of two, so the generations kept of a long run are among those kept of a
    shorter one: an extended run keeps the same teams as a run planned that long.
    """
    distance = 1
    while -(-n_generations // distance) > 16:
        distance *= 2
    return set(range(0, n_generations, distance))
