"""The multi-rover world, slow and obvious: one team, one epoch, in float64.

Written from Nitschke 2009, chapter 5, and the page of settled gaps, not from the kernels, so that
agreement with them means something. Where the thesis is silent a comment starts "Settled:".

All rovers sense, think and act on the state at the end of the previous iteration. An iteration is
sense -> think -> act -> (moves) -> coverage -> detection -> energy.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

LOW, MED, HI, MOVE, NONE = 0, 1, 2, 3, -1
A, B, C, D, E = range(5)

# Nitschke 2009, table 5.1: the two settings that together detect a rock of each type.
COMPLEMENTARY = {
    A: {(LOW, LOW)},
    B: {(LOW, MED), (MED, LOW)},
    C: {(MED, HI), (HI, MED)},
    D: {(HI, HI)},
    E: {(LOW, LOW), (MED, MED), (HI, HI)},
}

# A controller maps (iteration, 16 sensor values) to the five motor outputs MO-0..MO-4.
Controller = Callable[[int, np.ndarray], Sequence[float]]
# Success draw in [0, 1) of (iteration, rock, rover).
Uniform = Callable[[int, int, int], float]


@dataclass(frozen=True)
class Params:
    """Nitschke 2009, table 5.4; triples are low, med, hi (table 5.2 is lost: settled)."""

    iterations: int = 2500
    energy: float = 1000.0
    ranges: tuple[float, float, float] = (0.07, 0.05, 0.03)
    accuracies: tuple[float, float, float] = (0.7, 0.8, 0.9)
    costs: tuple[float, float, float] = (0.1, 0.2, 0.3)
    rover_range: float = 0.02
    sensing_cost: float = 0.05
    d_max: float = 0.01
    move_cost: float = 0.01
    report_cost: float = 0.05
    d_min: float = 0.01
    separation: float = 0.002
    coverage_cells: int = 100
    fitness: str = "cumulative"  # area so far; "activation": its own; "product", "value"
    rocks_per_activation: int = 0  # all in range
    sensor_noise: float = 0.0
    action_noise: float = 0.0
    failure: float = 0.0
    failure_at: int = 0


# --- controllers --------------------------------------------------------------------------------


def sigmoid(x: float) -> float:
    return 1.0 / (1.0 + math.exp(-x)) if x > -700.0 else 0.0


class Network:
    """An Elman network of neuron genotypes; weight = 10 x gene.

    Args:
        genes: [K, 31] pool; a genotype is 16 sensor, 10 context and 5 output weights.
        slots: [U] row of ``genes`` in each hidden slot, -1 for an empty slot.
    """

    def __init__(
        self,
        genes: np.ndarray,
        slots: Sequence[int],
        n_sensors: int = 16,
        n_context: int = 10,
        n_outputs: int = 5,
    ) -> None:
        assert genes.shape[1] == n_sensors + n_context + n_outputs
        self.neurons = [None if s < 0 else 10.0 * genes[s].astype(np.float64) for s in slots]
        self.n_outputs = n_outputs
        self.n_inputs = n_sensors + n_context
        self.context = [0.0] * n_context

    def __call__(self, t: int, sensors: np.ndarray) -> list[float]:
        inputs = [*sensors, *self.context]
        hidden = []
        for weights in self.neurons:
            if weights is None:
                hidden.append(0.0)
            else:
                total = sum(weights[i] * inputs[i] for i in range(self.n_inputs))
                hidden.append(sigmoid(total))
        outputs = []
        for o in range(self.n_outputs):
            total = 0.0
            for weights, activation in zip(self.neurons, hidden, strict=True):
                if weights is not None:
                    total += weights[self.n_inputs + o] * activation
            outputs.append(sigmoid(total))
        for k in range(len(self.context)):
            self.context[k] = hidden[k] if k < len(hidden) else 0.0
        return outputs


# Nitschke 2009, table 5.3: preferences for low, med, hi, move.
PREFERENCES = {
    "low": (0.7, 0.0, 0.0, 0.3),
    "med": (0.0, 0.7, 0.0, 0.3),
    "hi": (0.0, 0.0, 0.7, 0.3),
    "non-specialized": (0.25, 0.25, 0.25, 0.25),
}


class Heuristic:
    """A heuristic rover: random actions by preference, full steps in random directions.

    Args:
        preferences: probabilities of low, med, hi, move.
        draws: iteration -> two numbers in [0, 1): the first picks the action (in the order low,
            med, hi, move), the second is the direction as a fraction of a turn from +x.
    """

    def __init__(
        self, preferences: Sequence[float], draws: Callable[[int], tuple[float, float]]
    ) -> None:
        self.preferences = preferences
        self.draws = draws

    def __call__(self, t: int, sensors: np.ndarray) -> list[float]:
        pick, turn = self.draws(t)
        below = 0.0
        for setting in (LOW, MED, HI):
            below += self.preferences[setting]
            if pick < below:
                return activate(setting)
        return step_towards(2.0 * math.pi * turn)


def activate(setting: int) -> list[float]:
    """Outputs that activate the rock sensors with a setting."""
    outputs = [0.0] * 5
    outputs[setting] = 1.0
    return outputs


def step_towards(angle: float) -> list[float]:
    """Outputs that move a full step d_max; MO-3 and MO-4 may leave [0, 1], as no network's do."""
    half = math.sqrt(0.5)
    return [-1.0, -1.0, -1.0, 0.5 + half * math.cos(angle), 0.5 + half * math.sin(angle)]


