"""The best team of heuristic robots in gathering and construction, found by a search.

The ten teams of one heuristic and 190 random mixes play a few scenarios. The ten that deliver most
and ten neighbours of each play more, new scenarios; the best ten of these play still more
(``ROUNDS``).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from conevo.rng import stream
from conevo.worlds.gacc.world import GaccWorld
from teams import Teams, controlled, keys_of, play

ROUNDS = ((200, 10), (110, 40), (10, 200))  # mixes and scenarios of each
BRED, NEIGHBOURS = 10, 10  # mixes with neighbours after the first round, and neighbours of each
Mix = tuple[int, ...]  # robots of each heuristic


def candidate(world: GaccWorld, seed: int, k: int) -> Mix:
    """Return candidate k: first the teams of one heuristic, then random shares of useful ones."""
    if k < len(world.heuristics):
        return tuple(world.n_robots * (h == k) for h in range(len(world.heuristics)))
    rng, useful = stream(seed, "mixes", world.environment, k), useful_in(world)
    mix = np.zeros(len(world.heuristics), dtype=int)
    mix[useful] = rng.multinomial(world.n_robots, rng.dirichlet(np.full(len(useful), 0.5)))
    return tuple(mix.tolist())


def useful_in(world: GaccWorld) -> list[int]:
    """Return the heuristics for types in the plan, and the non-specialized one."""
    types = sorted(set(world.plan.parts.ravel().tolist()))
    return [3 * row + kind for row in range(3) for kind in types] + [9]


def neighbour(world: GaccWorld, mix: Mix, seed: int, k: int) -> Mix:
    """Return a mix in which up to eight robots follow a different heuristic."""
    rng = stream(seed, "mixes", world.environment, "neighbour", *map(str, mix), k)
    found = list(mix)
    loses = rng.choice(np.flatnonzero(mix))
    n = min(int(rng.integers(1, 9)), found[loses])
    found[loses] -= n
    found[rng.choice(useful_in(world))] += n
    return tuple(found)


def team_of(world: GaccWorld, mix: Mix, kind: str = "best mix") -> Teams:
    """Return the team of a mix."""
    return controlled(world, kind, np.repeat(np.arange(len(mix)), mix))


def written(world: GaccWorld, mix: Mix) -> str:
    """Return a mix in words."""
    return ", ".join(f"{n} {name}" for name, n in zip(world.heuristics, mix, strict=True) if n)


@cache
def best(world: GaccWorld, seed: int = 1) -> Mix:
    """Return the mix that delivers the most objects."""
    mixes = list(dict.fromkeys(candidate(world, seed, k) for k in range(ROUNDS[0][0])))
    for number, (n_mixes, n_scenarios) in enumerate(ROUNDS):
        if number == 1:
            pairs = ((mix, k) for mix in mixes[:BRED] for k in range(NEIGHBOURS))
            bred = [neighbour(world, mix, seed, k) for mix, k in pairs]
            mixes = list(dict.fromkeys([*mixes[:BRED], *bred]))
        mixes = mixes[:n_mixes]
        teams = team_of(world, mixes[0])
        for mix in mixes[1:]:
            teams += team_of(world, mix)
        keys = keys_of(seed, n_scenarios, "mixes", str(number))
        delivered = play(world, teams, keys).performance["delivered"].mean(axis=1)
        mixes = [mixes[k] for k in np.argsort(-delivered, kind="stable")]
    return mixes[0]
