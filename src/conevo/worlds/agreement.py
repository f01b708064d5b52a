"""Whether a device agrees with the CPU bit for bit: two teams play some iterations on both.

A driver, a compiler or a card may be at fault, and a run whose results depend on it would not be
reproducible.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import EnvironmentFailure
from conevo.rng import fold, stream
from conevo.worlds.protocol import Outcome
from conevo.worlds.rollout import Rollout

__all__ = ["difference", "random_teams_of", "refuse_other_bits"]

ITERATIONS = 20
_agreed: set[tuple[str, str]] = set()  # devices and fingerprints, in this process


def refuse_other_bits(played: Rollout, device: str) -> None:
    """Refuse a device with other results than the CPU; tried once for a world and controller.

    A team of random networks and one with a heuristic controller in every second robot play the
    same scenario on both.

    Args:
        played: the rollout on the device.
        device: its name.

    Raises:
        EnvironmentFailure: results differ; the first of them is named.
    """
    key = device, played.fingerprint
    if key in _agreed:
        return
    world = played.world
    genes, teams = random_teams_of(played.genome, world.n_robots, 2)
    heuristic = np.full((2, world.n_robots), -1, np.int32)
    if world.heuristics:
        heuristic[1, ::2] = np.arange(len(heuristic[1, ::2])) % len(world.heuristics)
    scenarios = world.scenarios([fold(1, "agreement", 0)])
    of_cpu, of_device = (
        one.evaluate(genes, teams, scenarios, heuristic, iterations=ITERATIONS)
        for one in (Rollout(world, played.controller, 1), played)
    )
    if problem := difference(of_cpu, of_device):
        raise EnvironmentFailure(
            f"device {device!r} gives other results than the CPU in {world.name}: {problem}; play "
            f"on the CPU (--device cpu), and install the newest driver of the device"
        )
    _agreed.add(key)


def difference(of_cpu: Outcome, of_device: Outcome) -> str:
    """Return the first difference between two outcomes, in any bit; nothing if they are equal."""
    for name, here in _arrays(of_cpu).items():
        there = _arrays(of_device)[name]
        differs = _bits(here) != _bits(there)
        if differs.any():
            team, *_ = where = tuple(int(k[0]) for k in np.nonzero(differs))
            return f"{name} of team {team} is {there[where]}, on the CPU {here[where]}"
    return ""


def random_teams_of(
    genome: Any, n_robots: int, n: int
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    """Return a pool of random genotypes and ``n`` teams of controllers made of it [N, R, U]."""
    n_genotypes = n * n_robots * genome.n_parts
    pool = stream(1, "check", "pool").uniform(-1, 1, (n_genotypes, genome.n_genes))
    teams = np.full((n, n_robots, genome.max_parts), -1, dtype=np.int32)
    teams[:, :, : genome.n_parts] = np.arange(n_genotypes).reshape(n, n_robots, -1)
    return pool.astype(np.float32), teams


def _arrays(outcome: Outcome) -> dict[str, npt.NDArray[Any]]:
    found = {name: getattr(outcome, name) for name in ("fitness", "counts", "switches")}
    return found | dict(outcome.performance)


def _bits(values: npt.NDArray[Any]) -> npt.NDArray[np.unsignedinteger[Any]]:
    """Return the bits of values as whole numbers; every NaN has the same ones."""
    if values.dtype.kind == "f":
        values = np.where(np.isnan(values), np.asarray(np.nan, values.dtype), values)
    return np.ascontiguousarray(values).view(f"u{values.dtype.itemsize}")
