"""Epochs of a PettingZoo task, side by side in worker processes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from conevo.simulators.particles import placed
from conevo.simulators.pettingzoo import episodes
from conevo.simulators.pettingzoo.workers import LOCK, Worker, ask_all, workers
from conevo.simulators.playing import TaskSimulator
from conevo.simulators.teams import Others

if TYPE_CHECKING:
    from conevo.simulators.pettingzoo.world import PettingZooWorld

__all__ = ["PettingZooEpochs", "PettingZooSimulator"]

Floats = npt.NDArray[np.float32]
Keys = npt.NDArray[np.uint64]
Bools = npt.NDArray[np.bool_]
SIDE_BY_SIDE = 32  # Choice: environments of a worker; more are not faster


class PettingZooSimulator(TaskSimulator):
    """Plays teams with a worker process for each thread.

    Args:
        world: the task.
        controller: of its robots.
        n_threads: worker processes; results do not depend on it.
    """

    world: PettingZooWorld

    @property
    def most(self) -> int:
        """Epochs side by side, at most."""
        return self.n_threads * SIDE_BY_SIDE

    def epochs(self, n: int) -> PettingZooEpochs:
        """Return what plays n epochs side by side."""
        return PettingZooEpochs(self.world, n, self.n_threads)

    def _play(self, *given: Any) -> tuple[npt.NDArray[Any], ...]:
        """Play teams; one thread of this process at a time."""
        with LOCK:
            return super()._play(*given)


class PettingZooEpochs:
    """B epochs of a task; see ``playing.Epochs``.

    Args:
        world: the task.
        n: B.
        n_workers: worker processes, at most.
    """

    def __init__(self, world: PettingZooWorld, n: int, n_workers: int) -> None:
        self._world, self._n, self._t = world, n, 0
        self._task = (world.environment, world.params.options)
        used = min(n, n_workers)
        ends = [n * k // used for k in range(used + 1)]
        self._parts: list[tuple[Worker, slice]] = [
            (worker, slice(*ends[k : k + 2])) for k, worker in enumerate(workers(used))
        ]
        self._playing = np.ones(n, np.bool_)

    def begin(self, keys: Keys) -> Floats:
        """Start an epoch for each key [B], and return what robots observe [B, R, S]."""
        facts = self._world.facts
        self._others = Others(facts, self._world.params.policy, keys)
        seeds = (keys % np.uint64(2**31)).tolist()
        asked = [(worker, (self._task, seeds[part])) for worker, part in self._parts]
        self._seen: Floats = np.concatenate(self._ask(episodes.begin, asked))
        return self._robots(self._seen)

    def step(self, actions: npt.NDArray[Any]) -> tuple[Floats, Floats, Bools]:
        """Execute actions [B, R] or [B, R, A] of robots; see ``playing.Epochs``."""
        facts = self._world.facts
        whole = facts.of_all(actions, self._others.of(self._t, self._seen))
        self._t += 1
        asked = [(worker, (whole[part], self._playing[part])) for worker, part in self._parts]
        found = self._ask(episodes.step, asked)
        self._seen, rewards, gone = map(np.concatenate, zip(*found, strict=True))
        team = list(facts.team)
        self._playing = (~gone[:, team]).sum(axis=1) > 0
        return self._robots(self._seen), rewards[:, team], gone[:, team]

    def heuristic(self, k: int, observed: Floats) -> npt.NDArray[Any]:
        """Raise an error: PettingZoo has no controllers."""
        raise AssertionError("PettingZoo has no controllers")

    def measured(self) -> Floats:
        """Return no measures [B, 0]."""
        return np.zeros((self._n, 0), np.float32)

    def places(self) -> dict[str, npt.NDArray[Any]]:
        """Return positions in the first epoch; robots in a row where the task has none."""
        facts = self._world.facts
        (found,) = self._ask(episodes.places, [(self._parts[0][0], ())])
        return placed(found, facts.team)

    def _ask(self, function: Any, asked: list[tuple[Worker, Any]]) -> list[Any]:
        """Return the results of a function that workers call."""
        return ask_all(f"pettingzoo:{self._world.environment}", function, asked)

    def _robots(self, seen: Floats) -> Floats:
        """Return what robots observe [B, R, S]."""
        facts = self._world.facts
        return np.ascontiguousarray(seen[:, list(facts.team), : facts.n_inputs])
