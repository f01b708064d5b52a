"""CMA-ES, covariance matrix adaptation evolution strategy, over clones or whole teams.

N. Hansen, The CMA evolution strategy: a tutorial, arXiv:1604.00772 (2016). ``evolution.covariance``
has the adaptation, in the full form and the separable one for large genomes (Ros and Hansen 2008).
A genotype contains the network of all robots of a team ("clones"), or one network for each robot
("whole").

Choice: the adaptation is conevo's own, not the library pycma, as a checkpoint contains plain arrays
and pycma keeps its state in objects that only pickle can store. A test compares the two.
Choice: genes outside [-1, 1] are reflected at the border when a team is made, and the adaptation
uses them as they were drawn. So no boundary distorts the distribution, and a run may settle at a
border, where many genes belong.
Choice: the step size has limits, within which a run always goes on. pycma stops there.
Choice: the fitness of a team is the mean credit of its robots in all rounds; a non-finite one ranks
last. The fittest team of a generation is the mean, after it has moved.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from conevo.errors import UsageError
from conevo.evolution.covariance import (
    Constants,
    Distribution,
    adapted,
    constants,
    sampled,
    standard,
)
from conevo.evolution.population import ranking
from conevo.evolution.protocol import BoolArray, FloatArray, Layout, Progress, Scores, Trials
from conevo.evolution.strategies import as_trials, controllers_of
from conevo.evolution.whole import TeamConfig, credit_of_team
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["CmaEs", "CmaEsConfig", "CmaEsState", "reflected"]

LARGEST = 2000  # genes of the full form, whose matrices then take 64 MB
LIMITS = (1e-6, 1.0)  # of the root mean square of the genes' standard deviations


@parameters("method")
class CmaEsConfig(TeamConfig):
    """Parameters of CMA-ES.

    Choice: sizes suit genes in [-1, 1], by a few trials in the example world.
    """

    form: Literal["full", "separable"] = "full"
    """covariance matrix: all of it (up to 2,000 genes), or its diagonal alone."""
    genotypes: Annotated[int, Ge(4), Le(1_000_000)] = 40
    """N, teams tried in a generation; the better half moves the mean. Choice: 40, above the
    tutorial's 4 + 3 ln(n), as fitness is noisy."""
    rounds: Annotated[int, Ge(1), Le(10_000)] = 2
    """times that each of them is tried, each time in other scenarios."""
    step_size: Annotated[float, Gt(0), Le(1)] = 0.3
    """standard deviation of a gene at the start, in gene units."""


@dataclass(frozen=True)
class CmaEsState:
    """State of CMA-ES; P = 1 for clones, else P = R.

    Attributes:
        progress: the header.
        phase: "genotypes", "fittest".
        active: [P, U] the slots in use.
        distribution: of the n genes in these slots, one controller after the other.
    """

    progress: Progress
    phase: str
    active: BoolArray
    distribution: Distribution

    def problem(self, first: CmaEsState) -> str:
        """Return the first field that is not valid in a state between generations, if any."""
        if self.active.shape != first.active.shape or not self.active.any(axis=1).all():
            return "active"
        n_genes = int(self.active.sum()) * self.progress.fittest_genes.shape[2]
        if self.distribution.covariance.ndim != first.distribution.covariance.ndim:
            return "covariance"
        if wrong := self.distribution.problem(n_genes):
            return wrong
        return "" if self.phase == "genotypes" else "phase"


