"""The pursuit worlds, slow and obvious: one team, one iteration at a time, in float64.

Written from Nitschke 2009, chapter 4, and the page of settled gaps, not from the kernels, so that
agreement with them means something. Where the thesis is silent a comment starts "Settled:".

Sensors are fans of many rays, arcs go around the centre of their circle. An iteration has four
phases: ``sense``, ``decide``, ``move``, ``judge``; a caller may put other values (those of a
record) between them. ``run`` does whole epochs.

cm, radians counter-clockwise from +x, one iteration is 100 ms.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from oracles import splitmix

RADIUS = 2.75
WHEEL_BASE = 5.3
PLACE = (13, 43, 68, 158, -158, -68, -43, -13)
LOOK = (10, 45, 90, 180, -180, -90, -45, -10)
ACTIONS = ("stop", "forward", "left", "right", "reverse")


@dataclass(frozen=True)
class Params:
    """Nitschke 2009, table 4.1, and what is settled."""

    arena: float = 100.0
    reach: float = 22.0  # of infrared and light sensors, from the rim
    half_angle: float = 30.0  # degrees
    speed: float = 0.8  # of a predator, per iteration
    prey_speed: float = 1.2  # of a prey, in predator speeds
    window: int = 10  # iterations for which a prey must be stuck
    share: float = 0.1  # of the distance that its wheels commanded
    least: float = 0.2  # cm
    hunters: int = 2  # predators in light range of a captured prey


# --- minds --------------------------------------------------------------------------------------


@dataclass
class Network:
    """A network of decoded weights: hidden [U, S + C] and output [U, 2]; slot k feeds context k.

    ``filled`` [U]: an empty slot has no output and feeds no context.
    """

    w_in: np.ndarray
    w_out: np.ndarray
    filled: Sequence[bool]

    def think(self, inputs: Sequence[float]) -> tuple[float, float, list[float]]:
        """Return the wheel commands and the hidden activations."""
        hidden = [
            sigmoid(sum(float(w) * float(i) for w, i in zip(weights, inputs, strict=True)))
            if there
            else 0.0
            for weights, there in zip(self.w_in, self.filled, strict=True)
        ]
        left, right = (
            2.0 * sigmoid(sum(float(w[o]) * h for w, h in zip(self.w_out, hidden, strict=True)))
            - 1.0
            for o in range(2)
        )
        return left, right, hidden


class Chaser:
    """The heuristic predator (section 4.3): to the prey, else to its last place, else anywhere."""


class Dodger:
    """The heuristic prey: turns away from the side that sees more."""


class Walker:
    """The random walk."""


Mind = Network | Chaser | Dodger | Walker


def sigmoid(x: float) -> float:
    return 1.0 / (1.0 + math.exp(-x)) if x > -700.0 else 0.0


def networks(
    genes: np.ndarray, slots: np.ndarray, n_inputs: int, weight_scale: float = 10.0
) -> list[Network]:
    """Decode a team: genes [K, G] and slots [R, U], -1 for an empty slot."""
    found = []
    for row in slots:
        weights = np.array([genes[s] if s >= 0 else np.zeros(genes.shape[1]) for s in row], float)
        weights *= weight_scale
        found.append(Network(weights[:, :n_inputs], weights[:, n_inputs:], [s >= 0 for s in row]))
    return found


# --- the world ----------------------------------------------------------------------------------


@dataclass
class World:
    """One scenario and its state.

    Args:
        p: parameters.
        is_prey: [B] which bodies are prey.
        minds: [B].
        x, y, heading: [B] poses, changed by ``move``.
        obstacles: [O, 2] centres.
        seed: of the random walks.
        clamp: [B] of 16 values held by the sensor inputs, NaN for a free one; or None.
        mortal: [B] whether a collision ends the body's epoch (the robots of the prey world).
    """

    p: Params
    is_prey: Sequence[bool]
    minds: Sequence[Mind]
    x: np.ndarray
    y: np.ndarray
    heading: np.ndarray
    obstacles: np.ndarray
    seed: int
    clamp: np.ndarray | None = None
    mortal: Sequence[bool] | None = None
    t: int = 0
    refused: list[bool] = field(default_factory=list)  # in the previous iteration
    context: list[list[float]] = field(default_factory=list)
    memory: list[tuple[float, float] | None] = field(default_factory=list)
    wander: list[float] = field(default_factory=list)
    dead: list[bool] = field(default_factory=list)

    def __post_init__(self) -> None:
        b = len(self.is_prey)
        self.x, self.y, self.heading = (
            np.array(v, np.float64)[:b] for v in (self.x, self.y, self.heading)
        )
        self.refused = [False] * b
        self.context = []
        for mind, is_prey in zip(self.minds, self.is_prey, strict=True):
            n_sensors = 8 if is_prey else 16
            n_context = mind.w_in.shape[1] - n_sensors if isinstance(mind, Network) else 0
            self.context.append([0.0] * n_context)
        self.memory = [None] * b
        self.wander = [float(h) for h in self.heading]
        self.dead = [False] * b

    @property
    def bodies(self) -> range:
        return range(len(self.is_prey))

    @property
    def prey(self) -> list[int]:
        return [b for b in self.bodies if self.is_prey[b]]

    @property
    def predators(self) -> list[int]:
        return [b for b in self.bodies if not self.is_prey[b]]

    def speed(self, body: int) -> float:
        return self.p.speed * (self.p.prey_speed if self.is_prey[body] else 1.0)

    def distance(self, a: int, b: int) -> float:
        return math.hypot(self.x[a] - self.x[b], self.y[a] - self.y[b])


# --- sensing ------------------------------------------------------------------------------------

Hit = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def disc(x: float, y: float) -> Hit:
    """Distance along rays (origin x, y and angle, all [...]) to a disc; inf where they miss it."""

    def hit(ox: np.ndarray, oy: np.ndarray, angle: np.ndarray) -> np.ndarray:
        dx, dy = x - ox, y - oy
        along = dx * np.cos(angle) + dy * np.sin(angle)
        aside = dx * np.sin(angle) - dy * np.cos(angle)
        hits = (along > 0.0) & (np.abs(aside) <= RADIUS)
        depth = np.sqrt(np.maximum(RADIUS**2 - aside**2, 0.0))
        return np.where(hits, np.maximum(along - depth, 0.0), np.inf)

    return hit


def wall(normal: float, offset: float) -> Hit:
    """Distance along rays to the line whose outward normal has an angle and an offset from 0."""

    def hit(ox: np.ndarray, oy: np.ndarray, angle: np.ndarray) -> np.ndarray:
        gap = offset - ox * math.cos(normal) - oy * math.sin(normal)
        towards = np.cos(angle - normal)
        rate = np.where(towards > 1e-12, towards, 1.0)
        return np.where(towards > 1e-12, np.maximum(gap, 0.0) / rate, np.inf)

    return hit


def walls(arena: float) -> list[Hit]:
    quarter = math.pi / 2
    return [wall(0.0, arena), wall(quarter, arena), wall(2 * quarter, 0.0), wall(3 * quarter, 0.0)]


def nearest(ox: np.ndarray, oy: np.ndarray, look: np.ndarray, half: float, hit: Hit) -> np.ndarray:
    """Distance to the nearest point of a thing inside cones [S]: a fan, then a finer one."""
    fan = np.linspace(-half, half, 91)
    ox, oy, look = ox[:, None], oy[:, None], look[:, None]
    coarse = hit(ox, oy, look + fan)
    middle = fan[coarse.argmin(axis=1)][:, None]
    step = fan[1] - fan[0]
    finer = np.clip(middle + np.linspace(-step, step, 91), -half, half)
    return np.minimum(coarse.min(axis=1), hit(ox, oy, look + finer).min(axis=1))


def sense_body(w: World, me: int, light: bool) -> np.ndarray:
    """Eight infrared or eight light sensors of one body."""
    p = w.p
    place = w.heading[me] + np.radians(PLACE)
    look = w.heading[me] + np.radians(LOOK)
    ox, oy = w.x[me] + RADIUS * np.cos(place), w.y[me] + RADIUS * np.sin(place)
    centres = [
        (w.x[b], w.y[b]) for b in w.bodies if b != me and (w.is_prey[b] or not light)
    ]  # Settled: nothing blocks the view of a lamp, it is on top
    things = []
    if not light:
        centres += [(x, y) for x, y in w.obstacles]
        things = walls(p.arena)
    for x, y in centres:
        if math.hypot(x - w.x[me], y - w.y[me]) < p.reach + 2 * RADIUS + 1.0:  # or out of range
            things.append(disc(x, y))
    # Settled: 1 at contact, 0 at the range, linear in between.
    active = np.zeros(8)
    for hit in things:
        d = nearest(ox, oy, look, math.radians(p.half_angle), hit)
        active = np.maximum(active, 1.0 - d / p.reach)
    return np.clip(active, 0.0, 1.0)


def sense(w: World, me: int) -> np.ndarray:
    """The sensors of a body: 8 infrared, and 8 light sensors of a predator; some may be clamped."""
    sensors = sense_body(w, me, light=False)
    if not w.is_prey[me]:
        sensors = np.concatenate([sensors, sense_body(w, me, light=True)])
    if w.clamp is not None and me < len(w.clamp):
        held = np.asarray(w.clamp[me][: len(sensors)], float)
        sensors = np.where(np.isnan(held), sensors, held)
    return sensors


# --- deciding -----------------------------------------------------------------------------------


def wrap(angle: float) -> float:
    """The same direction in [-pi, pi)."""
    while angle < -math.pi:
        angle += 2 * math.pi
    while angle >= math.pi:
        angle -= 2 * math.pi
    return angle


def steer(heading: float, direction: float, speed: float) -> tuple[float, float]:
    """Wheel commands that turn as far as possible in one iteration, and go ahead with the rest."""
    w = wrap(direction - heading) * WHEEL_BASE / (2 * speed)
    w = min(max(w, -1.0), 1.0)
    f = 1.0 - abs(w)
    return f - w, f + w


def dodge(s: Sequence[float]) -> tuple[float, float]:
    w = max(s[5], s[6], s[7]) - max(s[0], s[1], s[2])
    if max(s[0], s[7]) > 0.7 and abs(w) < 0.05:
        w = 1.0
    w = min(max(w, -1.0), 1.0)
    f = 1.0 - abs(w)
    return f - w, f + w


def walk(w: World, me: int) -> tuple[float, float]:
    # Settled: the first direction is the body's own heading, and may turn in the first iteration.
    if w.refused[me] or splitmix.uniform(w.seed, w.t, 1, me) < 0.05:
        w.wander[me] = 2 * math.pi * splitmix.uniform(w.seed, w.t, 2, me) - math.pi
    return steer(w.heading[me], w.wander[me], w.speed(me))


def chase(w: World, me: int) -> tuple[float, float]:
    visible = [b for b in w.prey if w.distance(me, b) - 2 * RADIUS <= w.p.reach]
    if visible:
        target = min(visible, key=lambda b: w.distance(me, b))
        w.memory[me] = (w.x[target], w.y[target])
    place = w.memory[me]
    if place is not None:
        dx, dy = place[0] - w.x[me], place[1] - w.y[me]
        if visible or math.hypot(dx, dy) > 5.5:
            return steer(w.heading[me], math.atan2(dy, dx), w.speed(me))
        w.memory[me] = None
    return walk(w, me)


def decide(w: World, me: int, sensors: Sequence[float]) -> tuple[float, float]:
    """Wheel commands, left and right, in [-1, 1]."""
    if w.dead[me]:
        return 0.0, 0.0
    mind = w.minds[me]
    if isinstance(mind, Network):
        left, right, hidden = mind.think([*sensors, *w.context[me]])
        w.context[me] = [hidden[k] if k < len(hidden) else 0.0 for k in range(len(w.context[me]))]
        return left, right
    if isinstance(mind, Chaser):
        return chase(w, me)
    return dodge(sensors) if isinstance(mind, Dodger) else walk(w, me)


def action(left: float, right: float) -> int:
    """The motor primitive of two wheel commands, an index of ``ACTIONS``."""
    f, w = (left + right) / 2, (right - left) / 2
    if max(abs(left), abs(right)) < 0.1:
        return 0
    if abs(w) > abs(f):
        return 2 if w > 0 else 3
    return 1 if f > 0 else 4


# --- moving -------------------------------------------------------------------------------------


def arc(
    x: float, y: float, heading: float, left: float, right: float, speed: float
) -> tuple[float, float, float]:
    """The pose after one iteration on a circle, around its centre on the axis of the wheels."""
    vl, vr = left * speed, right * speed
    turn = (vr - vl) / WHEEL_BASE
    if abs(turn) < 1e-9:
        way = (vl + vr) / 2
        return x + way * math.cos(heading), y + way * math.sin(heading), wrap(heading + turn)
    radius = WHEEL_BASE / 2 * (vl + vr) / (vr - vl)  # to the left if positive
    cx, cy = x - radius * math.sin(heading), y + radius * math.cos(heading)
    end = heading + turn
    return cx + radius * math.sin(end), cy - radius * math.cos(end), wrap(end)


@dataclass
class Moves:
    """The result of ``move``: whether each body was refused, and the closest comparison.

    ``margin``: cm by which the closest of all comparisons was decided.
    """

    refused: list[bool]
    margin: float


def move(w: World, left: Sequence[float], right: Sequence[float]) -> Moves:
    """Move all bodies whose path is free; a refused one keeps its old pose."""
    calls = [math.inf]

    def too_close(xa: float, ya: float, xb: float, yb: float) -> bool:
        calls.append(abs(math.hypot(xa - xb, ya - yb) - 2 * RADIUS))
        return math.hypot(xa - xb, ya - yb) < 2 * RADIUS

    goal = [
        arc(w.x[b], w.y[b], w.heading[b], left[b], right[b], w.speed(b)) if not w.dead[b]
        else (w.x[b], w.y[b], w.heading[b])
        for b in w.bodies
    ]  # fmt: skip
    blocked = []
    for b, (x, y, _) in enumerate(goal):
        clear = min(x, y, w.p.arena - x, w.p.arena - y) - RADIUS
        calls.append(abs(clear))
        in_the_way = [(ox, oy) for ox, oy in w.obstacles]
        in_the_way += [(w.x[o], w.y[o]) for o in w.bodies if o != b]
        hits = [too_close(x, y, *place) for place in in_the_way]
        blocked.append(clear < 0.0 or any(hits))
    refused = list(blocked)
    for b in w.bodies:
        for o in w.bodies:
            both = b != o and not blocked[b] and not blocked[o]
            if both and too_close(*goal[b][:2], *goal[o][:2]):
                refused[b] = True
    for b in w.bodies:
        if w.dead[b]:
            refused[b] = False
        elif not refused[b]:
            w.x[b], w.y[b], w.heading[b] = goal[b]
        elif w.mortal is not None and w.mortal[b]:
            w.dead[b] = True
    w.refused = refused
    w.t += 1
    return Moves(refused, min(calls))


# --- scoring ------------------------------------------------------------------------------------


def way(left: np.ndarray, right: np.ndarray, speed: float) -> np.ndarray:
    """Length of the path that wheel commands ask for, cm."""
    return np.abs(left + right) / 2 * speed


def immobilized(p: Params, moved: Sequence[float], commanded: Sequence[float]) -> bool:
    """Whether a prey was stuck in the last ten iterations; both arguments end with this one."""
    if len(moved) < p.window:
        return False
    got, wanted = sum(moved[-p.window :]), sum(commanded[-p.window :])
    return got < p.share * wanted or got < p.least


def surrounded(w: World, prey: int) -> bool:
    near = [b for b in w.predators if w.distance(b, prey) - 2 * RADIUS <= w.p.reach]
    return len(near) >= w.p.hunters


def hunt_result(captured: np.ndarray, refused: np.ndarray) -> dict[str, float]:
    """Performance of the pursuit world from captured [T, Q] and the predators' refused [T, R]."""
    captured = np.asarray(captured, bool)
    any_prey = captured.any(axis=1)
    captures = 0
    for q in range(captured.shape[1]):
        before = False
        for now in captured[:, q]:
            captures += now and not before
            before = now
    return {
        "capture_time": float(any_prey.sum()),
        "first_capture": float(np.flatnonzero(any_prey)[0] if any_prey.any() else len(captured)),
        "captures": float(captures),
        "collisions": float(np.asarray(refused, bool).sum()),
    }


