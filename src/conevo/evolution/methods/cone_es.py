"""CONE-ES: an evolution strategy of one shared controller and of each robot's deviation from it.

This method is conevo's own, not the thesis'. It keeps CONE's idea (Nitschke 2009, chapter 3: robots
with similar behaviour and genotypes share genes, and the gain regulates how much) in a form in
which fitness gives a clear direction. Robot r has the genes ``mean + deviations[r]``. Pairs of
teams are tried with opposite perturbations. As in Salimans, Ho, Chen, Sidor and Sutskever 2017,
fitness counts by rank among the teams of a round.

- Shared part: all robots of a team have the same perturbation, and the team's fitness gives the
  direction of the mean's step.
- Individual part: in a ``share`` of the pairs every robot also has its own perturbation, and its
  own fitness gives a direction. A single direction is mostly luck, but luck does not repeat, so it
  does not bias the products of directions of different generations, [R, R]. Their eigenvectors
  describe groups of similar robots, such as castes. Eigenvectors with larger eigenvalues than luck
  alone can cause are kept: a robot steps like the robots similar to it, in proportion to this
  signal.
- The share grows in generations with such a signal and shrinks in those without (as GST does,
  3.5.2).
- The team decides: each generation the mean's clones play in the scenarios of the fittest team.
  While deviations do not pay, they decay, and the clones are the generation's fittest team.

With ``individual = 0`` (the variant HomES) it is a plain evolution strategy over teams of clones.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

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
from conevo.evolution.strategies import PairsConfig, as_trials, gains, mirrored
from conevo.parameters import parameters, refuse_ineffective
from conevo.rng import stream

__all__ = ["ConeEs", "ConeEsConfig", "ConeEsState", "HomEsConfig"]

FIRST = 4  # generations of directions before they are compared
GROWTH, DECLINE = 1.1, 0.98  # of the share, in a generation with a signal and without
TRUST = 0.8  # memory of the deviations' worth to the team


@parameters("method")
class ConeEsConfig(PairsConfig):
    """Parameters of CONE-ES.

    Choice: all values come from a few trials in the multi-rover world, not from a search.
    """

    step: Annotated[float, Gt(0), Le(1)] = 0.02
    """root mean square of the mean's step in a generation, in gene units."""
    memory: Annotated[float, Ge(0), Le(0.999)] = 0.8
    """share of the previous direction that the next step keeps."""
    individual: Annotated[float, Ge(0), Le(1)] = 0.75
    """share of the pairs in which robots have their own perturbations, at the start; it is
    regulated. 0 switches the individual part off."""
    individual_least: Annotated[float, Gt(0), Le(1)] = 0.5
    """lower limit of this share."""
    individual_step: Annotated[float, Ge(0), Le(1)] = 0.02
    """root mean square of the deviations' step, in gene units, if all of it were signal."""
    individual_memory: Annotated[float, Ge(0.5), Le(0.999)] = 0.9
    """share of the robots' previous directions that the next generation keeps."""
    signal: Annotated[float, Ge(0), Le(1)] = 0.1
    """portion of signal, in the robots' strongest common component, above which the share grows."""
    decay: Annotated[float, Ge(0), Le(1)] = 0.1
    """portion of the deviations that is lost in a generation in which they do not pay."""

    def __post_init__(self) -> None:
        """Refuse parameters of the individual part without it."""
        super().__post_init__()
        if not self.individual:
            keys = ("individual_least", "individual_step", "individual_memory", "signal", "decay")
            refuse_ineffective(
                self, *keys, unless="the individual part (cone-es with individual > 0)"
            )


@parameters("method")
class HomEsConfig(ConeEsConfig):
    """Parameters of HomES: CONE-ES without the individual part."""

    individual: Annotated[float, Ge(0), Le(0)] = 0.0
    """always 0."""


