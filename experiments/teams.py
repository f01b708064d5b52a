"""Teams that the measurement scripts play: heuristic clones, random networks, champions of runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

import conevo
from conevo.controllers.registry import genome_of
from conevo.evolution.population import random_genes
from conevo.rng import fold, stream
from conevo.worlds.protocol import Outcome, World

Numbers = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Teams:
    """Teams of several kinds: genes [K, G], slots [N, R, U], heuristic [N, R], kind of each."""

    genes: npt.NDArray[np.float32]
    slots: npt.NDArray[np.int32]
    heuristic: npt.NDArray[np.int32]
    kinds: tuple[str, ...]

    def of(self, kind: str) -> list[int]:
        """Return the numbers of the teams of a kind."""
        return [n for n, k in enumerate(self.kinds) if k == kind]

    def one(self, n: int) -> Teams:
        """Return a single team."""
        some = slice(n, n + 1)
        return Teams(self.genes, self.slots[some], self.heuristic[some], self.kinds[some])

    def only(self, kind: str) -> Teams:
        """Return the teams of a kind."""
        some = self.of(kind)
        return Teams(self.genes, self.slots[some], self.heuristic[some], (kind,) * len(some))

    def without(self, numbers: Sequence[int]) -> Teams:
        """Return all teams except those with these numbers."""
        some = [n for n in range(len(self.kinds)) if n not in numbers]
        kinds = tuple(self.kinds[n] for n in some)
        return Teams(self.genes, self.slots[some], self.heuristic[some], kinds)

    def __add__(self, other: Teams) -> Teams:
        """Return the teams of both."""
        moved = np.where(other.slots >= 0, other.slots + len(self.genes), -1).astype(np.int32)
        return Teams(
            np.concatenate([self.genes, other.genes]),
            np.concatenate([self.slots, moved]),
            np.concatenate([self.heuristic, other.heuristic]),
            self.kinds + other.kinds,
        )


def controlled(world: World, kind: str, who: Any) -> Teams:
    """Return one team without networks; ``who`` are its heuristic controllers [R], or one."""
    genome, r = genome_of(conevo.controller(world=world), world), world.n_robots
    return Teams(
        np.zeros((1, genome.n_genes), dtype=np.float32),
        np.full((1, r, genome.max_parts), -1, dtype=np.int32),
        np.broadcast_to(np.asarray(who, dtype=np.int32), (1, r)),
        (kind,),
    )


def random_networks(world: World, n: int, seed: int, *where: str) -> Teams:
    """Return teams of random networks of the initial size, every robot different."""
    genome, r = genome_of(conevo.controller(world=world), world), world.n_robots
    rows = (r * genome.n_parts, genome.n_genes)
    genes = [random_genes(stream(seed, *where, "team", k), rows) for k in range(n)]
    slots = np.full((n, r, genome.max_parts), -1, dtype=np.int32)
    slots[:, :, : genome.n_parts] = np.arange(n * rows[0]).reshape(n, r, genome.n_parts)
    modes = np.full((n, r), -1, dtype=np.int32)
    return Teams(np.concatenate(genes), slots, modes, ("random",) * n)


def random_clones(world: World, n: int, seed: int, *where: str) -> Teams:
    """Return teams whose robots all have the same random network of the initial size."""
    genome, r = genome_of(conevo.controller(world=world), world), world.n_robots
    genes = random_genes(stream(seed, *where, "clones"), (n * genome.n_parts, genome.n_genes))
    slots = np.full((n, r, genome.max_parts), -1, dtype=np.int32)
    slots[:, :, : genome.n_parts] = np.arange(len(genes)).reshape(n, 1, genome.n_parts)
    return Teams(genes, slots, np.full((n, r), -1, dtype=np.int32), ("clones",) * n)


def champion(run: conevo.Run, kind: str) -> Teams:
    """Return the fittest team of a run."""
    if run.champion is None:
        raise SystemExit(f"{run.path} has no champion yet")
    if run.config.controller != conevo.controller(world=run.config.build_world()):
        raise SystemExit(f"{run.path} has other controllers than its world suggests")
    pool, slots = run.champion.as_trial()
    return Teams(pool, slots, np.full(slots.shape[:2], -1, dtype=np.int32), (kind,))


def play(world: World, teams: Teams, keys: Sequence[int], threads: int | None = 1) -> Outcome:
    """Run all teams in the scenarios with these keys."""
    rollout = conevo.Rollout(world, n_threads=threads)
    return rollout.evaluate(teams.genes, teams.slots, world.scenarios(keys), teams.heuristic)


def keys_of(seed: int, n: int, *where: str) -> list[int]:
    """Return the keys of n scenarios of a measurement."""
    return [fold(seed, *where, "scenario", k) for k in range(n)]


def error(values: Numbers) -> float:
    """Return the standard error of the mean."""
    return float(values.std(ddof=1) / len(values) ** 0.5) if len(values) > 1 else float("nan")


def sample(values: npt.NDArray[Any], rows: list[int]) -> Numbers:
    """Return the values for a standard error: scenarios of one team, or means of the teams."""
    some = values[rows].astype(np.float64)
    return some.mean(axis=1) if len(some) > 1 else some[0]


def ratio(changed: Numbers, default: Numbers) -> tuple[float, float]:
    """Return the ratio of two means of pairs and its standard error (delta method)."""
    if default.mean() == 0:
        return float("nan"), float("nan")
    quotient = float(changed.mean() / default.mean())
    return quotient, error(changed - quotient * default) / float(default.mean())
