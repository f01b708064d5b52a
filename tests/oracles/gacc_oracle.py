"""Gathering and collective construction, slow and obvious: one team, in float64.

Written from Nitschke 2009, chapter 6, and the page of settled gaps, not from the kernels, so that
agreement with them means something. State and senses are those of ``gacc_scene``. Where the thesis
is silent a comment starts "Settled:".

An iteration has four phases: all robots ``sense`` and ``decide`` on the state that the previous
iteration left, then all ``commit``, then the ``referee`` judges the home area. A caller may put
other values (those of a record) between them; ``run`` does whole epochs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oracles import splitmix
from oracles.gacc_scene import (
    CARRIED,
    DELIVERED,
    DETECT,
    DROPPED,
    GRIP,
    GRIPPED,
    HELPED,
    MOVE,
    NONE,
    UNDETECTED,
    WAITING,
    Network,
    Params,
    Robot,
    World,
    distance,
    is_inside,
    sense,
    sigmoid,
)

# Table 6.3.
HEURISTICS = [f"{x}-{kind}" for kind in ("detector", "gatherer", "constructor") for x in "ABC"]
HEURISTICS.append("non-specialized")

# --- deciding -----------------------------------------------------------------------------------


@dataclass
class Decision:
    """The decision of a robot: an action, a place to go to, an object to grip, to let go."""

    action: int
    x: float
    y: float
    target: int = NONE
    lets_go: bool = False
    situation: int = 0
    refused: str = ""  # the obstruction


def situation(w: World, i: int) -> tuple[int, int]:
    """The situation (section 6.2.8) of a robot, and the object concerned."""
    me, p = w.robots[i], w.p
    if not w.at_home(me):
        return 0, NONE
    if me.held != NONE:
        return 2, me.held  # "in the home area, and is gripping an object"
    # 1: "another robot gripping an object is detected in the home area"
    others = [
        (distance(me, other), j)
        for j, other in enumerate(w.robots)
        if j != i and w.at_home(other) and other.held not in (NONE, me.dropped)
    ]
    d, j = min(others, default=(math.inf, NONE))
    if d < p.home_sight:
        return 1, w.robots[j].held
    # 3: "not gripping an object, and an object is detected in the home area"
    objects = [
        (distance(me, block), k)
        for k, block in enumerate(w.objects)
        if w.lying(k) and w.known(k) and k != me.dropped and w.at_home(block)
    ]
    d, k = min(objects, default=(math.inf, NONE))
    return (3, k) if d < p.home_sight else (0, NONE)


def follow(w: World, i: int, number: int, k: int) -> Decision:
    """The behavior of a situation: wait, or move to the object and grip it."""
    me, block = w.robots[i], w.objects[k]
    grip = Decision(GRIP + block.type, me.x, me.y, situation=number)
    if number == 2:
        return grip
    d = distance(me, block)
    if d <= w.p.grip_distance:
        grip.target = k
        return grip
    return towards(w, i, block.x, block.y, number)


def towards(w: World, i: int, x: float, y: float, number: int = 0) -> Decision:
    """A step straight towards a place, not beyond it."""
    me = w.robots[i]
    d = math.hypot(x - me.x, y - me.y)
    share = min(w.p.move_range, d) / d
    return Decision(MOVE, me.x + share * (x - me.x), me.y + share * (y - me.y), situation=number)


def use_gripper(w: World, i: int, kind: int) -> Decision:
    """The gripper with a setting: grip a near object, keep a fitting one, let go another one."""
    me = w.robots[i]
    decision = Decision(GRIP + kind, me.x, me.y)
    if me.held != NONE:
        decision.lets_go = w.objects[me.held].type != kind
        return decision
    # Settled: in the home area only the situations grip.
    objects = [
        (distance(me, block), k)
        for k, block in enumerate(w.objects)
        if block.type == kind and w.lying(k) and w.known(k) and not w.at_home(block)
    ]
    d, k = min(objects, default=(math.inf, NONE))
    if d <= w.p.grip_distance and not w.at_home(me):
        decision.target = k
    return decision


def use_network(w: World, i: int, sums: Sequence[float]) -> Decision:
    """The action of the highest output, ties go to the first (6.2.7)."""
    me = w.robots[i]
    best = max(range(8), key=lambda o: (sums[o], -o))
    if best < 3:
        return Decision(DETECT + best, me.x, me.y)
    if best > 4:
        return use_gripper(w, i, best - 5)
    # Settled: scaled so that both outputs at an extreme make the longest step (6.2.5).
    scale = w.p.move_range * math.sqrt(2.0)
    dx, dy = (scale * (sigmoid(sums[o]) - 0.5) for o in (3, 4))
    return Decision(MOVE, me.x + dx, me.y + dy)


def use_heuristic(w: World, i: int, name: str) -> Decision:
    """Table 6.3. Settled: 70 percent own action, 30 percent move."""
    me = w.robots[i]
    u = splitmix.uniform(w.seed, w.t, 0, i)
    turn = 2.0 * math.pi * splitmix.uniform(w.seed, w.t, 1, i)
    wander = Decision(
        MOVE, me.x + w.p.move_range * math.cos(turn), me.y + w.p.move_range * math.sin(turn)
    )
    if name == "non-specialized":
        action = int(7 * u)
    else:
        letter, _, kind = name.partition("-")
        own = (DETECT if kind == "detector" else GRIP) + "ABC".index(letter)
        action = own if u < 0.7 else MOVE
        if kind == "constructor" and not w.at_home(me):
            return towards(w, i, 0.5, 0.5) if u < 0.7 else wander
    if action == MOVE:
        return wander
    return use_gripper(w, i, action - GRIP) if action >= GRIP else Decision(action, me.x, me.y)


def decide(w: World, i: int, sums: Sequence[float] | None) -> Decision:
    """The decision of a robot.

    Args:
        sums: weighted sums of the network's 8 outputs, None for a heuristic robot.
    """
    me = w.robots[i]
    if me.energy <= 0.0:
        return Decision(NONE, me.x, me.y)
    number, k = situation(w, i)
    if number:
        w.note(f"situation {number}")
        decision = follow(w, i, number, k)
    elif isinstance(me.mind, str):
        decision = use_heuristic(w, i, me.mind)
    else:
        decision = use_network(w, i, sums)
    if decision.action == MOVE:
        decision.refused = why_refused(w, i, decision.x, decision.y)
        if decision.refused:
            w.note(f"refused by {decision.refused}")
            decision.x, decision.y = me.x, me.y
    return decision


def why_refused(w: World, i: int, x: float, y: float) -> str:
    """The obstruction of a robot that wants to go to a place, empty if none."""
    me = w.robots[i]
    if not (0.0 <= x < 1.0 and 0.0 <= y < 1.0):
        return "edge"
    if any(is_inside(obstacle, x, y) for obstacle in w.obstacles):
        return "obstacle"
    if any(too_close(w, x, y, o.x, o.y) for j, o in enumerate(w.robots) if j != i):
        return "robot"
    is_constructor = isinstance(me.mind, str) and me.mind.endswith("constructor")
    if is_constructor and w.at_home(me) and not w.at_home(Robot(x, y, "")):
        return "home"  # "causes constructors to remain within the home area"
    return ""


def too_close(w: World, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether two places are the same: only one robot can occupy a position (6.1.2)."""
    return (ax - bx) ** 2 + (ay - by) ** 2 < w.p.separation**2


