"""The pursuit worlds' kernels against the slow oracle, phase by phase, and the oracle by hand.

Every iteration starts from the previous recorded state, so differences of float32 and float64 do
not grow. If a comparison is within float32's rounding of its threshold (a ray that grazes a disc, a
gap that equals the sensor range), the kernel must agree with the oracle for a state within this
rounding; such iterations are counted, and are rare.
"""

import math
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest

from conevo.controllers.registry import controller, genome_of
from conevo.rng import fold, stream
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from oracles import pursuit_oracle as oracle
from oracles.pursuit_oracle import Chaser, Dodger, Network, Params, Walker, World
from worlds.situations import NAN, random_prey_file

# --- the oracle by hand -------------------------------------------------------------------------


def place(poses, obstacles=(), prey=(), minds=None, **params):
    x, y, heading = np.array(poses, float).T
    is_prey = [b in prey for b in range(len(poses))]
    return World(
        p=Params(**params),
        is_prey=is_prey,
        minds=minds or [Walker()] * len(poses),
        x=x,
        y=y,
        heading=heading,
        obstacles=np.array(obstacles, float).reshape(-1, 2),
        seed=1,
    )


def test_a_disc_straight_ahead_of_a_side_sensor():
    """SI-2 sits at 68 deg and looks at 90 deg: a disc above it is seen at its nearest point."""
    x, y = 50 + 2.75 * math.cos(math.radians(68)), 50 + 2.75 * math.sin(math.radians(68))
    seen = oracle.sense(place([(50, 50, 0)], [(x, y + 2.75 + 5.5)]), 0)
    assert seen[2] == pytest.approx(1 - 5.5 / 22, abs=1e-6)
    assert not seen[[0, 3, 4, 5, 6, 7]].any()
    # The same disc, turned with the robot by half a turn and more.
    turned = place([(50, 50, 2.0)])
    c, s, dx, dy = math.cos(2.0), math.sin(2.0), x - 50, y + 8.25 - 50
    turned.obstacles = np.array([(50 + c * dx - s * dy, 50 + s * dx + c * dy)])
    np.testing.assert_allclose(oracle.sense(turned, 0), seen, atol=1e-6)


def test_a_disc_at_the_side_of_a_cone_is_seen_along_its_edge():
    """A cone of 10 deg on either side, along +y past a disc whose centre is outside the cone."""
    x, y = 50 + 2.75 * math.cos(math.radians(68)), 50 + 2.75 * math.sin(math.radians(68))
    w = place([(50, 50, 0)], [(x + 4.0, y + 10.0)], half_angle=10.0)
    beta = math.radians(80)  # the nearer edge ray
    along = 4 * math.cos(beta) + 10 * math.sin(beta)
    aside = 4 * math.sin(beta) - 10 * math.cos(beta)
    d = along - math.sqrt(2.75**2 - aside**2)
    assert oracle.sense(w, 0)[2] == pytest.approx(1 - d / 22, abs=1e-6)
    w.obstacles = np.array([(x + 5.0, y + 10.0)])  # the edge ray passes it
    assert oracle.sense(w, 0)[2] == 0.0


def test_walls_are_seen_square_on_or_along_the_edge_of_the_cone():
    """Facing a wall 10 cm away: SI-0 and SI-7 see it square on, SI-1 along -15 deg."""
    seen = oracle.sense(place([(90, 50, 0)]), 0)
    gap = [100 - 90 - 2.75 * math.cos(math.radians(a)) for a in (13, 43)]
    assert seen[[0, 7]] == pytest.approx([1 - gap[0] / 22] * 2, abs=1e-6)
    assert seen[[1, 6]] == pytest.approx([1 - gap[1] / math.cos(math.radians(15)) / 22] * 2)
    # 60 deg off the normal
    d = (10 - 2.75 * math.cos(math.radians(68))) / math.cos(math.radians(60))
    assert seen[[2, 5]] == pytest.approx([1 - d / 22] * 2, abs=1e-6)
    assert not seen[3:5].any()


