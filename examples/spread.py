"""Spread: agents learn to keep away from each other, in a world with its own simulator.

=============  ==========================================================
name           ``spread-v1``
source         made up, the smallest simulator there is
environments   ``open-1`` (agents begin close together)
robots         4
epoch          50 iterations
sensors        x and y of the closest other agent, seen from the agent
actions        rest; move
performance    ``gap`` to the closest other agent at the end, mean over the team
=============  ==========================================================

Nothing here is Warp: the epoch is numpy, for all teams and scenarios at once. A controller's
``forward`` turns what agents sense into what they do. So any environment can be evolved in that has
states, inputs and outputs; the methods, runs, campaigns and reports are those of the package.

The widest gap is 1: an agent in each corner. Clones, which all do the same, do not find it; CONE
does.

Version history:

- v1: first version.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt
from annotated_types import Ge, Gt, Le

from conevo import Controller
from conevo.parameters import parameters
from conevo.rng import stream
from conevo.worlds.protocol import Outcome, Scenarios
from conevo.worlds.registry import WorldEntry

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]


@parameters("world")
class SpreadParams:
    """Parameters of the world; lengths in sides of the square."""

    n_robots: Annotated[int, Ge(2), Le(64)] = 4
    """(agents) agents in a team."""
    iterations: Annotated[int, Ge(2), Le(100_000)] = 50
    """(iterations) length of an epoch."""
    step: Annotated[float, Gt(0), Le(0.1)] = 0.02
    """(side) the longest step, in each direction."""


@dataclass(frozen=True, kw_only=True)
class SpreadScenarios(Scenarios):
    """E scenarios: starts [E, R, 2] float32."""

    starts: Floats


@dataclass(frozen=True)
class SpreadWorld:
    """One environment of the task."""

    environment: str
    params: SpreadParams

    name: ClassVar[str] = "spread-v1"
    inputs: ClassVar[tuple[str, ...]] = ("closest x", "closest y")
    outputs: ClassVar[tuple[str, ...]] = ("rest", "move", "dx", "dy")
    controller: ClassVar[dict[str, Any]] = {"n_hidden": 4, "max_hidden": 8}
    actions: ClassVar[tuple[str, ...]] = ("rest", "move")
    castes: ClassVar[tuple[str, ...]] = actions
    performance: ClassVar[tuple[str, ...]] = ("gap",)
    heuristics: ClassVar[tuple[str, ...]] = ("sitter",)  # never moves

    @property
    def n_robots(self) -> int:
        """Number of agents."""
        return self.params.n_robots

    def scenarios(self, keys: Sequence[int]) -> SpreadScenarios:
        """Return one scenario per key."""
        shape = (self.n_robots, 2)
        starts = [0.4 + 0.2 * stream(key, self.name).random(shape, np.float32) for key in keys]
        return SpreadScenarios(
            starts=np.array(starts, np.float32), seed=np.array(keys, dtype=np.uint64)
        )

    def simulator(self, controller: Controller, n_threads: int) -> "SpreadSimulator":
        """Return the simulator of this world."""
        return SpreadSimulator(self, controller, n_threads)


@dataclass(frozen=True)
class SpreadSimulator:
    """Plays teams of agents; see ``conevo.worlds.protocol.Simulator``."""

    world: SpreadWorld
    controller: Controller
    n_threads: int

    fingerprint: ClassVar[str] = SpreadWorld.name

    def is_shared(self, name: str) -> bool:
        """Scenarios have nothing in common."""
        return False

    def evaluate(
        self,
        genes: Floats,
        teams: Ints,
        scenarios: SpreadScenarios,
        heuristic: Ints | None = None,
        rounds: int = 1,
    ) -> Outcome:
        """Play every team in every scenario of its round."""
        n, r = teams.shape[:2]
        e = len(scenarios) // rounds
        part = np.arange(n) // (n // rounds)  # each team's round
        starts = scenarios.starts.reshape(rounds, e, r, 2)[part].reshape(n * e, r, 2)
        modes = np.full((n, r), -1, np.int32) if heuristic is None else heuristic
        rows, modes = np.repeat(teams, e, axis=0), np.repeat(modes, e, axis=0)
        counts = np.zeros((n * e, r, len(self.world.actions)), np.int32)
        switches, before = np.zeros((n * e, r), np.int32), None
        for seen in self._epoch(genes, rows, modes, starts):
            action = seen["action"]
            counts += action[:, :, None] == np.arange(len(self.world.actions))
            switches += False if before is None else action != before
            before = action
        fitness = seen["fitness"]
        return Outcome(
            fitness=fitness.reshape(n, e, r),
            counts=counts.reshape(n, e, r, -1),
            switches=switches.reshape(n, e, r),
            performance={"gap": fitness.mean(axis=1).reshape(n, e)},
        )

    def record(
        self,
        genes: Floats,
        team: Ints,
        scenarios: SpreadScenarios,
        heuristic: Ints | None = None,
    ) -> dict[str, npt.NDArray[Any]]:
        """Execute one team in one scenario and return the arrays of every iteration."""
        modes = np.full(len(team), -1, np.int32) if heuristic is None else heuristic
        steps = list(self._epoch(genes, team[None], modes[None], scenarios.starts))
        found = {name: np.concatenate([step[name] for step in steps]) for name in steps[0]}
        return found | {"performance": found["fitness"].mean(axis=1, keepdims=True)}

    def _epoch(
        self, genes: Floats, teams: Ints, modes: Ints, starts: Floats
    ) -> Iterator[dict[str, npt.NDArray[Any]]]:
        """Yield the state of B teams after each iteration, [B, R, ...]."""
        b, r, u = teams.shape
        agents = teams.reshape(b * r, u)
        weights, active = genes[agents], agents >= 0
        memory = np.zeros((b * r, u, self.controller.n_memory), np.float32)
        place, step = starts.copy(), np.float32(2 * self.world.params.step)
        for _ in range(self.world.params.iterations):
            inputs = _closest(place)
            outputs, memory = self.controller.forward(
                weights, active, memory, inputs.reshape(b * r, 2), len(self.world.outputs)
            )
            outputs = outputs.reshape(b, r, -1)
            action = np.where(modes < 0, outputs[:, :, :2].argmax(axis=2), 0).astype(np.int32)
            way = step * (1 / (1 + np.exp(-outputs[:, :, 2:].clip(-20, 20))) - np.float32(0.5))
            place = (place + way * action[:, :, None]).clip(0, 1).astype(np.float32)
            yield {
                "x": place[:, :, 0],
                "y": place[:, :, 1],
                "action": action,
                "fitness": np.linalg.norm(_closest(place), axis=2),
                "inputs": inputs,
                "outputs": outputs,
                "hidden": memory[:, :, 0].reshape(b, r, u),
            }


def _closest(place: Floats) -> Floats:
    """Return the vector from every agent [B, R, 2] to the closest other one."""
    way = place[:, None] - place[:, :, None]  # from the first index to the second
    far = np.linalg.norm(way, axis=3)
    far[:, np.arange(place.shape[1]), np.arange(place.shape[1])] = np.inf
    closest: Floats = np.take_along_axis(way, far.argmin(axis=2)[:, :, None, None], 2)[:, :, 0]
    return closest


ENTRY = WorldEntry(
    name="spread-v1",
    title="Spread",
    summary="4 agents keep away from each other",
    source="made up",
    environments=("open-1",),
    params_name="SpreadParams",
    world_name="SpreadWorld",
)
