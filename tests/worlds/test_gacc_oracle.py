"""The kernels of the gathering world against the slow oracle, and the oracle by hand."""

import math
from functools import cache

import numpy as np
import pytest

from conevo.rng import fold
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from oracles import gacc_oracle as oracle
from oracles import splitmix
from oracles.gacc_scene import (
    DELIVERED,
    HELPED,
    LYING,
    UNDETECTED,
    Block,
    Complex,
    Network,
    Obstacle,
    Params,
    Robot,
    World,
    meets,
    octant,
    sense,
)
from worlds.gacc_comparison import Tally, compare
from worlds.gathering import SMALL, build, crowded, random_team

# --- the oracle by hand -------------------------------------------------------------------------


def place(robots, objects=(), plans=("ABC",), ordered=True, obstacles=(), **params):
    """A world of robots (x, y, mind or None) and objects (x, y, letter)."""
    return World(
        p=Params(**params),
        robots=[Robot(x, y, mind or "A-detector") for x, y, mind in robots],
        objects=[Block(x, y, "ABC".index(letter)) for x, y, letter in objects],
        obstacles=[Obstacle(*sides) for sides in obstacles],
        complexes=[Complex(["ABC".index(letter) for letter in plan], ordered) for plan in plans],
    )


def test_octants_run_counter_clockwise_from_east():
    compass = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
    assert [octant(dx, dy) for dx, dy in compass] == list(range(8))  # lower edges belong
    for o in range(8):
        angle = math.radians(45 * o + 22.5)
        assert octant(math.cos(angle), math.sin(angle)) == o
    assert octant(1.0, -1e-20) == 7


@pytest.mark.parametrize(
    ("a", "b", "hit"),
    [
        ((0, 0.5), (1, 0.5), True),  # through
        ((0, 0.2), (0.39, 0.2), False),  # stops before
        ((0, 0.4), (0.4, 0.4), True),  # ends on the corner, which belongs
        ((0.5, 0), (0.5, 0.39), False),
        ((0.5, 0), (0.5, 0.4), True),  # ends on the side
        ((0.39, 0), (0.39, 1), False),  # next to it
        ((0.3, 0.35), (0.45, 0.65), True),  # cuts the corner off: x = 0.4 at y = 0.55
        ((0.3, 0.3), (0.41, 0.71), False),  # passes it: y = 0.6 at x = 0.38
        ((0.5, 0.5), (0.5, 0.5), True),  # inside, of no length
    ],
)
def test_a_segment_meets_a_closed_rectangle(a, b, hit):
    box = Obstacle(0.4, 0.4, 0.7, 0.6)
    assert meets(box, *a, *b) == hit
    assert meets(box, *b, *a) == hit
    turned = Obstacle(0.4, 0.4, 0.6, 0.7)
    assert meets(turned, *a[::-1], *b[::-1]) == hit


def test_readings_are_bounded_and_of_the_closest_in_each_octant():
    w = place(
        [(0.3, 0.3, None), (0.3, 0.305, None), (0.28, 0.299, None)],
        [(0.34, 0.301, "C"), (0.33, 0.301, "C"), (0.301, 0.34, "C"), (0.302, 0.33, "A")],
        obstacles=[(0.25, 0.32, 0.29, 0.34)],
    )
    w.robots[0].action, w.robots[1].held, w.objects[2].life = 2, 3, HELPED
    values, seen = sense(w, 0)
    assert seen == {0, 1}  # not the one that is held, not the one of another type
    near = 1e-4 / (0.03**2 + 0.001**2)
    expected = np.zeros(24)
    expected[0] = near  # of type C, 3 / 3
    expected[2] = -1e-4 / (0.01**2 + 0.02**2)  # the obstacle's corner
    expected[8 + 2] = 1 / 3  # 0.005 away counts as 0.01; carries an A
    expected[16 + 1] = 0.1 / math.hypot(0.2, 0.2)  # the edge of two octants is the second's
    assert values[:24] == pytest.approx(expected)
    assert sense(w, 1)[0][8 + 6] == 0.0  # robot 0 holds nothing


