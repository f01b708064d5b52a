"""A team of predators in recorded epochs: their behaviour and sensing.

Nitschke 2009, section 4.6.1 and appendix B: the fittest team is executed again in 20 fresh
scenarios, those of the testing phase, and everything is recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from conevo.rng import stream
from conevo.worlds.pursuit.study.behaviours import (
    BEHAVIOURS,
    ArenaSizes,
    Conduct,
    Rules,
    conduct,
)
from conevo.worlds.pursuit.study.captures import Capture, find_captures
from conevo.worlds.pursuit.study.sensors import Spell, average, find_spells, profile, sample

if TYPE_CHECKING:
    from conevo.worlds.protocol import Simulator
    from conevo.worlds.pursuit.world import PursuitWorld

__all__ = ["N_INSTANCES", "Observation", "record_team", "sizes_of"]

N_INSTANCES = 20  # of each behaviour, appendix B
Record = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class Observation:
    """A team in E recorded epochs.

    Attributes:
        simulator: of its world.
        genes: pool of genotypes [K, G].
        team: [R, U] rows of the pool.
        seed: of further random numbers.
        keys: [E] of the scenarios.
        records: [E], each as ``Simulator.record`` returns it.
        rules: that identify behaviours.
    """

    simulator: Simulator
    genes: npt.NDArray[np.float32]
    team: npt.NDArray[np.int32]
    seed: int
    keys: tuple[int, ...]
    records: tuple[Record, ...]
    rules: Rules

    @property
    def world(self) -> PursuitWorld:
        """Its world, or one that inherits it."""
        return cast("PursuitWorld", self.simulator.world)

    @cached_property
    def sizes(self) -> ArenaSizes:
        """The arena and the robots."""
        return sizes_of(self.world)

    @cached_property
    def conducts(self) -> list[Conduct]:
        """Behaviour of the predators in each epoch."""
        return [conduct(record, self.sizes, self.rules) for record in self.records]

    @cached_property
    def captures(self) -> list[list[Capture]]:
        """The captures of each epoch."""
        pairs = zip(self.records, self.conducts, strict=True)
        return [find_captures(record, one, self.sizes, self.rules) for record, one in pairs]

    @cached_property
    def all_captures(self) -> list[Capture]:
        """The captures of all epochs."""
        return [one for epoch in self.captures for one in epoch]

    @cached_property
    def spells(self) -> list[Spell]:
        """All instances of individual behaviours."""
        return find_spells(self.conducts)

    @property
    def inputs(self) -> list[npt.NDArray[Any]]:
        """Sensor inputs of each epoch [T, R, 16]."""
        return [record["inputs"] for record in self.records]

    @property
    def capture_time(self) -> float:
        """Iterations with a captured prey, on average over the epochs."""
        return float(np.mean([(one["captured"] > 0).any(axis=1).sum() for one in self.records]))

    def instances(self, behaviour: str, predator: int | None = None) -> list[Spell]:
        """Return up to 20 instances of a behaviour, of one predator or of all, drawn at random."""
        found = [
            one
            for one in self.spells
            if one.behaviour == behaviour and predator in (None, one.predator)
        ]
        whose = "team" if predator is None else predator
        return sample(found, N_INSTANCES, stream(self.seed, "instances", behaviour, whose))

    def sensor_table(self) -> list[dict[str, Any]]:
        """Return averages and ten-segment profiles of each observed behaviour, over the team.

        Plain data: behaviour, instances (number of sampled ones), proximity and light (averages of
        the eight sensors), proximity_profile and light_profile (figures B-1 to B-9).
        """
        rows = []
        for behaviour in BEHAVIOURS:
            if not (some := self.instances(behaviour)):
                continue
            means, portions = average(some, self.inputs), profile(some, self.inputs)
            rows.append(
                {
                    "behaviour": behaviour,
                    "instances": len(some),
                    "proximity": means[:8].tolist(),
                    "light": means[8:].tolist(),
                    "proximity_profile": portions.proximity.tolist(),
                    "light_profile": portions.light.tolist(),
                }
            )
        return rows


def record_team(
    simulator: Simulator,
    genes: npt.NDArray[np.float32],
    team: npt.NDArray[np.int32],
    keys: Sequence[int],
    seed: int,
    rules: Rules | None = None,
) -> Observation:
    """Record a team of predators in the scenarios of some keys; see ``Observation``."""
    scenarios = simulator.world.scenarios
    records = tuple(simulator.record(genes, team, scenarios([key])) for key in keys)
    return Observation(simulator, genes, team, seed, tuple(keys), records, rules or Rules())


def sizes_of(world: PursuitWorld) -> ArenaSizes:
    """Return the sizes of a world for the rules of behaviours."""
    from conevo.kernels.khepera import AXLE, RADIUS

    return ArenaSizes(
        n_predators=world.n_robots,
        arena_cm=world.params.arena_cm,
        range_cm=world.params.sensor_range_cm,
        speed_cm=world.params.max_speed_cm,
        radius_cm=float(RADIUS),
        axle_cm=float(AXLE),
    )
