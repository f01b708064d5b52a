"""CONE, Collective Neuro-Evolution: Multi-Agent ESP whose populations may share genes.

Nitschke 2009, chapter 3. It adds to MESP: type C fitness (elite controllers with elite partners),
recombination between populations with similar behaviour and similar sub-populations (the
specialization and genotype difference metrics, SDM and GDM), and regulation of both thresholds.

Variants (4.5.7, 5.5.5, 6.5.6): CONE-1 without the GDM, CONE-2 without the SDM, CONE-3 without both.
Choice: the thesis contradicts itself on CONE-1; here its paired populations recombine slot by slot.
Choice: in CONE-2 all pairs of populations are candidates at once, so one population may exchange
with several. The most similar sub-populations come first, and each is taken once.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from conevo.errors import UsageError
from conevo.evolution import credit
from conevo.evolution.assembly import elite_teams
from conevo.evolution.behaviour import evenness
from conevo.evolution.generation import begin, count, note, push, trials
from conevo.evolution.methods.mesp import Mesp, MespConfig, MespState
from conevo.evolution.population import ranking
from conevo.evolution.protocol import BoolArray, FloatArray, IntArray, Layout, Scores, Trials
from conevo.evolution.regulation import regulate_gst, regulate_sst
from conevo.evolution.selection import (
    entropy_distance,
    label_distance,
    pair_populations,
    pair_similar,
    pair_slots,
    shares_distance,
    specialization_distance,
)
from conevo.parameters import parameters, refuse_ineffective
from conevo.rng import stream

__all__ = ["Cone", "Cone1Config", "Cone2Config", "Cone3Config", "ConeConfig", "ConeState"]


@parameters("method")
class ConeConfig(MespConfig):
    """Parameters of CONE: those of Multi-Agent ESP and its own."""

    stagnation_v: Annotated[int, Ge(1), Le(100_000)] = 15
    """V, generations without progress of the fittest team before SST moves (table 5.5: 15; 10 for
    pursuit)."""
    stagnation_w: Annotated[int, Ge(1), Le(100_000)] = 10
    """W, further generations before GST moves; a controller's size is questioned after V + W + Y
    (table 5.5: 10)."""
    sst: Annotated[float, Ge(0), Le(1)] = 0.5
    """specialization similarity threshold at the start. Higher makes more populations candidates
    for recombination. Choice: 0.5, the middle of table 5.5's range."""
    gst: Annotated[float, Ge(0), Le(1)] = 0.2
    """genotype similarity threshold at the start. Higher recombines more. Choice: 0.2; two random
    sub-populations are 0.33 apart, and genotypes "needed to be very similar in order to be
    recombined" (7.1.2)."""
    gd_aggregate: Literal["mean", "sum"] = "mean"
    """the "mean" or "sum" of the distances of rank-paired elites. Choice: the mean."""
    threshold_step: Annotated[float, Ge(0), Le(1)] = 0.01
    """change of a threshold (section 3.5: 1 %). Choice: absolute."""
    thresholds_from: Literal["settings", "ancestor"] = "settings"
    """initial SST and GST of a run that starts with another one's populations (``--from``, a stage
    of shaping): the "settings" ``sst`` and ``gst``, or the last values of that run, its "ancestor".
    Choice: the settings; section 3.5 is silent."""
    type_c: Literal["own", "team", "off"] = "own"
    """fitness that ranks the elite (type C): "own" is that of the robot on trial, as for type A;
    "team" is the mean of all robots; "off" leaves the order of type A and saves the evaluations.
    Choice: "own", as in eq. 5.4 for type A."""
    type_c_rounds: Annotated[int, Ge(0), Le(10_000)] = 0
    """teams in which each elite controller is tried for type C; 0 means the number of type A: one
    if "systematic", ``rounds`` if "shared". Choice: 0, so that type C never overwrites better
    evidence."""
    pairing: Literal["nearest", "all"] = "nearest"
    """which pairs of populations below SST may exchange genes: "nearest" takes the most similar
    first and each population once; "all" takes every pair, and each sub-population once. Choice:
    "nearest"; the printed loop overwrites a population n - 1 times."""
    sd: Literal["switching", "shares", "label", "entropy"] = "switching"
    """difference between the behaviours of two robots: "switching" is that of their S (eq. 3.5);
    "shares" the part of its life that one would have to spend differently to be like the other;
    "label" 0 if they do the same most and are both specialized (S < 0.5) or both not, else 1;
    "entropy" is that of the entropies of their shares of actions, which then replaces S in the
    regulation of SST, too (7.2: a metric without labels and thresholds)."""
    exchange_slots: Literal["any", "same"] = "any"
    """whether sub-populations of "any" two slots may recombine, or only of the "same" slot, as the
    genotypes' tags imply. CONE-1 always takes the same. Choice: "any"; section 3.7 tests each pair
    of sub-populations."""
    exchange_share: Annotated[float, Ge(0), Le(1)] = 1.0
    """chance of each pair of populations that may exchange genes to do so in a generation."""
    use_gdm: bool = True
    """require similar genotypes (the genotype difference metric)."""
    use_sdm: bool = True
    """require similar behaviour (the specialization difference metric)."""

    def __post_init__(self) -> None:
        """Refuse parameters that would have no effect."""
        super().__post_init__()
        if not self.use_sdm:
            metric = "the specialization difference metric (use_sdm)"
            refuse_ineffective(self, "pairing", "sd", unless=metric)
        if not (self.use_sdm or self.use_gdm):
            keys = ("exchange_slots", "exchange_share", "thresholds_from")
            refuse_ineffective(self, *keys, unless="a difference metric (use_sdm, use_gdm)")
        if self.type_c == "off":
            refuse_ineffective(self, "type_c_rounds", unless="type C fitness (type_c)")

    @property
    def n_elite_rounds(self) -> int:
        """The number of teams in which each elite controller is tried for type C fitness."""
        as_type_a = self.rounds if self.evaluation == "shared" else 1
        return self.type_c_rounds or as_type_a