def test_sensors_are_off_without_an_activation_and_do_not_see_through_obstacles():
    w = place([(0.3, 0.3, None)], [(0.34, 0.301, "A")])
    assert sense(w, 0)[1] == set()
    w.robots[0].action = 0
    assert sense(w, 0)[1] == {0}
    w.obstacles = [Obstacle(0.31, 0.29, 0.32, 0.31)]
    values, seen = sense(w, 0)
    assert seen == set()
    assert values[:8] == pytest.approx([-1] + [0] * 7)  # the obstacle itself, 0.01 away
    w.robots[0].x = w.robots[0].y = 0.98  # walls, in octants 0 and 2
    assert sense(w, 0)[0][:8] == pytest.approx([-0.25, 0, -0.25, 0, 0, 0, 0, 0])


def test_the_demand_of_the_thesis_example():
    """Section 6.2.3: two complex objects of four parts that have two each.

    The first needs A next and B last, the second B next and C last. Priorities are 1, 1/2, 0 and
    0, 1, 1/2; one A, two B and one C are not delivered.
    """
    w = place([], [(0.5, 0.5, x) for x in "AAAABBCA"], ("AAAB", "AABC"))
    for k in (0, 1, 2, 3):
        w.objects[k].life = DELIVERED
    for one in w.complexes:
        one.built = [0, 0]
    assert [[c.priority(x) for x in range(3)] for c in w.complexes] == [[1, 0.5, 0], [0, 1, 0.5]]
    assert [oracle.demand(w, x) for x in range(3)] == [1.0, 0.5, 0.5]
    w.complexes[1].built = [0]  # one part only: it is silent
    assert [oracle.demand(w, x) for x in range(3)] == [1.0, 0.25, 0.0]
    w.complexes[0].built = [0, 0, 0, 1]  # complete
    assert [oracle.demand(w, x) for x in range(3)] == [0.0, 0.0, 0.0]


def test_needs_of_an_ordered_and_a_disordered_complex_object():
    plan = [0, 1, 0, 2]
    for ordered, built, needs, priority in [
        (True, [], [1, 0, 0], [1, 1 / 2, 1 / 4]),
        (True, [0, 1], [1, 0, 0], [1, 0, 1 / 2]),
        (True, plan, [0, 0, 0], [0, 0, 0]),
        (False, [], [1, 1, 1], [1, 1, 1]),
        (False, [2, 0], [1, 1, 0], [1, 1, 0]),
        (False, [0, 2, 0], [0, 1, 0], [0, 1, 0]),
        (False, [0, 2, 0, 1], [0, 0, 0], [0, 0, 0]),
    ]:
        one = Complex(plan, ordered, built)
        assert [one.needs(x) for x in range(3)] == needs
        assert [one.priority(x) for x in range(3)] == priority


def test_a_network_by_hand():
    w_in, w_out = np.zeros((3, 5)), np.zeros((3, 8))
    w_in[0, 1], w_in[2, 3] = 2.0, 1.0  # sensor 1; context 0
    w_out[0, 4], w_out[2, 0] = 3.0, -1.0
    network = Network(w_in, w_out, np.array([True, False, True]))
    first, last = 1 / (1 + math.exp(-2.0)), 1 / (1 + math.exp(-1.0))
    sums, context = network.think(np.array([0, 0.5, 0, 0, 0]), 2)
    assert sums == pytest.approx([1 - last, 1, 1, 1, 1 + 3 * first, 1, 1, 1])
    assert context == pytest.approx([first, 0.0])  # the empty slot feeds nothing


@pytest.mark.parametrize("name", oracle.HEURISTICS)
@pytest.mark.parametrize("home", [True, False])
def test_heuristic_robots_follow_table_6_3(name, home):
    w = place([(0.5, 0.5, name) if home else (0.2, 0.5, name)], iterations=2000)
    actions = np.zeros(7)
    centred = 0
    for w.t in range(2000):
        decision = oracle.decide(w, 0, None)
        actions[decision.action] += 1 / 2000
        step = decision.x - w.robots[0].x, decision.y - 0.5
        assert math.hypot(*step) == pytest.approx(0.01 if decision.action == 3 else 0.0)
        centred += step == pytest.approx((0.01, 0.0))
    letter, _, kind = name.partition("-")
    expected = np.full(7, 1 / 7)
    if letter != "non":
        expected = np.zeros(7)
        own = {"detector": 0, "gatherer": 4, "constructor": 4}[kind] + "ABC".index(letter)
        expected[own], expected[3] = 0.7, 0.3
        if kind == "constructor" and not home:
            expected = np.eye(7)[3]
            assert centred / 2000 == pytest.approx(0.7, abs=0.05)
    assert actions == pytest.approx(expected, abs=0.05)