@dataclass(frozen=True)
class ConeEsState:
    """State of CONE-ES.

    Attributes:
        progress: the header.
        phase: "first" (random teams of clones), "second" (the best of them once more in every
            round), "pairs", "fittest".
        active: [U] the slots in use.
        mean: [U, G] float32 the shared genes, zero in empty slots.
        deviations: [R, U, G] float32 differences of the robots' genes from the mean; their mean
            over robots is 0.
        direction: [U, G] float64 of the mean's steps, averaged over generations.
        directions: [R, U, G] float64 of each robot, by its own fitness, averaged likewise.
        likeness: [R, R] float64 products of directions of different generations, averaged.
        luck: mean square of a generation's directions, averaged.
        age: number of generations in these averages.
        share: of the pairs in which robots have their own perturbations.
        worth: of the deviations to the team: its gain over clones of the mean, as a portion of
            both, averaged over generations.
        best: [2 * pairs / rounds] int32 the best controllers of generation 0, the fittest first.
    """

    progress: Progress
    phase: str
    active: BoolArray
    mean: FloatArray
    deviations: FloatArray
    direction: FloatArray
    directions: FloatArray
    likeness: FloatArray
    luck: float
    age: int
    share: float
    worth: float
    best: IntArray

    def problem(self, first: ConeEsState) -> str:
        """Return the first field that is not valid in a state between generations, if any."""
        for name in ("active", "mean", "deviations", "direction", "directions", "likeness"):
            found, right = getattr(self, name), getattr(first, name)
            if found.shape != right.shape or not np.isfinite(found).all():
                return name
        if not (np.abs(self.mean + self.deviations) <= 1.001).all():
            return "deviations"
        if not self.active.any():
            return "active"
        if self.best.shape != first.best.shape or self.best.min() < 0:
            return "best"
        for name, least, most in (
            ("share", 0.0, 1.0),
            ("worth", -1.0, 1.0),
            ("luck", 0.0, np.inf),
            ("age", 0, np.inf),
        ):
            if not least <= getattr(self, name) <= most:
                return name
        return "" if self.phase in ("first", "pairs") else "phase"