@parameters("method")
class Cone1Config(ConeConfig):
    """Parameters of CONE-1: CONE without the genotype difference metric."""

    use_gdm: Literal[False] = False


@parameters("method")
class Cone2Config(ConeConfig):
    """Parameters of CONE-2: CONE without the specialization difference metric."""

    use_sdm: Literal[False] = False


@parameters("method")
class Cone3Config(Cone1Config):
    """Parameters of CONE-3: CONE without both metrics."""

    use_sdm: Literal[False] = False


@dataclass(frozen=True)
class ConeState(MespState):
    """State of CONE.

    Attributes:
        past_specialization: [H] float64 mean S of the fittest team, like ``past_fitness``; with
            ``sd`` = "entropy" the mean entropy of its robots' actions.
        past_recombinations: [H] float64 recombinations between populations.
        distance: [P, P] float64 SD between the last fittest team's controllers; NaN before the
            first one, and without the SDM.
        sst: specialization similarity threshold, NaN without the SDM.
        gst: genotype similarity threshold, NaN without the GDM.
    """

    past_specialization: FloatArray
    past_recombinations: FloatArray
    distance: FloatArray
    sst: float
    gst: float


@dataclass(frozen=True)
class Cone(Mesp[ConeState]):
    """Collective Neuro-Evolution; see the module."""

    config: ConeConfig = field(default_factory=ConeConfig)
    name: str = "cone"
    title: str = "CONE"

    def init(self, layout: Layout, root: int) -> ConeState:
        """Return generation 0 with random genotypes."""
        config = self.config
        return begin(
            ConeState,
            layout,
            root,
            **self.beginning(layout),
            past_specialization=np.full(self.patience + 1, np.nan),
            past_recombinations=np.full(self.patience + 1, np.nan),
            distance=np.full((layout.n_robots, layout.n_robots), np.nan),
            sst=float(config.sst if config.use_sdm else np.nan),
            gst=float(config.gst if config.use_gdm else np.nan),
        )

    def ask(self, state: ConeState) -> Trials:
        """Return the teams of the state's phase."""
        if state.phase != "elites":
            return super().ask(state)
        config = self.config
        generator = stream(state.root, "elites", state.generation)
        teams = np.concatenate(
            [
                elite_teams(state.active, state.elite, config.genotypes, generator)
                for _ in range(config.n_elite_rounds)
            ]
        )
        return trials(state, teams, rounds=config.n_elite_rounds if config.fresh_rounds else 1)

    def tell(self, state: ConeState, trials: Trials, scores: Scores) -> ConeState:
        """Return the state after these scores."""
        if state.phase == "elites":
            told = self.type_c(count(state, trials, scores), scores)
            return note(told, type_c_evaluations=len(trials.teams) * scores.plays)
        told = super().tell(state, trials, scores)
        has_elites = state.phase == "genotypes" and self.config.type_c != "off"
        return replace(told, phase="elites") if has_elites else told

    def type_c(self, state: ConeState, scores: Scores) -> ConeState:
        """Return the state with the elite ranked by type C fitness.

        Choice: type C fitness changes the order of the elite portion, but not its members. Ranks
        with equal type C keep their order by type A, the same in all sub-populations.
        """
        n_populations, _, n_elite = state.elite.shape
        if self.config.type_c == "team":
            of_trial = scores.fitness.mean(axis=1)
        else:
            robot = np.tile(np.arange(n_populations).repeat(n_elite), self.config.n_elite_rounds)
            of_trial = credit.of_robot(scores.fitness, robot)
        by_rank = of_trial.reshape(-1, n_populations, n_elite).mean(axis=0)
        fitness = credit.overwrite(state.fitness, state.elite, by_rank)
        fitness[~state.active] = np.nan
        order = ranking(by_rank)[:, None, :]
        elite = np.take_along_axis(state.elite, np.broadcast_to(order, state.elite.shape), axis=2)
        return replace(state, phase="fittest", fitness=fitness, elite=elite)

    def crowned(self, state: ConeState, trials: Trials, scores: Scores) -> ConeState:
        """Return the state with its fittest team and the SD between its controllers recorded."""
        state = super().crowned(state, trials, scores)
        if not self.config.use_sdm:
            return state
        state = replace(state, distance=self.differ(scores))
        if self.config.sd == "entropy" and scores.shares is not None:
            state = note(state, activity_entropy=float(evenness(scores.shares[0]).mean()))
        return state

    def differ(self, scores: Scores) -> FloatArray:
        """Return SD [P, P] between the controllers of the first team of some scores.

        Raises:
            UsageError: it needs shares of actions, and the scores have none.
        """
        specialization, sd = scores.specialization[0], self.config.sd
        if sd == "switching":
            return specialization_distance(specialization)
        if scores.shares is None:
            raise UsageError(f"method.sd = {sd!r} needs scores.shares, the activity of each robot")
        if sd == "shares":
            return shares_distance(scores.shares[0])
        if sd == "entropy":
            return entropy_distance(scores.shares[0])
        return label_distance(specialization, scores.shares[0])

    @property
    def patience(self) -> int:
        """Generations without progress before a controller's size is questioned: V + W + Y."""
        config = self.config
        return config.stagnation_v + config.stagnation_w + config.stagnation_y

    def pairs(self, state: ConeState) -> IntArray:
        """Return the sub-populations [Q, 2] that recombine between populations."""
        config = self.config
        if not (config.use_sdm or config.use_gdm):
            return super().pairs(state)
        candidates = self.candidates(state)
        if not config.use_gdm:
            return pair_slots(state.active, candidates)
        elites = np.take_along_axis(state.genes, state.elite[..., None], axis=2)
        return pair_similar(
            elites,
            state.active,
            candidates,
            state.gst,
            config.gd_aggregate,
            config.exchange_slots,
        )

    def candidates(self, state: ConeState) -> IntArray:
        """Return the pairs [C, 2] of populations that may exchange genes in this generation."""
        if self.config.use_sdm:
            pairs = pair_populations(state.distance, state.sst, self.config.pairing)
        else:
            pairs = np.stack(np.triu_indices(len(state.active), k=1), axis=1)
        drawn = stream(state.root, "exchange", state.generation).random(len(pairs))
        return pairs[drawn < self.config.exchange_share]

    def finish(
        self, state: ConeState, active: BoolArray, judged: BoolArray | None = None
    ) -> ConeState:
        """Return the next generation, with its thresholds regulated."""
        state = self.remember(super().finish(state, active, judged))
        v, w = self.config.stagnation_v, self.config.stagnation_w
        fitness, step = state.past_fitness.mean(axis=1), self.config.threshold_step
        sst, gst = state.sst, state.gst
        if state.generation > v:
            recent = slice(-(v + 1), None)
            sst = regulate_sst(sst, fitness[recent], state.past_specialization[recent], step)
        if state.generation > v + w:
            recent = slice(-(v + w + 1), None)
            gst = regulate_gst(gst, fitness[recent], state.past_recombinations[recent], step)
        return note(replace(state, sst=sst, gst=gst), sst=state.sst, gst=state.gst)

    def remember(self, state: ConeState) -> ConeState:
        """Return the state with the ended generation added to the windows of its thresholds."""
        ended = state.progress
        specialization = ended.numbers.get("activity_entropy")
        if specialization is None:
            specialization = float(np.mean(ended.fittest_specialization))
        return replace(
            state,
            past_specialization=push(state.past_specialization, specialization),
            past_recombinations=push(state.past_recombinations, ended.numbers["recombinations"]),
        )
