"""Hand-built situations of the gathering world, for tests, and its oracle's state of a record.

A robot of a situation plays a script: its first neuron is always on, the k-th is on until
iteration k, and its output weights are solved for the outputs that each iteration asks for.
"""

import math
from copy import copy
from dataclasses import fields, replace

import numpy as np

from conevo.controllers.registry import controller, genome_of
from conevo.rng import stream
from conevo.worlds.registry import world
from oracles import gacc_oracle as oracle
from oracles.gacc_scene import Block, Complex, Obstacle, Params, Robot, World, networks, sigmoid

PARTS = 10
# Environments by their complex objects, ordered and disordered.
BUILDS = {"o": "complex-3", "d": "complex-1", "oo": "complex-5", "od": "complex-4",
          "ooo": "complex-7", "ood": "complex-6"}  # fmt: skip
FAR = (0.97, 0.97)  # the place of unused objects
# A small home area and short sight, so that home and outside, near and far, are close together;
# objects are known from the start and waits are short, so that events happen soon.
SMALL = {
    "home_side": 0.2,
    "home_sight": 0.05,
    "object_range": 0.05,
    "robot_range": 0.05,
    "grip_distance": 0.02,
    "move_range": 0.01,
    "needs_detection": False,
    "wait": 5,
}
STEP = 0.0055  # the longest step of a script in both directions at once
IDLE = ["detect C"]


def logit(y):
    return math.log(y / (1.0 - y))


def targets(phase, move_range=0.01):
    """Weighted sums of the 8 outputs for "detect A", "grip B" or a step (dx, dy)."""
    sums = np.full(8, -3.0)
    if isinstance(phase, str):
        verb, _, letter = phase.partition(" ")
        sums[{"detect": 0, "grip": 5}[verb] + "ABC".index(letter)] = 4.0
    else:
        for o, way in zip((3, 4), phase, strict=True):
            sums[o] = logit(way / (move_range * math.sqrt(2.0)) + 0.5)
    return sums


def script(phases, n_genes=45, n_inputs=37, move_range=0.01):
    """Neurons [n, G] that execute one phase per iteration, at most 10, and repeat the last."""
    n = len(phases)
    genes = np.zeros((n, n_genes))
    on = np.zeros((n, n))  # activation of each neuron in each iteration
    for k in range(1, n):
        genes[k, 27] -= 1.0  # the context of the neuron that is always on
        if k > 1:
            genes[k, 27 + k - 1] += 1.0
    context = np.zeros(PARTS)
    for t in range(n):
        on[t] = [sigmoid(1.0 + 10.0 * g[27:n_inputs] @ context) for g in genes]
        context[:n] = on[t]
    wanted = np.array([targets(phase, move_range) for phase in phases])
    genes[:, n_inputs:] = np.linalg.solve(on, (wanted - 1.0) / 10.0)
    assert np.abs(genes).max() <= 1.0
    return genes.astype(np.float32)


def team(robots, genome, move_range=0.01):
    """Genes, slots and heuristics of robots (x, y, script or name of a heuristic controller)."""
    genes, slots = [], np.full((len(robots), genome.max_parts), -1, np.int32)
    heuristic = np.full(len(robots), -1, np.int32)
    for i, (_, _, mind) in enumerate(robots):
        if isinstance(mind, str):
            heuristic[i] = oracle.HEURISTICS.index(mind)
            continue
        first = sum(map(len, genes))
        genes.append(script(mind, move_range=move_range))
        slots[i, : len(mind)] = first + np.arange(len(mind))
    genes.append(np.zeros((1, genome.n_genes), np.float32))
    return np.concatenate(genes), slots, heuristic


def gathering(robots, objects, plans, *, ordered=None, obstacles=(), **params):
    """A world and a scenario with these robots and objects, and no others within sight.

    Args:
        robots: (x, y, script or name of a heuristic controller).
        objects: (x, y, letter); the other ones of ``plans`` lie at ``FAR``.
        plans: the parts of each complex object, as in "ABBC"; filled up with C to ten.
        ordered: "o" or "d" for each complex object; all ordered by default.
        params: of the world; ``SMALL`` and 12 iterations by default.
        obstacles: (left, bottom, right, top).

    Returns:
        The world, the arguments that ``Rollout.record`` takes, and the number of each object.
    """
    plans = [plan.ljust(PARTS, "C") for plan in plans]
    path = f"gacc/{BUILDS[ordered or 'o' * len(plans)]}"
    params = SMALL | {"iterations": 12} | params
    a_world = world(path, n_robots=len(robots), **params)
    types = sorted("".join(plans))
    numbers, free = [], list(range(len(types)))
    for _, _, letter in objects:
        k = next(k for k in free if types[k] == letter)
        free.remove(k)
        numbers.append(k)
    x, y = (np.full((1, len(types)), v, np.float32) for v in FAR)
    for k, (ox, oy, _) in zip(numbers, objects, strict=True):
        x[0, k], y[0, k] = ox, oy
    base = a_world.scenarios([7])
    blocks = np.tile(np.array([0.999, 0.0005, 0.9995, 0.001], np.float32), (base.left.shape[1], 1))
    blocks[: len(obstacles)] = np.array(obstacles, np.float32).reshape(-1, 4)
    scenarios = replace(
        base,
        object_x=x,
        object_y=y,
        object_type=np.array([["ABC".index(letter) for letter in types]], np.int32),
        plan=np.array([["ABC".index(letter) for letter in plan] for plan in plans], np.int32),
        start_x=np.array([[r[0] for r in robots]], np.float32),
        start_y=np.array([[r[1] for r in robots]], np.float32),
        **{
            name: blocks[None, :, k].copy()
            for k, name in enumerate(("left", "bottom", "right", "top"))
        },
    )
    genome = genome_of(controller(world=a_world), a_world)
    genes, slots, heuristic = team(robots, genome, a_world.params.move_range)
    return a_world, (genes, slots, scenarios, heuristic), numbers


