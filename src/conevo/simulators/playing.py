"""The simulator of a task of another package: epochs of many teams side by side, step by step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from conevo.controllers.protocol import Controller
from conevo.rng import fold_all, uniforms
from conevo.simulators.networks import Networks
from conevo.worlds.protocol import Outcome, Scenarios

if TYPE_CHECKING:
    from conevo.simulators.tasks import TaskWorld

__all__ = ["Chosen", "Epochs", "Minds", "TaskSimulator"]

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Keys = npt.NDArray[np.uint64]
Bools = npt.NDArray[np.bool_]
Arrays = dict[str, npt.NDArray[Any]]
MOST = 4096  # Choice: epochs side by side, which bounds memory
NOTHING, RANDOM = 0, 1  # heuristic controllers of every task; those of the package follow


class Epochs(Protocol):
    """B epochs of a task, side by side.

    Each depends on its key and its actions alone, not on the others.
    """

    def begin(self, keys: Keys) -> Floats:
        """Start an epoch for each key [B], and return what robots observe [B, R, S]."""

    def step(self, actions: npt.NDArray[Any]) -> tuple[Floats, Floats, Bools]:
        """Execute the actions of all robots.

        Returns:
            Robots' next observations [B, R, S], their rewards [B, R], and which epochs end [B], or
            which robots have gone [B, R]: their rewards and actions count no more, and an epoch
            ends when all of its robots have gone.
        """

    def heuristic(self, k: int, observed: Floats) -> npt.NDArray[Any]:
        """Return the actions of the package's controller k, given what robots observe."""

    def measured(self) -> Floats:
        """Return the measures [B, measures] of this iteration, without the reward."""

    def places(self) -> Arrays:
        """Return positions in the first epoch: "x" and "y" [R], and arrays that are drawn."""


class Minds(Protocol):
    """The controllers of B teams of R robots; see ``networks.Networks``."""

    def think(self, inputs: Floats) -> Floats:
        """Return the outputs [B, R, O] of all robots, given their inputs [B, R, S]."""

    @property
    def hidden(self) -> Floats:
        """The activation of each part [B, R, U], 0 in empty slots."""


@dataclass
class _Tally:
    """The results of B epochs so far."""

    fitness: Floats  # [B, R]
    counts: Ints  # [B, R, C]
    switches: Ints  # [B, R]
    measured: Floats  # [B, measures], sums over iterations
    steps: npt.NDArray[np.int64]  # [B]

    @staticmethod
    def of(b: int, r: int, c: int, m: int) -> _Tally:
        return _Tally(
            np.zeros((b, r), np.float32),
            np.zeros((b, r, c), np.int32),
            np.zeros((b, r), np.int32),
            np.zeros((b, m), np.float32),
            np.zeros(b, np.int64),
        )

    def performance(self) -> Floats:
        """Return the measures [B, 1 + measures]: mean reward of robots, then means over time."""
        total = np.zeros(len(self.fitness), np.float32)
        for of_robot in self.fitness.T:  # one by one: a sum in the same order for any B
            total += of_robot
        total /= np.float32(self.fitness.shape[1])
        steps = np.maximum(self.steps, 1).astype(np.float32)
        return np.concatenate([total[:, None], self.measured / steps[:, None]], axis=1)