def test_lamps_are_seen_through_bodies_and_only_those_of_prey():
    w = place([(30, 50, 0), (40, 50, 0), (48, 50, 0)], prey=[2])
    seen = oracle.sense(w, 0)
    assert seen.shape == (16,)
    d = math.hypot(18 - 2.75 * math.cos(math.radians(13)), 2.75 * math.sin(math.radians(13))) - 2.75
    assert seen[[8, 15]] == pytest.approx([1 - d / 22] * 2, abs=1e-6)
    assert seen[0] > seen[8] > 0
    assert oracle.sense(w, 2).shape == (8,)


def test_the_arc_is_the_limit_of_many_small_steps():
    rng = stream(3, "arcs")
    for left, right in [*rng.uniform(-1, 1, (20, 2)), (0.5, 0.5), (1, -1), (0.3, 0.3 + 1e-7)]:
        x, y, heading = 10.0, 20.0, float(rng.uniform(-3, 3))
        end = oracle.arc(x, y, heading, left, right, 0.96)
        n = 20000
        turn = (right - left) * 0.96 / 5.3
        angles = heading + (np.arange(n) + 0.5) / n * turn
        way = (left + right) / 2 * 0.96 / n
        assert end[0] == pytest.approx(x + way * np.cos(angles).sum(), abs=1e-6)
        assert end[1] == pytest.approx(y + way * np.sin(angles).sum(), abs=1e-6)
        assert end[2] == pytest.approx(oracle.wrap(heading + turn), abs=1e-9)


def test_motor_primitives():
    names = [
        oracle.ACTIONS[oracle.action(left, right)]
        for left, right in
        [(0.09, -0.09), (1, 1), (0.5, -0.2), (-0.2, 0.5), (-0.3, -0.1), (0, 0.5), (0.1, 0)]
    ]  # fmt: skip
    assert names == ["stop", "forward", "right", "left", "reverse", "forward", "forward"]


def test_steering_turns_by_the_missing_angle_and_no_more():
    for missing in (0.05, -0.2, 0.3018, 2.0, -3.0):
        left, right = oracle.steer(1.0, 1.0 + missing, 0.8)
        turn = (right - left) * 0.8 / 5.3
        assert turn == pytest.approx(math.copysign(min(abs(missing), 1.6 / 5.3), missing))
        assert (left + right) / 2 == pytest.approx(1 - abs(turn) * 5.3 / 1.6)


def test_a_chaser_remembers_forgets_and_then_walks():
    w = place([(20, 50, 0), (47.4, 50, 0)], prey=[1], minds=[Chaser(), Walker()])
    assert oracle.decide(w, 0, []) == (1.0, 1.0)
    assert w.memory[0] == (47.4, 50.0)
    w.x[1] = 60.0  # out of sight: to its last known place
    w.y[0] = 40.0
    assert oracle.decide(w, 0, [])[0] < 1.0
    assert w.memory[0] == (47.4, 50.0)
    w.x[0], w.y[0], w.x[1], w.seed = 43.0, 50.0, 90.0, 2
    assert oracle.decide(w, 0, []) == (1.0, 1.0)  # now a walk along its first heading
    assert w.memory[0] is None


def test_a_dodger_turns_away_and_out_of_dead_ends():
    assert oracle.dodge([0] * 8) == (1.0, 1.0)
    assert oracle.dodge([0, 0.4, 0, 1, 1, 0, 0, 0]) == pytest.approx((1.0, 0.2))
    assert oracle.dodge([0, 0, 0, 0, 0, 0, 0, 0.8]) == pytest.approx((-0.6, 1.0))
    assert oracle.dodge([0.8, 0, 0, 0, 0, 0, 0, 0.82]) == (-1.0, 1.0)
    assert oracle.dodge([0.8, 0, 0, 0, 0, 0.9, 0, 0.8]) == pytest.approx((0.8, 1.0))


def test_moves_are_refused_by_walls_old_places_and_each_other():
    w = place([(97, 50, 0), (30, 50, 0), (36, 50, 0), (50, 20, 0), (56.5, 20, math.pi)])
    old = w.x.copy()
    assert oracle.move(w, [1] * 5, [1] * 5).refused == [True, True, False, True, True]
    np.testing.assert_allclose(w.x - old, [0, 0, 0.8, 0, 0], atol=1e-12)


