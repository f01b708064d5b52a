"""Team assembly: teams as rows of a pool of neuron genotypes.

The pool is ``genes.reshape(-1, G)``, so genotype m of slot u of population p is row
``(p * U + u) * M + m``; a second pool may be appended at an ``offset``. An empty slot is -1.
Methods with one population (P = 1) take every robot's genotypes from it.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from conevo.evolution.protocol import BoolArray, IntArray
from conevo.parameters import WrongValue, parameters
from conevo.rng import stream

__all__ = [
    "SchemeConfig",
    "best_team",
    "distinct",
    "elite_teams",
    "lesion_teams",
    "on_trial",
    "place_on_trial",
    "rows",
    "shared",
    "systematic",
]


@parameters("method")
class SchemeConfig:
    """How genotypes of several populations are tried in teams, the same for all such methods."""

    evaluation: Literal["systematic", "shared"] = "systematic"
    """how genotypes are tried: "systematic" tries every genotype once (section 3.3.1), in R x M
    teams if it is a whole network, in R x U x M if it is a neuron; "shared" draws rounds x M
    complete teams in which every genotype takes part ``rounds`` times, the scheme published with
    ESP itself."""
    rounds: Annotated[int, Ge(1), Le(10_000)] = 10
    """K, trials of each genotype under "shared". More makes fitness less noisy. Choice: 10, as in
    ESP."""
    fresh_rounds: bool = True
    """whether each round has its own scenarios: with the same number of evaluations every genotype
    meets ``rounds`` times the number of scenarios, and all genotypes meet the same ones. Choice:
    on, since without it co-evolved teams do not learn the shipped example."""

    partners: Literal["by_scheme", "elite", "any"] = "by_scheme"
    """partners of a genotype on trial: genotypes of the previous generation's elite portion
    ("elite", 5.3.3), or "any" of its own generation (3.3.1). Choice: "by_scheme" is "elite" under
    "systematic", for all methods with several populations; under "shared" all members of a team are
    on trial, so it is "any" there and "elite" is refused."""

    def __post_init__(self) -> None:
        """Refuse partners that do not exist under the scheme."""
        if self.evaluation == "shared" and self.partners == "elite":
            raise WrongValue(
                "partners",
                "method.partners = 'elite'",
                'has no effect with evaluation = "shared", where a whole team is on trial',
            )

    @property
    def has_elite_partners(self) -> bool:
        """Whether the elite portion of a generation plays with the genotypes of the next one."""
        return self.evaluation == "systematic" and self.partners != "any"

    @property
    def n_parts(self) -> int:
        """The number of parts of a generation's teams with separate scenarios."""
        return self.rounds if self.evaluation == "shared" and self.fresh_rounds else 1


def rows(active: BoolArray, choice: IntArray, n_genotypes: int, offset: int = 0) -> IntArray:
    """Return the pool rows [..., R, U] of chosen genotypes, -1 in empty slots.

    Args:
        active: [P, U] slots in use; P = R or 1.
        choice: [..., R, U] genotype numbers, or [..., R, 1] for whole networks.
        n_genotypes: M, genotypes per slot in the pool.
        offset: first row of the pool.
    """
    slots = np.arange(active.size, dtype=np.int32).reshape(active.shape)
    found = (slots * n_genotypes + offset) + choice.astype(np.int32, copy=False)
    return np.where(active, found, np.int32(-1))


def on_trial(active: BoolArray, n_genotypes: int) -> tuple[IntArray, IntArray, IntArray]:
    """Return population, slot and genotype [N] on trial in each team of ``systematic``."""
    population, slot = np.nonzero(active)
    genotype = np.tile(np.arange(n_genotypes), len(population))
    return population.repeat(n_genotypes), slot.repeat(n_genotypes), genotype


def systematic(
    active: BoolArray,
    n_genotypes: int,
    generator: np.random.Generator,
    n_partners: int = 0,
    *,
    networks: bool = False,
) -> IntArray:
    """Return one team per genotype, [N, P, U], with every other place filled at random.

    Nitschke 2009, 3.3.1: genotype g with random genotypes of its population's other
    sub-populations, and controllers of random genotypes of the other populations.

    Args:
        active: [P, U] slots in use.
        n_genotypes: M.
        generator: the source of the random partners.
        n_partners: L, partners per slot in a second pool behind the first, from which the other
            places are filled; 0: from the first.
        networks: whether a genotype is a whole network, so that all slots of a population have the
            same number.
    """
    tried = active[:, :1] if networks else active
    population, slot, genotype = on_trial(tried, n_genotypes)
    n_from, offset = (n_partners, active.size * n_genotypes) if n_partners else (n_genotypes, 0)
    shape = (len(population), *tried.shape)
    teams = rows(active, generator.integers(n_from, size=shape, dtype=np.int32), n_from, offset)
    own = rows(active, genotype[:, None, None], n_genotypes)
    place = np.arange(len(population)), population, slice(None) if networks else slot
    teams[place] = own[place]
    return teams


