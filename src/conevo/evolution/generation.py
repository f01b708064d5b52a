"""The life of a generation, common to all methods: begin, count, grade, crown, turn the page."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from conevo.errors import UsageError
from conevo.evolution.population import join, random_genes, ranking, split
from conevo.evolution.protocol import (
    BoolArray,
    FloatArray,
    IntArray,
    Layout,
    Scores,
    State,
    Trials,
)
from conevo.evolution.variation import VariationConfig, breed
from conevo.rng import stream

__all__ = ["advance", "begin", "breed_networks", "count", "crown", "grade", "pool", "trials"]


def begin(
    layout: Layout,
    root: int,
    *,
    n_populations: int,
    n_genotypes: int,
    networks: bool = False,
    window: int = 0,
    sst: float = float("nan"),
    gst: float = float("nan"),
) -> State:
    """Return generation 0: random genotypes in the first ``n_hidden`` slots.

    Args:
        layout: the size of the problem.
        root: the seed of every random decision.
        n_populations: P, one per robot or 1.
        n_genotypes: M, genotypes per slot.
        networks: whether a genotype is a whole network, so that fitness has no U axis.
        window: H, generations of history that the method looks back on.
        sst: initial specialization similarity threshold.
        gst: initial genotype similarity threshold.
    """
    shape = (n_populations, layout.max_hidden, n_genotypes, layout.n_genes)
    active = np.zeros(shape[:2], dtype=np.bool_)
    active[:, : layout.n_hidden] = True
    graded = (n_populations,) if networks else active.shape
    robots, nan = layout.n_robots, float("nan")
    return State(
        root=root,
        generation=0,
        phase="genotypes",
        team_evaluations=0,
        genes=random_genes(stream(root, "genotypes"), shape) * active[:, :, None, None],
        active=active,
        fitness=np.full((*graded, n_genotypes), nan),
        elite=np.zeros((*graded, 0), dtype=np.int32),
        partners=np.zeros((*shape[:2], 0, layout.n_genes), dtype=np.float32),
        past_fitness=np.full((window, robots), nan),
        past_specialization=np.full(window, nan),
        past_recombinations=np.full(window, nan),
        watched_since=np.zeros(n_populations, dtype=np.int64),
        sst=float(sst),
        gst=float(gst),
        fittest_genes=np.zeros((robots, layout.max_hidden, layout.n_genes), dtype=np.float32),
        fittest_active=np.zeros((robots, layout.max_hidden), dtype=np.bool_),
        fittest_fitness=np.full(robots, nan),
        fittest_specialization=np.full(robots, nan),
        best_fitness=nan,
        mean_fitness=nan,
        n_nonfinite=0,
        recombinations=0,
        n_hidden=active.sum(axis=1),
    )


def pool(state: State) -> FloatArray:
    """Return the neuron genotypes as one list of rows, [P * U * M, G]."""
    return state.genes.reshape(-1, state.genes.shape[-1])


def trials(
    state: State, teams: IntArray, genes: FloatArray | None = None, rounds: int = 1
) -> Trials:
    """Return ``teams`` as the state's trials, over its own pool unless another is given."""
    genes = pool(state) if genes is None else genes
    return Trials(state.phase, state.generation, genes, teams, rounds)


def count(state: State, asked: Trials, scores: Scores) -> State:
    """Return the state with the evaluation counted, after checking that it answers the question."""
    if (asked.phase, asked.generation) != (state.phase, state.generation):
        raise UsageError(
            f"these scores are for phase {asked.phase!r} of generation {asked.generation}, "
            f"the state waits for {state.phase!r} of {state.generation}"
        )
    expected = asked.teams.shape[:2]
    for name in ("fitness", "specialization"):
        shape = np.shape(getattr(scores, name))
        if shape != expected:
            raise UsageError(f"scores.{name} has shape {shape}, teams x robots is {expected}")
    bad = int(np.count_nonzero(~np.isfinite(scores.fitness)))
    earlier = 0 if state.phase == "genotypes" else state.n_nonfinite
    return replace(
        state,
        team_evaluations=state.team_evaluations + expected[0],
        n_nonfinite=earlier + bad,
    )


def grade(state: State, fitness: FloatArray, n_elite: int, phase: str) -> State:
    """Return the state with type A fitness given and the elite portion named.

    Args:
        state: in phase "genotypes".
        fitness: [P, U, M] or [P, M]; NaN where there is no genotype.
        n_elite: L.
        phase: what comes next.
    """
    finite = fitness[np.isfinite(fitness)]
    return replace(
        state,
        phase=phase,
        fitness=fitness,
        elite=ranking(fitness)[..., :n_elite],
        best_fitness=float(finite.max()) if finite.size else float("nan"),
        mean_fitness=float(finite.mean()) if finite.size else float("nan"),
    )


def crown(state: State, asked: Trials, scores: Scores) -> State:
    """Return the state with the fittest team on record: it is evaluated together once more."""
    team: IntArray = asked.teams[0]
    return replace(
        state,
        fittest_genes=asked.networks()[0].astype(np.float32),
        fittest_active=team >= 0,
        fittest_fitness=np.array(scores.fitness[0], dtype=np.float64),
        fittest_specialization=np.array(scores.specialization[0], dtype=np.float64),
        past_fitness=_push(state.past_fitness, scores.fitness[0]),
        past_specialization=_push(state.past_specialization, np.mean(scores.specialization[0])),
    )


def breed_networks(state: State, elite: IntArray, config: VariationConfig) -> FloatArray:
    """Return children [P, U, M, G] of methods whose genotypes are whole networks.

    Args:
        state: the generation that ends.
        elite: [P, L] elite genotypes, the fittest first.
        config: how to vary.
    """
    _, n_slots, _, n_genes = state.genes.shape
    networks = join(state.genes, int(state.n_hidden[0]))
    children = breed(networks, elite, stream(state.root, "breed", state.generation), config)
    return split(children, n_slots, n_genes)


def advance(
    state: State, genes: FloatArray, active: BoolArray, recombinations: int = 0, **changes: Any
) -> State:
    """Return the first state of the next generation.

    Args:
        state: the generation that ends.
        genes: [P, U, M, G] children.
        active: [P, U] slots in use from now on; all others are emptied.
        recombinations: sub-population pairs recombined between populations.
        changes: further fields that change (thresholds, windows, partners).
    """
    return replace(
        state,
        generation=state.generation + 1,
        phase="genotypes",
        genes=genes * active[:, :, None, None],
        active=active,
        n_hidden=active.sum(axis=1),
        recombinations=recombinations,
        past_recombinations=_push(state.past_recombinations, recombinations),
        **changes,
    )


def _push(past: FloatArray, newest: Any) -> FloatArray:
    """Drop the oldest entry, append the newest; a history of length 0 stays empty."""
    return np.concatenate([past, np.asarray(newest, dtype=np.float64)[None]])[1:]
