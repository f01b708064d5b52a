"""Reproduction of behaviours, which shows that sensing causes the observed behaviour.

Nitschke 2009, sections 4.6.2 and 4.6.3.

**Individual.** A predator's sixteen sensor inputs are held at their averages during a behaviour,
and the resulting behaviour is observed. Choice: each trial starts like an instance of the
behaviour, with all bodies in their places, so the predator is within range of a prey and of another
predator; all others act freely. Choice: a predator's own averages, "repeated for each predator"
(appendix B).

**Collective.** The predators are put together around a prey, each in a place for its role, within
infrared range of another and light range of the prey (for spiders-fly also with the prey in that
range of a wall), and the captures are named. Choice: a predator's role is its most frequent longest
one in the captures to be reproduced. A predator without a role may be anywhere in range; headings
are random. Choice: blockers start in front of the prey, flankers at the sides of its rear, pursuers
not in front of it. Choice: controllers are left free by default, since constant inputs cannot react
to a prey; ``clamped`` holds them at the averages of the role.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from conevo.rng import fold, stream
from conevo.worlds.pursuit.study.behaviours import BEHAVIOURS, NONE, conduct
from conevo.worlds.pursuit.study.captures import COLLECTIVES, find_captures
from conevo.worlds.pursuit.study.observation import Observation, Record
from conevo.worlds.pursuit.study.sensors import average
from conevo.worlds.simulators import simulator

if TYPE_CHECKING:
    from conevo.worlds.protocol import Simulator
    from conevo.worlds.pursuit.arena import ArenaScenarios

__all__ = ["place_together", "reproduce_collectives", "reproduce_individuals"]

TRIAL = 30  # Choice: iterations of an individual's trial, three windows of the default rules
MARGIN = 0.01  # cm between bodies that are put into an arena
N_TRIES = 1000  # places to try before an arrangement is started again

Pose = tuple[float, float, float]


def reproduce_individuals(seen: Observation) -> list[dict[str, Any]]:
    """Return each predator's behaviour with its sensors held at the averages of its behaviours.

    Plain data, a row per predator and observed behaviour: predator, behaviour, trials,
    sensors (the 16 averages, proximity first), result (the most frequent most executed behaviour,
    or "none"), reproduced (portion of the trials in which the behaviour is executed most),
    primitive (motor primitive executed most), left and right (mean wheel commands), and
    is_reproduced, whether the result is the behaviour.
    """
    params = dataclasses.replace(seen.world.params, iterations=TRIAL)
    world = dataclasses.replace(seen.world, params=params)
    player = simulator(world, seen.simulator.controller, seen.simulator.n_threads)
    rows = []
    for predator in range(world.n_robots):
        for behaviour in BEHAVIOURS:
            if not (some := seen.instances(behaviour, predator)):
                continue
            held = average(some, seen.inputs)
            results: Counter[str] = Counter()
            records = []
            for one in some:
                start = _clamped(_resumed(seen, one.epoch, one.start), {predator: held})
                records.append(_play(player, seen, start))
                results[_most_executed(seen, records[-1], predator)] += 1
            action, left, right = (
                np.concatenate([record[name][:, predator] for record in records])
                for name in ("action", "left", "right")
            )
            result = max((*BEHAVIOURS, "none"), key=lambda name: results[name])
            rows.append(
                {
                    "predator": predator,
                    "behaviour": behaviour,
                    "trials": len(some),
                    "sensors": held.tolist(),
                    "result": result,
                    "reproduced": results[behaviour] / len(some),
                    "primitive": world.actions[int(np.bincount(action).argmax())],
                    "left": float(left.mean()),
                    "right": float(right.mean()),
                    "is_reproduced": result == behaviour,
                }
            )
    return rows


def reproduce_collectives(
    seen: Observation, trials: int = 20, *, clamped: bool = False
) -> list[dict[str, Any]]:
    """Return the results of putting predators together as in each observed collective behaviour.

    Plain data, a row per collective behaviour: collective, roles (of each predator, "" without
    one), trials, captured (trials with a capture), reproduced (trials with a capture of that name),
    seen (captures of each name), is_reproduced (whether a trial had a capture of that name).

    Args:
        seen: the observed team.
        trials: test simulations of each.
        clamped: hold each predator's sensors at its averages of its role.
    """
    rows = []
    for collective in COLLECTIVES[:-1]:
        own = [one.roles for one in seen.all_captures if one.collective == collective]
        if not own:
            continue
        roles = [_usual_role([one[i] for one in own]) for i in range(seen.world.n_robots)]
        held = {
            i: average(some, seen.inputs)
            for i, role in enumerate(roles)
            if clamped and (some := seen.instances(role, i))
        }
        names: Counter[str] = Counter()
        captured = reproduced = 0
        for k in range(trials):
            start = _clamped(_together(seen, roles, collective, k), held)
            record = _play(seen.simulator, seen, start)
            one = conduct(record, seen.sizes, seen.rules)
            found = [c.collective for c in find_captures(record, one, seen.sizes, seen.rules)]
            captured += bool(found)
            reproduced += collective in found
            names.update(found)
        rows.append(
            {
                "collective": collective,
                "roles": roles,
                "trials": trials,
                "captured": captured,
                "reproduced": reproduced,
                "seen": {name: names[name] for name in COLLECTIVES},
                "is_reproduced": reproduced > 0,
            }
        )
    return rows


def place_together(
    rng: np.random.Generator, seen: Observation, roles: Sequence[str], *, at_wall: bool
) -> npt.NDArray[np.float32]:
    """Return places and headings [B, 3]: the predators around the first prey, by their roles.

    Args:
        rng: draws places and headings.
        seen: has the sizes of arena and bodies, and the rules.
        roles: of each predator, "" without one.
        at_wall: whether the prey is within infrared range of a wall.
    """
    sizes, n_prey = seen.sizes, seen.world.n_prey
    edge = sizes.radius_cm + MARGIN
    while True:
        prey = _anywhere(rng, sizes.arena_cm, edge)
        if at_wall:
            gap = rng.uniform(MARGIN, min(sizes.range_cm, sizes.arena_cm / 2 - edge))
            side, axis = int(rng.integers(2)), int(rng.integers(2))
            at = sizes.radius_cm + gap
            at = sizes.arena_cm - at if side else at
            prey = (at, prey[1], prey[2]) if axis else (prey[0], at, prey[2])
        placed: list[Pose] = []
        for role in roles:
            pose = _fitting(rng, seen, role, prey, placed)
            if pose is None:
                break
            placed.append(pose)
        else:
            bodies = [*placed, prey]
            while len(bodies) < len(roles) + n_prey:
                pose = _anywhere(rng, sizes.arena_cm, edge)
                if all(math.dist(pose[:2], other[:2]) > 2 * edge for other in bodies):
                    bodies.append(pose)
            return np.array(bodies, dtype=np.float32)


def _fitting(
    rng: np.random.Generator, seen: Observation, role: str, prey: Pose, placed: Sequence[Pose]
) -> Pose | None:
    """Draw a pose for a role: free, in range of the prey and of a predator already placed."""
    sizes, rules = seen.sizes, seen.rules
    body = 2 * (sizes.radius_cm + MARGIN)
    sector = {
        "pursuer": (rules.front_deg, 180.0),
        "blocker": (0.0, rules.front_deg),
        "flanker": (rules.rear_deg, rules.behind_deg),
    }.get(role, (0.0, 180.0))
    low, high = sizes.radius_cm + MARGIN, sizes.arena_cm - sizes.radius_cm - MARGIN
    for _ in range(N_TRIES):
        far = rng.uniform(body, 2 * sizes.radius_cm + sizes.range_cm)
        angle = math.radians(rng.uniform(*sector)) * (1 if rng.integers(2) else -1) + prey[2]
        x, y = prey[0] + far * math.cos(angle), prey[1] + far * math.sin(angle)
        gaps = [math.dist((x, y), other[:2]) - body for other in placed]
        is_free = low <= x <= high and low <= y <= high and min(gaps, default=0.0) >= 0
        if is_free and min(gaps, default=0.0) <= sizes.range_cm - 2 * MARGIN:
            return x, y, rng.uniform(-math.pi, math.pi)
    return None


def _anywhere(rng: np.random.Generator, arena_cm: float, edge: float) -> Pose:
    x, y = rng.uniform(edge, arena_cm - edge, 2)
    return float(x), float(y), rng.uniform(-math.pi, math.pi)


def _together(seen: Observation, roles: list[str], collective: str, k: int) -> ArenaScenarios:
    """Return trial ``k``'s scenario."""
    key = fold(seen.seed, "together", collective, k)
    poses = place_together(stream(key, "places"), seen, roles, at_wall=collective == "spiders-fly")
    return _posed(seen.world.scenarios([key]), poses)