@dataclass(frozen=True)
class CmaEs:
    """Covariance matrix adaptation evolution strategy; see the module."""

    config: CmaEsConfig = field(default_factory=CmaEsConfig)
    name: str = "cma-es"
    title: str = "CMA-ES"

    def init(self, layout: Layout, root: int) -> CmaEsState:
        """Return generation 0, with all genes of the mean 0.

        Raises:
            UsageError: the genome is too large for the full form.
        """
        shape = (self.config.n_networks(layout), layout.max_hidden)
        active = np.broadcast_to(np.arange(layout.max_hidden) < layout.n_hidden, shape).copy()
        return self._around(layout, root, np.zeros((*shape, layout.n_genes)), active)

    def begin_with(
        self, layout: Layout, root: int, genes: FloatArray, active: BoolArray
    ) -> CmaEsState:
        """Return generation 0 around a team; for clones, around its mean controller.

        Args:
            layout: the size of the problem.
            root: the seed of every random decision.
            genes: [R', U, G] the team's genes; robot r starts as its robot r mod R'.
            active: [R', U] its slots in use; clones use those that any robot uses.

        Raises:
            UsageError: the genome is too large for the full form.
        """
        is_clones = self.config.team == "clones"
        found, used = controllers_of(layout, genes, active, is_clones=is_clones)
        return self._around(layout, root, found, used)

    def ask(self, state: CmaEsState) -> Trials:
        """Return teams drawn from the distribution, in every round, then its mean."""
        if state.phase == "fittest":
            return self._trials(state, state.distribution.mean[None])
        return self._trials(state, np.tile(self._drawn(state), (self.config.rounds, 1)))

    def tell(self, state: CmaEsState, trials: Trials, scores: Scores) -> CmaEsState:
        """Return the state after these scores."""
        is_first = state.phase == "genotypes"
        progress = state.progress.counted(trials, scores, is_first=is_first)
        if not is_first:
            progress = progress.crowned(trials, scores)
            progress = replace(progress, generation=progress.generation + 1)
            return replace(state, progress=progress, phase="genotypes")
        by_round = credit_of_team(scores.fitness).reshape(self.config.rounds, -1)
        with np.errstate(invalid="ignore"):
            fitness = by_round.mean(axis=0)
        progress = progress.graded(fitness)
        distribution = adapted(
            state.distribution, self._drawn(state), ranking(fitness), self._constants(state)
        )
        lengths = distribution.lengths
        usual = float(np.sqrt((lengths**2).mean()))  # of the genes, in units of the step size
        step_size = float(np.clip(distribution.step_size, LIMITS[0] / usual, LIMITS[1] / usual))
        return replace(
            state,
            progress=progress.with_numbers(
                step_size=step_size * usual, axis_ratio=float(lengths.max() / lengths.min())
            ),
            phase="fittest",
            distribution=replace(distribution, step_size=step_size),
        )

    def _around(
        self, layout: Layout, root: int, genes: FloatArray, active: BoolArray
    ) -> CmaEsState:
        """Return generation 0 around controllers [P, U, G] with these slots [P, U] in use."""
        is_full, mean = self.config.form == "full", genes[active].ravel()
        if is_full and mean.size > LARGEST:
            raise UsageError(
                f"method.form = 'full': a genotype has {mean.size:,} genes, and a full matrix is "
                f"for {LARGEST:,} at most; use --set method.form=separable"
            )
        progress = replace(
            Progress.first(layout, root, len(active)), n_hidden=active.sum(axis=1, dtype=np.int64)
        )
        return CmaEsState(
            progress=progress,
            phase="genotypes",
            active=active,
            distribution=standard(mean, self.config.step_size, is_full=is_full),
        )

    def _drawn(self, state: CmaEsState) -> FloatArray:
        """Return a generation's genotypes [N, n], not yet reflected."""
        generator = stream(state.progress.root, "genotypes", state.progress.generation)
        shape = (self.config.genotypes, len(state.distribution.mean))
        return sampled(state.distribution, generator.standard_normal(shape))

    def _constants(self, state: CmaEsState) -> Constants:
        n_genes, is_full = len(state.distribution.mean), self.config.form == "full"
        return constants(n_genes, self.config.genotypes, is_full=is_full)

    def _trials(self, state: CmaEsState, genotypes: FloatArray) -> Trials:
        """Return genotypes [N, n] as trials of teams."""
        shape = state.progress.fittest_genes.shape
        controllers = np.zeros((len(genotypes), *state.active.shape, shape[2]))
        controllers[:, state.active] = reflected(genotypes).reshape(len(genotypes), -1, shape[2])
        teams = np.broadcast_to(controllers, (len(genotypes), *shape))
        rounds = self.config.rounds
        return as_trials(state.progress, state.phase, teams, state.active, rounds)


def reflected(genes: FloatArray) -> FloatArray:
    """Return genes reflected at -1 and 1 until they are between them."""
    inside: FloatArray = 1 - np.abs((genes + 1) % 4 - 2)
    return inside
