"""A world's own simulator, whose results are checked before they are used."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.controllers.protocol import Controller
from conevo.errors import UsageError
from conevo.outside import takes
from conevo.worlds.measures import measures_of
from conevo.worlds.protocol import Outcome, World

__all__ = ["OwnSimulator", "build_own"]

NEEDED = ("world", "controller", "fingerprint", "n_threads", "evaluate", "record", "is_shared")
ARGUMENTS = {  # of its functions, as they are called here
    "evaluate": ("genes, teams, scenarios, heuristic, rounds", 5),
    "record": ("genes, team, scenarios, heuristic", 4),
    "is_shared": ("name", 1),
}
KINDS = {"f": "floats", "iu": "whole numbers"}


def build_own(world: World, controller: Controller, n_threads: int) -> OwnSimulator:
    """Return the simulator that a world brings.

    Raises:
        UsageError: it lacks something.
    """
    make: Any = world.simulator  # type: ignore[attr-defined]
    refuse = f"world {world.name}: "
    if not takes(make, 2):
        raise UsageError(f"{refuse}simulator must be declared as simulator(controller, n_threads)")
    made = make(controller, n_threads)
    refuse += f"its simulator, {type(made).__name__}, "
    for name in NEEDED:
        if not hasattr(made, name):
            raise UsageError(f"{refuse}needs {name}")
    if not isinstance(made.fingerprint, str):
        raise UsageError(f"{refuse}needs a text as fingerprint, not {made.fingerprint!r:.60}")
    for name, (arguments, n) in ARGUMENTS.items():
        if not takes(getattr(made, name), n):
            raise UsageError(f"{refuse}must have {name}({arguments})")
    return OwnSimulator(made, world, controller, n_threads)


class OwnSimulator:
    """The checked simulator of a world that brings its own; see ``worlds.protocol.Simulator``.

    Args:
        made: the simulator that the world has made.
        world: the world.
        controller: of its robots.
        n_threads: CPU threads.
    """

    def __init__(self, made: Any, world: World, controller: Controller, n_threads: int) -> None:
        self._made = made
        self.world, self.controller, self.n_threads = world, controller, n_threads
        self.fingerprint: str = made.fingerprint

    def is_shared(self, name: str) -> bool:
        """Return whether all scenarios have a field of theirs in common."""
        return bool(self._made.is_shared(name))

    def evaluate(
        self,
        genes: npt.NDArray[np.float32],
        teams: npt.NDArray[np.int32],
        scenarios: Any,
        heuristic: npt.NDArray[np.int32] | None = None,
        rounds: int = 1,
    ) -> Outcome:
        """Play every team in every scenario of its round.

        Raises:
            UsageError: the world's simulator does not return an outcome of these teams.
        """
        found = self._made.evaluate(genes, teams, scenarios, heuristic, rounds)
        shape = (len(teams), len(scenarios) // rounds)
        for fault in self._faults_of_outcome(found, *shape):
            raise UsageError(f"world {self.world.name}: evaluate: {fault}")
        outcome: Outcome = found
        return outcome

    def record(
        self,
        genes: npt.NDArray[np.float32],
        team: npt.NDArray[np.int32],
        scenarios: Any,
        heuristic: npt.NDArray[np.int32] | None = None,
    ) -> dict[str, npt.NDArray[Any]]:
        """Play one team in one scenario and return what happened in every iteration.

        Raises:
            UsageError: the world's simulator does not return a record of this epoch.
        """
        found = self._made.record(genes, team, scenarios, heuristic)
        for fault in self._faults_of_record(found, team.shape[1]):
            raise UsageError(f"world {self.world.name}: record: {fault}")
        return dict(found)

    def record_with_outcome(
        self,
        genes: npt.NDArray[np.float32],
        team: npt.NDArray[np.int32],
        scenarios: Any,
        heuristic: npt.NDArray[np.int32] | None = None,
    ) -> tuple[dict[str, npt.NDArray[Any]], Outcome]:
        """Return the results of ``record`` and ``evaluate``, the simulator's only functions."""
        seen = self.record(genes, team, scenarios, heuristic)
        modes = None if heuristic is None else heuristic[None]
        return seen, self.evaluate(genes, team[None], scenarios, modes)

    def _faults_of_outcome(self, out: Any, n: int, e: int) -> Iterator[str]:
        world, names = self.world, [one.name for one in measures_of(self.world)]
        if not isinstance(out, Outcome):
            yield f"it must return an Outcome, not {type(out).__name__}"
            return
        r, c = world.n_robots, len(world.castes)
        yield from _faults("fitness", out.fitness, (n, e, r))
        yield from _faults("counts", out.counts, (n, e, r, c), "iu")
        yield from _faults("switches", out.switches, (n, e, r), "iu")
        reached: Any = out.performance
        if not isinstance(reached, Mapping):
            yield f"performance must be a dict, not {type(reached).__name__}"
        elif list(reached) != names:
            given = ", ".join(map(str, reached)) or "none"
            yield f"performance must have {', '.join(names)}, got {given}"
        else:
            for name in names:
                yield from _faults(name, reached[name], (n, e))
        if out.steps is not None:
            yield from _faults("steps", out.steps, (n, e), "iu", world.params.iterations)

    def _faults_of_record(self, seen: Any, u: int) -> Iterator[str]:
        world = self.world
        if not isinstance(seen, Mapping):
            yield f"it must return a dict, not {type(seen).__name__}"
            return
        t, r = world.params.iterations, world.n_robots
        shapes = {"x": (t, r), "y": (t, r), "action": (t, r), "fitness": (t, r)}
        wide = {"inputs": len(world.inputs), "outputs": len(world.outputs), "hidden": u}
        every = shapes | {name: (t, r, size) for name, size in wide.items()}
        every |= {"performance": (t, len(measures_of(world)))}
        for name, shape in every.items():
            if name not in seen:
                yield f"it must have {name}"
            else:
                yield from _faults(name, seen[name], shape, "iu" if name == "action" else "f")
        for name in seen.keys() - every.keys():
            if not isinstance(seen[name], np.ndarray) or seen[name].dtype.kind not in "biuf":
                yield f"{name} must be an array of numbers"


def _faults(
    name: str, values: Any, shape: tuple[int, ...], kind: str = "f", most: int | None = None
) -> Iterator[str]:
    """Yield the faults of an array that must have this shape, and numbers of this kind."""
    if not isinstance(values, np.ndarray):
        yield f"{name} must be an array {list(shape)}, not {type(values).__name__}"
    elif values.shape != shape:
        yield f"{name} must be {list(shape)}, got {list(values.shape)}"
    elif values.dtype.kind not in kind:
        yield f"{name} must be an array of {KINDS[kind]}, not of {values.dtype}"
    elif kind == "iu" and name != "action" and values.size and values.min() < 0:
        yield f"{name} must be 0 or more, not {values.min()}"
    elif most is not None and values.size and values.max() > most:
        yield f"{name} must be {most} or less, not {values.max()}"
