"""The objects of gathering and collective construction, and how its robots sense them.

The first half of the oracle: state, geometry, sensing, in float64; ``gacc_oracle`` is the second.
Written from Nitschke 2009, chapter 6, and the page of settled gaps, not from the kernels. Where the
thesis is silent a comment starts "Settled:".
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from oracles import splitmix

NONE = -1
DETECT, MOVE, GRIP = 0, 3, 4  # actions: detect A, B, C; move; grip A, B, C
UNDETECTED = 2**31 - 1
LYING, GRIPPED, CARRIED, WAITING, HELPED, DELIVERED, DROPPED = range(7)


@dataclass(frozen=True)
class Params:
    """Nitschke 2009, table 6.4, and what is settled; lengths in sides of the square.

    The world has its own values; here they are small, for tests by hand.
    """

    iterations: int = 3000
    energy: float = 1000.0
    home_side: float = 0.2
    zone_side: float = 0.06
    home_range: float = 1.0
    home_sight: float = 0.05  # of the situations of 6.2.8
    object_range: float = 0.05
    object_accuracy: float = 1.0
    object_cost: float = 0.02
    robot_range: float = 0.05
    robot_cost: float = 0.01
    grip_distance: float = 0.02
    grip_cost: float = 0.01
    move_range: float = 0.01
    move_cost: float = 0.01
    wait: int = 30
    needs_detection: bool = True
    min_distance: float = 0.01
    separation: float = 0.002


# --- minds --------------------------------------------------------------------------------------


def sigmoid(x: float) -> float:
    return 1.0 / (1.0 + math.exp(-x)) if x > -700.0 else 0.0


@dataclass
class Network:
    """A network of decoded weights (section 6.2.7): hidden [U, S + C] and output [U, 8].

    ``filled`` [U]: an empty slot has no output and feeds no context. Slot k feeds context k.
    """

    w_in: np.ndarray
    w_out: np.ndarray
    filled: np.ndarray

    def think(self, inputs: np.ndarray, n_context: int) -> tuple[np.ndarray, list[float]]:
        """Return the outputs' weighted sums and the next context."""
        # "A value of one is added to each neuron's weight product."
        hidden = np.array([sigmoid(1.0 + s) for s in self.w_in @ inputs]) * self.filled
        sums = 1.0 + self.w_out.T @ hidden
        return sums, [float(hidden[k]) if k < len(hidden) else 0.0 for k in range(n_context)]


def networks(genes: np.ndarray, slots: np.ndarray, n_inputs: int) -> list[Network]:
    """Decode a team: genes [K, G] and slots [R, U], -1 for an empty slot; weight = 10 x gene."""
    found = []
    for row in slots:
        weights = np.array([genes[s] if s >= 0 else np.zeros(genes.shape[1]) for s in row], float)
        weights *= 10.0
        found.append(Network(weights[:, :n_inputs], weights[:, n_inputs:], np.array(row) >= 0))
    return found


# --- the world ----------------------------------------------------------------------------------


@dataclass
class Robot:
    """A robot; its mind is a network or the name of a heuristic controller."""

    x: float
    y: float
    mind: Network | str
    energy: float = 1000.0
    fitness: float = 0.0
    action: int = NONE  # executed in the previous iteration
    held: int = NONE  # object
    waited: int = 0
    dropped: int = NONE  # object released at home, not touched again before the robot leaves
    situation: int = 0
    counts: list[int] = field(default_factory=lambda: [0] * 10)
    switches: int = 0
    inputs: list[float] = field(default_factory=lambda: [0.0] * 27)
    context: list[float] = field(default_factory=lambda: [0.0] * 10)


@dataclass
class Block:
    """An atomic object."""

    x: float
    y: float
    type: int
    life: int = LYING
    detected: int = UNDETECTED  # iteration in which it was first sensed
    part: int = NONE  # complex object x parts + step


@dataclass
class Complex:
    """A complex object: types in order, and the types delivered so far."""

    plan: list[int]
    ordered: bool
    built: list[int] = field(default_factory=list)

    @property
    def is_complete(self) -> bool:
        return len(self.built) == len(self.plan)

    def needs(self, kind: int) -> bool:
        """Whether an object of a type can be its next part."""
        if self.is_complete:
            return False
        if self.ordered:
            return self.plan[len(self.built)] == kind
        return self.built.count(kind) < self.plan.count(kind)

    def priority(self, kind: int) -> float:
        """1 / steps until the next use (the next part is one step away), 0 if never used."""
        if not self.ordered:
            return 1.0 if self.needs(kind) else 0.0
        rest = self.plan[len(self.built) :]
        return 1.0 / (rest.index(kind) + 1) if kind in rest else 0.0


@dataclass(frozen=True)
class Obstacle:
    left: float
    bottom: float
    right: float
    top: float


@dataclass
class World:
    """One scenario and its state."""

    p: Params
    robots: list[Robot]
    objects: list[Block]
    obstacles: list[Obstacle]
    complexes: list[Complex]
    seed: int = 0
    t: int = 0
    demand: list[float] = field(default_factory=lambda: [0.0] * 3)
    events: Counter[str] = field(default_factory=Counter)

    def note(self, *events: str) -> None:
        """Count an event, so that a test can check whether it happened."""
        self.events.update(events)

    def at_home(self, thing: Robot | Block) -> bool:
        """Whether a thing is in the home area, a closed square at the centre (6.1)."""
        half = self.p.home_side / 2
        return abs(thing.x - 0.5) <= half and abs(thing.y - 0.5) <= half

    def holders(self, k: int) -> list[Robot]:
        return [robot for robot in self.robots if robot.held == k]

    def lying(self, k: int) -> bool:
        return self.objects[k].life in (LYING, DROPPED)

    def known(self, k: int) -> bool:
        """Settled: only an object that was found in an earlier iteration can be gripped."""
        return self.objects[k].detected < self.t or not self.p.needs_detection


