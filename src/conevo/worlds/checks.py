"""Checks of the rules that a world must follow: one finding for each topic.

``findings`` yields them in turn. A memory fault of the world may end the process, so
``worlds.checking`` runs it in a child process.
"""

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal, get_type_hints

import numpy as np
import numpy.typing as npt
from pydantic import ValidationError

from conevo.controllers.registry import controller, genome_of, refuse_misfit
from conevo.errors import ConevoError, EnvironmentFailure, UsageError
from conevo.outside import line_of
from conevo.parameters import wrong_values
from conevo.rng import fold
from conevo.worlds import own_checks
from conevo.worlds.agreement import random_teams_of
from conevo.worlds.contract import faults, scenario_faults
from conevo.worlds.drawn_checks import drawn_in_words, of_drawing
from conevo.worlds.protocol import World
from conevo.worlds.registry import WorldEntry, resolve, study_of
from conevo.worlds.rollout import Rollout
from conevo.worlds.simulators import has_own_simulator, simulator
from conevo.worlds.trial import Trial

__all__ = ["Finding", "findings", "mixed_teams", "random_teams"]

ITERATIONS = 100  # of the epochs that are run step by step
NETWORKS = 4  # teams of random networks among those
RANDOM_TEAMS = 100
TEAM_STEPS = 200_000  # limit for all random teams together
FEW = 0.02  # a smaller share of random teams with any fitness is noted
KEYS = [fold(1, "check", k) for k in range(3)]

Teams = tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.int32]]


@dataclass(frozen=True)
class Finding:
    """Result of one check: "ok", a "note" to think about, or a "problem".

    A finding "running" is not a result: it announces a check that takes seconds in a good world.
    """

    status: Literal["ok", "note", "problem", "running"]
    topic: str
    text: str


def findings(path: str, given: Mapping[str, Any] | None = None) -> Iterator[Finding]:
    """Yield the findings for a world, up to a problem on which the other checks depend.

    Args:
        path: "FILE.py:ENVIRONMENT" or "rover/complex-1".
        given: parameters of a world for a check of indices only; None: everything is checked.

    Raises:
        EnvironmentFailure: the machine failed, and the world could not be checked.
    """
    try:
        entry, environment = resolve(path)
        if given is None:
            yield from _all(entry, environment)
        else:
            yield from _stepped(_shorter(entry, environment, given))
    except EnvironmentFailure:
        raise
    except ConevoError as error:
        yield Finding("problem", "world", str(error))
    except (Exception, SystemExit) as error:
        line = line_of(error)
        if not line:
            raise
        yield Finding("problem", "world", line)


def _all(entry: WorldEntry, environment: str) -> Iterator[Finding]:
    is_sound = True
    groups = (_declared, _drawn, _played, _rolled_out)
    for group in (_declared, _own) if has_own_simulator(entry.world_class) else groups:
        for finding in group(entry, environment):
            is_sound = is_sound and finding.status != "problem"
            yield finding
        if not is_sound:
            if group is not _rolled_out:
                yield Finding("note", "stopped", "the rest is checked once this is right")
            return


def _topic(topic: str, problems: Iterator[str], fine: str) -> Iterator[Finding]:
    found = [Finding("problem", topic, text) for text in problems]
    yield from found or [Finding("ok", topic, fine)]


def _declared(entry: WorldEntry, environment: str) -> Iterator[Finding]:
    """Check the declarations in the world's file."""
    names = [Path(file).name for file in entry.files] or [entry.module]
    imports = f", which imports {', '.join(names[1:])}" if names[1:] else ""
    yield Finding("ok", "file", names[0] + imports)
    wrong = list(_of_parameters(entry.params_class))
    yield from _topic("parameters", iter(wrong), "all with bounds")
    if wrong:
        return
    for name in entry.environments:
        built = entry.build(name, entry.params(name))
        if name == environment:
            is_own = has_own_simulator(built)
            fine = "names, controller" if is_own else "names, controller, phases, state, scene"
            yield from _topic("structure", _of_structure(built), fine)
    if entry.studied:
        yield from _topic("study", _of_study(entry), entry.studied)


def _of_structure(built: World) -> Iterator[str]:
    if has_own_simulator(built):
        found = list(own_checks.of_declarations(built))
    else:
        found = list(faults(built, built.simulation()))
    yield from found
    if not found:
        try:
            refuse_misfit(controller(world=built), built)
        except UsageError as error:
            yield str(error)


def _of_study(entry: WorldEntry) -> Iterator[str]:
    try:
        study_of(entry)
    except UsageError as error:
        yield str(error)


