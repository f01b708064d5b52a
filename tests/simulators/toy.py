"""A family of one task, in numpy: robots on a line go to its middle, where their epoch ends."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import pytest

from conevo.errors import unknown_name
from conevo.playback.drawn import Drawn, Objects
from conevo.rng import fold_all, uniforms
from conevo.simulators.actions import Continuous, Discrete
from conevo.simulators.tasks import TaskEntry, TaskFacts, TaskParams, TaskWorld
from conevo.worlds.families import FAMILIES
from conevo.worlds.measures import Measure

__all__ = ["TaskParams", "ToyWorld", "entry", "known"]

NEAR = 0.06
VERSION = ["toy 1.0"]


@dataclass(frozen=True)
class ToyWorld(TaskWorld):
    """The task with continuous actions ("line") or discrete ones ("steps")."""

    name: ClassVar[str] = "toy"

    @cached_property
    def facts(self) -> TaskFacts:
        n = int(self.params.keywords.get("n_agents", 2))
        ends = np.ones((n, 1), np.float32)
        actions: Any = Continuous(-ends, ends, ("force",), (("right", "left"),))
        if self.environment == "steps":
            actions = Discrete(("stay", "left", "right"), np.full(n, 3))
        return TaskFacts(
            versions=VERSION[0],
            n_robots=n,
            n_inputs=2,
            actions=actions,
            measures=(Measure("distance", larger_is_better=False),),
            heuristics=("homing",),
            drawn=Drawn(objects=(Objects("middle", "middle[0:1]", "middle[1:2]"),)),
        )

    def epochs(self, n: int) -> ToyEpochs:
        return ToyEpochs(self)


class ToyEpochs:
    """B epochs: robots start anywhere, and a step is a tenth of the line at most."""

    def __init__(self, world: ToyWorld) -> None:
        self.r, self.is_discrete = world.n_robots, world.environment == "steps"

    def begin(self, keys: Any) -> Any:
        own = fold_all(keys.copy(), "starts")[:, None]
        self.x = 2 * uniforms(own, 0, 0, np.arange(self.r)) - 1
        return self.observed()

    def observed(self) -> Any:
        return np.stack([self.x, np.abs(self.x)], axis=2).astype(np.float32)

    def step(self, actions: Any) -> Any:
        if self.is_discrete:
            actions = np.array([0, -1, 1], np.float32)[actions][:, :, None]
        self.x = (self.x + np.float32(0.1) * actions[:, :, 0]).clip(-1, 1).astype(np.float32)
        return self.observed(), -np.abs(self.x), (np.abs(self.x) < NEAR).all(axis=1)

    def heuristic(self, k: int, observed: Any) -> Any:
        x = observed[:, :, 0]
        if self.is_discrete:
            return np.where(np.abs(x) < NEAR, 0, np.where(x > 0, 1, 2))
        return (-10 * x).clip(-1, 1)[:, :, None]

    def measured(self) -> Any:
        return np.abs(self.x).max(axis=1, keepdims=True).astype(np.float32)

    def places(self) -> Any:
        x = self.x[0].copy()
        return {"x": x, "y": np.zeros_like(x), "middle": np.zeros(2, np.float32)}


def entry(task: str) -> TaskEntry:
    """Return the entry of a task."""
    if task not in (names := ("line", "steps", "line.v3")):
        raise unknown_name("task", task, names, "of toy")
    return TaskEntry(
        name="toy",
        title="Toy",
        summary="robots go to the middle",
        source="made up",
        environments=(task,),
        params_name="TaskParams",
        world_name="ToyWorld",
        module=__name__,
    )


@contextmanager
def known() -> Iterator[None]:
    """Make the family known."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(FAMILIES, "toy", __name__)
        yield
