"""The rover kernels against the oracle written from the thesis, and in situations built by hand."""

from dataclasses import replace

import numpy as np
import pytest

from conevo.controllers.registry import controller, genome_of
from conevo.rng import fold, stream
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from conevo.worlds.rover.world import RoverParams
from oracles import rover_oracle, splitmix

LOW, MED, HI, MOVE, NONE = 0, 1, 2, 3, -1


def crowd(scenarios, n_robots, seed, side=0.12):
    """Put the rovers of one scenario into a small square: they meet rocks and each other."""
    rng = stream(seed, "crowd")
    mask = scenarios.canal.astype(bool)
    k = rng.integers(scenarios.rock_x.shape[1])
    middle = np.array([scenarios.rock_x[0, k], scenarios.rock_y[0, k]])
    starts = []
    while len(starts) < n_robots:
        place = np.clip(middle + rng.uniform(-side / 2, side / 2, 2), 0, 0.999).astype(np.float32)
        column, row = (place * 200).astype(int)
        if not mask[row, column]:
            starts.append(place)
    starts = np.array(starts)[None]
    return replace(scenarios, start_x=starts[:, :, 0].copy(), start_y=starts[:, :, 1].copy())


def oracle_params(p: RoverParams) -> rover_oracle.Params:
    def reach(value: float) -> float:
        return float(np.sqrt(value / np.pi)) if p.range_is == "area" else value

    return rover_oracle.Params(
        iterations=p.iterations,
        energy=p.energy,
        ranges=(reach(p.low_range), reach(p.med_range), reach(p.hi_range)),
        accuracies=(p.low_accuracy, p.med_accuracy, p.hi_accuracy),
        costs=(p.low_cost, p.med_cost, p.hi_cost),
        rover_range=reach(p.rover_sensor_range),
        sensing_cost=p.rover_sensor_cost,
        d_max=p.move_range,
        move_cost=p.move_cost,
        report_cost=p.report_cost,
        d_min=p.min_distance,
        separation=p.separation,
        fitness=p.fitness,
        rocks_per_activation=p.rocks_per_activation,
        sensor_noise=p.sensor_noise,
        action_noise=p.action_noise,
        failure=p.failure,
        failure_at=p.failure_at,
    )


def run_oracle(a_world, genes, slots, scenarios, heuristic):
    seed = int(scenarios.seed[0])

    def controller(i):
        h = int(heuristic[i])
        if h < 0:
            return rover_oracle.Network(genes, [int(k) for k in slots[i]])
        return rover_oracle.Heuristic(
            rover_oracle.PREFERENCES[a_world.heuristics[h]],
            lambda t: tuple(splitmix.uniform(seed, t, 2**20 - 4 + k, i) for k in range(2)),
        )

    return rover_oracle.run(
        oracle_params(a_world.params),
        [controller(i) for i in range(a_world.n_robots)],
        scenarios.rock_x[0],
        scenarios.rock_y[0],
        scenarios.rock_type[0],
        scenarios.rock_value[0],
        scenarios.canal.astype(bool),
        np.stack([scenarios.start_x[0], scenarios.start_y[0]], axis=1),
        lambda t, k, v: splitmix.uniform(seed, t, k, v),
    )


def random_team(a_world, seed, max_slots=20):
    """Networks that do not saturate (or float64 has ties): small genes, random empty slots."""
    rng = stream(seed, "team")
    genome = genome_of(controller(world=a_world), a_world)
    r, u = a_world.n_robots, genome.max_parts
    genes = rng.uniform(-0.3, 0.3, (r * u, genome.n_genes)).astype(np.float32)
    slots = np.arange(r * u, dtype=np.int32).reshape(r, u)
    slots[rng.random((r, u)) < 0.4] = -1
    slots[:, max_slots:] = -1
    return genes, slots


