"""Hand-built situations of the pursuit worlds, for tests.

The robots of a situation drive with constant wheels: a neuron whose input weights are 0 has the
activation 1/2, and without neurons a wheel does not turn.
"""

import math
from dataclasses import replace

import numpy as np

from conevo.controllers.registry import controller, genome_of
from conevo.rng import stream
from conevo.worlds.pursuit.prey_sets import PreySet, save
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout

STOP, FORWARD, LEFT, RIGHT, REVERSE, NONE = 0, 1, 2, 3, 4, -1
PI = math.pi
IDLE, AHEAD = (0.0, 0.0), (1.0, 1.0)
FAR = (90.0, 90.0, 0.0)  # out of sight
T = 40
NAN = float("nan")


def half_sum(command):
    """Sum of a wheel's output unit, halved, for a command in [-1, 1]."""
    return math.atanh(min(max(command, -1 + 1e-13), 1 - 1e-13))


def drivers(wheels, genome):
    """Networks [K, G] and slots [R, U] of robots with constant wheels."""
    genes = np.zeros((len(wheels), genome.n_genes), np.float32)
    slots = np.full((len(wheels), genome.max_parts), -1, np.int32)
    for i, (left, right) in enumerate(wheels):
        genes[i, -2:] = 2 * half_sum(left) / 30, 2 * half_sum(right) / 30  # 6 x 10 gene / 2
        if (left, right) != IDLE:
            slots[i, :6] = i
    return genes, slots


def situation(robots, prey, path=None, obstacles=(), heuristic=None, **params):
    """Play robots and prey at poses (x, y, heading), each with wheels, or (-1) heuristic prey.

    Returns:
        The outcome's performance and the robots' fitness, and the record.
    """
    free_prey = len(prey[0]) == 3
    path = path or f"pursuit/team-{len(robots) - 1 + 5 * (len(prey) - 1)}"
    params = {"iterations": T} | params | ({"prey": "heuristic"} if free_prey else {})
    a_world = world(path, **params)
    scenarios = placed(a_world, [*robots, *prey], obstacles)
    if not free_prey:
        n = len(scenarios.prey_in) // len(prey)
        out = [[4 * half_sum(w) / n for w in one[3]] for one in prey for _ in range(n)]
        scenarios = replace(
            scenarios,
            prey_in=np.zeros_like(scenarios.prey_in),
            prey_out=np.array(out, np.float32),
        )
    return play(a_world, [one[3] for one in robots], scenarios, heuristic)


def shaping(prey, predators=(), obstacles=(), heuristic=None, **params):
    """Play prey with wheels in the prey world, with heuristic predators and obstacles."""
    a_world = world(
        f"prey/shaping-{3 * len(prey)}", **({"iterations": T, "least": 0, "most": 6} | params)
    )
    scenarios = placed(a_world, [*prey, *predators], obstacles)
    return play(a_world, [one[3] for one in prey], scenarios, heuristic)


def placed(a_world, poses, obstacles):
    """A scenario with only these bodies and obstacles."""
    scenarios = a_world.scenarios([11])
    fields = {name: getattr(scenarios, name).copy() for name in ("x", "y", "heading")}
    fields |= {name: np.zeros((1, 6), np.float32) for name in ("obstacle_x", "obstacle_y")}
    for b, (x, y, heading, *_) in enumerate(poses):
        fields["x"][0, b], fields["y"][0, b], fields["heading"][0, b] = x, y, heading
    for k, (x, y) in enumerate(obstacles):
        fields["obstacle_x"][0, k], fields["obstacle_y"][0, k] = x, y
    return replace(
        scenarios,
        n_bodies=np.array([len(poses)], np.int32),
        n_obstacles=np.array([len(obstacles)], np.int32),
        **fields,
    )


def play(a_world, wheels, scenarios, heuristic):
    rollout = Rollout(a_world, n_threads=1)
    genes, slots = drivers(wheels, rollout.genome)
    modes = np.full(a_world.n_robots, -1, np.int32)
    if heuristic is not None:
        modes[:] = heuristic
    seen = rollout.record(genes, slots, scenarios, modes)
    out = rollout.evaluate(genes, slots[None], scenarios, modes[None])
    result = {name: float(value[0, 0]) for name, value in out.performance.items()}
    return result | {"fitness": out.fitness[0, 0].tolist()}, seen


def around(x, y, distance, angles, wheels=IDLE):
    """Robots around a place, facing it."""
    return [
        (
            x + distance * math.cos(math.radians(a)),
            y + distance * math.sin(math.radians(a)),
            math.radians(a) + (PI if a <= 0 else -PI),
            wheels,
        )
        for a in angles
    ]


def hunt(capture_time, first_capture, captures, collisions):
    return {
        "capture_time": capture_time,
        "first_capture": first_capture,
        "captures": captures,
        "collisions": collisions,
    }


def split(result):
    return {k: v for k, v in result.items() if k != "fitness"}, result["fitness"]


def random_team(a_world, seed, scale=0.15):
    rng = stream(seed, "team")
    genome = genome_of(controller(world=a_world), a_world)
    slots = np.arange(a_world.n_robots * genome.max_parts, dtype=np.int32)
    genes = rng.uniform(-scale, scale, (len(slots), genome.n_genes)).astype(np.float32)
    genes[:, -2:] += 0.2 * scale
    return genes, slots.reshape(a_world.n_robots, -1)


def random_prey_file(path, seed):
    """A prey set of random networks that drive ahead and turn depending on their inputs.

    The lone prey has fewer slots than the two, and one of these has an empty slot.
    """
    rng = stream(seed, "prey")
    one, two = (
        rng.uniform(-0.4, 0.4, shape).astype(np.float32) for shape in ((1, 4, 10), (2, 6, 10))
    )
    one[:, :, 8:] += 0.15
    two[:, :, 8:] += 0.15
    active = np.ones((1, 4), bool), np.ones((2, 6), bool)
    active[1][1, 2] = False
    save(path, PreySet(one=one, one_active=active[0], two=two, two_active=active[1]))
    return str(path)