# --- random teams and crowded places ------------------------------------------------------------


def random_team(a_world, seed, scale=0.3):
    """Networks with random empty slots, some of them beyond the context."""
    rng = stream(seed, "team")
    mind = controller(world=a_world)
    genome = genome_of(mind, a_world)
    r, u = a_world.n_robots, genome.max_parts
    genes = rng.uniform(-scale, scale, (r * u, genome.n_genes)).astype(np.float32)
    # Gathering is more likely than detecting; the choice depends on inputs and memory.
    first = len(a_world.inputs) + mind.n_context
    genes[:, first : first + 3] -= 0.05
    slots = np.arange(r * u, dtype=np.int32).reshape(r, u)
    slots[rng.random((r, u)) < 0.4] = -1
    slots[:, mind.n_hidden + 2 :] = -1
    return genes, slots


def crowded(scenarios, seed, robots=0.3, objects=0.3, e=0):
    """The same scenario with robots and objects in squares of these sides around the centre."""
    rng = stream(seed, "crowd")
    sides = (getattr(scenarios, name)[e] for name in ("left", "bottom", "right", "top"))
    blocks = np.stack(list(sides), axis=1)

    def draw(n, side):
        places = []
        while len(places) < n:
            at = (0.5 + rng.uniform(-side / 2, side / 2, 2)).astype(np.float32)
            is_free = not np.any(np.all((at >= blocks[:, :2]) & (at <= blocks[:, 2:]), axis=1))
            apart = all(math.dist(at, other) > 0.0025 for other in places)
            if is_free and apart:
                places.append(at)
        return np.array(places)[None]

    a, b = draw(scenarios.start_x.shape[1], robots), draw(scenarios.object_x.shape[1], objects)
    return replace(
        scenarios,
        start_x=a[:, :, 0].copy(),
        start_y=a[:, :, 1].copy(),
        object_x=b[:, :, 0].copy(),
        object_y=b[:, :, 1].copy(),
    )


# --- the oracle's state -------------------------------------------------------------------------


def build(a_world, genes, slots, scenarios, heuristic):
    """The oracle's world at the start of a scenario."""
    s, p = scenarios, a_world.params
    n_context = controller(world=a_world).n_context
    nets = networks(genes, slots, len(a_world.inputs) + n_context)
    minds = [net if h < 0 else oracle.HEURISTICS[h] for net, h in zip(nets, heuristic, strict=True)]
    robots = [
        Robot(float(x), float(y), mind, energy=p.energy, context=[0.0] * n_context)
        for x, y, mind in zip(s.start_x[0], s.start_y[0], minds, strict=True)
    ]
    things = zip(s.object_x[0], s.object_y[0], s.object_type[0], strict=True)
    rectangles = zip(s.left[0], s.bottom[0], s.right[0], s.top[0], strict=True)
    return World(
        p=Params(**{f.name: getattr(p, f.name) for f in fields(Params)}),
        robots=robots,
        objects=[Block(float(x), float(y), int(kind)) for x, y, kind in things],
        obstacles=[Obstacle(*map(float, sides)) for sides in rectangles],
        complexes=[
            Complex([int(kind) for kind in parts], ordered)
            for parts, ordered in zip(s.plan, a_world.plan.is_ordered, strict=True)
        ],
        seed=int(s.seed[0]),
    )


ROBOT = ("x", "y", "energy", "fitness", "action", "held", "waited", "dropped", "situation")
OBJECT = {"object_x": "x", "object_y": "y", "life": "life", "detected": "detected", "part": "part"}


def twin(w):
    """A copy whose state changes independently of the original."""
    other = copy(w)
    other.robots = [replace(r, counts=list(r.counts)) for r in w.robots]
    other.objects = [copy(block) for block in w.objects]
    other.complexes = [replace(one, built=list(one.built)) for one in w.complexes]
    other.events = w.events.copy()
    return other


def load(w, seen, t):
    """Set the oracle's state to the recorded one after iteration t."""
    for name in ROBOT:
        for robot, value in zip(w.robots, seen[name][t].tolist(), strict=True):
            setattr(robot, name, value)
    for i, robot in enumerate(w.robots):
        robot.counts = seen["counts"][t][i].tolist()
        robot.inputs = seen["inputs"][t, i].tolist()
        robot.context = seen["hidden"][t, i, : len(robot.context)].tolist()
    for name, ours in OBJECT.items():
        for block, value in zip(w.objects, seen[name][t].tolist(), strict=True):
            setattr(block, ours, value)
    built = {block.part: block.type for block in w.objects if block.part >= 0}
    for c, one in enumerate(w.complexes):
        steps = range(c * len(one.plan), (c + 1) * len(one.plan))
        one.built = [built[step] for step in steps if step in built]
    w.demand = seen["demand"][t].tolist()
    w.t = t + 1


def state(w):
    """The oracle's state in the form of ``Rollout.record``."""
    found = {name: np.array([getattr(r, name) for r in w.robots]) for name in ROBOT}
    for name, ours in OBJECT.items():
        found[name] = np.array([getattr(block, ours) for block in w.objects])
    found["counts"] = np.array([r.counts for r in w.robots]).ravel()
    found["demand"] = np.array(w.demand)
    return found