@pytest.mark.parametrize("environment", ["simple-3", "complex-1", "complex-5", "extended-7"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_kernel_equals_the_oracle(environment, seed):
    """Action by action, until float32 decides a near-tie differently from float64."""
    kinds = {1: "networks", 2: "heuristics", 3: "both"}
    a_world = world(
        f"rover/{environment}",
        n_robots=7,
        iterations=60,
        energy=9.013 if seed == 3 else 1000.0,  # some die within the run
        fitness="product" if seed == 2 else "cumulative",
    )
    compare_with_oracle(a_world, environment, seed, kinds[seed])


@pytest.mark.parametrize(
    ("environment", "options"),
    [
        ("complex-5", {"rocks_per_activation": 1}),
        pytest.param(  # a kernel that no other test needs
            *("simple-3", {"rocks_per_activation": 1, "fitness": "value"}),
            marks=pytest.mark.exhaustive,
        ),
        ("simple-3", {"fitness": "value"}),
        ("complex-5", {"fitness": "activation"}),
        ("complex-5", {"range_is": "area", "fitness": "value"}),
        ("complex-5", {"sensor_noise": 0.2, "action_noise": 0.1, "failure": 0.005}),
        ("complex-1", {"range_is": "area", "rocks_per_activation": 1, "fitness": "activation"}),
    ],
)
def test_kernel_equals_the_oracle_with_other_readings(environment, options):
    a_world = world(f"rover/{environment}", n_robots=7, iterations=60, **options)
    expected = compare_with_oracle(a_world, environment, 3, "both")
    assert (expected["credited"] > 0).sum() > 2


def compare_with_oracle(a_world, environment, seed, kind):
    genes, slots = random_team(a_world, seed)
    heuristic = np.full(7, -1, dtype=np.int32)
    if kind != "networks":
        heuristic[:: 2 if kind == "both" else 1] = 3
        heuristic[0] = 0
    scenarios = crowd(a_world.scenarios([fold(seed, environment)]), 7, seed)
    seen = Rollout(a_world).record(genes, slots, scenarios, heuristic)
    expected = run_oracle(a_world, genes, slots, scenarios, heuristic)

    differs = (seen["action"] != expected["action"]).any(axis=1)
    until = int(differs.argmax()) if differs.any() else a_world.params.iterations
    if until < a_world.params.iterations:  # only a near-tie may cause a difference
        robots = seen["action"][until] != expected["action"][until]
        top = np.sort(expected["outputs"][until][robots], axis=1)
        assert (top[:, -1] - top[:, -2] < 1e-3).all()
    assert until >= 40
    same = slice(0, until)
    position = np.stack([seen["x"], seen["y"]], axis=2)
    assert np.abs(position[same] - expected["position"][same]).max() < 1e-5
    alive = expected["action"][same] != NONE
    sensors = np.abs(seen["inputs"][same] - expected["sensors"][same])[alive]
    assert sensors.max() < 1e-3
    assert np.allclose(seen["energy"][same], expected["energy"][same], rtol=1e-5, atol=1e-4)
    assert np.abs(seen["covered"][same] / 1e4 - expected["covered"][same]).max() < 2e-4
    if until == a_world.params.iterations:
        out = Rollout(a_world).evaluate(genes, slots[None], scenarios, heuristic[None])
        assert np.array_equal(out.counts[0, 0], expected["counts"])
        assert np.array_equal(out.switches[0, 0], expected["switches"])
        assert out.performance["value"][0, 0] == expected["value"]
        assert abs(out.performance["area"][0, 0] - expected["area"]) < 2e-4
        assert np.allclose(out.fitness[0, 0], expected["fitness"], rtol=1e-3, atol=1e-3)
    return expected


def test_the_comparison_above_is_not_vacuous():
    """The compared runs detect rocks, move, refuse moves and let rovers die."""
    a_world = world("rover/complex-5", n_robots=7, iterations=60, energy=9.013)
    genes, slots = random_team(a_world, 3)
    heuristic = np.array([0, -1, 3, -1, 3, -1, 3], dtype=np.int32)
    scenarios = crowd(a_world.scenarios([fold(3, "complex-5")]), 7, 3)
    out = run_oracle(a_world, genes, slots, scenarios, heuristic)
    assert out["value"] > 0
    assert (out["action"] == NONE).any()
    assert (out["action"] == MOVE).any()
    moved = np.abs(np.diff(out["position"], axis=0)).sum(axis=2) > 0
    assert ((out["action"][1:] == MOVE) & ~moved).any()


# --- hand-built situations --------------------------------------------------------------------


def constant(action: int, dx: float = 0.0, dy: float = 0.0, n_genes: int = 31) -> np.ndarray:
    """Two neurons [2, G] that always choose an action; a mover goes towards (dx, dy).

    Input weights 0 make the hidden activations 1/2, so outputs are sigmoid(5 x sum of genes).
    """
    genes = np.zeros((2, n_genes), dtype=np.float32)
    genes[:, 26:] = -1.0
    if action == MOVE:
        genes[:, 29], genes[:, 30] = dx, dy
    else:
        genes[:, 26 + action] = 1.0
    return genes


def situation(robots, rocks=(), *, iterations=3, canal=None, **params):
    """Build a world of exactly these robots (x, y, action[, dx, dy]) and rocks (x, y, type)."""
    a_world = world(
        "rover/complex-1",
        n_robots=len(robots),
        iterations=iterations,
        **({"low_accuracy": 1.0, "med_accuracy": 1.0, "hi_accuracy": 1.0} | params),
    )
    base = a_world.scenarios([1])
    k = base.rock_x.shape[1]
    # Rocks in use; the others lie in a far corner.
    x = np.full(k, 0.999, np.float32)
    y = np.full(k, 0.999, np.float32)
    kind = np.zeros(k, np.int32)
    for n, (rx, ry, letter) in enumerate(rocks):
        x[n], y[n], kind[n] = rx, ry, "ABCDE".index(letter)
    cells = (y * 40).astype(int) * 40 + (x * 40).astype(int)
    order = np.argsort(cells, kind="stable")
    value = np.array([1, 2, 3, 4, 1], np.float32)[kind]
    value[len(rocks) :] = 0.0
    scenarios = replace(
        base,
        rock_x=x[order][None],
        rock_y=y[order][None],
        rock_value=value[order][None],
        rock_type=kind[order][None],
        cell=np.searchsorted(cells[order], np.arange(1601)).astype(np.int32)[None],
        canal=np.zeros((200, 200), np.uint8) if canal is None else canal,
        start_x=np.array([[r[0] for r in robots]], np.float32),
        start_y=np.array([[r[1] for r in robots]], np.float32),
    )
    genes = np.concatenate([constant(r[2], *r[3:]) for r in robots])
    slots = np.full((len(robots), 20), -1, np.int32)
    slots[:, :2] = np.arange(2 * len(robots)).reshape(-1, 2)
    rollout = Rollout(a_world, n_threads=1)
    out = rollout.evaluate(genes, slots[None], scenarios)
    return out, rollout.record(genes, slots, scenarios)


PAIRS = {
    ("A", LOW, LOW): 1,
    ("B", LOW, MED): 2,
    ("C", MED, HI): 3,
    ("D", HI, HI): 4,
    ("E", LOW, LOW): 1,
    ("E", MED, MED): 1,
    ("E", HI, HI): 1,
}


@pytest.mark.parametrize("letter", "ABCDE")
@pytest.mark.parametrize("a", [LOW, MED, HI])
@pytest.mark.parametrize("b", [LOW, MED, HI])
def test_table_5_1_which_settings_detect_which_rock(letter, a, b):
    value = PAIRS.get((letter, *sorted((a, b))), 0)
    out, seen = situation([(0.5, 0.49, a), (0.5, 0.51, b)], [(0.5, 0.5, letter)])
    assert out.performance["value"][0, 0] == value
    assert seen["value"][0].tolist() == [value, value]  # in the first iteration, both credited


def test_a_detection_pays_value_times_area_over_squared_distance_to_both_once():
    out, seen = situation([(0.5, 0.48, LOW), (0.5, 0.515, LOW)], [(0.5, 0.5, "A")])
    area = seen["covered"][0] / 1e4
    assert area == pytest.approx([np.pi * 0.07**2] * 2, rel=0.02)
    assert out.fitness[0, 0] == pytest.approx(area / np.array([0.02**2, 0.015**2]), rel=1e-4)
    assert np.array_equal(seen["fitness"][0], seen["fitness"][-1])


def test_the_distance_is_bounded_from_below():
    out, seen = situation([(0.5, 0.4999, LOW), (0.5, 0.54, LOW)], [(0.5, 0.5, "A")])
    assert out.fitness[0, 0, 0] == pytest.approx(seen["covered"][0, 0] / 1e4 / 0.01**2, rel=1e-4)


@pytest.mark.parametrize(
    "robots",
    [
        [(0.5, 0.49, LOW), (0.1, 0.1, LOW)],  # alone
        [(0.5, 0.49, LOW), (0.5, 0.575, LOW)],  # the other out of range
        [(0.5, 0.49, LOW), (0.5, 0.51, MOVE)],  # the other does something else
    ],
)
def test_one_rover_detects_nothing(robots):
    out, _ = situation(robots, [(0.5, 0.5, "A")])
    assert out.performance["value"][0, 0] == 0
    assert not out.fitness.any()


def test_accuracy_is_the_chance_of_each_rover():
    """1000 rocks, one try: detected ones are binomial with p = 0.7 x 0.8."""
    rocks = [(0.5 + 0.0001 * (k % 40), 0.5 + 0.0001 * (k // 40), "B") for k in range(1000)]
    out, _ = situation(
        [(0.5, 0.49, LOW), (0.5, 0.51, MED)],
        rocks,
        iterations=2,  # the lander receives only the first
        low_accuracy=0.7,
        med_accuracy=0.8,
    )
    n = out.performance["value"][0, 0] / 2
    assert abs(n - 560) < 5 * np.sqrt(1000 * 0.56 * 0.44)


def test_one_rock_per_activation_is_the_same_one_for_both():
    """Of twenty in range of both, each activation detects one, until none is left."""
    rocks = [(0.5 + 0.0005 * k, 0.5, "A") for k in range(20)]
    robots = [(0.5, 0.49, LOW), (0.5, 0.51, LOW), (0.1, 0.1, LOW)]
    _, seen = situation(robots, rocks, iterations=25, rocks_per_activation=1)
    steps = np.minimum(np.arange(1, 26), 20)
    assert seen["value"].tolist() == np.stack([steps, steps, 0 * steps], axis=1).tolist()
    order = np.sort(seen["detected"][seen["detected"] < 25])
    assert order.tolist() == list(range(20))


def test_a_third_rover_takes_the_same_rock_or_none():
    """Three rovers in range of the same rocks take one of them: each is credited, the team once."""
    rocks = [(0.5, 0.5 + 0.0005 * k, "E") for k in range(6)]
    robots = [(0.5, 0.49, MED), (0.5, 0.515, MED), (0.49, 0.5, MED)]
    out, seen = situation(robots, rocks, iterations=4, rocks_per_activation=1)
    assert seen["value"][0].tolist() == [1, 1, 1]
    assert out.performance["value"][0, 0] == 3


def test_fitness_readings_by_hand():
    robots, rocks = [(0.5, 0.48, MED), (0.5, 0.515, HI)], [(0.5, 0.5, "C"), (0.5, 0.5, "D")]
    for fitness, expected in {
        "activation": 3 * np.pi * np.array([0.05**2 / 0.02**2, 0.03**2 / 0.015**2]),
        "value": [3, 3],
    }.items():
        out, seen = situation(robots, rocks, iterations=6, fitness=fitness)
        assert out.fitness[0, 0] == pytest.approx(expected, rel=1e-4)
        assert seen["value"][-1].tolist() == [3, 3]
    out, seen = situation(robots, rocks, iterations=6, fitness="product")
    assert out.fitness[0, 0] == pytest.approx(3 * seen["covered"][-1] / 1e4, rel=1e-5)


def test_a_range_as_a_share_of_the_area_is_a_disc_of_that_area():
    """Nitschke 2009, 5.2.1: "a portion of the environment's size"; 0.05 is a radius of 0.126."""
    p = world("rover/complex-1", range_is="area").params
    assert p.ranges == pytest.approx((0.1493, 0.1262, 0.0977), abs=1e-4)
    assert np.pi * np.square(p.ranges) == pytest.approx([0.07, 0.05, 0.03])
    assert p.rover_sensor_radius == pytest.approx(0.0798, abs=1e-4)


def test_the_lander_receives_detections_one_iteration_later():
    robots, rocks = [(0.5, 0.49, LOW), (0.5, 0.51, LOW)], [(0.5, 0.5, "A")]
    assert situation(robots, rocks, iterations=2)[0].performance["value"][0, 0] == 1
    late = [(0.5, 0.49, LOW), (0.5, 0.51, LOW)]
    out, _ = situation(late, rocks, iterations=2, low_accuracy=0.0)
    assert out.performance["value"][0, 0] == 0


def test_energy_runs_out_and_the_body_stays():
    out, seen = situation(
        [(0.5, 0.49, LOW), (0.5, 0.51, HI)], iterations=12, energy=1.0, hi_cost=0.3
    )
    assert seen["energy"][0] == pytest.approx([1 - 0.05 - 0.1, 1 - 0.05 - 0.3])
    assert out.counts[0, 0, 0, LOW] == 7  # 0.15 each: the seventh is the last that it can start
    assert out.counts[0, 0, 1, HI] == 3
    assert (seen["action"][3:, 1] == NONE).all()
    assert seen["energy"][2, 1] == seen["energy"][-1, 1]


def test_reporting_costs_once_however_many_rocks():
    _, seen = situation(
        [(0.5, 0.49, LOW), (0.5, 0.51, LOW)], [(0.5, 0.5, "A"), (0.501, 0.5, "A")], energy=10.0
    )
    assert seen["energy"][0] == pytest.approx([10 - 0.05 - 0.1 - 0.05] * 2)
    assert seen["energy"][1] == pytest.approx(seen["energy"][0] - 0.15)


def test_the_largest_step_is_d_max_and_edges_canals_and_rovers_refuse_it():
    _, seen = situation([(0.5, 0.5, MOVE, 1.0, 1.0), (0.1, 0.1, LOW)])
    step = np.hypot(seen["x"][0, 0] - 0.5, seen["y"][0, 0] - 0.5)
    assert step == pytest.approx(0.01, rel=1e-3)

    _, seen = situation([(0.004, 0.5, MOVE, -1.0, 0.0), (0.1, 0.1, LOW)], iterations=5)
    assert (seen["x"][:, 0] == np.float32(0.004)).all()
    assert (seen["action"][:, 0] == MOVE).all()  # refused, but executed and charged

    canal = np.zeros((200, 200), np.uint8)
    canal[:, 102] = 1  # x in [0.51, 0.515)
    _, seen = situation([(0.5001, 0.5, MOVE, 1.0, 0.0), (0.1, 0.1, LOW)], iterations=9, canal=canal)
    assert seen["x"][:, 0].max() < 0.51
    assert seen["x"][0, 0] > 0.5001

    rovers = [(0.5, 0.5, MOVE, 1.0, 0.0), (0.50705, 0.5, LOW)]
    _, seen = situation(rovers)
    assert seen["x"][0, 0] == np.float32(0.5)
    _, seen = situation(rovers, separation=0.0)
    assert seen["x"][0, 0] > 0.507


def test_two_rovers_with_one_goal_yield_to_the_lower_number():
    _, seen = situation(
        [(0.5, 0.5, MOVE, 1.0, 0.0), (0.5142, 0.5, MOVE, -1.0, 0.0), (0.1, 0.1, LOW)],
        iterations=1 + 1,
    )
    assert seen["x"][0, 0] > 0.507
    assert seen["x"][0, 1] == np.float32(0.5142)


def test_rovers_see_each_other_and_rocks_only_after_an_activation():
    _, seen = situation(
        [(0.5, 0.5, LOW), (0.515, 0.5005, HI)], [(0.47, 0.5005, "D"), (0.47, 0.501, "C")]
    )
    inputs = seen["inputs"]
    d2 = 0.015**2 + 0.0005**2
    assert inputs[0, 0, 0] == pytest.approx(1e-4 / (3 * d2), rel=1e-4)  # shows 1 at the start
    assert inputs[1, 0, 0] == pytest.approx(3e-4 / (3 * d2), rel=1e-4)  # hi is 3
    assert inputs[1, 1, 4] == pytest.approx(1e-4 / (3 * d2), rel=1e-4)
    assert not inputs[0, :, 8:16].any()
    z = 4e-4 / (0.03**2 + 0.0005**2) + 3e-4 / (0.03**2 + 0.001**2)
    assert inputs[1, 0, 8 + 3] == pytest.approx(z / (1 + z), rel=1e-4)


def test_switches_and_counts_of_a_steady_rover():
    out, _ = situation([(0.5, 0.5, MED), (0.1, 0.1, LOW)], iterations=30)
    assert out.counts[0, 0].tolist() == [[0, 30, 0, 0], [30, 0, 0, 0]]
    assert not out.switches.any()


# --- symmetries and containment ---------------------------------------------------------------


def test_relabelling_the_rovers_relabels_the_outcome():
    """With certain success and without bodies the numbers of the rovers have no effect."""
    a_world = world(
        "rover/complex-5",
        n_robots=8,
        iterations=40,
        low_accuracy=1.0,
        med_accuracy=1.0,
        hi_accuracy=1.0,
        separation=0.0,
    )
    genes, slots = random_team(a_world, 6)
    scenarios = crowd(a_world.scenarios([fold(6, "relabel")]), 8, 6)
    order = stream(5, "order").permutation(8)
    turned = replace(
        scenarios,
        start_x=scenarios.start_x[:, order].copy(),
        start_y=scenarios.start_y[:, order].copy(),
    )
    rollout = Rollout(a_world)
    out = rollout.evaluate(genes, slots[None], scenarios)
    relabelled = rollout.evaluate(genes, slots[order][None], turned)
    assert out.fitness.any()
    assert np.array_equal(out.fitness[0, 0, order], relabelled.fitness[0, 0])
    assert np.array_equal(out.counts[0, 0, order], relabelled.counts[0, 0])
    assert np.array_equal(out.performance["value"], relabelled.performance["value"])


def test_rovers_stay_inside_and_outside_canals_and_apart():
    a_world = world("rover/complex-8", n_robots=20, iterations=300)
    genes, slots = random_team(a_world, 9)
    scenarios = crowd(a_world.scenarios([fold(9, "inside")]), 20, 9, side=0.3)
    heuristic = np.full(20, 3, np.int32)
    seen = Rollout(a_world).record(genes, slots, scenarios, heuristic)
    x, y = seen["x"], seen["y"]
    assert ((x >= 0) & (x < 1) & (y >= 0) & (y < 1)).all()
    assert not scenarios.canal[(y * 200).astype(int), (x * 200).astype(int)].any()
    start = np.stack([scenarios.start_x[0], scenarios.start_y[0]], axis=1)
    moved = np.stack([x, y], axis=2) - np.concatenate([start[None], np.stack([x, y], axis=2)[:-1]])
    assert np.hypot(moved[..., 0], moved[..., 1]).max() < 0.01 * (1 + 1e-4)
    for t in range(0, 300, 10):
        d2 = (x[t][:, None] - x[t]) ** 2 + (y[t][:, None] - y[t]) ** 2
        far = d2[~np.eye(20, dtype=bool)]
        crowded_start = (start[:, None] - start) ** 2
        if crowded_start.sum(axis=2)[~np.eye(20, dtype=bool)].min() >= 0.002**2:
            assert far.min() >= 0.002**2 * (1 - 1e-4)


def test_scenarios_are_addressed_by_key():
    a_world = world("rover/complex-5")
    one, two, again = a_world.scenarios([1]), a_world.scenarios([2]), a_world.scenarios([2, 1])
    assert np.array_equal(one.rock_x[0], again.rock_x[1])
    assert np.array_equal(two.start_x[0], again.start_x[0])
    assert not np.array_equal(one.start_x, two.start_x)
    for scenarios in (one, two):
        assert np.bincount(scenarios.rock_type[0], minlength=5).tolist() == [500] * 4 + [0]
        assert scenarios.rock_value.sum() == 5000
        row, column = (
            (scenarios.start_y[0] * 200).astype(int),
            (scenarios.start_x[0] * 200).astype(int),
        )
        assert not scenarios.canal[row, column].any()