def flight_fitness(
    left: np.ndarray, right: np.ndarray, refused: np.ndarray, speed: float
) -> np.ndarray:
    """Fitness so far [T] of one prey of the prey world: far, fast, straight; 0 once collided."""
    total, dead, history = 0.0, False, []
    for l, r, stop in zip(left, right, refused, strict=True):  # noqa: E741
        dead = dead or bool(stop)
        total += abs(l + r) / 2 * speed * (1.0 - math.sqrt(abs(r - l) / 2))
        history.append(0.0 if dead else total)
    return np.array(history)


# --- the epoch ----------------------------------------------------------------------------------


def run(w: World, iterations: int) -> dict[str, np.ndarray]:
    """Simulate an epoch.

    Returns:
        After every iteration: x, y, heading, left, right, refused [T, B], captured [T, Q],
        sensors, a list of [B] arrays per iteration; margin [T].
    """
    log: dict[str, list] = {
        k: []
        for k in ("x", "y", "heading", "left", "right", "refused", "captured", "sensors", "margin")
    }
    moved: dict[int, list[float]] = {q: [] for q in w.prey}
    commanded: dict[int, list[float]] = {q: [] for q in w.prey}
    for _ in range(iterations):
        sensors = [sense(w, b) for b in w.bodies]
        wheels = [decide(w, b, sensors[b]) for b in w.bodies]
        left, right = (np.array([lr[k] for lr in wheels]) for k in range(2))
        moves = move(w, left, right)
        captured = []
        for q in w.prey:
            asked = float(way(left[q], right[q], w.speed(q)))
            moved[q].append(0.0 if moves.refused[q] else asked)
            commanded[q].append(asked)
            captured.append(immobilized(w.p, moved[q], commanded[q]) and surrounded(w, q))
        for name, value in {
            "x": w.x.copy(), "y": w.y.copy(), "heading": w.heading.copy(), "left": left,
            "right": right, "refused": moves.refused, "captured": captured, "margin": moves.margin,
        }.items():  # fmt: skip
            log[name].append(value)
        log["sensors"].append(sensors)
    return {k: v if k == "sensors" else np.array(v) for k, v in log.items()}  # type: ignore[misc]