def _of_parameters(params_class: Any) -> Iterator[str]:
    hints = get_type_hints(params_class, include_extras=True)
    kind, is_whole = params_class.__name__, True
    if not params_class.__dataclass_params__.frozen:
        yield f"{kind} must be frozen: @dataclass(frozen=True)"
    for field in fields(params_class):
        name, hint = f"{kind}.{field.name}", hints[field.name]
        if hint in (int, float):
            example = f"Annotated[{hint.__name__}, Ge(0), Le(9)]"
            yield f"{name} has no bounds; declare them, as in {example}"
        if field.default is MISSING:
            yield f"{name} needs a default"
            is_whole = False
    if is_whole:
        try:
            params_class()
        except UsageError as error:
            why = error.__cause__
            several = wrong_values(why, "world") if isinstance(why, ValidationError) else [error]
            yield from map(str, several)


def _own(entry: WorldEntry, environment: str) -> Iterator[Finding]:
    """Check a world's own simulator."""
    a_world = _shorter(entry, environment)
    fine = "the same for the same key"
    yield from _topic("scenarios", own_checks.of_scenarios(a_world, KEYS), fine)
    teams = mixed_teams(a_world)
    fine = "the same again, alone and in rounds; all finite"
    yield from _topic("evaluate", own_checks.of_play(a_world, teams, KEYS[:2]), fine)
    found = list(_topic("record", own_checks.of_record(a_world, teams, KEYS), "equals evaluate"))
    yield from found
    if all(finding.status == "ok" for finding in found):
        yield from _of_drawing(a_world, teams)
    yield from _of_random_teams(entry.build(environment, entry.params(environment)))


def _drawn(entry: WorldEntry, environment: str) -> Iterator[Finding]:
    """Check how scenarios are drawn."""
    a_world = entry.build(environment, entry.params(environment))
    yield Finding("running", "scenarios", "")
    fine = "the same for the same key, different for different keys"
    found = list(_topic("scenarios", _of_scenarios(a_world), fine))
    yield from found
    if all(finding.status == "ok" for finding in found):
        yield from _of_environments(entry)


def _of_scenarios(a_world: World) -> Iterator[str]:
    scene = a_world.simulation().scene
    three, again = a_world.scenarios(KEYS), a_world.scenarios(KEYS)
    wrong = list(scenario_faults(scene, three, len(KEYS)))
    yield from wrong
    if wrong:
        return
    last = a_world.scenarios(KEYS[-1:])
    own = [name for name, var in scene.vars.items() if var.type.ndim == 1]
    for name in scene.vars:
        values = getattr(three, name)
        if values.tobytes() != getattr(again, name).tobytes():
            yield f"{name} changes from call to call: draw it from stream(key, NAME)"
        elif name in own and values[-1:].tobytes() != getattr(last, name).tobytes():
            yield f"{name} of a scenario changes with the other keys of the call"
    rows = {b"".join(getattr(three, name)[k].tobytes() for name in own) for k in range(len(KEYS))}
    places = [name for name in own if name != "seed"]
    drawn = {tuple(getattr(three, name)[k].tobytes() for name in places) for k in range(len(KEYS))}
    if len(rows) < len(KEYS) or (places and len(drawn) == 1):
        names = ", ".join(places or own)
        yield f"{names} are the same for all keys: draw them from stream(key, NAME)"


def _of_environments(entry: WorldEntry) -> Iterator[Finding]:
    """Note environments that have the same parameters and the same scenario."""
    known: dict[tuple[object, ...], str] = {}
    for name in entry.environments:
        a_world = entry.build(name, entry.params(name))
        simulation, drawn = a_world.simulation(), a_world.scenarios(KEYS[:1])
        if wrong := list(scenario_faults(simulation.scene, drawn, 1)):
            yield Finding("problem", "environments", f"{name}: {wrong[0]}")
            continue
        made = (
            *(getattr(drawn, field).tobytes() for field in simulation.scene.vars),
            repr(simulation.params.numpy_value()),
            repr(a_world.controller),
            a_world.n_robots,
            tuple(simulation.functions.values()),
        )
        if (other := known.setdefault(made, name)) != name:
            text = f"{name} is the same as {other}: in its parameters, and in a scenario of one key"
            yield Finding("note", "environments", text)


