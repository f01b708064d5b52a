"""Epochs of a JaxMARL task, side by side: played step by step, or played whole and read back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from conevo.simulators.jaxmarl import episodes
from conevo.simulators.jaxmarl.episodes import WIDTH
from conevo.simulators.particles import placed
from conevo.simulators.teams import Others

if TYPE_CHECKING:
    from conevo.simulators.jaxmarl.facts import JaxMarlFacts
    from conevo.simulators.jaxmarl.world import JaxMarlWorld

__all__ = ["JaxMarlEpochs", "PlayedEpochs", "padded"]

Floats = npt.NDArray[np.float32]
Keys = npt.NDArray[np.uint64]
Bools = npt.NDArray[np.bool_]
Arrays = dict[str, npt.NDArray[Any]]


class JaxMarlEpochs:
    """B epochs of a task; see ``playing.Epochs``.

    Args:
        world: the task.
        n: B.
    """

    def __init__(self, world: JaxMarlWorld, n: int) -> None:
        self._world, self._n, self._t = world, n, 0
        self._begin, self._step = episodes.begin(world), episodes.step(world)
        self._states: list[Any] = []  # of each WIDTH epochs
        self._places = np.zeros((0, 2), np.float32)

    def begin(self, keys: Keys) -> Floats:
        """Start an epoch for each key [B], and return what robots observe [B, R, S]."""
        self._others = Others(self._world.facts, self._world.params.policy, keys)
        self._keys = np.split(padded(episodes.key_of(keys)), -(-self._n // WIDTH))
        with episodes.on_cpu():
            found = [self._begin(own) for own in self._keys]
        self._states, self._t = [state for _, state in found], 0
        return self._robots([seen for seen, _ in found])

    def step(self, actions: npt.NDArray[Any]) -> tuple[Floats, Floats, Bools]:
        """Execute actions [B, R] or [B, R, W] of robots; see ``playing.Epochs``."""
        facts = self._world.facts
        given = facts.of_all(actions, self._others.of(self._t, self._seen))
        blocks = np.split(padded(given), len(self._keys))
        with episodes.on_cpu():
            found = [
                self._step(keys, np.int32(self._t), state, own)
                for keys, state, own in zip(self._keys, self._states, blocks, strict=True)
            ]
        self._t += 1
        self._states = [one[1] for one in found]
        self._places = np.asarray(found[0][4])[0]
        rewards, ended = (
            np.concatenate([np.asarray(one[k]) for one in found])[: self._n] for k in (2, 3)
        )
        return self._robots([one[0] for one in found]), rewards[:, list(facts.team)], ended

    def heuristic(self, k: int, observed: Floats) -> npt.NDArray[Any]:
        """Raise an error: JaxMARL's controllers are not used."""
        raise AssertionError("a task of JaxMARL has no controllers")

    def measured(self) -> Floats:
        """Return no measures [B, 0]."""
        return np.zeros((self._n, 0), np.float32)

    def places(self) -> Arrays:
        """Return positions in the first epoch; robots in a row where the task has none."""
        return placed(self._places, self._world.facts.team)

    def _robots(self, parts: list[Any]) -> Floats:
        """Keep what all agents observe, and return what robots do [B, R, S]."""
        facts = self._world.facts
        self._seen = np.concatenate([np.asarray(one) for one in parts])[: self._n]
        return np.ascontiguousarray(self._seen[:, list(facts.team), : facts.n_inputs])


class PlayedEpochs:
    """B epochs that have been played whole, read iteration by iteration.

    They are the ``playing.Epochs`` and the ``playing.Minds`` of them.

    Args:
        facts: about the task.
        found: outputs [T, B, R, O], rewards [T, B, R] and ended [T, B]; if they are wanted also
            seen [T, B, R, S], hidden [T, B, R, U] and places [T, B, K, 2].
    """

    def __init__(self, facts: JaxMarlFacts, found: Arrays) -> None:
        self._facts, self._found, self._t = facts, found, 0
        n = found["rewards"].shape[1]
        self._unseen = np.zeros((n, facts.n_robots, facts.n_inputs), np.float32)

    def begin(self, keys: Keys) -> Floats:
        """Return what robots observe first [B, R, S], zeros if it is not wanted."""
        return self._seen()

    def think(self, inputs: Floats) -> Floats:
        """Return the outputs [B, R, O] of all robots."""
        outputs: Floats = self._found["outputs"][self._t]
        return outputs

    def step(self, actions: npt.NDArray[Any]) -> tuple[Floats, Floats, Bools]:
        """Go on to the next iteration; the actions are those that have been executed."""
        rewards, ended = self._found["rewards"][self._t], self._found["ended"][self._t]
        self._t += 1
        return self._seen(), rewards, ended

    def _seen(self) -> Floats:
        if "seen" not in self._found or self._t == len(self._found["seen"]):
            return self._unseen
        seen: Floats = self._found["seen"][self._t]
        return seen

    @property
    def hidden(self) -> Floats:
        """The activation of each part [B, R, U] in the last iteration."""
        hidden: Floats = self._found["hidden"][self._t - 1]
        return hidden

    def heuristic(self, k: int, observed: Floats) -> npt.NDArray[Any]:
        """Raise an error: JaxMARL's controllers are not used."""
        raise AssertionError("a task of JaxMARL has no controllers")

    def measured(self) -> Floats:
        """Return no measures [B, 0]."""
        return np.zeros((len(self._unseen), 0), np.float32)

    def places(self) -> Arrays:
        """Return positions in the first epoch; robots in a row where the task has none."""
        return placed(self._found["places"][self._t - 1, 0], self._facts.team)


def padded(rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return rows [B, ...] with the first one repeated up to a multiple of WIDTH."""
    return np.concatenate([rows, np.repeat(rows[:1], -len(rows) % WIDTH, axis=0)])
