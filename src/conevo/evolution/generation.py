"""The steps of a generation of populations: begin, count, grade, crown, advance.

Nitschke 2009, chapter 3. A generation has several phases: "genotypes" (type A fitness), for CONE
"elites" (type C), "fittest" (each population's fittest controller, together once more) and, when a
controller's size is in question, "lesion".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from conevo.errors import UsageError
from conevo.evolution.population import join, random_genes, ranking, split
from conevo.evolution.protocol import (
    BoolArray,
    FloatArray,
    IntArray,
    Layout,
    Progress,
    Scores,
    Trials,
)
from conevo.evolution.variation import VariationConfig, breed
from conevo.parameters import parameters
from conevo.rng import stream

__all__ = [
    "Populations",
    "StartConfig",
    "advance",
    "begin",
    "breed_networks",
    "count",
    "crown",
    "grade",
    "note",
    "pool",
    "push",
    "trials",
]

FITTEST = ("fittest", "lesion")  # phases in which the fittest team plays


@parameters("method")
class StartConfig:
    """How several populations start."""

    common_start: bool = False
    """whether random populations start as copies of the first one; they then drift apart.
    Populations from another run (``--from``, shaping) are not random. Choice: off; section 3.7 only
    states that n populations are initialized."""


@dataclass(frozen=True)
class Populations:
    """State of methods with populations of neurons or networks; some of them add fields.

    Arrays with a U axis have all ``max_hidden`` slots; empty slots contain zeros. Where genotypes
    are whole networks (HomCNE, HetCNE, CCGA) they have one fitness each, so ``fitness`` and
    ``elite`` lack the U axis.

    Attributes:
        progress: the header.
        phase: the phase of the next trials.
        genes: [P, U, M, G] float32 genotypes in [-1, 1].
        active: [P, U] the slots (sub-populations) in use.
        fitness: [P, U, M] or [P, M] float64 fitness of this generation (type A; C overwrites it).
        elite: [P, U, L] or [P, L] int32 genotypes of the elite portion, the fittest first; L = 0
            before the first generation is graded.
    """

    progress: Progress
    phase: str
    genes: FloatArray
    active: BoolArray
    fitness: FloatArray
    elite: IntArray

    @property
    def root(self) -> int:
        """The seed of every random decision."""
        return self.progress.root

    @property
    def generation(self) -> int:
        """The generation being evaluated, from 0."""
        return self.progress.generation

    def problem(self, first: Populations) -> str:
        """Return the first field that is not valid in a state between generations, if any.

        Args:
            first: generation 0 of the same run.
        """
        grows = {"elite": -1, "partners": -2}  # empty in generation 0
        for field in fields(self):
            found, right = getattr(self, field.name), getattr(first, field.name)
            if isinstance(right, np.ndarray):
                length = grows.get(field.name)
                if found.shape[:length] != right.shape[:length]:
                    return field.name
                if field.name in ("genes", "partners") and not (np.abs(found) <= 1).all():
                    return field.name
        if not ((self.elite >= 0) & (self.elite < self.genes.shape[2])).all():
            return "elite"
        if self.progress.n_hidden.shape != first.progress.n_hidden.shape:
            return "n_hidden"
        return "phase" if self.phase != first.phase else ""


Kind = TypeVar("Kind", bound=Populations)


def begin(
    kind: type[Kind],
    layout: Layout,
    root: int,
    *,
    n_populations: int,
    n_genotypes: int,
    networks: bool = False,
    common_start: bool = False,
    **own: Any,
) -> Kind:
    """Return generation 0: random genotypes in the first ``n_hidden`` slots.

    Args:
        kind: the method's state.
        layout: the size of the problem.
        root: the seed of every random decision.
        n_populations: P, one per robot or 1.
        n_genotypes: M, genotypes per slot.
        networks: whether a genotype is a whole network, so that fitness has no U axis.
        common_start: whether all populations are copies of the first.
        own: further fields of the method's state.
    """
    shape = (n_populations, layout.max_hidden, n_genotypes, layout.n_genes)
    active = np.zeros(shape[:2], dtype=np.bool_)
    active[:, : layout.n_hidden] = True
    graded = (n_populations,) if networks else active.shape
    genes = random_genes(stream(root, "genotypes"), shape)
    if common_start:
        genes = genes[:1]
    return kind(
        progress=Progress.first(layout, root, n_populations),
        phase="genotypes",
        genes=genes * active[:, :, None, None],
        active=active,
        fitness=np.full((*graded, n_genotypes), np.nan),
        elite=np.zeros((*graded, 0), dtype=np.int32),
        **own,
    )


def pool(state: Populations, partners: FloatArray | None = None) -> FloatArray:
    """Return the neuron genotypes as one list of rows, [P * U * M, G].

    Args:
        state: with the genotypes.
        partners: [P, U, L, G] further genotypes, which come after these.
    """
    rows: FloatArray = state.genes.reshape(-1, state.genes.shape[-1])
    if partners is None or not partners.size:
        return rows
    return np.concatenate([rows, partners.reshape(-1, rows.shape[-1])])


def trials(
    state: Populations, teams: IntArray, genes: FloatArray | None = None, rounds: int = 1
) -> Trials:
    """Return ``teams`` as the state's trials, over its own pool unless another is given.

    The fittest teams of all generations meet the same scenarios.
    Choice: so do their lesions, so that a neuron is not removed because of one lucky scenario.
    """
    return Trials(
        generation=state.generation,
        genes=pool(state) if genes is None else genes,
        teams=teams,
        scenarios="fixed" if state.phase in FITTEST else "fresh",
        portrait=state.phase == "fittest",
        rounds=rounds,
        purpose=state.phase,
    )


def count(state: Kind, asked: Trials, scores: Scores) -> Kind:
    """Return the state with the evaluation counted, after checking that it is of these trials."""
    if (asked.purpose, asked.generation) != (state.phase, state.generation):
        raise UsageError(
            f"these scores are for phase {asked.purpose!r} of generation {asked.generation}, "
            f"the state waits for {state.phase!r} of {state.generation}"
        )
    is_first = state.phase == "genotypes"
    return replace(state, progress=state.progress.counted(asked, scores, is_first=is_first))


def grade(state: Kind, fitness: FloatArray, n_elite: int, phase: str) -> Kind:
    """Return the state with its type A fitness and its elite portion.

    Args:
        state: in phase "genotypes".
        fitness: [P, U, M] or [P, M]; NaN without a genotype.
        n_elite: L.
        phase: the next one.
    """
    return replace(
        state,
        progress=state.progress.graded(fitness),
        phase=phase,
        fitness=fitness,
        elite=ranking(fitness)[..., :n_elite],
    )


def crown(state: Kind, asked: Trials, scores: Scores, **changes: Any) -> Kind:
    """Return the state with its fittest team recorded, after its evaluation as a team.

    Args:
        state: in phase "fittest".
        asked: the fittest team.
        scores: of it.
        changes: further fields that change (windows).
    """
    return replace(state, progress=state.progress.crowned(asked, scores), **changes)


def breed_networks(state: Populations, elite: IntArray, config: VariationConfig) -> FloatArray:
    """Return children [P, U, M, G] of methods whose genotypes are whole networks.

    Args:
        state: the generation that ends.
        elite: [P, L] elite genotypes, the fittest first.
        config: how to vary.
    """
    _, n_slots, _, n_genes = state.genes.shape
    networks = join(state.genes, int(state.progress.n_hidden[0]))
    children = breed(networks, elite, stream(state.root, "breed", state.generation), config)
    return split(children, n_slots, n_genes)


def advance(
    state: Kind,
    genes: FloatArray,
    active: BoolArray,
    numbers: Mapping[str, float] | None = None,
    **changes: Any,
) -> Kind:
    """Return the first state of the next generation.

    Args:
        state: the generation that ends.
        genes: [P, U, M, G] children.
        active: [P, U] slots in use from now on; all others are emptied.
        numbers: further numbers that the log records of the generation that ends.
        changes: further fields that change (windows, partners).
    """
    progress = replace(
        state.progress.with_numbers(**(numbers or {})),
        generation=state.generation + 1,
        n_hidden=active.sum(axis=1),
    )
    return replace(
        state,
        progress=progress,
        phase="genotypes",
        genes=genes * active[:, :, None, None],
        active=active,
        **changes,
    )


def note(state: Kind, **numbers: float) -> Kind:
    """Return the state with further numbers that the log records of the generation."""
    return replace(state, progress=state.progress.with_numbers(**numbers))


def push(past: FloatArray, newest: Any) -> FloatArray:
    """Return a window without its oldest entry and with a new one; one of length 0 stays empty."""
    return np.concatenate([past, np.asarray(newest, dtype=np.float64)[None]])[1:]
