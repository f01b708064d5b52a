"""The referee of ``worlds.gacc.world``, which decides about objects that robots hold.

Objects that are ready to be built in compete for places in a plan, so one lane decides about them
in their order. Lanes share all other work.
"""

import warp as wp

from conevo.kernels.phases import Phase
from conevo.kernels.sets import has, lowest, one, part_of, without_lowest
from conevo.worlds.gacc.state import (
    CARRIED,
    CONSTRUCT,
    DELIVERED,
    DROPPED,
    GATHER,
    GRIPPED,
    HELPED,
    LYING,
    N_CASTES,
    NONE,
    WAITING,
    GaccConstants,
    GaccScene,
    GaccTeam,
    is_home,
    object_parts,
    release,
    robot_parts,
)

__all__ = ["RESOLVE"]


@wp.func
def place_for(team: GaccTeam, scene: GaccScene, p: GaccConstants, kind: int) -> int:
    """Return the first complex object that needs a part of this type now, or NONE."""
    parts = scene.plan.shape[1]
    for c in range(p.n_complex):
        if team.built[c] < parts:
            if ((p.ordered >> c) & 1) != 0:
                if scene.plan[c, team.built[c]] == kind:
                    return c
            elif team.missing[3 * c + kind] > 0:
                return c
    return NONE


@wp.func
def let_go(team: GaccTeam, i: int) -> None:
    """Open robot ``i``'s gripper in the home area; it avoids the object until it has left."""
    team.dropped[i] = team.held[i]
    team.waited[i] = 0
    release(team, i)


@wp.func
def build(team: GaccTeam, scene: GaccScene, p: GaccConstants, k: int, c: int) -> None:
    """Make object ``k`` the next part of complex object ``c`` and credit all that hold it."""
    kind = scene.object_type[k]
    parts = scene.plan.shape[1]
    step = team.built[c]
    team.part[k] = c * parts + step
    team.built[c] = step + 1
    team.missing[3 * c + kind] = team.missing[3 * c + kind] - 1
    team.life[k] = DELIVERED
    team.object_x[k] = 0.5 + p.zone_side * ((float(step) + 0.5) / float(parts) - 0.5)
    team.object_y[k] = 0.5 + p.zone_side * ((float(c) + 0.5) / float(p.n_complex) - 0.5)
    rest = team.holders[k]
    while rest != wp.uint64(0):
        j = lowest(rest)
        spent = team.waited[j] + 1
        row = j * N_CASTES
        team.counts[row + GATHER + kind] = team.counts[row + GATHER + kind] - spent
        team.counts[row + CONSTRUCT + kind] = team.counts[row + CONSTRUCT + kind] + spent
        team.fitness[j] = team.fitness[j] + 1.0
        team.waited[j] = 0
        release(team, j)
        rest = without_lowest(rest)
    team.holders[k] = wp.uint64(0)


@wp.func
def signal(team: GaccTeam, scene: GaccScene, p: GaccConstants) -> None:
    """Set the demand for each type (6.2.3): how soon it is needed, over the number missing.

    Choice: the demand of a complex object of two parts or more for a type is 1 / steps until its
    next use if it has an order, else 1. The team senses the strongest, divided as in eqs 6.4 to
    6.6.
    """
    parts = scene.plan.shape[1]
    for kind in range(3):
        strongest = float(0.0)
        missing = int(0)
        for c in range(p.n_complex):
            missing += team.missing[3 * c + kind]
            if team.built[c] >= 2 and team.missing[3 * c + kind] > 0:
                steps = int(1)
                if ((p.ordered >> c) & 1) != 0:
                    while scene.plan[c, wp.min(team.built[c] + steps, parts) - 1] != kind:
                        steps += 1
                strongest = wp.max(strongest, 1.0 / float(steps))
        team.demand[kind] = 0.0
        if missing > 0:
            team.demand[kind] = strongest / float(missing)
    team.has_news[0] = 1


# --- the phases ---------------------------------------------------------------------------------


@wp.func
def count_holders(team: GaccTeam, scene: GaccScene, p: GaccConstants, q: int, t: int) -> None:
    """List the objects that robots of part ``q`` hold, and those that several robots hold."""
    rest = part_of(team.carriers[0], q)
    while rest != wp.uint64(0):
        j = lowest(rest)
        k = team.held[j]
        wp.atomic_or(team.taken, 0, one(k))
        if wp.atomic_or(team.holders, k, one(j)) != wp.uint64(0):
            wp.atomic_or(team.shared, 0, one(k))
        rest = without_lowest(rest)


@wp.func
def judge(team: GaccTeam, scene: GaccScene, p: GaccConstants, q: int, t: int) -> None:
    """Build in or refuse objects held by several robots at home, which compete for places."""
    team.waiting[0] = wp.uint64(0)
    has_built = int(0)
    rest = team.shared[0]
    team.shared[0] = wp.uint64(0)
    while rest != wp.uint64(0):
        k = lowest(rest)
        rest = without_lowest(rest)
        if is_home(p, team.object_x[k], team.object_y[k]):
            kind = scene.object_type[k]
            c = place_for(team, scene, p, kind)
            if c >= 0:
                if int(wp.bit_count(team.holders[k])) >= 2 + kind:
                    build(team, scene, p, k, c)
                    has_built = 1
            else:
                those = team.holders[k]
                while those != wp.uint64(0):
                    let_go(team, lowest(those))
                    team.situation[lowest(those)] = 4
                    those = without_lowest(those)
                team.holders[k] = wp.uint64(0)
    if has_built != 0:
        signal(team, scene, p)


@wp.func
def end_waits(team: GaccTeam, scene: GaccScene, p: GaccConstants, q: int, t: int) -> None:
    """Make those robots of part ``q`` let go that have waited for too long."""
    rest = part_of(team.carriers[0], q)
    while rest != wp.uint64(0):
        j = lowest(rest)
        if team.waited[j] >= p.wait:
            wp.atomic_and(team.holders, team.held[j], ~one(j))
            let_go(team, j)
        rest = without_lowest(rest)


@wp.func
def name_lives(team: GaccTeam, scene: GaccScene, p: GaccConstants, q: int, t: int) -> None:
    """Set the life of those objects of part ``q`` that a robot holds or has held."""
    rest = part_of(team.taken[0], q)
    while rest != wp.uint64(0):
        k = lowest(rest)
        at_home = is_home(p, team.object_x[k], team.object_y[k])
        life = team.life[k]
        n = int(wp.bit_count(team.holders[k]))
        if n == 0:
            if life >= GRIPPED and life <= HELPED:
                life = DROPPED
            wp.atomic_and(team.taken, 0, ~one(k))
        elif at_home:
            life = wp.where(n == 1, WAITING, HELPED)
            wp.atomic_or(team.waiting, 0, team.holders[k])
        elif life != CARRIED:
            life = GRIPPED
        team.life[k] = life
        team.holders[k] = wp.uint64(0)
        is_lying = life == LYING or life == DROPPED
        if is_lying != has(team.lying[0], k):
            wp.atomic_or(team.changed, 0, one(k))
            if not is_lying:
                wp.atomic_and(team.lying, 0, ~one(k))
                wp.atomic_and(team.lying_home, 0, ~one(k))
            else:
                wp.atomic_or(team.lying, 0, one(k))
                if at_home:
                    wp.atomic_or(team.lying_home, 0, one(k))
        rest = without_lowest(rest)


RESOLVE = (
    Phase(count_holders, robot_parts),
    Phase(judge, 1),
    Phase(end_waits, robot_parts),
    Phase(name_lives, object_parts),
)