def place_on_trial(root: int, generation: int, n_robots: int) -> int:
    """Return the robot whose credit counts in all teams of a generation.

    Choice: it is drawn for each generation, so that all genotypes of a generation are compared in
    the same place, and genotypes are not bred for one place where robots start in different places.
    """
    return int(stream(root, "place", generation).integers(n_robots))


def shared(
    active: BoolArray,
    n_genotypes: int,
    rounds: int,
    generator: np.random.Generator,
    *,
    networks: bool = False,
) -> IntArray:
    """Return ``rounds`` x M teams [N, P, U] in which every genotype plays exactly ``rounds`` times.

    Each round is a new permutation of every sub-population (with ``networks``: of every
    population's whole networks), as in ESP (Gomez; Yong and Miikkulainen).
    """
    n_populations, n_slots = active.shape
    shape = (rounds, n_populations, 1 if networks else n_slots, n_genotypes)
    order = np.broadcast_to(np.arange(n_genotypes, dtype=np.int32), shape)
    choice = np.moveaxis(generator.permuted(order, axis=-1), -1, 1)
    return rows(active, choice.reshape(rounds * n_genotypes, *shape[1:3]), n_genotypes)


def elite_teams(
    active: BoolArray, elite: IntArray, n_genotypes: int, generator: np.random.Generator
) -> IntArray:
    """Return P x L teams [N, P, U] for type C fitness; ``i * L + l`` is for population i, rank l.

    Nitschke 2009, 3.3.2: controller i from the genotypes of equal rank l in its sub-populations,
    the other controllers from random genotypes of the elite portions.

    Args:
        active: [P, U] slots in use.
        elite: [P, U, L] elite genotypes, the fittest first.
        n_genotypes: M.
        generator: the source of the random partners.
    """
    n_populations, n_slots, n_elite = elite.shape
    size = (n_populations, n_elite, n_populations, n_slots)
    rank = generator.integers(n_elite, size=size, dtype=np.int32)
    for population in range(n_populations):
        rank[population, :, population] = np.arange(n_elite)[:, None]
    first = np.arange(0, elite.size, n_elite).reshape(n_populations, n_slots)
    choice = elite.ravel()[first + rank]
    return rows(active, choice.reshape(-1, n_populations, n_slots), n_genotypes)


def best_team(active: BoolArray, elite: IntArray, n_genotypes: int) -> IntArray:
    """Return the fittest team [1, P, U]: the first of the elite in every slot.

    It has the controller of greatest utility of each population (type B fitness, Nitschke 2009,
    eq. 3.8): the sum over slots is greatest if every term is.
    """
    return rows(active, elite[None, :, :, 0], n_genotypes)


def lesion_teams(team: IntArray, suspects: BoolArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the complete fittest team, then its lesions, each without one neuron.

    Nitschke 2009, section 3.6. Choice: the complete team is evaluated with its lesions, in the same
    scenarios; otherwise the comparison would depend on the luck of different scenarios.

    Args:
        team: [R, U] rows of the fittest team.
        suspects: [R] the robots whose neurons are lesioned, one at a time.

    Returns:
        Teams [1 + N, R, U], and the robot and the slot [N] that each but the first lacks.
    """
    robot, slot = np.nonzero((team >= 0) & suspects[:, None])
    teams = np.repeat(team[None], 1 + len(robot), axis=0)
    teams[1 + np.arange(len(robot)), robot, slot] = -1
    return teams, robot, slot


def distinct(n_teams: int, n_members: int, n_from: int, generator: np.random.Generator) -> IntArray:
    """Return ``n_teams`` draws of ``n_members`` different numbers below ``n_from``, [N, members].

    The numbers are dealt from shuffled decks, so all are used about equally often.
    """
    if n_members == 0:
        return np.empty((n_teams, 0), dtype=np.int32)
    hands = n_from // n_members
    decks = -(-n_teams // hands)
    deck = np.broadcast_to(np.arange(n_from, dtype=np.int32), (decks, n_from))
    dealt = generator.permuted(deck, axis=1)[:, : hands * n_members]
    return dealt.reshape(-1, n_members)[:n_teams]