def test_immobility_needs_ten_iterations():
    p = Params()
    assert not oracle.immobilized(p, [0] * 9, [1] * 9)
    assert oracle.immobilized(p, [0] * 10, [1] * 10)
    assert oracle.immobilized(p, [0.019] * 10, [0.019] * 10)
    assert not oracle.immobilized(p, [0.021] * 10, [0.021] * 10)
    assert not oracle.immobilized(p, [1.1] + [0] * 9, [1] * 10)
    assert oracle.immobilized(p, [1.1] + [0] * 10, [1] * 11)


def test_a_flight_counts_until_the_collision():
    wheels = np.array([1.0, 0.5, 1.0]), np.array([1.0, 1.0, -1.0])
    free = oracle.flight_fitness(*wheels, np.zeros(3), 0.96)
    np.testing.assert_allclose(free, 0.96 * np.cumsum([1.0, 0.75 * 0.5, 0.0]))
    hit = oracle.flight_fitness(*wheels, np.array([0, 1, 0]), 0.96)
    assert hit.tolist() == [0.96, 0.0, 0.0]


# --- the kernels --------------------------------------------------------------------------------


CAPTURE = {
    "capture_window": "window",
    "capture_share": "share",
    "capture_distance_cm": "least",
    "capture_predators": "hunters",
}


def params_of(p):
    return Params(
        arena=p.arena_cm,
        reach=p.sensor_range_cm,
        half_angle=p.sensor_angle_deg,
        speed=p.max_speed_cm,
        prey_speed=p.prey_speed,
        **{ours: getattr(p, theirs) for theirs, ours in CAPTURE.items() if hasattr(p, theirs)},
    )


def build(a_world, genes, slots, scenarios, heuristic):
    """The oracle's world of a scenario of one of the two worlds."""
    r, b = a_world.n_robots, int(scenarios.n_bodies[0])
    n_inputs = len(a_world.inputs) + controller(world=a_world).n_context
    minds = oracle.networks(genes, slots, n_inputs)
    names = {"heuristic": Dodger(), "random": Walker()}
    if a_world.name == "pursuit-v2":
        minds = [m if h < 0 else Chaser() for m, h in zip(minds, heuristic, strict=True)]
        mode = a_world.params.prey
        hidden = len(scenarios.prey_in) // (b - r)
        for q in range(b - r):
            if mode in names:
                minds.append(names[mode])
            else:
                rows = slice(q * hidden, (q + 1) * hidden)
                weights = scenarios.prey_in[rows], scenarios.prey_out[rows]
                minds.append(Network(*weights, [True] * hidden))
        is_prey = [i >= r for i in range(b)]
    else:
        kinds = [names[name] for name in a_world.heuristics]
        minds = [m if h < 0 else kinds[h] for m, h in zip(minds, heuristic, strict=True)]
        minds += [Chaser()] * (b - r)
        is_prey = [i < r for i in range(b)]
    n = int(scenarios.n_obstacles[0])
    return World(
        p=params_of(a_world.params),
        is_prey=is_prey,
        minds=minds,
        x=scenarios.x[0],
        y=scenarios.y[0],
        heading=scenarios.heading[0],
        obstacles=np.stack([scenarios.obstacle_x[0, :n], scenarios.obstacle_y[0, :n]], axis=1),
        seed=int(scenarios.seed[0]),
        clamp=scenarios.clamp,
        mortal=[a_world.name == "prey-v2" and i < r for i in range(b)],
    )


def twin(w):
    """A copy whose minds change independently of the original's."""
    other = copy(w)
    other.memory, other.wander, other.context = list(w.memory), list(w.wander), list(w.context)
    return other


def nearby(w, n=40):
    """Copies of a world within float32's rounding, for near-ties."""
    rng = stream(0, "nearby")
    for k in range(n):
        other = twin(w)
        for name in ("x", "y", "heading"):
            grain = 10.0 ** -(4 + k % 3)
            shift = rng.normal(size=len(w.x)) * grain
            setattr(other, name, getattr(w, name) + shift)
        yield other


@dataclass
class Tally:
    """Counts of a comparison: near-ties and, so that it is not vacuous, events."""

    near_ties: int = 0
    refused: int = 0
    captured: int = 0
    seen: int = 0
    lights: int = 0
    steps: int = 0
    actions: set = field(default_factory=set)