# --- sensing ------------------------------------------------------------------------------------


def octant(dx: float, dy: float) -> int:
    """Octant 0..7 of a direction, counter-clockwise from +x (figure 5.6)."""
    angle = math.atan2(dy, dx)
    if angle < 0.0:
        angle += 2.0 * math.pi
    # A direction a hair below +x rounds to a full turn.
    return min(math.floor(angle / (math.pi / 4.0)), 7)


def rover_sensors(p: Params, me: int, xy: np.ndarray, shown: Sequence[int]) -> list[float]:
    """Eight rover sensors, eq. 5.3: setting of the closest rover over its squared distance.

    Args:
        xy: [R, 2] positions.
        shown: [R] setting 1, 2, 3 that each rover shows.
    """
    closest = [math.inf] * 8
    values = [0.0] * 8
    for other in range(len(xy)):
        if other == me:
            continue
        dx, dy = xy[other] - xy[me]
        d2 = dx * dx + dy * dy
        o = octant(dx, dy)
        if d2 < p.rover_range**2 and d2 < closest[o]:
            closest[o] = d2
            # Settled: scaled by d_min^2 / 3, so that the largest value is 1.
            values[o] = shown[other] * p.d_min**2 / (3.0 * max(d2, p.d_min**2))
    return values


def rock_sensors(
    p: Params,
    position: np.ndarray,
    setting: int,
    rock_xy: np.ndarray,
    value: np.ndarray,
    detected: np.ndarray,
) -> list[float]:
    """Eight rock sensors, eq. 5.2: sum of rock values over squared distance.

    Args:
        position: [2] of the rover.
        setting: its previous action; sensors are off unless that was an activation.
        detected: [K] iteration of detection, -1 while undetected.
    """
    if setting not in (LOW, MED, HI):
        return [0.0] * 8
    sums = [0.0] * 8
    for k in within(position, rock_xy, p.ranges[setting]):
        if detected[k] < 0:
            dx, dy = rock_xy[k] - position
            d2 = dx * dx + dy * dy
            sums[octant(dx, dy)] += value[k] * p.d_min**2 / max(d2, p.d_min**2)
    return [z / (1.0 + z) for z in sums]  # Settled: squashed into [0, 1)


def within(position: np.ndarray, points: np.ndarray, radius: float) -> list[int]:
    """Indices of the points strictly closer than radius, ascending."""
    d2 = ((points - position) ** 2).sum(axis=1)
    return [int(k) for k in np.flatnonzero(d2 < radius**2)]


# --- acting -------------------------------------------------------------------------------------