@dataclass(frozen=True)
class ConeEs:
    """Evolution strategy of a shared controller and individual deviations; see the module."""

    config: ConeEsConfig = field(default_factory=ConeEsConfig)
    name: str = "cone-es"
    title: str = "CONE-ES"

    def init(self, layout: Layout, root: int) -> ConeEsState:
        """Return generation 0, in which random controllers are tried as clones.

        Choice: one for each team of a generation. The best are tried again in every round, and the
        fittest of them is the first mean.
        """
        robots, slots, genes = layout.n_robots, layout.max_hidden, layout.n_genes
        return ConeEsState(
            progress=Progress.first(layout, root),
            phase="first",
            active=np.arange(slots) < layout.n_hidden,
            mean=np.zeros((slots, genes), dtype=np.float32),
            deviations=np.zeros((robots, slots, genes), dtype=np.float32),
            direction=np.zeros((slots, genes)),
            directions=np.zeros((robots, slots, genes)),
            likeness=np.zeros((robots, robots)),
            luck=0.0,
            age=0,
            share=self.config.individual if robots > 1 else 0.0,
            worth=0.0,
            best=np.zeros(2 * self.config.pairs // self.config.rounds, dtype=np.int32),
        )

    def begin_with(
        self, layout: Layout, root: int, genes: FloatArray, active: BoolArray
    ) -> ConeEsState:
        """Return generation 0 around a team: its mean controller, and each robot's deviation.

        Choice: a slot that only some robots use contains zeros in the others. HomES starts with the
        mean alone.

        Args:
            layout: the size of the problem.
            root: the seed of every random decision.
            genes: [R', U, G] the team's genes; robot r starts as its robot r mod R'.
            active: [R', U] its slots in use; the mean uses those that any robot uses.
        """
        fresh = self.init(layout, root)
        used = np.asarray(active.any(axis=0))
        team = (genes * active[..., None])[np.arange(layout.n_robots) % len(genes)]
        mean, deviations = self._parted(team)
        return replace(
            fresh,
            progress=replace(fresh.progress, n_hidden=np.array([used.sum()])),
            phase="pairs",
            active=used,
            mean=mean,
            deviations=deviations,
        )

    def ask(self, state: ConeEsState) -> Trials:
        """Return clones in generation 0, the best of them again; later pairs; the fittest team."""
        if state.phase == "fittest":
            return self._trials(state, np.stack(self._finalists(state)))
        if state.phase == "first":
            return self._trials(state, self._clones(state, self._candidates(state)))
        if state.phase == "second":
            best = self._clones(state, self._candidates(state)[state.best])
            return self._trials(state, np.concatenate([best] * self.config.rounds))
        shared, own = self._perturbations(state)
        moved = np.broadcast_to(shared[:, None], (len(shared), *state.deviations.shape)).copy()
        moved[self._is_own(state)] += own
        teams = mirrored(self.config.spread * moved, self.config.rounds)
        return self._trials(state, state.mean + state.deviations + teams)

    def tell(self, state: ConeEsState, trials: Trials, scores: Scores) -> ConeEsState:
        """Return the state after these scores."""
        is_first = state.phase in ("first", "pairs")
        state = replace(state, progress=state.progress.counted(trials, scores, is_first=is_first))
        credit = np.where(np.isfinite(scores.fitness), scores.fitness, np.nan)  # [N, R]
        fitness = credit.mean(axis=1)
        if state.phase == "fittest":
            crowned = replace(state, progress=state.progress.crowned(trials, scores))
            return self._end(crowned, fitness)
        state = replace(state, progress=state.progress.graded(fitness))
        if state.phase == "first":
            return replace(state, phase="second", best=ranking(fitness)[: len(state.best)])
        if state.phase == "second":
            fittest = state.best[ranking(fitness.reshape(self.config.rounds, -1).mean(axis=0))[0]]
            mean = self._candidates(state)[fittest] * state.active[:, None]
            return replace(state, phase="fittest", mean=mean)
        return self._step(state, credit)

    def _step(self, state: ConeEsState, credit: FloatArray) -> ConeEsState:
        """Return the state with mean and deviations moved by one step, given credit [N, R]."""
        config, n_robots = self.config, len(state.deviations)
        shared, own = self._perturbations(state)
        gain = gains(credit.mean(axis=1, keepdims=True), config.rounds)[:, 0]
        direction = np.tensordot(gain, shared, axes=1) / config.pairs
        direction = config.memory * state.direction + (1 - config.memory) * direction
        centre = state.mean + config.step * direction / _size(direction, state.active)
        state = replace(state, phase="fittest", direction=direction)
        deviations = state.deviations
        if config.individual and n_robots > 1:
            own_gain = gains(credit, config.rounds)[self._is_own(state)]
            found: FloatArray = np.einsum("nr,nrug->rug", own_gain, own) / config.pairs
            state = self._remember(state, found - found.mean(axis=0))
            kept, signal = _signal(state, config.individual_memory)
            size = _size(state.directions, np.broadcast_to(state.active, (n_robots, kept.shape[1])))
            deviations = deviations + config.individual_step * kept / size
            if state.age > FIRST:
                grows = signal > config.signal
                share = state.share * (GROWTH if grows else DECLINE)
                state = replace(state, share=float(np.clip(share, config.individual_least, 1.0)))
            numbers = {"individual_share": state.share, "individual_signal": signal}
            state = replace(state, progress=state.progress.with_numbers(**numbers))
        team = np.clip(centre + deviations, -1, 1) * state.active[:, None]
        mean, deviations = self._parted(team)
        return replace(state, mean=mean, deviations=deviations)

    def _parted(self, team: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the mean [U, G] of a team [R, U, G] and its deviations, which are 0 for clones."""
        genes = team.astype(np.float32)
        mean = genes.mean(axis=0, dtype=np.float64).astype(np.float32)
        return mean, (genes - mean) * np.float32(self.config.individual > 0)

    def _remember(self, state: ConeEsState, found: FloatArray) -> ConeEsState:
        """Return the state with the robots' directions [R, U, G] of a generation averaged in."""
        keep, n_robots = self.config.individual_memory, len(found)
        new, old = found.reshape(n_robots, -1), state.directions.reshape(n_robots, -1)
        n_genes = state.active.sum() * found.shape[2]
        likeness = state.likeness
        if state.age:
            together = new @ old.T / (n_genes * (1 - keep**state.age))
            likeness = keep * likeness + (1 - keep) * (together + together.T) / 2
        return replace(
            state,
            directions=keep * state.directions + (1 - keep) * found,
            likeness=likeness,
            luck=float(keep * state.luck + (1 - keep) * (new**2).sum() / (n_genes * n_robots)),
            age=state.age + 1,
        )

    def _end(self, state: ConeEsState, fitness: FloatArray) -> ConeEsState:
        """Return the first state of the next generation, given the finalists' fitness."""
        progress, worth, deviations = state.progress, state.worth, state.deviations
        if len(fitness) == 2:
            team, clones = fitness if worth >= 0 else fitness[::-1]
            both = abs(team) + abs(clones)
            failed = float(np.isnan(clones)) - float(np.isnan(team))
            more = float((team - clones) / both) if both > 0 else failed
            worth = TRUST * worth + (1 - TRUST) * more
            if worth < 0:
                deviations = ((1 - self.config.decay) * deviations).astype(np.float32)
            progress = progress.with_numbers(individual_worth=worth)
        progress = replace(progress, generation=progress.generation + 1)
        return replace(state, progress=progress, phase="pairs", worth=worth, deviations=deviations)

    def _finalists(self, state: ConeEsState) -> list[FloatArray]:
        """Return the team with deviations and that of clones, [R, U, G], the fitter one first."""
        team = state.mean + state.deviations
        if not state.deviations.any():
            return [team]
        clones = np.broadcast_to(state.mean, team.shape)
        return [team, clones] if state.worth >= 0 else [clones, team]

    def _candidates(self, state: ConeEsState) -> FloatArray:
        """Return the random controllers [2 * pairs, U, G] of generation 0."""
        shape = (2 * self.config.pairs, *state.mean.shape)
        return random_genes(stream(state.progress.root, "genotypes"), shape)

    def _clones(self, state: ConeEsState, controllers: FloatArray) -> FloatArray:
        shape = (len(controllers), len(state.deviations), *state.mean.shape)
        return np.broadcast_to(controllers[:, None], shape)

    def _perturbations(self, state: ConeEsState) -> tuple[FloatArray, FloatArray]:
        """Return a generation's perturbations: shared [pairs, U, G], and own ones [n, R, U, G]."""
        generator = stream(state.progress.root, "pairs", state.progress.generation)
        used = state.active[:, None]
        shared = generator.standard_normal((self.config.pairs, *state.mean.shape), dtype=np.float32)
        n_own = int(self._is_own(state).sum())
        own = generator.standard_normal((n_own, *state.deviations.shape), dtype=np.float32)
        return shared * used, own * used

    def _is_own(self, state: ConeEsState) -> BoolArray:
        """Return the pairs [pairs] in which robots have their own perturbations, by round."""
        per_round = self.config.pairs // self.config.rounds
        n_own = max(int(state.share * per_round + 0.5), int(state.share > 0))
        return np.tile(np.arange(per_round) < n_own, self.config.rounds)

    def _trials(self, state: ConeEsState, teams: FloatArray) -> Trials:
        """Return teams [N, R, U, G] as trials."""
        return as_trials(state.progress, state.phase, teams, state.active, self.config.rounds)


def _size(directions: FloatArray, active: BoolArray) -> float:
    """Return the root mean square of the genes in use, at least a tiny number."""
    n = active.sum() * directions.shape[-1]
    return float(np.sqrt((directions**2).sum() / n)) + 1e-12


def _signal(state: ConeEsState, memory: float) -> tuple[FloatArray, float]:
    """Return the signal in the robots' directions [R, U, G], and its largest portion.

    A Wiener filter over robots. Without any signal the eigenvalues of ``likeness`` lie between two
    edges, which Marchenko and Pastur 1967 derive for products of R rows of this number of genes;
    weighted as here, they are narrower by the root of 2. An eigenvalue above the upper edge is
    taken as signal, in proportion to its excess.
    """
    directions = state.directions
    if state.age <= FIRST:
        return np.zeros_like(directions), 0.0
    faded = memory**state.age  # at first averages are over few generations, and noisier
    values, vectors = np.linalg.eigh(state.likeness / (1 - memory ** (state.age - 1)))
    luck = state.luck / (1 - faded)
    noise = luck * (1 - memory) / (1 + memory) * (1 + faded) / (1 - faded)
    rows_per_gene = len(directions) / max(state.active.sum() * directions.shape[2], 1)
    edge = noise * ((1 + np.sqrt(rows_per_gene)) ** 2 - 1) / np.sqrt(2)
    believed = np.maximum(values - edge, 0.0)
    portion = believed / (believed + noise + 1e-30)
    kept = np.einsum("rk,k,sk,sug->rug", vectors, portion, vectors, directions)
    return kept, float(portion.max())