def check_sensors(w, me, seen, tally):
    expected = oracle.sense(w, me)
    tally.seen += int((seen[:8] > 0).sum())
    tally.lights += int((seen[8:] > 0).sum())
    if np.abs(seen - expected).max() < 1e-4:
        return
    tally.near_ties += 1
    around = np.array([oracle.sense(other, me) for other in nearby(w)])
    assert (seen > around.min(axis=0) - 1e-4).all(), (w.t, me, seen, expected)
    assert (seen < around.max(axis=0) + 1e-4).all(), (w.t, me, seen, expected)


def check_wheels(w, me, seen, inputs, tally):
    """``inputs``: the recorded inputs of a robot of the team, None for another body."""
    before = twin(w)
    mind = w.minds[me]
    needs_eyes = inputs is None and isinstance(mind, Network | Dodger)
    expected = oracle.decide(w, me, oracle.sense(w, me) if needs_eyes else inputs)
    # If the oracle's own sensors feed a network, weights of up to 10 multiply their difference.
    tolerance = 1e-3 if needs_eyes else 1e-4
    if np.abs(np.array(seen) - expected).max() < tolerance:
        return
    tally.near_ties += 1
    for other in nearby(before):
        got = oracle.decide(other, me, oracle.sense(other, me) if inputs is None else inputs)
        if np.abs(np.array(seen) - got).max() < 10 * tolerance:
            w.memory[me], w.wander[me] = other.memory[me], other.wander[me]
            return
    raise AssertionError(f"iteration {w.t}, body {me}: {seen}, expected {expected}")


def compare(a_world, genes, slots, scenarios, heuristic):
    """Assert that the record of a rollout is the oracle's, phase by phase; return the tally."""
    rollout = Rollout(a_world)
    seen = rollout.record(genes, slots, scenarios, heuristic)
    w = build(a_world, genes, slots, scenarios, heuristic)
    r, n_context = a_world.n_robots, controller(world=a_world).n_context
    robots, prey = range(r), w.prey
    tally = Tally()
    grain = 2e-5 + 2e-7 * a_world.params.arena_cm
    moved = {q: [] for q in prey}
    commanded = {q: [] for q in prey}
    captured = np.zeros((a_world.params.iterations, len(prey)), bool)
    refused = np.zeros((a_world.params.iterations, len(w.bodies)), bool)
    for t in range(a_world.params.iterations):
        tally.steps += 1
        inputs, hidden = (seen[name][t].astype(float) for name in ("inputs", "hidden"))
        left, right = seen["left"][t].astype(float), seen["right"][t].astype(float)
        for b in w.bodies:
            if w.dead[b]:
                assert left[b] == right[b] == 0.0
                continue
            if b in robots:
                check_sensors(w, b, inputs[b], tally)
            check_wheels(w, b, (left[b], right[b]), inputs[b] if b in robots else None, tally)
            if b in robots:
                if isinstance(w.minds[b], Network):
                    context = hidden[b, :n_context]
                    assert np.abs(w.context[b] - context).max(initial=0) < 1e-4
                    w.context[b] = list(context)
                edge = abs(max(abs(left[b]), abs(right[b])) - 0.1) < 1e-5
                f, turn = abs(left[b] + right[b]), abs(left[b] - right[b])
                if not edge and abs(f - turn) > 1e-5:
                    assert seen["action"][t, b] == oracle.action(left[b], right[b])
                tally.actions.add(int(seen["action"][t, b]))

        alive = [not d for d in w.dead]
        moves = oracle.move(w, left, right)
        refused[t] = seen["collided"][t, : len(w.bodies)]
        if moves.margin > 5 * grain:
            assert moves.refused == (refused[t] & alive).tolist(), (t, moves)
            assert np.abs(seen["x"][t, : len(w.bodies)] - w.x).max() < grain
            assert np.abs(seen["y"][t, : len(w.bodies)] - w.y).max() < grain
            turned = seen["heading"][t, : len(w.bodies)] - w.heading
            assert np.abs(np.sin(turned / 2)).max() < 1e-5
        else:
            tally.near_ties += 1
        tally.refused += int(refused[t].sum())
        for name in ("x", "y", "heading"):
            setattr(w, name, seen[name][t, : len(w.bodies)].astype(float))
        w.refused = refused[t].tolist()

        for k, q in enumerate(prey):
            asked = float(oracle.way(left[q], right[q], w.speed(q)))
            commanded[q].append(asked)
            moved[q].append(0.0 if refused[t, q] else asked)
            still = oracle.immobilized(w.p, moved[q], commanded[q])
            captured[t, k] = still and oracle.surrounded(w, q)
        if a_world.name == "pursuit-v2":
            for k, q in enumerate(prey):
                if captured[t, k] != seen["captured"][t, k]:
                    tally.near_ties += 1
                    got, wanted = (sum(v[q][-w.p.window :]) for v in (moved, commanded))
                    gaps = [w.distance(b, q) - 5.5 - w.p.reach for b in w.predators]
                    calls = [got - w.p.least, got - w.p.share * wanted, *gaps]
                    assert np.abs(calls).min() < 1e-4
            captured[t] = seen["captured"][t]
            assert (seen["fitness"][t] == captured[: t + 1].any(axis=1).sum()).all()
    out = rollout.evaluate(genes, slots[None], scenarios, heuristic[None])
    performance = {name: float(values[0, 0]) for name, values in out.performance.items()}
    if a_world.name == "pursuit-v2":
        tally.captured = int(captured.sum())
        assert performance == oracle.hunt_result(captured, refused[:, :r])
    else:
        fitness = np.stack(
            [
                oracle.flight_fitness(
                    seen["left"][:, b], seen["right"][:, b], refused[:, b], w.speed(b)
                )
                for b in robots
            ],
            axis=1,
        )
        assert np.allclose(seen["fitness"], fitness, rtol=1e-4, atol=1e-3)
        assert performance["path"] == pytest.approx(fitness[-1].mean(), rel=1e-4, abs=1e-3)
        assert performance["collided"] == refused[:, :r].any(axis=0).mean()
    return tally