def test_uniform_numbers_are_the_kernels():
    """The two can therefore agree in random events."""
    u = [splitmix.uniform(5, t, 16, 3) for t in range(4000)]
    assert np.histogram(u, 4, (0, 1))[0] == pytest.approx([1000] * 4, abs=150)


def test_unknown_objects_stay_unknown():
    w = place([(0.3, 0.3, "A-gatherer")], [(0.301, 0.3, "A")])
    for w.t, detected, gripped in [(3, UNDETECTED, -1), (3, 3, -1), (4, 3, 0)]:
        w.objects[0].detected = detected
        assert oracle.use_gripper(w, 0, 0).target == gripped
    w.objects[0].detected, w.p = UNDETECTED, Params(needs_detection=False)
    assert oracle.use_gripper(w, 0, 0).target == 0
    assert w.objects[0].life == LYING


# --- the kernels --------------------------------------------------------------------------------

FOUND = SMALL | {"needs_detection": True, "wait": 30}
WIDE = {"object_range": 0.3, "robot_range": 0.4, "move_range": 0.02}
PRICES = {"zone_side": 0.1, "object_cost": 0.03, "robot_cost": 0.02, "grip_cost": 0.04,
          "move_cost": 0.05}  # fmt: skip
# Environment, minds, robots, iterations, sides of the squares that robots and objects start in.
CASES = [
    ("complex-1", "networks", 30, 60, 0.3, 0.3, SMALL | {"grip_distance": 0.05}),
    ("complex-6", "both", 20, 60, 0.3, 0.3, SMALL | {"wait": 30}),
    ("complex-4", "both", 30, 60, 0.3, 0.3, SMALL | {"wait": 4}),
    ("complex-9", "both", 30, 90, 0.3, 0.3, FOUND),
    ("complex-9", "heuristics", 30, 120, 0.3, 0.3, FOUND | {"wait": 3, "energy": 2.503}),
    ("complex-5", "heuristics", 30, 90, 0.25, 0.15, FOUND | {"wait": 6, "home_sight": 0.1}),
    ("complex-8", "heuristics", 40, 70, 0.2, 0.2, SMALL | PRICES | {"wait": 3, "home_sight": 0.2}),
    ("complex-2", "heuristics", 40, 120, 0.23, 0.23, SMALL | {"wait": 8, "move_range": 0.02}),
    ("complex-3", "heuristics", 30, 90, 0.2, 0.1, SMALL | {"wait": 8, "grip_distance": 0.05}),
    ("complex-7", "networks", 30, 70, 0.3, 0.3, SMALL | WIDE | {"grip_distance": 0.04}),
    ("simple-9", "heuristics", 30, 90, 0.2, 0.2, FOUND | {"wait": 4, "object_accuracy": 0.5}),
    ("simple-10", "both", 30, 60, 0.99, 0.99, FOUND | WIDE | {"home_range": 0.3}),
    ("complex-9", "heuristics", 30, 60, 0.9, 0.9, SMALL | WIDE | {"grip_distance": 0.2}),
    ("complex-4", "heuristics", 30, 120, 0.24, 0.24, SMALL | WIDE | {"home_side": 0.06, "wait": 4,
                                                                     "energy": 2.003}),
    ("complex-6", "networks", 12, 90, 0.2, 0.2, SMALL | {"wait": 2, "separation": 0.01,
                                                          "min_distance": 0.03}),
    ("complex-2", "heuristics", 30, 50, 0.99, 0.99, SMALL | WIDE | {"object_accuracy": 0.5}),
    # The world as it is: a large home area, all of it in sight.
    ("complex-9", "both", 30, 90, 0.9, 0.9, {}),
    ("complex-4", "networks", 30, 90, 0.99, 0.7, {}),
    ("simple-7", "heuristics", 30, 90, 0.7, 0.6, {"object_range": 0.1, "object_accuracy": 0.7}),
]  # fmt: skip


