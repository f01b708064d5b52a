"""What populations take with them from one task into the next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from conevo.errors import UsageError
from conevo.evolution.protocol import Layout, Method, State

__all__ = ["hand_on"]

AXES = {"slots": 1, "genotypes per slot": 2, "genes per neuron": 3}  # of State.genes


def hand_on(method: Method, layout: Layout, root: int, state: State) -> State:
    """Return generation 0 of a new task, its populations those that ``state`` has.

    Nitschke 2009, sections 4.3 and 6.4.2: each experiment starts from the last. Genes and slots in
    use are taken over; of a state between two generations these are the children of the last one.

    Choice: fitness of different tasks does not compare, so thresholds, windows, histories, partners
    and counters begin anew. Choice: in a team with more robots than before population p begins as
    a copy of population p mod P; in a smaller one the last populations are left behind.

    Args:
        method: the method of the new task.
        layout: the size of the new task.
        root: the seed of every random decision from now on.
        state: what to begin with; it is not changed.

    Raises:
        UsageError: slots, genotypes or genes are not as many as before, or genotypes are whole
            networks in one of the two only.
    """
    fresh = method.init(layout, root)
    old, new = state.genes.shape, fresh.genes.shape
    different = [
        f"{old[axis]} {name} became {new[axis]}"
        for name, axis in AXES.items()
        if old[axis] != new[axis]
    ]
    if state.fitness.ndim != fresh.fitness.ndim:
        different.append("single neurons and whole networks are no genotypes of one kind")
    if different:
        raise UsageError(f"these populations cannot be handed on: {'; '.join(different)}")
    source = np.arange(new[0]) % old[0]
    active = state.active[source]
    return replace(fresh, genes=state.genes[source], active=active, n_hidden=active.sum(axis=1))