class TaskSimulator:
    """Plays teams in a task; see ``worlds.protocol.Simulator``.

    Args:
        world: the task.
        controller: of its robots.
        n_threads: CPU threads that are allowed; a family may use fewer.
    """

    def __init__(self, world: TaskWorld, controller: Controller, n_threads: int) -> None:
        self.world, self.controller, self.n_threads = world, controller, n_threads

    @property
    def fingerprint(self) -> str:
        """Packages with versions, task, and a digest of its settings."""
        return self.world.fingerprint

    @property
    def most(self) -> int:
        """Epochs side by side, at most."""
        return MOST

    def epochs(self, n: int) -> Epochs:
        """Return what plays n epochs side by side."""
        return self.world.epochs(n)

    def players(
        self, genes: Floats, teams: Ints, keys: Keys, modes: Ints, is_watched: bool
    ) -> tuple[Minds, Epochs]:
        """Return the controllers of teams and their epochs; see ``_play``.

        A family whose package can play an epoch in one call replaces this.

        Args:
            genes: pool of genotypes.
            teams: pool rows of the parts [B, R, U].
            keys: of scenarios [B].
            modes: [B, R] index of a heuristic controller, -1 for the robot's own.
            is_watched: whether hidden activations and places are asked for.
        """
        n_outputs = len(self.world.outputs)
        return Networks(self.controller, genes, teams, n_outputs), self.epochs(len(keys))

    def is_shared(self, name: str) -> bool:
        """Scenarios have nothing in common."""
        return False

    def evaluate(
        self,
        genes: Floats,
        teams: Ints,
        scenarios: Scenarios,
        heuristic: Ints | None = None,
        rounds: int = 1,
    ) -> Outcome:
        """Play every team in every scenario of its round; see ``worlds.protocol.Simulator``."""
        n, e = len(teams), len(scenarios) // rounds
        part = np.arange(n) // max(1, n // rounds)  # each team's round
        keys = scenarios.seed.reshape(rounds, e)[part].reshape(n * e)
        modes = np.full(teams.shape[:2], -1, np.int32) if heuristic is None else heuristic
        team = np.repeat(np.arange(n), e)
        most = min(MOST, self.most)
        parts = [
            self._play(genes, teams[rows], keys[first : first + most], modes[rows])
            for first in range(0, n * e, most)
            for rows in [team[first : first + most]]
        ]
        fitness, counts, switches, steps, reached = (
            np.concatenate([part[k] for part in parts]).reshape(n, e, *parts[0][k].shape[1:])
            for k in range(5)
        )
        names = [one.name for one in self.world.performance]
        performance = {name: reached[:, :, k] for k, name in enumerate(names)}
        return Outcome(fitness, counts, switches, performance, steps)

    def record(
        self, genes: Floats, team: Ints, scenarios: Scenarios, heuristic: Ints | None = None
    ) -> Arrays:
        """Play one team in one scenario and return the arrays of every iteration."""
        modes = np.full(len(team), -1, np.int32) if heuristic is None else heuristic
        seen: list[Arrays] = []
        self._play(genes, team[None], scenarios.seed[:1], modes[None], seen.append)
        while len(seen) < self.world.params.iterations:  # it has ended: nothing moves any more
            seen.append(seen[-1] | {"action": np.full(len(team), -1, np.int32)})
        return {name: np.stack([one[name] for one in seen]) for name in seen[0]}

    def _play(
        self,
        genes: Floats,
        teams: Ints,
        keys: Keys,
        modes: Ints,
        watch: Callable[[Arrays], None] | None = None,
    ) -> tuple[npt.NDArray[Any], ...]:
        """Play teams [B, R, U], each in the scenario of a key [B].

        Args:
            genes: pool of genotypes.
            teams: pool rows of the parts.
            keys: of scenarios.
            modes: [B, R] index of a heuristic controller, -1 for the robot's own.
            watch: called with the arrays of the first epoch after every iteration.

        Returns:
            Fitness, counts, switches, steps and performance, each [B, ...].
        """
        world, actions = self.world, self.world.facts.actions
        own = world.params.own_labels
        b, r = modes.shape
        tally = _Tally.of(b, r, len(world.castes), len(world.facts.measures))
        chosen = Chosen(world, keys, modes)
        minds, epochs = self.players(genes, teams, keys, modes, watch is not None)
        observed = epochs.begin(keys)
        before: npt.NDArray[np.int64] | None = None
        alive = np.ones((b, r), bool)
        for t in range(world.params.iterations):
            inputs = self._inputs(observed)
            outputs = minds.think(inputs)
            action = chosen.of(t, epochs, observed, actions.of(outputs))
            label = actions.label(action) if own is None else own.of(observed, action)
            label = np.where(alive, label, -1)
            tally.counts += label[:, :, None] == np.arange(tally.counts.shape[2])
            if before is not None:
                tally.switches += (label != before) & alive
            before = label
            is_played = alive.sum(axis=1) > 0
            tally.steps += is_played
            observed, reward, ended = epochs.step(action)
            tally.fitness += np.where(alive, reward, np.float32(0))
            if tally.measured.size:
                tally.measured += np.where(is_played[:, None], epochs.measured(), np.float32(0))
            alive = alive & ~_wide(ended, 2)
            if watch is not None:
                now: Arrays = {
                    "action": label[0].astype(np.int32),
                    "fitness": tally.fitness[0].copy(),
                    "inputs": inputs[0].copy(),
                    "outputs": outputs[0].copy(),
                    "hidden": minds.hidden[0].copy(),
                    "performance": tally.performance()[0],
                }
                watch(now | epochs.places())
            if not alive.any():
                break
        return tally.fitness, tally.counts, tally.switches, tally.steps, tally.performance()

    def _inputs(self, observed: Floats) -> Floats:
        """Return the inputs of controllers: observations, and the constant."""
        if not self.world.params.constant_input:
            return observed
        one = np.ones((*observed.shape[:2], 1), np.float32)
        return np.concatenate([observed, one], axis=2)


class Chosen:
    """The actions of robots, some of which have a heuristic controller."""

    def __init__(self, world: TaskWorld, keys: Keys, modes: Ints) -> None:
        self._actions, self._modes = world.facts.actions, modes
        self._kinds = [int(k) for k in np.unique(modes) if k >= 0]
        self._width = len(world.facts.actions.outputs)
        self._keys = fold_all(keys.copy(), "random actions")[:, None, None]

    def of(
        self, t: int, epochs: Epochs | None, observed: Floats, action: npt.NDArray[Any]
    ) -> npt.NDArray[Any]:
        """Return the actions of iteration t, given those of the robots' own controllers.

        Without epochs, no robot may have a controller of the package.
        """
        b, r = self._modes.shape
        if action.dtype.kind == "f":  # of an epoch that has ended, or gone wrong
            action = np.where(np.isfinite(action), action, self._actions.nothing(b))
        for kind in self._kinds:
            if kind == NOTHING:
                other = self._actions.nothing(b)
            elif kind == RANDOM:
                places = np.arange(r)[:, None], np.arange(self._width)
                other = self._actions.drawn(uniforms(self._keys, t, *places))
            else:
                assert epochs is not None
                other = epochs.heuristic(kind - RANDOM - 1, observed)
            action = np.where(_wide(self._modes == kind, action.ndim), other, action)
        return action


def _wide(flags: Bools, ndim: int) -> Bools:
    """Return flags with dimensions of size 1 at their end."""
    return flags.reshape(*flags.shape, *[1] * (ndim - flags.ndim))
