"""Checks of the rules for a world with its own simulator: a line for each violation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.controllers.registry import controller
from conevo.errors import UsageError
from conevo.worlds.contract import faults_of_names
from conevo.worlds.protocol import Outcome, Simulator, World
from conevo.worlds.simulators import simulator

__all__ = ["of_declarations", "of_play", "of_record", "of_scenarios"]

Teams = tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.int32]]


def of_declarations(a_world: World) -> Iterator[str]:
    """Yield the faults in a world's names."""
    yield from faults_of_names(a_world)


def of_scenarios(a_world: World, keys: list[int]) -> Iterator[str]:
    """Yield the faults in how scenarios are drawn."""
    some, again, last = (a_world.scenarios(one) for one in (keys, keys, keys[-1:]))
    if len(some) != len(keys):
        yield f"scenarios({len(keys)} keys) has length {len(some)}"
        return
    for name, values in vars(some).items():
        if not isinstance(values, np.ndarray):
            yield f"{name} must be an array, not {type(values).__name__}"
        elif values.tobytes() != getattr(again, name).tobytes():
            yield f"{name} changes from call to call: draw it from stream(key, NAME)"
        elif len(values) == len(keys) and values[-1:].tobytes() != getattr(last, name).tobytes():
            yield f"{name} of a scenario changes with the other keys of the call"


def of_play(a_world: World, teams: Teams, keys: list[int]) -> Iterator[str]:
    """Yield the faults of ``evaluate``: shapes, numbers, and results that depend on other calls."""
    made = simulator(a_world, controller(world=a_world))
    genes, rows, modes = teams
    n = len(rows)
    scenarios = a_world.scenarios(keys)
    try:
        out = made.evaluate(genes, rows, scenarios, modes)
    except UsageError as error:
        yield str(error).removeprefix(f"world {a_world.name}: ")
        return
    for name, values in (("fitness", out.fitness), *out.performance.items()):
        if not np.isfinite(values).all():
            yield f"evaluate: {name} is not finite"
    if not _same(out, made.evaluate(genes, rows, scenarios, modes)):
        yield "evaluate gives other results when it is called again"
    alone = [made.evaluate(genes, rows[k : k + 1], scenarios, modes[k : k + 1]) for k in range(n)]
    if not _same(out, _joined(alone)):
        yield "evaluate gives other results for a team alone than among others"
    both = a_world.scenarios([*keys, *keys[::-1]])
    twice = made.evaluate(
        genes, np.concatenate([rows, rows]), both, np.concatenate([modes, modes]), rounds=2
    )
    other = made.evaluate(genes, rows, a_world.scenarios(keys[::-1]), modes)
    if not _same(twice, _joined([out, other])):
        yield "evaluate(rounds=2) gives other results than a call for each round"
    nobody = np.full_like(rows, -1)
    if not np.isfinite(made.evaluate(genes, nobody, scenarios).fitness).all():
        yield "evaluate: fitness of a team of empty controllers is not finite"


def of_record(a_world: World, teams: Teams, keys: list[int]) -> Iterator[str]:
    """Yield the faults of ``record``: it must agree with the counts of ``evaluate``."""
    made: Simulator = simulator(a_world, controller(world=a_world))
    genes, rows, modes = teams
    scenario = a_world.scenarios(keys[:1])
    try:
        seen = made.record(genes, rows[0], scenario, modes[0])
    except UsageError as error:
        yield str(error).removeprefix(f"world {a_world.name}: ")
        return
    out = made.evaluate(genes, rows[:1], scenario, modes[:1])
    if seen["fitness"][-1].tobytes() != out.fitness[0, 0].tobytes():
        yield "fitness at the end of record differs from that of evaluate"
    ended = [float(values[0, 0]) for values in out.performance.values()]
    if seen["performance"][-1].tolist() != ended:
        yield "performance at the end of record differs from that of evaluate"
    executed = np.stack([(seen["action"] == a).sum(axis=0) for a in range(len(a_world.actions))], 1)
    if a_world.castes == a_world.actions and not np.array_equal(executed, out.counts[0, 0]):
        yield "counts of evaluate are not those of the actions that record shows"


def _joined(parts: list[Outcome]) -> Outcome:
    """Return outcomes of several calls as one."""
    names: dict[str, Any] = {
        name: np.concatenate([getattr(one, name) for one in parts])
        for name in ("fitness", "counts", "switches")
    }
    performance = {
        name: np.concatenate([one.performance[name] for one in parts])
        for name in parts[0].performance
    }
    steps = [one.steps for one in parts if one.steps is not None]
    return Outcome(**names, performance=performance, steps=np.concatenate(steps) if steps else None)


def _same(one: Outcome, other: Outcome) -> bool:
    """Return whether two outcomes are the same, bit for bit."""
    if (one.steps is None) != (other.steps is None):
        return False
    arrays: list[Any] = [
        (one.fitness, other.fitness),
        (one.counts, other.counts),
        (one.switches, other.switches),
        *([] if one.steps is None or other.steps is None else [(one.steps, other.steps)]),
        *((values, other.performance[name]) for name, values in one.performance.items()),
    ]
    return all(np.array_equal(a, b) and a.dtype == b.dtype for a, b in arrays)