def distance(a: Robot | Block, b: Robot | Block) -> float:
    return math.hypot(a.x - b.x, a.y - b.y)


# --- geometry -----------------------------------------------------------------------------------


def octant(dx: float, dy: float) -> int:
    """Octant 0..7 of a direction, counter-clockwise from +x (figure 6.4)."""
    if dx == dy == 0.0:
        return 3  # Settled: the octant without a direction
    angle = math.atan2(dy, dx)
    if angle < 0.0:
        angle += 2.0 * math.pi
    return min(math.floor(angle / (math.pi / 4.0)), 7)  # a hair below +x rounds to a full turn


def meets(obstacle: Obstacle, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether the segment from a to b meets a closed rectangle."""
    # The parts of the segment between left and right, and between bottom and top.
    enter, leave = 0.0, 1.0
    for a, b, low, high in (
        (ax, bx, obstacle.left, obstacle.right),
        (ay, by, obstacle.bottom, obstacle.top),
    ):
        if a == b:
            if not low <= a <= high:
                return False
            continue
        first, last = sorted(((low - a) / (b - a), (high - a) / (b - a)))
        enter, leave = max(enter, first), min(leave, last)
    return enter <= leave


def is_inside(obstacle: Obstacle, x: float, y: float) -> bool:
    return obstacle.left <= x <= obstacle.right and obstacle.bottom <= y <= obstacle.top


def in_view(w: World, me: Robot, other: Robot | Block) -> bool:
    """Whether the view is free of obstacles (figure 6.2)."""
    if any(meets(o, me.x, me.y, other.x, other.y) for o in w.obstacles):
        w.note(f"hidden {type(other).__name__.lower()}")
        return False
    return True


# --- sensing ------------------------------------------------------------------------------------


def reading(w: World, value: float, d: float) -> float:
    """Value over the squared distance, which is bounded from below (eqs 6.1 to 6.3).

    Settled: times the square of the least distance, so that readings lie in [-1, 1].
    """
    return value * w.p.min_distance**2 / max(d, w.p.min_distance) ** 2


def sense_objects(w: World, i: int) -> tuple[list[float], set[int]]:
    """Eight object/obstacle sensors (6.2.1), and the numbers of all objects that were seen."""
    me = w.robots[i]
    values, closest, seen = [0.0] * 8, [math.inf] * 8, set()
    if me.action not in (0, 1, 2):  # "Detection sensors need to be explicitly activated"
        return values, seen

    def look(number: int, dx: float, dy: float, o: int, value: float) -> bool:
        d = math.hypot(dx, dy)
        if d >= w.p.object_range:
            return False
        if splitmix.uniform(w.seed, w.t, 16 + number, i) >= w.p.object_accuracy:
            return False
        if d < closest[o]:  # "the closest object type, or obstacle, in quadrant q"
            closest[o] = d
            values[o] = reading(w, value, d)
        return True

    for k, block in enumerate(w.objects):
        near = distance(me, block) < w.p.object_range
        if block.type == me.action and w.lying(k) and near and in_view(w, me, block):
            dx, dy = block.x - me.x, block.y - me.y
            if look(k, dx, dy, octant(dx, dy), (block.type + 1) / 3):
                seen.add(k)
    number = len(w.objects)
    for obstacle in w.obstacles:
        dx = min(max(me.x, obstacle.left), obstacle.right) - me.x
        dy = min(max(me.y, obstacle.bottom), obstacle.top) - me.y
        look(number, dx, dy, octant(dx, dy), -1.0)
        number += 1
    for o, gap in ((0, 1.0 - me.x), (2, 1.0 - me.y), (4, me.x), (6, me.y)):
        look(number, gap, 0.0, o, -1.0)
        number += 1
    return values, seen


def sense_robots(w: World, i: int) -> list[float]:
    """Eight robot sensors (6.2.2): the type that the closest robot carries, 0 for none, 1..3."""
    me = w.robots[i]
    values, closest = [0.0] * 8, [math.inf] * 8
    for j, other in enumerate(w.robots):
        d = distance(me, other)
        if j == i or d >= w.p.robot_range or not in_view(w, me, other):
            continue
        o = octant(other.x - me.x, other.y - me.y)
        if d < closest[o]:
            closest[o] = d
            load = 0 if other.held == NONE else w.objects[other.held].type + 1
            values[o] = reading(w, load / 3, d)
    return values


def sense_home(w: World, i: int) -> list[float]:
    """Eight home area sensors (6.2.4). Settled: 1 inside a disc, then as 1 / distance."""
    me = w.robots[i]
    values, half = [0.0] * 8, w.p.home_side / 2
    dx, dy = 0.5 - me.x, 0.5 - me.y
    d = math.hypot(dx, dy)
    if d < w.p.home_range:
        values[octant(dx, dy)] = half / max(d, half)
    return values


def sense(w: World, i: int) -> tuple[list[float], set[int]]:
    """The 27 sensors of a robot and the objects it sees."""
    objects, seen = sense_objects(w, i)
    return objects + sense_robots(w, i) + sense_home(w, i) + list(w.demand), seen