def _resumed(seen: Observation, epoch: int, t: int) -> ArenaScenarios:
    """Return an epoch's scenario with all bodies at their places before iteration ``t``."""
    record = seen.records[epoch]
    poses = np.stack([record[name][t - 1] for name in ("x", "y", "heading")], axis=-1)
    return _posed(seen.world.scenarios([seen.keys[epoch]]), poses)


def _posed(scenario: ArenaScenarios, poses: npt.NDArray[np.float32]) -> ArenaScenarios:
    x, y, heading = (np.ascontiguousarray(column[None]) for column in poses.T)
    return dataclasses.replace(scenario, x=x, y=y, heading=heading)


def _clamped(scenario: ArenaScenarios, held: dict[int, npt.NDArray[np.float64]]) -> ArenaScenarios:
    clamp = scenario.clamp.copy()
    for predator, values in held.items():
        clamp[predator] = values
    return dataclasses.replace(scenario, clamp=clamp)


def _play(player: Simulator, seen: Observation, scenario: ArenaScenarios) -> Record:
    return player.record(seen.genes, seen.team, scenario)


def _most_executed(seen: Observation, record: Record, predator: int) -> str:
    """Return the behaviour that a predator executed most in a trial, "none" if none."""
    behaviour = conduct(record, seen.sizes, seen.rules).behaviour[:, predator]
    named = behaviour[behaviour != NONE]
    return BEHAVIOURS[int(np.bincount(named).argmax())] if named.size else "none"


def _usual_role(own: Sequence[Sequence[str]]) -> str:
    """Return a predator's most frequent longest role, "" if it mostly had none."""
    longest = Counter(roles[0] if roles else "" for roles in own)
    return max(("", *BEHAVIOURS), key=lambda role: (longest[role], role != ""))
