"""The fittest team of a pursuit-evasion run, watched: what its predators do and sense.

Nitschke 2009, section 4.6.1 and appendix B: the fittest team is executed again in 20 fresh
scenarios, those of the testing phase, and everything is recorded.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.analysis.behaviours import (
    BEHAVIOURS,
    Conduct,
    Lifetime,
    Rules,
    Setting,
    conduct,
    lifetimes,
)
from conevo.analysis.captures import Capture, find_captures
from conevo.analysis.fittest import equip
from conevo.analysis.sensors import Spell, average, find_spells, profile, sample
from conevo.controllers.protocol import Controller
from conevo.errors import UsageError
from conevo.kernels.khepera import AXLE, RADIUS
from conevo.rng import fold, stream
from conevo.runs.champions import Team
from conevo.runs.lab import Lab
from conevo.runs.run import Run
from conevo.worlds.pursuit.world import PursuitWorld

__all__ = ["N_INSTANCES", "Observation", "lab_of", "observe", "setting_of", "watch"]

N_INSTANCES = 20  # of each behaviour, appendix B
Record = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class Observation:
    """A team in E recorded epochs.

    Attributes:
        world: its world.
        controller: of its robots.
        team: its controllers.
        seed: the scenarios' root.
        keys: [E] of the scenarios.
        records: [E], each as ``Rollout.record`` returns it.
        setting: the arena and the robots.
        rules: by which behaviours were told.
        n_threads: CPU threads for whatever is simulated further; None for all.
    """

    world: PursuitWorld
    controller: Controller
    team: Team
    seed: int
    keys: tuple[int, ...]
    records: tuple[Record, ...]
    setting: Setting
    rules: Rules
    n_threads: int | None = None

    @cached_property
    def conducts(self) -> list[Conduct]:
        """What the predators did in each epoch."""
        return [conduct(record, self.setting, self.rules) for record in self.records]

    @cached_property
    def lifetimes(self) -> list[Lifetime]:
        """Each predator's shares of behaviours, S and label."""
        return lifetimes(self.conducts)

    @cached_property
    def captures(self) -> list[list[Capture]]:
        """The captures of each epoch."""
        pairs = zip(self.records, self.conducts, strict=True)
        return [find_captures(record, one, self.setting, self.rules) for record, one in pairs]

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
        """Return averages and ten-segment profiles of each behaviour that was seen, over the team.

        Plain data: behaviour, instances (how many were sampled), proximity and light (averages of
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


def observe(
    run: Run,
    scenarios: int = 20,
    seed: int | None = None,
    *,
    threads: int | None = None,
    rules: Rules | None = None,
) -> Observation:
    """Record the fittest team of a run in fresh scenarios.

    Args:
        run: of a ``pursuit`` world, finished or not.
        scenarios: how many.
        seed: draws other scenarios than those of the run's own testing phase.
        threads: CPU threads, all by default.
        rules: by which behaviours are told.

    Raises:
        UsageError: another world, no generation has finished yet, or made with other kernels.
    """
    team, lab = lab_of(run, threads)
    root = run.config.run.seed if seed is None else seed
    return watch(team, lab, scenarios, root, threads=threads, rules=rules)


def watch(
    team: Team,
    lab: Lab,
    scenarios: int,
    seed: int,
    *,
    threads: int | None = None,
    rules: Rules | None = None,
) -> Observation:
    """Record a team of predators in the scenarios of the testing phase.

    Args:
        team: of the lab's world.
        lab: of a ``pursuit`` run.
        scenarios: how many.
        seed: their root.
        threads: CPU threads for whatever is simulated further, all by default.
        rules: by which behaviours are told.
    """
    keys = tuple(fold(seed, "test", k) for k in range(scenarios))
    world = lab.world
    assert isinstance(world, PursuitWorld)
    genes, (rows,) = team.as_trial()
    records = tuple(lab.simulator.record(genes, rows, world.scenarios([key])) for key in keys)
    return Observation(
        world=world,
        controller=lab.simulator.controller,
        team=team,
        seed=seed,
        keys=keys,
        records=records,
        setting=setting_of(world),
        rules=rules or Rules(),
        n_threads=threads,
    )


def lab_of(run: Run, threads: int | None = None) -> tuple[Team, Lab]:
    """Return the fittest team of a pursuit run and what simulates it.

    Raises:
        UsageError: another world, no generation has finished yet, or made with other kernels.
    """
    if not run.config.world.startswith("pursuit-v"):
        raise UsageError(
            f"{run.path} is a run of {run.config.task}: behaviours are those of the predators of "
            f"pursuit-v1, as in conevo run pursuit/team-3"
        )
    return equip(run, threads)


def setting_of(world: PursuitWorld) -> Setting:
    """Return what the rules of behaviours must know of a world."""
    return Setting(
        n_predators=world.n_robots,
        arena_cm=world.params.arena_cm,
        range_cm=world.params.sensor_range_cm,
        speed_cm=world.params.max_speed_cm,
        radius_cm=float(RADIUS),
        axle_cm=float(AXLE),
    )