def random_team(a_world, seed, scale):
    """Networks with random empty slots, some of them beyond the context."""
    rng = stream(seed, "team")
    mind = controller(world=a_world)
    genome = genome_of(mind, a_world)
    r, u = a_world.n_robots, genome.max_parts
    genes = rng.uniform(-scale, scale, (r * u, genome.n_genes)).astype(np.float32)
    genes[:, -2:] += 0.2 * scale  # ahead more than back
    slots = np.arange(r * u, dtype=np.int32).reshape(r, u)
    slots[rng.random((r, u)) < 0.3] = -1
    slots[:, mind.n_hidden + 1 :] = -1
    return genes, slots


@pytest.fixture(scope="module")
def prey(tmp_path_factory):
    return random_prey_file(tmp_path_factory.mktemp("prey") / "random.npz", 4)


# Environment, prey, which robots are heuristic (every n-th, 0 for none), scale of genes,
# iterations, parameters.
HUNTS = [
    ("team-1", "heuristic", 0, 0.1, 80, {"arena_cm": 60.0}),
    ("team-2", "random", 2, 0.3, 120, {"arena_cm": 60.0, "capture_window": 7}),
    ("team-3", "shaped", 0, 0.1, 80, {"arena_cm": 60.0}),
    ("team-3", "file", 1, 0.3, 140, {"arena_cm": 60.0}),
    ("team-5", "heuristic", 1, 0.3, 100, {}),
    ("team-5", "random", 3, 1.0, 70, {"max_speed_cm": 2.5, "prey_speed": 0.9}),
    ("team-6", "file", 0, 0.1, 70, {"arena_cm": 60.0, "sensor_angle_deg": 12.0}),
    ("team-7", "random", 1, 0.3, 40, {"arena_cm": 1000.0}),
    ("team-8", "shaped", 2, 0.2, 70, {"sensor_range_cm": 40.0, "n_obstacles": 4}),
    ("team-9", "heuristic", 3, 0.1, 70, {"arena_cm": 60.0, "sensor_angle_deg": 45.0}),
    ("team-10", "file", 2, 0.1, 70, {"arena_cm": 60.0, "n_obstacles": 6}),
    ("team-10", "random", 1, 0.1, 100, {"capture_share": 0.5, "capture_predators": 3}),
]  # fmt: skip


