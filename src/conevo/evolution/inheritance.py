"""Populations and teams handed on from one task to the next."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from conevo.errors import UsageError
from conevo.evolution.generation import Populations
from conevo.evolution.methods.cone import ConeState
from conevo.evolution.protocol import BoolArray, FloatArray, Layout, Method, State
from conevo.evolution.variation import VariationConfig, mutate, perturb
from conevo.rng import stream
from conevo.terms import counted

__all__ = ["breed_from", "hand_on", "refuse_idle"]

AXES = {"slots": 1, "genotypes per slot": 2, "genes per neuron": 3}  # of Populations.genes


def hand_on(method: Method, layout: Layout, root: int, state: State) -> State:
    """Return generation 0 of a new task, with the populations of ``state``.

    Nitschke 2009, sections 4.3 and 6.4.2: each experiment starts from the last one. Genes and slots
    in use are taken over. Between two generations these are the children of the last one.

    Choice: fitness of different tasks cannot be compared, so windows, histories, partners and
    counters start again, and so do thresholds unless CONE's parameter ``thresholds_from`` keeps
    them. Choice: in a team with more robots than before, population p starts as a copy of
    population p mod P; in a smaller team the last populations are dropped. A method with a function
    ``begin_with(layout, root, genes, active)`` has no populations: it starts around the fittest
    team of the last generation, or from random genotypes if no generation has ended yet. One with
    a function ``inherit(layout, root, state)``, whose genotypes are not networks, takes them over.

    Args:
        method: the method of the new task.
        layout: the size of the new task.
        root: the seed of every random decision from now on.
        state: with the populations; it is not changed.

    Raises:
        UsageError: the numbers of slots, genotypes or genes differ, genotypes are whole networks in
            only one of the two, one of the two has no populations, or ``state`` lacks the
            thresholds that the parameters require.
    """
    if hasattr(method, "inherit"):
        inherited: State = method.inherit(layout, root, state)
        return inherited
    if hasattr(method, "begin_with"):
        ended = state.progress
        return _around(method, layout, root, ended.fittest_genes, ended.fittest_active)
    fresh = method.init(layout, root)
    if not (isinstance(fresh, Populations) and isinstance(state, Populations)):
        who = "the method it is from" if isinstance(fresh, Populations) else method.title
        raise UsageError(
            f"these populations cannot be handed on: {who} has none that consists of controllers"
        )
    old, new = state.genes.shape, fresh.genes.shape
    different = [
        f"{old[axis]} {name} became {new[axis]}"
        for name, axis in AXES.items()
        if old[axis] != new[axis]
    ]
    if state.fitness.ndim != fresh.fitness.ndim:
        different.append("genotypes that are neurons do not mix with whole networks")
    if different:
        raise UsageError(
            f"these populations cannot be handed on: {'; '.join(different)}; use the "
            f"sizes in the settings of the run that they come from"
        )
    source = np.arange(new[0]) % old[0]
    active = state.active[source]
    fresh = _with_thresholds(fresh, method, state)
    return _with(fresh, state.genes[source], active)


def breed_from(
    method: Method, layout: Layout, root: int, genes: FloatArray, active: BoolArray
) -> State:
    """Return generation 0 of a task, with all genotypes bred from one team.

    Choice: population p consists of copies of the team's controller p mod R. All but the first are
    mutated like children, or with normal noise (``start_noise``), so that selection has variation
    and the controller itself is kept. A method with one population takes the R controllers in turn.

    Args:
        method: the method of the task.
        layout: the size of the task.
        root: the seed of every random decision.
        genes: [R, U, G] the team's genes.
        active: [R, U] its slots in use.

    Raises:
        UsageError: the numbers of slots or genes differ from the task's, the method's networks have
            another, fixed size, or it has no populations, or requires thresholds.
    """
    if hasattr(method, "begin_with"):
        return _around(method, layout, root, genes, active)
    fresh = method.init(layout, root)
    if not isinstance(fresh, Populations):
        inherits = "; it starts from its own runs (--from)" if hasattr(method, "inherit") else ""
        raise UsageError(
            f"no population can be bred from this team: {method.title} has none that consists of "
            f"controllers{inherits}"
        )
    fresh = _with_thresholds(fresh, method, None)
    n_populations, n_slots, n_genotypes, n_genes = fresh.genes.shape
    n_robots = len(genes)
    different = [
        f"{found} {name} became {wanted}"
        for name, found, wanted in (
            ("slots", genes.shape[1], n_slots),
            ("genes per neuron", genes.shape[2], n_genes),
        )
        if found != wanted
    ]
    is_whole = fresh.fitness.ndim == 2
    if not different and is_whole and not (active == fresh.active[0]).all():
        different = [
            f"{method.title} has networks of {counted(layout.n_hidden, 'neuron')}, which never grow"
        ]
    if different:
        raise UsageError(f"no population can be bred from this team: {'; '.join(different)}")
    source = np.arange(n_populations)[:, None] + np.zeros(n_genotypes, dtype=np.int64)
    n_kept = 1
    if n_populations == 1:
        source, n_kept = np.arange(n_genotypes)[None], min(n_robots, n_genotypes)
    copies = genes[source % n_robots].swapaxes(1, 2)
    probability, scale, noise = (
        getattr(method.config, name, getattr(VariationConfig, name))
        for name in ("mutation_probability", "mutation_scale", "start_noise")
    )
    generator = stream(root, "champion")
    if noise:
        bred = perturb(copies, noise, generator)
    else:
        bred = mutate(copies, probability, scale, generator)
    bred[:, :, :n_kept] = copies[:, :, :n_kept]
    kept = fresh.active if is_whole else active[source[:, 0] % n_robots]
    return _with(fresh, bred * kept[:, :, None, None], kept)


def refuse_idle(config: Any, place: str = "here") -> None:
    """Refuse parameters of a method that have no effect in a run without a team to breed from.

    Args:
        config: the method's parameters.
        place: where they are set, for the message.

    Raises:
        UsageError: the method has such a parameter.
    """
    if noise := getattr(config, "start_noise", 0.0):
        raise UsageError(
            f"method.start_noise = {noise:g} does nothing {place}: it is for populations bred from "
            f"a champion (conevo run --from-champion RUN)"
        )


def _with_thresholds(fresh: Populations, method: Method, state: State | None) -> Populations:
    """Return generation 0 with the thresholds of a state, if CONE's parameters require them.

    Raises:
        UsageError: the state has none.
    """
    if not isinstance(fresh, ConeState) or method.config.thresholds_from == "settings":
        return fresh
    found: dict[str, Any] = {
        name: getattr(state, name, math.nan)
        for name in ("sst", "gst")
        if not math.isnan(getattr(fresh, name))
    }
    if missing := [name for name, value in found.items() if math.isnan(value)]:
        raise UsageError(
            f"method.thresholds_from = 'ancestor': the origin of this run has no {missing[0]} "
            f"(populations of a method with that threshold have one, a champion has none)"
        )
    return replace(fresh, **found)


def _around(method: Any, layout: Layout, root: int, genes: FloatArray, active: BoolArray) -> State:
    """Return generation 0 of a method that starts around a team [R, U, G], not with populations.

    Raises:
        UsageError: the number of slots or genes differs from the layout's.
    """
    wanted = (layout.max_hidden, layout.n_genes)
    different = [
        f"{found} {name} became {right}"
        for name, found, right in zip(
            ("slots", "genes per neuron"), genes.shape[1:], wanted, strict=True
        )
        if found != right
    ]
    if different:
        raise UsageError(f"{method.title} cannot start from this team: {'; '.join(different)}")
    state: State = (
        method.begin_with(layout, root, genes, active)
        if active.any()
        else method.init(layout, root)
    )
    return state


def _with(fresh: Populations, genes: FloatArray, active: BoolArray) -> Populations:
    """Return generation 0 with these genotypes [P, U, M, G] and slots [P, U] in use."""
    progress = replace(fresh.progress, n_hidden=active.sum(axis=1))
    return replace(fresh, progress=progress, genes=genes, active=active)
