"""An evolution strategy whose genotypes are whole teams; it adapts its own step size.

Cumulative step-size adaptation: N. Hansen and A. Ostermeier, Completely derandomized
self-adaptation in evolution strategies, Evolutionary Computation 9(2), 2001; formulas and constants
are those of N. Hansen, The CMA evolution strategy: a tutorial, arXiv:1604.00772 (2016), appendix A,
with a covariance matrix that remains the identity. A (mu/mu_w, lambda)-ES: lambda teams are drawn
around a mean team, the better half moves the mean, and the step size grows where successive steps
point the same way and shrinks where they cancel out.

It shares nothing with the methods of the package: no populations, no crossover, no elite, and
its own state. Run it, alone or next to CONE, with::

    conevo run rover/complex-1 --method examples/own_method.py:team-es
    conevo run rover/complex-1 --method examples/own_method.py:team-es,cone --seeds 3

Choice: the fitness of a team is the mean credit of its robots; a non-finite one ranks last.
Choice: genes of the tried teams are clipped to [-1, 1], and the mean moves to the mean of the
clipped teams, so that a clipped step does not lengthen the path.
Choice: the fittest team of a generation is its mean, after it has moved.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from conevo.evolution.methods.registry import MethodEntry
from conevo.evolution.population import ranking
from conevo.evolution.protocol import FloatArray, Layout, Progress, Scores, Trials
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = ["ENTRY", "TeamEs", "TeamEsConfig", "TeamEsState"]


@parameters("method")
class TeamEsConfig:
    """Parameters of the strategy."""

    genotypes: Annotated[int, Ge(4), Le(1_000_000)] = 40
    """Lambda, teams tried in a generation; half of them move the mean. Choice: 40, above the
    tutorial's 4 + 3 ln(n) for the thousands of genes of a team, as fitness is noisy."""
    step_size: Annotated[float, Gt(0), Le(1)] = 0.2
    """Sigma at the start, the standard deviation of a gene. Choice: 0.2, a tenth of the range of a
    gene, with a mean of 0."""


@dataclass(frozen=True)
class TeamEsState:
    """State of the strategy.

    Attributes:
        progress: the header.
        mean: [R, H, G] float64 genes of the mean team, in [-1, 1]; H hidden neurons of a robot.
        path: [R, H, G] float64 the evolution path: steps of the mean, the older the fainter.
        step_size: sigma.
        has_moved: whether the mean has moved in this generation and is to be tried.
    """

    progress: Progress
    mean: FloatArray
    path: FloatArray
    step_size: float
    has_moved: bool

    def problem(self, first: TeamEsState) -> str:
        """Return the first field that is not valid between generations, if any."""
        for name in ("mean", "path"):
            found = getattr(self, name)
            if found.shape != first.mean.shape or not np.isfinite(found).all():
                return name
        if (np.abs(self.mean) > 1).any():
            return "mean"
        if not 0 < self.step_size < np.inf:
            return "step_size"
        return "has_moved" if self.has_moved else ""


@dataclass(frozen=True)
class TeamEs:
    """The evolution strategy; see the module."""

    config: TeamEsConfig = field(default_factory=TeamEsConfig)
    name: str = "team-es"
    title: str = "Team ES"

    def init(self, layout: Layout, root: int) -> TeamEsState:
        """Return generation 0, with all genes of the mean 0."""
        shape = (layout.n_robots, layout.n_hidden, layout.n_genes)
        return TeamEsState(
            progress=Progress.first(layout, root),
            mean=np.zeros(shape),
            path=np.zeros(shape),
            step_size=float(self.config.step_size),
            has_moved=False,
        )

    def ask(self, state: TeamEsState) -> Trials:
        """Return lambda teams around the mean, then the mean."""
        generation, n_slots = state.progress.generation, state.progress.fittest_genes.shape[1]
        if state.has_moved:
            genes, rows = as_pool(state.mean[None], n_slots)
            return Trials(generation, genes, rows, scenarios="fixed", portrait=True)
        return Trials(generation, *as_pool(self.teams(state), n_slots))

    def tell(self, state: TeamEsState, trials: Trials, scores: Scores) -> TeamEsState:
        """Return the state after these scores."""
        progress = state.progress.counted(trials, scores, is_first=not state.has_moved)
        if state.has_moved:
            progress = progress.crowned(trials, scores)
            progress = replace(progress, generation=progress.generation + 1)
            return replace(state, progress=progress, has_moved=False)
        fitness = scores.fitness.mean(axis=1)
        progress = progress.graded(fitness).with_numbers(step_size=state.step_size)
        weights = recombination_weights(self.config.genotypes // 2)
        best = ranking(fitness)[: len(weights)]
        parents = self.teams(state)[best]
        mean = np.clip((weights[:, None, None, None] * parents).sum(axis=0), -1, 1)
        step = (mean - state.mean) / state.step_size
        path, step_size = cumulated(state.path, state.step_size, step, weights)
        return TeamEsState(
            progress=progress,
            mean=mean,
            path=path,
            step_size=step_size,
            has_moved=True,
        )

    def teams(self, state: TeamEsState) -> FloatArray:
        """Return the teams [M, R, H, G] that are tried, normally distributed around the mean."""
        generator = stream(state.progress.root, "steps", state.progress.generation)
        steps = generator.standard_normal((self.config.genotypes, *state.mean.shape))
        return np.clip(state.mean + state.step_size * steps, -1, 1)


def recombination_weights(n: int) -> FloatArray:
    """Return the weights [mu] of the ``n`` best, the best first; their sum is 1."""
    raw = np.log(n + 0.5) - np.log(np.arange(1, n + 1))
    weights: FloatArray = raw / raw.sum()
    return weights


def cumulated(
    path: FloatArray, step_size: float, step: FloatArray, weights: FloatArray
) -> tuple[FloatArray, float]:
    """Return the evolution path and the step size after a step.

    Args:
        path: [...] before.
        step_size: sigma before.
        step: [...] the weighted mean of the best steps, in units of sigma.
        weights: [mu] of these.
    """
    n, mu_eff = path.size, 1 / float(np.sum(weights**2))
    c = (mu_eff + 2) / (n + mu_eff + 5)
    damping = 1 + 2 * max(0.0, np.sqrt((mu_eff - 1) / (n + 1)) - 1) + c
    path = (1 - c) * path + np.sqrt(c * (2 - c) * mu_eff) * step
    expected = np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))  # length of a random path
    length = float(np.sqrt(np.sum(path**2)))
    return path, float(step_size * np.exp(c / damping * (length / expected - 1)))


def as_pool(teams: FloatArray, n_slots: int) -> tuple[FloatArray, np.ndarray]:
    """Return a pool of neurons [K, G] and the rows [N, R, U] in it of teams [N, R, H, G]."""
    n, robots, hidden, n_genes = teams.shape
    rows = np.full((n, robots, n_slots), -1, dtype=np.int32)
    rows[:, :, :hidden] = np.arange(n * robots * hidden).reshape(n, robots, hidden)
    return teams.reshape(-1, n_genes).astype(np.float32), rows


ENTRY = MethodEntry(
    name="team-es",
    title="Team ES",
    summary="an evolution strategy on all genes of a team, with cumulative step-size adaptation",
    source="Hansen and Ostermeier 2001",
    config_name="TeamEsConfig",
    method_name="TeamEs",
)
