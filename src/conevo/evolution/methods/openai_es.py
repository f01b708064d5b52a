"""OpenAI-ES: an evolution strategy that follows the gradient of ranks along mirrored perturbations.

Salimans, Ho, Chen, Sidor and Sutskever 2017, Evolution strategies as a scalable alternative to
reinforcement learning, arXiv:1703.03864: perturbations in mirrored pairs, centred ranks, a step by
Adam (Kingma and Ba 2015) or with momentum, and weight decay. A team is

- "clones": all robots have one controller, and the team's fitness moves it;
- "whole": each robot has its own controller, and the team's fitness moves all genes of the team;
- "robots": each robot has its own controller. A ``share`` s of the variance of its perturbation is
  the same for all robots, and moves all of them by the team's fitness. The rest is its own, and
  moves it by its own credit. In generation g robot r is tried at

      genes[r] +- spread (sqrt(s) e + sqrt(1 - s) h[r]),

  with standard normal e and h[r], and its gradient is the mean over pairs of

      (sqrt(s) a e + sqrt(1 - s) a[r] h[r]) / (2 spread),

  where a is the difference of the pair's ranks by the team's fitness, and a[r] by robot r's credit.
  With s = 1 robots are clones; with s = 0 they are R independent strategies.

Choice: ranks are those among the teams of a round, since each round has its own scenarios.
Choice: weight decay does not pass through Adam (Loshchilov and Hutter 2019), which would divide it
by the size of the gradient.
Choice: genes of the tried teams and of the mean are clipped to [-1, 1]. The mirrored pairs of a
gene at the border still have a gradient that points inward.
Choice: the fittest team of a generation is the mean, after it has moved.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from conevo.evolution.population import random_genes, ranking
from conevo.evolution.protocol import (
    BoolArray,
    FloatArray,
    IntArray,
    Layout,
    Progress,
    Scores,
    Trials,
)
from conevo.evolution.strategies import (
    PairsConfig,
    as_trials,
    controllers_of,
    gains,
    mirrored,
)
from conevo.parameters import parameters, refuse_ineffective
from conevo.rng import fold, stream

__all__ = ["OpenAiEs", "OpenAiEsConfig", "OpenAiEsState"]

TINY = 1e-8  # added to the root of Adam's second moment


@parameters("method")
class OpenAiEsConfig(PairsConfig):
    """Parameters of OpenAI-ES.

    Choice: sizes suit genes in [-1, 1], by a few trials in the example world.
    """

    team: Literal["clones", "whole", "robots"] = "clones"
    """who has a controller of its own, and whose fitness moves it; see the module."""
    share: Annotated[float, Ge(0), Le(1)] = 0.5
    """share of the variance of a robot's perturbation that all robots have in common, from
    independent robots (0) to clones (1); only for ``team = "robots"``."""
    optimiser: Literal["adam", "momentum"] = "adam"
    """how the gradient becomes a step."""
    step: Annotated[float, Gt(0), Le(10)] = 0.05
    """learning rate: with "adam" about the length of a step of a gene with a steady gradient, in
    gene units; with "momentum" the factor of the gradient, which is in ranks per gene unit."""
    memory: Annotated[float, Ge(0), Le(0.999)] = 0.9
    """share of the mean gradient of earlier generations that the next step keeps."""
    memory_squares: Annotated[float, Ge(0), Lt(1)] = 0.99
    """the same for the mean of its square, for "adam" (Choice: 0.99, not 0.999: a run has hundreds
    of generations, not many thousands)."""
    weight_decay: Annotated[float, Ge(0), Le(1)] = 0.005
    """portion of a gene, times ``step``, that is lost in a generation."""

    def __post_init__(self) -> None:
        """Refuse parameters of another team or optimiser."""
        super().__post_init__()
        if self.team != "robots":
            refuse_ineffective(self, "share", unless="method.team = robots")
        if self.optimiser != "adam":
            refuse_ineffective(self, "memory_squares", unless="method.optimiser = adam")


@dataclass(frozen=True)
class OpenAiEsState:
    """State of OpenAI-ES; P = 1 for clones, else P = R.

    Attributes:
        progress: the header.
        phase: "first" (random teams), "second" (the best of them once more in every round),
            "pairs", "fittest".
        active: [P, U] the slots in use.
        genes: [P, U, G] float64 controllers in [-1, 1], zero in empty slots.
        gradient: [P, U, G] float64 mean gradient, the older the fainter.
        squares: [P, U, G] float64 mean of its square likewise.
        steps: the number of steps so far.
        best: [P, 2 * pairs / rounds] int32 the best controllers of generation 0, the fittest first.
    """

    progress: Progress
    phase: str
    active: BoolArray
    genes: FloatArray
    gradient: FloatArray
    squares: FloatArray
    steps: int
    best: IntArray

    def problem(self, first: OpenAiEsState) -> str:
        """Return the first field that is not valid in a state between generations, if any."""
        for name in ("active", "genes", "gradient", "squares"):
            found, right = getattr(self, name), getattr(first, name)
            if found.shape != right.shape or not np.isfinite(found).all():
                return name
        if not (np.abs(self.genes) <= 1).all():
            return "genes"
        if not self.active.any(axis=1).all():
            return "active"
        if (self.squares < 0).any():
            return "squares"
        if self.steps < 0:
            return "steps"
        if self.best.shape != first.best.shape or self.best.min() < 0:
            return "best"
        return "" if self.phase in ("first", "pairs") else "phase"


@dataclass(frozen=True)
class OpenAiEs:
    """Evolution strategy by the gradient of ranks; see the module."""

    config: OpenAiEsConfig = field(default_factory=OpenAiEsConfig)
    name: str = "openai-es"
    title: str = "OpenAI-ES"

    def init(self, layout: Layout, root: int) -> OpenAiEsState:
        """Return generation 0, in which random teams are tried, as in HomES.

        Choice: one for each team of a generation. The best are tried again in every round, and the
        mean starts at the fittest of them. Robots that share nothing choose by their own credit;
        those that share something start as clones.
        """
        n_controllers = 1 if self.config.team == "clones" else layout.n_robots
        zeros = np.zeros((n_controllers, layout.max_hidden, layout.n_genes))
        return OpenAiEsState(
            progress=Progress.first(layout, root, n_controllers),
            phase="first",
            active=np.tile(np.arange(layout.max_hidden) < layout.n_hidden, (n_controllers, 1)),
            genes=zeros,
            gradient=zeros,
            squares=zeros,
            steps=0,
            best=np.zeros((n_controllers, 2 * self.config.pairs // self.config.rounds), np.int32),
        )

    def begin_with(
        self, layout: Layout, root: int, genes: FloatArray, active: BoolArray
    ) -> OpenAiEsState:
        """Return generation 0 around a team; for clones, around its mean controller.

        Args:
            layout: the size of the problem.
            root: the seed of every random decision.
            genes: [R', U, G] the team's genes; robot r starts as its robot r mod R'.
            active: [R', U] its slots in use; clones use those that any robot uses.
        """
        fresh = self.init(layout, root)
        found, used = controllers_of(layout, genes, active, is_clones=self.config.team == "clones")
        progress = replace(fresh.progress, n_hidden=used.sum(axis=1))
        return replace(fresh, progress=progress, phase="pairs", active=used, genes=found)

    def ask(self, state: OpenAiEsState) -> Trials:
        """Return random teams in generation 0, the best of them again; later pairs; the mean."""
        rounds = 1 if state.phase == "first" else self.config.rounds
        if state.phase == "first":
            teams = self._candidates(state)
        elif state.phase == "second":
            best = np.take_along_axis(self._candidates(state), _rows(state.best), axis=0)
            teams = np.concatenate([best] * rounds)
        elif state.phase == "pairs":
            shared, own = self._perturbations(state)
            teams = state.genes + mirrored(self.config.spread * (shared + own), rounds)
        else:
            teams = state.genes[None]
        shape = (len(teams), *state.progress.fittest_genes.shape)
        teams = np.broadcast_to(teams, shape)
        return as_trials(state.progress, state.phase, teams, state.active, rounds)

    def tell(self, state: OpenAiEsState, trials: Trials, scores: Scores) -> OpenAiEsState:
        """Return the state after these scores."""
        is_first = state.phase in ("first", "pairs")
        progress = state.progress.counted(trials, scores, is_first=is_first)
        if state.phase == "fittest":
            progress = progress.crowned(trials, scores)
            progress = replace(progress, generation=progress.generation + 1)
            return replace(state, progress=progress, phase="pairs")
        credit = np.where(np.isfinite(scores.fitness), scores.fitness, np.nan)  # [N, R]
        fitness = credit.mean(axis=1)
        state = replace(state, progress=progress.graded(fitness))
        if state.phase == "pairs":
            return self._step(state, self._gradient(state, credit, fitness))
        is_alone = self.config.team == "robots" and self._share() == 0
        judged = credit.T if is_alone else np.tile(fitness, (len(state.genes), 1))  # [P, N]
        if state.phase == "first":
            best = ranking(judged)[:, : state.best.shape[1]]
            return replace(state, phase="second", best=best)
        tried = judged.reshape(len(judged), self.config.rounds, -1).mean(axis=1)
        chosen = np.take_along_axis(state.best, ranking(tried)[:, :1], axis=1)
        genes = np.take_along_axis(self._candidates(state), _rows(chosen), axis=0)[0]
        genes = genes.astype(np.float64) * state.active[:, :, None]
        return replace(state, phase="fittest", genes=genes)

    def _candidates(self, state: OpenAiEsState) -> FloatArray:
        """Return the controllers [2 * pairs, P, U, G] of generation 0.

        Robots that share nothing, and those of a whole team, have different ones.
        """
        root, n_controllers = state.progress.root, len(state.genes)
        shape = (2 * self.config.pairs, 1, *state.genes.shape[1:])
        if self._share() > 0:
            shared = random_genes(stream(root, "genotypes"), shape)
            return np.repeat(shared, n_controllers, axis=1)
        roots = [fold(root, "robot", robot) for robot in range(n_controllers)]
        return np.concatenate([random_genes(stream(one, "genotypes"), shape) for one in roots], 1)

    def _perturbations(self, state: OpenAiEsState) -> tuple[FloatArray, FloatArray]:
        """Return a generation's perturbations, the shared and the own part, [pairs, 1 or P, U, G].

        Each robot has its own stream, so that without sharing it is a strategy of its own.
        """
        root, generation = state.progress.root, state.progress.generation
        shape = (self.config.pairs, 1, *state.genes.shape[1:])
        share, nothing = self._share(), np.zeros(shape)
        shared = own = nothing
        if share > 0:
            generator = stream(root, "pairs", generation)
            shared = np.sqrt(share) * generator.standard_normal(shape)
        if share < 1:
            roots = [fold(root, "robot", robot) for robot in range(len(state.genes))]
            parts = [stream(one, "pairs", generation).standard_normal(shape) for one in roots]
            own = np.sqrt(1 - share) * np.concatenate(parts, axis=1)
        used = state.active[:, :, None]
        return shared * used, own * used

    def _gradient(
        self, state: OpenAiEsState, credit: FloatArray, fitness: FloatArray
    ) -> FloatArray:
        """Return the gradient [P, U, G] of ranks, given credit [N, R] and fitness [N] of teams."""
        shared, own = self._perturbations(state)
        by_team = gains(fitness[:, None], self.config.rounds)
        by_robot = gains(credit, self.config.rounds)
        found = []
        for k in range(len(state.genes)):  # copies: one after the other, a sum is always the same
            mine = by_robot[:, k].copy() if self.config.team == "robots" else by_team[:, 0]
            part = np.tensordot(by_team[:, 0], shared[:, k], axes=1)
            found.append(part + np.tensordot(mine, own[:, k], axes=1))
        return np.stack(found) / (2 * self.config.pairs * self.config.spread)

    def _step(self, state: OpenAiEsState, gradient: FloatArray) -> OpenAiEsState:
        """Return the state with the genes moved along a gradient [P, U, G]."""
        config, steps = self.config, state.steps + 1
        mean = config.memory * state.gradient + (1 - config.memory) * gradient
        squares = config.memory_squares * state.squares + (1 - config.memory_squares) * gradient**2
        move = mean
        if config.optimiser == "adam":
            root = np.sqrt(squares / (1 - config.memory_squares**steps))
            move = mean / (1 - config.memory**steps) / (root + TINY)
        genes = state.genes + config.step * (move - config.weight_decay * state.genes)
        progress = state.progress
        if len(genes) > 1:
            apart = np.sqrt(((genes - genes.mean(axis=0))[state.active] ** 2).mean())
            progress = progress.with_numbers(apart=float(apart))
        return replace(
            state,
            progress=progress,
            phase="fittest",
            genes=np.clip(genes, -1, 1) * state.active[:, :, None],
            gradient=mean,
            squares=squares,
            steps=steps,
        )

    def _share(self) -> float:
        """Return the share of a perturbation's variance that all robots have in common."""
        return {"clones": 1.0, "whole": 0.0, "robots": self.config.share}[self.config.team]


def _rows(indices: IntArray) -> IntArray:
    """Return the indices [P, L] of controllers by robot as those of rows [L, P, 1, 1]."""
    return indices.T[:, :, None, None]