# --- committing ---------------------------------------------------------------------------------


def commit(w: World, decisions: Sequence[Decision]) -> None:
    """Execute all decisions: moves, grips, their costs."""
    alive = [i for i, robot in enumerate(w.robots) if robot.energy > 0.0]
    for i, robot in enumerate(w.robots):
        if i not in alive:
            robot.action, robot.situation = NONE, 0
    loads = [NONE if r.held == NONE else w.objects[r.held].type for r in w.robots]
    for i in alive:
        count(w.robots[i], decisions[i].action, loads[i])
    for i in alive:
        move(w, i, decisions)
    grip(w, alive, decisions)
    for i in alive:
        robot, decision = w.robots[i], decisions[i]
        robot.action, robot.situation = decision.action, decision.situation
        if decision.situation == 2:
            robot.waited += 1
        robot.energy -= w.p.robot_cost + price(w.p, decision.action)
        if robot.energy <= 0.0:
            let_go(w, robot, "no energy")
        if not w.at_home(robot):
            robot.dropped = NONE


def count(robot: Robot, action: int, load: int) -> None:
    """Count an action: a move with a gripped object counts as gathering its type (6.1.1)."""
    column = GRIP + load if action == MOVE and load != NONE else action
    robot.counts[column] += 1
    if robot.action not in (NONE, action):
        robot.switches += 1


def move(w: World, i: int, decisions: Sequence[Decision]) -> None:
    """Go to the proposed place with the carried object, unless a lower number goes there."""
    robot, place = w.robots[i], decisions[i]
    if (place.x, place.y) == (robot.x, robot.y):
        return
    if any(too_close(w, place.x, place.y, d.x, d.y) for d in decisions[:i]):
        w.note("refused by rival")
        return
    robot.x, robot.y = place.x, place.y
    if robot.held != NONE:
        block = w.objects[robot.held]
        block.x, block.y, block.life = robot.x, robot.y, CARRIED