def choose(outputs: Sequence[float]) -> int:
    """The action of the highest output, the first on a tie; MO-3 and MO-4 both mean move."""
    best = 0
    for o in range(1, 5):
        if outputs[o] > outputs[best]:
            best = o
    return min(best, MOVE)


def blocked(p: Params, me: int, target: np.ndarray, xy: np.ndarray, mask: np.ndarray) -> bool:
    """Whether a target is outside, in a canal, or upon another rover's last position."""
    x, y = target
    if not (0.0 <= x < 1.0 and 0.0 <= y < 1.0):
        return True
    if mask[math.floor(y * mask.shape[0]), math.floor(x * mask.shape[1])]:
        return True
    return any(other != me and too_close(p, target, xy[other]) for other in range(len(xy)))


def too_close(p: Params, a: np.ndarray, b: np.ndarray) -> bool:
    return bool(((a - b) ** 2).sum() < p.separation**2)


# --- the epoch ----------------------------------------------------------------------------------


def run(
    p: Params,
    controllers: Sequence[Controller],
    rock_x: np.ndarray,
    rock_y: np.ndarray,
    rock_type: np.ndarray,
    rock_value: np.ndarray,
    mask: np.ndarray,
    start: np.ndarray,
    uniform: Uniform,
) -> dict[str, np.ndarray]:
    """Simulate one team for one epoch.

    Args:
        p: parameters.
        controllers: one per rover.
        rock_x, rock_y, rock_type, rock_value: [K] rocks; types 0..4 are A..E.
        mask: [rows, columns] canals over the unit square; row from y, column from x.
        start: [R, 2] positions.
        uniform: success draw of (iteration, rock, rover); detection succeeds below the accuracy.

    Returns:
        Per iteration: position [T, R, 2], action [T, R] (0..3, -1 dead), sensors [T, R, 16],
        outputs [T, R, 5], energy [T, R], covered [T, R] (fraction), all at the iteration's end.
        Per rock: detected [K] (iteration, -1 never). Per rover: fitness, credited (sum of values)
        [R], counts [R, 4], switches [R]. Of the team: value, area.
    """
    n_robots, n_rocks, n_iterations = len(controllers), len(rock_x), p.iterations
    xy = np.array(start, np.float64)
    rock_xy = np.stack([rock_x, rock_y], axis=1).astype(np.float64)
    value = np.asarray(rock_value, np.float64)
    energy = np.full(n_robots, p.energy)
    previous = [NONE] * n_robots  # action of the previous iteration
    shown = [1] * n_robots  # Settled: setting "low" before the first activation
    detected = np.full(n_rocks, -1)
    fitness = np.zeros(n_robots)
    credited = np.zeros(n_robots)
    counts = np.zeros((n_robots, 4), np.int64)
    switches = np.zeros(n_robots, np.int64)
    side = p.coverage_cells
    middles = (np.arange(side) + 0.5) / side
    cells = np.array([(x, y) for y in middles for x in middles])
    covered = np.zeros((n_robots, side * side), np.bool_)
    log: dict[str, np.ndarray] = {
        "position": np.zeros((n_iterations, n_robots, 2)),
        "action": np.full((n_iterations, n_robots), NONE),
        "sensors": np.zeros((n_iterations, n_robots, 16)),
        "outputs": np.zeros((n_iterations, n_robots, 5)),
        "energy": np.zeros((n_iterations, n_robots)),
        "covered": np.zeros((n_iterations, n_robots)),
    }

    for t in range(n_iterations):
        alive = [v for v in range(n_robots) if energy[v] > 0.0]

        # Sense and think: no state changes here.
        action = [NONE] * n_robots
        proposal: dict[int, np.ndarray] = {}
        for v in alive:
            sensors = np.array(
                rover_sensors(p, v, xy, shown)
                + rock_sensors(p, xy[v], previous[v], rock_xy, value, detected)
            )
            if p.sensor_noise:
                u = np.array([uniform(t, 2**20 - 512 + k, v) for k in range(16)])
                sensors = np.clip(sensors + p.sensor_noise * (2 * u - 1), 0.0, 1.0)
            outputs = controllers[v](t, sensors)
            if p.action_noise and uniform(t, 2**20 - 320, v) < p.action_noise:
                outputs = [sigmoid(8 * uniform(t, 2**20 - 384 + o, v) - 4) for o in range(5)]
            action[v] = choose(outputs)
            log["sensors"][t, v] = sensors
            log["outputs"][t, v] = outputs
            if action[v] == MOVE:
                # Settled: a corner of the output square is a step of exactly d_max.
                scale = 2.0 * p.d_max / math.sqrt(2.0)
                target = xy[v] + scale * np.array([outputs[3] - 0.5, outputs[4] - 0.5])
                if not blocked(p, v, target, xy, mask):
                    proposal[v] = target

        # Move. A proposal yields to one of a lower index even if that one yields itself.
        for v, target in proposal.items():
            rivals = [w for w in proposal if w < v and too_close(p, target, proposal[w])]
            if not rivals:
                xy[v] = target

        # Cover. A rover that activates stands still, so its place is the same all iteration.
        activating = [v for v in alive if action[v] in (LOW, MED, HI)]
        for v in activating:
            covered[v, within(xy[v], cells, p.ranges[action[v]])] = True

        # Detect.
        hits: dict[int, list[int]] = {}
        for v in activating:
            for k in within(xy[v], rock_xy, p.ranges[action[v]]):
                if detected[k] < 0 and uniform(t, k, v) < p.accuracies[action[v]]:
                    hits.setdefault(k, []).append(v)

        def partners_of(k: int, rovers: Sequence[int], action: list[int] = action) -> set[int]:
            """The rovers that belong to a pair whose settings detect rock k."""
            fitting = COMPLEMENTARY[int(rock_type[k])]
            return {
                v for v in rovers for w in rovers if v != w and (action[v], action[w]) in fitting
            }

        if p.rocks_per_activation == 1:
            # Settled: of the rocks that it could detect with any partner, each rover takes the
            # first in random order.
            could = {k: partners_of(k, rovers) for k, rovers in hits.items()}
            hits = {}
            for v in activating:
                mine = [k for k in could if v in could[k]]
                if mine:
                    first = min(mine, key=lambda k, t=t: (uniform(t, k, 64), k))
                    hits.setdefault(first, []).append(v)
        reporting = set()
        for k, rovers in sorted(hits.items()):
            partners = partners_of(k, rovers)
            for v in sorted(partners):
                d2 = ((rock_xy[k] - xy[v]) ** 2).sum()
                # eq. 5.4; the bound of eq. 5.1 is against singularities, hence a maximum.
                own = math.pi * p.ranges[action[v]] ** 2
                area = own if p.fitness == "activation" else covered[v].mean()
                fitness[v] += value[k] * area / max(d2, p.d_min**2)
                credited[v] += value[k]
            if partners:
                detected[k] = t
                reporting |= partners

        # Pay the costs, and store the actions.
        for v in alive:
            energy[v] -= p.sensing_cost
            energy[v] -= p.move_cost if action[v] == MOVE else p.costs[action[v]]
            may_fail = p.failure_at in (0, t + 1)
            if p.failure and may_fail and uniform(t, 2**20 - 319, v) < p.failure:
                energy[v] = min(energy[v], 0.0)  # for good
            if v in reporting:
                energy[v] -= p.report_cost
            counts[v, action[v]] += 1
            if previous[v] not in (NONE, action[v]):  # the dead stay dead
                switches[v] += 1
            if action[v] != MOVE:
                shown[v] = action[v] + 1
        previous = action
        log["position"][t] = xy
        log["action"][t] = action
        log["energy"][t] = energy
        log["covered"][t] = covered.mean(axis=1)

    if p.fitness == "product":
        fitness = credited * covered.mean(axis=1)
    if p.fitness == "value":
        fitness = credited
    # The lander records a detection one iteration later, so those of the last one are lost.
    recorded = (detected >= 0) & (detected <= n_iterations - 2)
    return log | {
        "detected": detected,
        "fitness": fitness,
        "credited": credited,
        "counts": counts,
        "switches": switches,
        "value": np.array(value[recorded].sum()),
        "area": np.array(covered.any(axis=0).mean()),
    }