def random_teams(a_world: World, n: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    """Return a pool of random genotypes and ``n`` teams of controllers made of it [N, R, U].

    The controller is the one that the world suggests.
    """
    genome = genome_of(controller(world=a_world), a_world)
    return random_teams_of(genome, a_world.n_robots, n)


def _shorter(entry: WorldEntry, environment: str, given: Mapping[str, Any] = {}) -> World:
    params = entry.params(environment, **given)
    return entry.build(environment, replace(params, iterations=min(ITERATIONS, params.iterations)))


def _stepped(a_world: World) -> Iterator[Finding]:
    """Run some epochs step by step; an index outside its array ends the process."""
    trial = Trial(a_world, *mixed_teams(a_world), a_world.scenarios(KEYS[:2]))
    about = f"{trial.n_worlds} epochs of {a_world.params.iterations} iterations"
    for _ in trial.run():
        yield Finding("running", "memory", "")
    yield Finding("ok", "memory", f"{about}: all array indices are in bounds")
    for topic, problems, fine in trial.seen():
        yield from _topic(topic, iter(problems), fine)
    for text in trial.unplayed_heuristics():
        yield Finding("note", "heuristics", text)


def _played(entry: WorldEntry, environment: str) -> Iterator[Finding]:
    yield from _stepped(_shorter(entry, environment))


def mixed_teams(a_world: World) -> Teams:
    """Return teams of networks, a mixed one, and one of each heuristic controller."""
    n_heuristics = len(a_world.heuristics)
    pool, teams = random_teams(a_world, NETWORKS + 1 + n_heuristics)
    heuristic = np.full(teams.shape[:2], -1, dtype=np.int32)
    heuristic[NETWORKS, ::2] = np.arange(len(heuristic[NETWORKS, ::2])) % n_heuristics
    heuristic[NETWORKS + 1 :] = np.arange(n_heuristics)[:, None]
    return pool, teams, heuristic


def _rolled_out(entry: WorldEntry, environment: str) -> Iterator[Finding]:
    """Run the kernel that evolution runs."""
    a_world = _shorter(entry, environment)
    teams = mixed_teams(a_world)
    yield from _topic("record", _of_record(a_world, teams), "equals evaluate, bit for bit")
    yield from _of_drawing(a_world, teams)
    yield from _of_random_teams(entry.build(environment, entry.params(environment)))


def _of_drawing(a_world: World, teams: Teams) -> Iterator[Finding]:
    """Check that an epoch can be drawn; a world without ``drawn`` need not be."""
    pool, rows, heuristic = teams
    played = simulator(a_world, controller(world=a_world))
    wrong = list(of_drawing(played, pool, rows[NETWORKS], heuristic[NETWORKS], KEYS[0]))
    if wrong and getattr(a_world, "drawn", None) is None:
        yield Finding("note", "drawn", wrong[0])
    else:
        yield from _topic("drawn", iter(wrong), "" if wrong else drawn_in_words(a_world))


def _of_record(a_world: World, mixed: Teams) -> Iterator[str]:
    pool, teams, heuristic = mixed
    one = slice(NETWORKS, NETWORKS + 1)
    scenarios, rollout = a_world.scenarios(KEYS[:1]), Rollout(a_world)
    out = rollout.evaluate(pool, teams[one], scenarios, heuristic[one])
    seen = rollout.record(pool, teams[NETWORKS], scenarios, heuristic[NETWORKS])
    ended = np.array([values[0, 0] for values in out.performance.values()])
    if seen["fitness"][-1].tobytes() != out.fitness[0, 0].tobytes():
        yield "fitness differs from that of evaluate: does outcome change more than performance?"
    if seen["performance"][-1].tobytes() != ended.tobytes():
        yield "performance differs from that of evaluate: outcome must start from 0 each time"


def _of_random_teams(a_world: World) -> Iterator[Finding]:
    epochs = TEAM_STEPS // a_world.params.iterations // 2
    n = int(min(RANDOM_TEAMS, max(10, epochs)))
    played = simulator(a_world, controller(world=a_world))
    out = played.evaluate(*random_teams(a_world, n), a_world.scenarios(KEYS[:2]))
    for name, values in (("fitness", out.fitness), *out.performance.items()):
        if bad := int((~np.isfinite(values)).sum()):
            share = f"{bad} of {values.size} values"
            yield Finding("problem", "random teams", f"{name} is not finite: {share}")
    main, values = next(iter(out.performance.items()))
    if np.ptp(values) == 0:
        text = f"{main} is {values.flat[0]:g} for all {n} in all scenarios"
        yield Finding("note", "random teams", text)
    fitness = out.fitness.reshape(n, -1)
    some = int((fitness != 0).any(axis=1).sum())
    kinds = len({row.tobytes() for row in fitness})
    text = f"{some} of {n} have any fitness, {kinds} different"
    if kinds == 1:
        text = f"all {n} have the same fitness: there is nothing to select on"
        yield Finding("problem", "random teams", text)
    elif some < FEW * n:
        yield Finding("note", "random teams", f"{text}: evolution may find nothing to start with")
    else:
        yield Finding("ok", "random teams", text)
