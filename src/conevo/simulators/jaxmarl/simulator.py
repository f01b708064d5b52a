"""The simulator of a JaxMARL task: whole epochs in one call, wherever jax can compute them."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from conevo.controllers.srn import Srn
from conevo.simulators.jaxmarl import episodes
from conevo.simulators.jaxmarl.episodes import WIDTH
from conevo.simulators.jaxmarl.epochs import PlayedEpochs, padded
from conevo.simulators.playing import MOST, Chosen, Epochs, Minds, TaskSimulator
from conevo.simulators.teams import Others

if TYPE_CHECKING:
    from conevo.simulators.jaxmarl.world import JaxMarlWorld

__all__ = ["JaxMarlSimulator"]

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Keys = npt.NDArray[np.uint64]
Arrays = dict[str, npt.NDArray[Any]]
NUMBERS = 2**24  # Choice: outputs that are kept at once, 64 MiB
ALWAYS, WATCHED = ("outputs", "rewards", "ended"), ("hidden", "places")


class JaxMarlSimulator(TaskSimulator):
    """Plays teams in WIDTH epochs side by side, on each thread.

    A simple recurrent network is computed by jax. Other controllers, and other agents that act by a
    user's function, are computed here: then the epochs are played step by step.
    """

    world: JaxMarlWorld

    @property
    def most(self) -> int:
        """Epochs side by side, at most."""
        of_epoch = self.world.params.iterations * self.world.n_robots * len(self.world.outputs)
        most: int = min(MOST, NUMBERS // of_epoch // WIDTH * WIDTH)
        return max(WIDTH, most)

    def players(
        self, genes: Floats, teams: Ints, keys: Keys, modes: Ints, is_watched: bool
    ) -> tuple[Minds, Epochs]:
        """Return controllers and epochs, which have been played if jax can play them whole."""
        controller, params = self.controller, self.world.params
        if not isinstance(controller, Srn) or params.policy is not None:
            return super().players(genes, teams, keys, modes, is_watched)
        play = episodes.whole(self.world, controller)
        wanted = [*ALWAYS, *WATCHED * is_watched]
        if is_watched or params.own_labels is not None:
            wanted.append("seen")

        def block(first: int) -> Arrays:
            rows = slice(first, first + WIDTH)
            given, is_given = self._given(keys[rows], modes[rows])
            arguments = (
                *map(padded, episodes.weights_of(controller, genes, teams[rows])),
                padded(episodes.key_of(keys[rows])),
                given,
                padded(is_given),
            )
            with episodes.on_cpu():
                found = play(*arguments)
            return {name: np.asarray(found[name])[:, : len(keys[rows])] for name in wanted}

        firsts = range(0, len(keys), WIDTH)
        parts = [block(0)]  # compiled once, before other threads need it
        with ThreadPoolExecutor(self.n_threads) as pool:
            parts += pool.map(block, firsts[1:])
        found = {name: np.concatenate([one[name] for one in parts], axis=1) for name in wanted}
        played = PlayedEpochs(self.world.facts, found)
        return played, played

    def _given(self, keys: Keys, modes: Ints) -> tuple[Floats, npt.NDArray[np.bool_]]:
        """Return actions that no network chooses [T, WIDTH, A, W], and whose they are [B, A]."""
        facts, iterations = self.world.facts, self.world.params.iterations
        n, b = len(facts.agents), len(keys)
        given = np.zeros((iterations, WIDTH, n, facts.width), np.float32)
        is_given = np.ones((b, n), np.bool_)
        is_given[:, list(facts.team)] = modes >= 0
        if is_given.any():
            others = Others(facts, None, keys)
            unseen = np.zeros((b, n, 0), np.float32)
            chosen, own = Chosen(self.world, keys, modes), facts.actions.nothing(b)
            for t in range(iterations):
                robots = chosen.of(t, None, unseen, own)
                given[t, :b] = facts.of_all(robots, others.of(t, unseen))
        return given, is_given