def grip(w: World, alive: Sequence[int], decisions: Sequence[Decision]) -> None:
    """Grip and let go: one robot per object outside, any number of them in the home area."""
    taken = set()
    for i in alive:
        robot, k = w.robots[i], decisions[i].target
        if decisions[i].lets_go:
            let_go(w, robot, "other setting")
        if k != NONE and (w.at_home(w.objects[k]) or k not in taken):
            robot.held, robot.waited = k, 0
            taken.add(k)


def price(p: Params, action: int) -> float:
    return p.object_cost if action < MOVE else p.move_cost if action == MOVE else p.grip_cost


def let_go(w: World, robot: Robot, why: str) -> None:
    if robot.held != NONE:
        w.note(f"let go: {why}")
    if why in ("waited", "out of order"):
        robot.dropped = robot.held
    robot.held, robot.waited = NONE, 0


# --- refereeing ---------------------------------------------------------------------------------


def referee(w: World) -> None:
    """Judge the objects held in the home area, then update the state of every object."""
    for k, block in enumerate(w.objects):
        holders = w.holders(k)
        if block.life == DELIVERED or not holders or not w.at_home(block):
            continue
        needy = [c for c, one in enumerate(w.complexes) if one.needs(block.type)]
        if needy and len(holders) >= 2 + block.type:  # table 6.1
            deliver(w, k, needy[0])
        elif not needy and len(holders) >= 2:  # situation 4: "out-of-order"
            for robot in holders:
                let_go(w, robot, "out of order")
                robot.situation = 4
    for robot in w.robots:
        # "If the wait with cargo time period is exceeded then drop the object"
        if robot.held != NONE and w.at_home(robot) and robot.waited >= w.p.wait:
            let_go(w, robot, "waited")
    for k, block in enumerate(w.objects):
        block.life = next_life(w, k)
    w.demand = [demand(w, kind) for kind in range(3)]
    w.t += 1


def deliver(w: World, k: int, c: int) -> None:
    """Put an object in its place and reward its holders equally (eq. 6.8)."""
    block, one = w.objects[k], w.complexes[c]
    step, parts = len(one.built), len(one.plan)
    block.part, block.life = c * parts + step, DELIVERED
    block.x = 0.5 + w.p.zone_side * ((step + 0.5) / parts - 0.5)
    block.y = 0.5 + w.p.zone_side * ((c + 0.5) / len(w.complexes) - 0.5)
    one.built.append(block.type)
    for robot in w.holders(k):
        robot.fitness += 1
        # A constructor "specializes to correctly delivering": the wait and the iteration in which
        # it came or gripped were construction, not gathering.
        robot.counts[GRIP + block.type] -= robot.waited + 1
        robot.counts[GRIP + 3 + block.type] += robot.waited + 1
        let_go(w, robot, "delivered")
    w.note(f"delivered {'ABC'[block.type]}", "ordered" if one.ordered else "disordered")


def next_life(w: World, k: int) -> int:
    block, n = w.objects[k], len(w.holders(k))
    if block.life == DELIVERED:
        return DELIVERED
    if n == 0:
        return DROPPED if block.life in (GRIPPED, CARRIED, WAITING, HELPED) else block.life
    if w.at_home(block):
        return WAITING if n == 1 else HELPED
    return CARRIED if block.life == CARRIED else GRIPPED


def demand(w: World, kind: int) -> float:
    """Demand for a type (eqs 6.4 to 6.6): priority divided by the objects not delivered yet.

    A complex object broadcasts once it has two parts, until it is complete (section 6.1.2).
    """
    broadcasting = [one for one in w.complexes if len(one.built) >= 2 and not one.is_complete]
    left = sum(block.type == kind and block.life != DELIVERED for block in w.objects)
    top = max((one.priority(kind) for one in broadcasting), default=0.0)
    return top / left if top else 0.0


def performance(w: World) -> dict[str, float]:
    delivered = sum(block.life == DELIVERED for block in w.objects)
    return {
        "delivered": float(delivered),
        "completed": float(sum(one.is_complete for one in w.complexes)),
        "delivered_share": 100.0 * delivered / len(w.objects),
    }


# --- the epoch ----------------------------------------------------------------------------------


def step(w: World) -> list[Decision]:
    """One iteration; returns the robots' decisions."""
    decisions, found = [], set()
    for i, robot in enumerate(w.robots):
        sums = None
        if robot.energy > 0.0:
            robot.inputs, seen = sense(w, i)
            found |= seen
        if isinstance(robot.mind, Network):
            inputs = np.array([*robot.inputs, *robot.context])
            sums, robot.context = robot.mind.think(inputs, len(robot.context))
        decisions.append(decide(w, i, sums))
    for k in found:
        if w.objects[k].detected == UNDETECTED:
            w.objects[k].detected = w.t
    commit(w, decisions)
    referee(w)
    return decisions


def run(w: World, iterations: int) -> None:
    for _ in range(iterations):
        step(w)