def setup(number):
    """World, networks, scenario and heuristics of a case."""
    environment, minds, n_robots, iterations, robots, objects, params = CASES[number]
    a_world = world(f"gacc/{environment}", n_robots=n_robots, iterations=iterations, **params)
    scenarios = crowded(a_world.scenarios([fold(number, "gacc")]), number, robots, objects)
    kinds = np.arange(n_robots, dtype=np.int32)
    heuristic = {"networks": 0 * kinds - 1, "heuristics": kinds % 10, "both": kinds % 11 - 1}[minds]
    return a_world, *random_team(a_world, number), scenarios, heuristic


@cache
def compared(number):
    return compare(*setup(number))


@pytest.mark.parametrize("number", range(len(CASES)))
def test_kernels_equal_the_oracle(number):
    tally = compared(number)
    assert tally.near_ties <= 0.03 * tally.steps


MEANT = {
    # Every transition of an object's life that the card names, and those that skip a state.
    "LYING -> GRIPPED", "LYING -> WAITING", "LYING -> HELPED", "LYING -> DELIVERED",
    "GRIPPED -> CARRIED", "GRIPPED -> DROPPED", "GRIPPED -> WAITING",
    "CARRIED -> WAITING", "CARRIED -> DROPPED",
    "WAITING -> HELPED", "WAITING -> DELIVERED", "WAITING -> DROPPED",
    "HELPED -> WAITING", "HELPED -> DELIVERED", "HELPED -> DROPPED",
    "DROPPED -> GRIPPED", "DROPPED -> WAITING", "DROPPED -> HELPED", "DROPPED -> DELIVERED",
    "situation 1", "situation 2", "situation 3",
    "let go: waited", "let go: out of order", "let go: other setting", "let go: no energy",
    "let go: delivered", "delivered A", "delivered B", "delivered C", "ordered", "disordered",
    "last part", "detected", "hidden block", "hidden robot",
    "refused by edge", "refused by obstacle", "refused by robot", "refused by rival",
    "refused by home",
    "demand silent", "demand silent with one part", "demand complete", "demand of several",
    "demand ordered next", "demand ordered later", "demand ordered not needed",
    "demand disordered next", "demand disordered not needed",
}  # fmt: skip


def test_the_comparisons_above_are_not_vacuous():
    tally = Tally()
    for number in range(len(CASES)):
        tally += compared(number)
    kinds = {name for name in tally.events if "->" in name}
    assert {name for name in MEANT if not tally.events[name]} == set()
    assert kinds <= MEANT  # no other transition is possible
    assert min(tally.events[name] for name in ("ordered", "disordered")) >= 20
    assert min(tally.events[f"delivered {letter}"] for letter in "ABC") >= 20


def test_a_whole_epoch_of_the_world_as_it_is():
    """All thirty heuristic robots of every kind with the defaults, from a drawn start."""
    a_world = world("gacc/complex-9", iterations=300)
    genes, slots = random_team(a_world, 1)
    heuristic = (np.arange(30) % 10).astype(np.int32)
    tally = compare(a_world, genes, slots, a_world.scenarios([3]), heuristic)
    assert tally.near_ties <= 3
    assert tally.events["GRIPPED -> CARRIED"] > 10


@pytest.mark.parametrize("number", [0, 1, 3, 7])
def test_an_epoch_without_correction_follows_the_oracle(number):
    """Until the smallest differences have grown into other decisions."""
    a_world, *rest = setup(number)
    seen = Rollout(a_world, n_threads=1).record(*rest)
    w = build(a_world, *rest)
    oracle.run(w, a_world.params.iterations)
    assert [r.action for r in w.robots] == seen["action"][-1].tolist()
    assert [r.x for r in w.robots] == pytest.approx(seen["x"][-1].tolist(), abs=1e-4)
    assert [block.life for block in w.objects] == seen["life"][-1].tolist()
    assert [r.counts for r in w.robots] == seen["counts"][-1].tolist()