def hunt(case, prey, seed):
    """World, networks, scenario and heuristics of a case."""
    environment, mode, every, scale, iterations, params = case
    mode = prey if mode == "file" else mode
    a_world = world(f"pursuit/{environment}", prey=mode, iterations=iterations, **params)
    heuristic = np.full(a_world.n_robots, -1, np.int32)
    if every:
        heuristic[::every] = 0
    scenarios = a_world.scenarios([fold(seed, environment)])
    return a_world, *random_team(a_world, seed, scale), scenarios, heuristic


@cache
def compared(k, prey):
    return compare(*hunt(HUNTS[k], prey, 1))


@pytest.mark.parametrize("k", range(len(HUNTS)))
def test_hunts_equal_the_oracle(k, prey):
    tally = compared(k, prey)
    assert tally.near_ties <= 0.03 * tally.steps


# Environment, heuristic of each robot (-1 for none), parameters; 90 iterations.
FLIGHTS = [
    ("shaping-1", [-1], {}),
    ("shaping-2", [-1], {"arena_cm": 60.0}),
    ("shaping-3", [0], {"arena_cm": 60.0}),
    ("shaping-3", [1], {}),
    ("shaping-4", [-1, 0], {"arena_cm": 60.0}),
    ("shaping-5", [0, 0], {"max_speed_cm": 2.0}),
    ("shaping-6", [-1, 1], {"sensor_angle_deg": 20.0}),
    ("shaping-6", [-1, -1], {"prey_speed": 1.0}),
]


def flight(case, seed):
    environment, heuristic, params = case
    a_world = world(f"prey/{environment}", iterations=90, **params)
    scenarios = a_world.scenarios([fold(seed, environment)])
    genes, slots = random_team(a_world, seed, 0.3 if seed % 2 else 0.1)
    return a_world, genes, slots, scenarios, np.array(heuristic, np.int32)


@pytest.mark.parametrize("case", FLIGHTS, ids=lambda c: f"{c[0]}-{c[1]}")
@pytest.mark.parametrize("seed", [1, 2])
def test_flights_equal_the_oracle(case, seed):
    tally = compare(*flight(case, seed))
    assert tally.near_ties <= 0.03 * tally.steps


def test_held_sensors_equal_the_oracles(prey):
    a_world, genes, slots, scenarios, _ = hunt(HUNTS[9], prey, 2)
    clamp = np.full((a_world.n_robots, 16), NAN, np.float32)
    clamp[0] = np.linspace(0, 1, 16)
    clamp[1, [0, 7, 9]] = 0.25, 0.0, 1.0
    free = np.full(a_world.n_robots, -1, np.int32)
    compare(a_world, genes, slots, replace(scenarios, clamp=clamp), free)


def test_the_comparisons_above_are_not_vacuous(prey):
    tallies = [compared(k, prey) for k in (1, 5, 9, 10, 11)]
    assert sum(t.captured for t in tallies) > 50
    assert sum(t.refused for t in tallies) > 500
    assert sum(t.lights for t in tallies) > 1000
    assert sum(t.seen for t in tallies) > 5000
    assert set().union(*(t.actions for t in tallies)) >= {1, 2, 3, 4}


@pytest.mark.parametrize("case", [HUNTS[0], HUNTS[9], FLIGHTS[4], FLIGHTS[6]])
def test_an_epoch_without_correction_follows_the_oracle(case, prey):
    """Until the smallest differences have grown into other decisions."""
    setup = hunt(case, prey, 3) if len(case) == 6 else flight(case, 4)
    seen = Rollout(setup[0]).record(*setup[1:])
    w = build(*setup)
    expected = oracle.run(w, 60)
    n = len(w.bodies)
    assert np.abs(seen["x"][:60, :n] - expected["x"]).max() < 0.01
    assert np.abs(seen["y"][:60, :n] - expected["y"]).max() < 0.01
    assert (seen["collided"][:60, :n] == expected["refused"]).all()
    if "captured" in seen:
        assert (seen["captured"][:60] == expected["captured"]).all()
