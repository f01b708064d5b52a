"""The life of an object of the gathering world, in small cases solved by hand.

Every case is played by the kernels and, phase by phase, by the oracle. Coordinates: the home area
is [0.4, 0.6] x [0.4, 0.6], robots grip within 0.02, move 0.01 by themselves and see others at home
within 0.05. By default objects are known from the start and the wait is 5.
"""

import math

import numpy as np
import pytest

from conevo.worlds.rollout import Rollout
from worlds.gacc_comparison import compare
from worlds.gathering import IDLE, gathering

LYING, GRIPPED, CARRIED, WAITING, HELPED, DELIVERED, DROPPED = range(7)
NONE = -1
EAST, WEST = (0.0055, 0.0), (-0.005, 0.0)


class Play:
    """The record, with objects in the given order."""

    def __init__(self, robots, objects, plans, **how):
        a_world, rest, self.numbers = gathering(robots, objects, plans, **how)
        rollout = Rollout(a_world, n_threads=1)
        self.seen = rollout.record(*rest)
        compare(a_world, *rest, seen=self.seen)
        out = rollout.evaluate(rest[0], rest[1][None], rest[2], rest[3][None])
        self.counts = out.counts[0, 0]
        self.performance = {name: float(v[0, 0]) for name, v in out.performance.items()}
        self.fitness = out.fitness[0, 0].tolist()

    def life(self, n=0):
        return self.seen["life"][:, self.numbers[n]].tolist()

    def part(self, n=0):
        return int(self.seen["part"][-1, self.numbers[n]])

    def place(self, t, n=0):
        k = self.numbers[n]
        return self.seen["object_x"][t, k], self.seen["object_y"][t, k]

    def of(self, name, i):
        """A robot's recorded values; objects are numbered in the given order."""
        values = self.seen[name][:, i].tolist()
        if name in ("held", "dropped"):
            order = {k: n for n, k in enumerate(self.numbers)} | {NONE: NONE}
            return [order[k] for k in values]
        return values


# --- carried home -------------------------------------------------------------------------------


def test_two_robots_and_a_type_a():
    """Robot 0 grips outside, carries the object over the border and waits; robot 1 comes."""
    play = Play(
        [(0.385, 0.5, ["grip A", EAST]), (0.425, 0.5, IDLE)],
        [(0.39, 0.5, "A")],
        ["AB"],
        iterations=7,
    )
    assert play.life() == [GRIPPED, CARRIED, CARRIED, WAITING, WAITING, DELIVERED, DELIVERED]
    assert play.of("held", 0) == [0] * 5 + [NONE] * 2
    assert play.of("situation", 0) == [0, 0, 0, 0, 2, 2, 0]
    assert play.of("situation", 1) == [0, 0, 0, 0, 1, 1, 0]  # a step, then the grip
    assert play.of("waited", 0) == [0, 0, 0, 0, 1, 0, 0]
    assert play.place(0) == pytest.approx((0.39, 0.5))  # gripping does not move it
    for t in (1, 2, 3):
        assert play.place(t) == pytest.approx((0.385 + 0.0055 * t, 0.5))
    assert play.place(5) == pytest.approx((0.5 + 0.06 * (0.05 - 0.5), 0.5))
    assert play.part() == 0
    assert play.fitness == [1, 1]
    assert play.performance == {"delivered": 1, "completed": 0, "delivered_share": 10}
    # Construction is from the arrival on (3 iterations), or from the grip at home.
    assert play.counts[0].tolist() == [0, 0, 0, 1, 3, 0, 0, 3, 0, 0]
    assert play.counts[1].tolist() == [0, 0, 5, 1, 0, 0, 0, 1, 0, 0]


def test_a_grip_and_a_step_over_the_border_skip_the_carrying():
    play = Play([(0.3965, 0.5, ["grip A", EAST]), (0.1, 0.1, IDLE)], [(0.39, 0.5, "A")], ["A"])
    assert play.life()[:3] == [GRIPPED, WAITING, WAITING]
    assert play.place(1) == pytest.approx((0.402, 0.5))


def test_three_are_needed_and_only_two_come():
    """Both wait for five iterations after their grip, then do not touch it again."""
    robots = [(0.5, 0.49, IDLE), (0.5, 0.51, IDLE)]
    play = Play(robots, [(0.505, 0.5, "B")], ["B"])
    assert play.life() == [HELPED] * 5 + [DROPPED] * 7
    for i in (0, 1):
        assert play.of("held", i) == [0] * 5 + [NONE] * 7
        assert play.of("waited", i) == [0, 1, 2, 3, 4] + [0] * 7
        assert play.of("dropped", i) == [NONE] * 5 + [0] * 7
        assert play.of("situation", i) == [3] + [2] * 5 + [0] * 6
    assert not any(play.fitness)
    assert play.place(11) == pytest.approx((0.505, 0.5))
    # A third one is enough, in the same iteration.
    play = Play([*robots, (0.515, 0.5, IDLE)], [(0.505, 0.5, "B")], ["B"])
    assert play.life() == [DELIVERED] * 12
    assert play.fitness == [1, 1, 1]


@pytest.mark.parametrize(("letter", "n"), [("A", 2), ("B", 3), ("C", 4)])
def test_how_many_robots_each_type_needs(letter, n):
    around = [(0.5 + 0.01 * math.cos(a), 0.5 + 0.01 * math.sin(a), IDLE) for a in range(6)]
    for there, life in ((n - 1, WAITING if n == 2 else HELPED), (n, DELIVERED), (6, DELIVERED)):
        robots = around[:there] + [(0.1, 0.1, IDLE)] * (there < 2)
        play = Play(robots, [(0.5, 0.5, letter)], [letter], iterations=3)
        assert play.life()[0] == life
        assert play.fitness[:there] == [float(there >= n)] * there  # all holders, the same


@pytest.mark.parametrize(("y", "in_time"), [(0.456, True), (0.455, False)])
def test_a_helper_in_the_last_waiting_iteration_and_one_that_is_too_late(y, in_time):
    """Robot 1 sees robot 0 but not the object. It goes four steps of 0.01 from 0.0595 or 0.0605."""
    play = Play([(0.5, 0.5, IDLE), (0.508, y, IDLE)], [(0.5, 0.515, "A")], ["A"], iterations=14)
    if in_time:
        assert play.life() == [WAITING] * 5 + [DELIVERED] * 9
        assert play.of("situation", 1) == [0] + [1] * 5 + [0] * 8
        assert play.fitness == [1, 1]
        assert play.counts[0, 7] == 6
    else:
        # It finds the dropped object, waits for help itself, and gets none from robot 0.
        assert play.life() == [WAITING] * 5 + [DROPPED] + [WAITING] * 5 + [DROPPED] * 3
        assert play.of("situation", 1) == [0] + [1] * 5 + [3] + [2] * 5 + [0] * 2
        assert play.of("held", 0) == [0] * 5 + [NONE] * 9
        assert play.fitness == [0, 0]


def test_every_robot_waits_its_own_time():
    """The first lets go of a B after its wait; the second one, which came later, is left alone."""
    play = Play([(0.5, 0.5, IDLE), (0.508, 0.456, IDLE)], [(0.5, 0.515, "B")], ["B"], iterations=14)
    assert play.of("held", 1).index(0) == 5  # in which robot 0 lets go
    assert play.life() == [WAITING] * 10 + [DROPPED] * 4
    play = Play([(0.5, 0.5, IDLE), (0.508, 0.47, IDLE)], [(0.5, 0.515, "B")], ["B"], iterations=14)
    assert play.of("held", 1).index(0) == 3  # situation 3 already in iteration 0
    assert play.life() == [WAITING] * 3 + [HELPED] * 2 + [WAITING] * 3 + [DROPPED] * 6
    assert play.of("waited", 1)[:9] == [0, 0, 0, 0, 1, 2, 3, 4, 0]


# --- order --------------------------------------------------------------------------------------


def test_out_of_order_is_dropped_at_once_by_two_and_waited_for_by_one():
    robots = [(0.5, 0.49, IDLE), (0.5, 0.51, IDLE)]
    play = Play(robots, [(0.505, 0.5, "A")], ["BA"])
    assert play.life() == [LYING] * 12
    for i in (0, 1):
        assert play.of("situation", i) == [4] + [0] * 11
        assert play.of("held", i) == [NONE] * 12
        assert play.of("dropped", i) == [0] * 12
    # With one waiting and one that comes:
    play = Play([(0.5, 0.5, IDLE), (0.508, 0.47, IDLE)], [(0.5, 0.515, "A")], ["BA"])
    assert play.life() == [WAITING] * 3 + [DROPPED] * 9
    assert play.of("situation", 0)[2:5] == [2, 4, 0]
    # Alone it waits, whatever the next part is.
    play = Play([(0.5, 0.5, IDLE), (0.1, 0.1, IDLE)], [(0.5, 0.515, "A")], ["BA"])
    assert play.life() == [WAITING] * 5 + [DROPPED] * 7


def test_a_disordered_complex_object_takes_any_type_that_it_lacks():
    robots = [(0.5, 0.49, IDLE), (0.5, 0.51, IDLE)]
    two = [(0.505, 0.5, "A"), (0.515, 0.5, "A")]
    play = Play(robots, two, ["BAA"], ordered="d", iterations=4)
    assert play.life(0) == [DELIVERED] * 4
    assert play.life(1) == [LYING] + [DELIVERED] * 3
    assert [play.part(0), play.part(1)] == [0, 1]  # in the order in which they came
    assert play.fitness == [2, 2]


def test_a_type_that_no_complex_object_needs_is_out_of_order():
    """The only A of the first plan is built in; the other A belongs to the second, after a B."""
    robots = [(0.5, 0.49, IDLE), (0.5, 0.51, IDLE)]
    two = [(0.505, 0.5, "A"), (0.515, 0.5, "A")]
    play = Play(robots, two, ["ACC", "BA"], iterations=4)
    assert play.part(0) == 0
    assert play.of("situation", 0) == [3, 4, 0, 0]
    assert play.life(1) == [LYING] * 4


def test_two_complex_objects_that_both_need_a_type():
    robots = [(0.5, 0.49, IDLE), (0.5, 0.51, IDLE)]
    three = [(0.505, 0.5, "A"), (0.509, 0.5, "A"), (0.513, 0.5, "A")]
    play = Play(robots, three, ["AAB", "AAC"], iterations=4)
    assert [play.part(n) for n in range(3)] == [0, 1, 10]  # the first, until it needs another
    y = [0.5 + 0.06 * ((c + 0.5) / 2 - 0.5) for c in (0, 1)]
    x = [0.5 + 0.06 * ((step + 0.5) / 10 - 0.5) for step in (0, 1)]
    places = [play.place(3, n) for n in range(3)]
    assert np.allclose(places, [(x[0], y[0]), (x[1], y[0]), (x[0], y[1])], atol=1e-6)
    # A disordered second one takes what the first cannot use now.
    play = Play(robots, three, ["ABA", "CAB"], ordered="od", iterations=4)
    assert [play.part(n) for n in range(2)] == [0, 10]
    assert play.of("situation", 0)[2] == 4


@pytest.mark.parametrize(("plan", "parts"), [("AB", [0, 1]), ("BA", [NONE, 0])])
def test_of_objects_that_are_ready_at_once_the_lower_number_comes_first(plan, parts):
    """Two hold an A and three a B from the first iteration on: with "BA" the A comes too soon."""
    robots = [(0.45, 0.49, IDLE), (0.45, 0.51, IDLE)]
    robots += [(0.55, 0.49, IDLE), (0.55, 0.51, IDLE), (0.56, 0.5, IDLE)]
    play = Play(robots, [(0.45, 0.5, "A"), (0.55, 0.5, "B")], [plan], iterations=3)
    assert [play.part(0), play.part(1)] == parts
    assert play.of("situation", 0)[0] == (3 if plan == "AB" else 4)
    assert play.fitness == [float(plan == "AB")] * 2 + [1.0] * 3


def test_the_last_part_and_the_demand_before_it():
    robots = [(0.499, 0.5, IDLE), (0.501, 0.5, IDLE)]
    objects = [(0.5, 0.5015 + 0.0015 * k, "A") for k in range(10)]
    play = Play(robots, objects, ["A" * 10], iterations=12)
    assert [play.part(n) for n in range(10)] == list(range(10))
    demand = play.seen["demand"]
    # With two parts it starts to broadcast; the next part is an A, divided by the number left.
    assert demand[:, 0] == pytest.approx([0] + [1 / left for left in range(8, 0, -1)] + [0] * 3)
    assert not demand[:, 1:].any()
    assert play.performance == {"delivered": 10, "completed": 1, "delivered_share": 100}
    assert play.fitness == [10, 10]
    # The stop signal lasts; inputs show the demand one iteration later.
    assert play.seen["inputs"][1:, 0, 24:27] == pytest.approx(demand[:-1])


def test_the_demand_of_the_thesis_example_in_the_kernels():
    """Section 6.2.3: each complex object lacks two parts, A then B, and B then C."""
    robots = [(0.499, 0.5, IDLE), (0.501, 0.5, IDLE), (0.5, 0.498, IDLE)]
    objects = [(0.5, 0.5015 + 0.001 * k, "B") for k in range(16)]
    plans = ["B" * 8 + "AB", "B" * 8 + "BC"]
    play = Play(robots, objects, plans, iterations=17)
    assert play.performance["delivered"] == 16
    assert play.seen["demand"][-1] == pytest.approx([1.0, 1 / 2, 1 / 2])
    # After two parts of the first: A is 7 steps away, B the next, C not in its plan.
    assert play.seen["demand"][1] == pytest.approx([1 / 7 / 1, 1 / 16, 0])
    # The first has all its eight and the second two.
    assert play.seen["demand"][9] == pytest.approx([1.0, 1 / 8, 1 / 8 / 1])


# --- gripping -----------------------------------------------------------------------------------


def test_the_wrong_setting_grips_nothing_and_lets_go():
    robots = [
        (0.2, 0.2, ["grip A", "grip C", "grip B", "grip B", EAST, "grip B", "grip C", "detect C"]),
        (0.8, 0.2, IDLE),
    ]
    play = Play(robots, [(0.205, 0.2, "B")], ["B"], iterations=9)
    assert play.of("held", 0) == [NONE, NONE, 0, 0, 0, 0, NONE, NONE, NONE]
    assert play.life() == [LYING] * 2 + [GRIPPED] * 2 + [CARRIED] * 2 + [DROPPED] * 3
    assert play.place(8) == pytest.approx((0.2055, 0.2))
    assert play.of("dropped", 0) == [NONE] * 9  # this is remembered at home only
    assert play.of("action", 0) == [4, 6, 5, 5, 3, 5, 6, 2, 2]
    assert play.counts[0].tolist() == [0, 0, 2, 0, 1, 4, 2, 0, 0, 0]  # moving a B is gathering it


def test_the_gripper_has_its_range_and_takes_the_closest():
    far = (0.2, 0.22 + 2e-5, "A")
    assert Play([(0.2, 0.2, ["grip A"]), (0.8, 0.2, IDLE)], [far], ["A"]).life() == [LYING] * 12
    near = (0.2, 0.22 - 2e-5, "A")
    play = Play(
        [(0.2, 0.2, ["grip A"]), (0.8, 0.2, IDLE)],
        [near, (0.2, 0.19, "B"), (0.205, 0.21, "A"), (0.191, 0.205, "A")],
        ["AAAB"],
    )
    assert play.of("held", 0) == [3] * 12


def test_ties_of_distance_go_to_the_first():
    """At distances that are exact in binary: outside, at home, and among robots that need help."""
    x = 1 / 64
    around = [(0.25 + x, 0.25, "A"), (0.25 - x, 0.25, "A"), (0.25, 0.25 - x, "A")]
    play = Play([(0.25, 0.25, ["grip A"]), (0.8, 0.8, IDLE)], around, ["AAA"], iterations=2)
    assert play.of("held", 0) == [0, 0]
    at_home = [(ox + 0.25, oy + 0.25, "A") for ox, oy, _ in around]
    play = Play([(0.5, 0.5, IDLE), (0.8, 0.8, IDLE)], at_home, ["AAA"], iterations=2)
    assert play.of("held", 0) == [0, 0]
    holders = [(0.5 - 2 * x, 0.5, IDLE), (0.5 + 2 * x, 0.5, IDLE), (0.5, 0.59, [(0.0, -0.005)] * 2)]
    things = [(0.5 - 2.5 * x, 0.5, "B"), (0.5 + 2.5 * x, 0.5, "B")]
    for order in ([0, 1], [1, 0]):
        robots = [holders[order[0]], holders[order[1]], holders[2]]
        play = Play(robots, things, ["BB"], home_sight=0.095, grip_distance=0.01, iterations=4)
        assert play.of("held", 0)[:2] == [order[0]] * 2
        moved = play.of("x", 2)[3] - play.of("x", 2)[0]
        assert moved * (1 if order[0] else -1) > 0.005


def test_of_two_that_grip_one_object_outside_the_lower_number_gets_it():
    here, there = (0.2, 0.2, ["grip A"]), (0.21, 0.2, ["grip A"])
    thing = [(0.206, 0.2, "A")]  # closer to the second
    for robots in ([here, there], [there, here]):
        play = Play(robots, thing, ["A"])
        assert play.of("held", 0) == [0] * 12
        assert play.of("held", 1) == [NONE] * 12  # nor later: another robot holds it
        assert play.life() == [GRIPPED] * 12
    # Carried past a third robot, it is not taken either.
    play = Play([(0.2, 0.2, ["grip A", EAST]), (0.22, 0.205, ["grip A"])], thing, ["A"])
    assert play.life() == [GRIPPED] + [CARRIED] * 11
    assert play.of("held", 1) == [NONE] * 12


def test_no_robot_grips_across_the_border():
    inside = [(0.405, 0.5, "A")]
    play = Play([(0.395, 0.5, ["grip A"]), (0.1, 0.1, IDLE)], inside, ["A"])
    assert play.life() == [LYING] * 12
    outside = [(0.395, 0.5, "A")]
    play = Play([(0.405, 0.5, ["grip A"]), (0.1, 0.1, IDLE)], outside, ["A"])
    assert play.life() == [LYING] * 12
    assert play.of("situation", 0) == [0] * 12


@pytest.mark.parametrize("who", [0, 1])
def test_an_object_must_be_detected_before_it_is_gripped(who):
    """Activated in iteration 1, seen in 2, known in 3; the other robot sees it as well."""
    eyes = ["grip A", "detect A", "grip A"]
    hands = ["grip A"]
    scripts = [eyes, IDLE] if who == 0 else [hands, ["detect C", "detect A", "detect C"]]
    play = Play(
        [(0.2, 0.2, scripts[0]), (0.23, 0.2, scripts[1])],
        [(0.21, 0.2, "A")],
        ["A"],
        needs_detection=True,
    )
    k = play.numbers[0]
    assert play.seen["detected"][:, k].tolist() == [2**31 - 1] * 2 + [2] * 10
    assert play.life() == [LYING] * 3 + [GRIPPED] * 9
    assert play.of("held", 0) == [NONE] * 3 + [0] * 9
    # Seen with another setting it is not found; nor from too far.
    for other, x in (("detect B", 0.21), ("detect A", 0.2501 + 2e-5)):
        play = Play([(0.2, 0.2, [other, "grip A"]), (0.8, 0.2, IDLE)], [(x, 0.2, "A")], ["A"],
                    needs_detection=True, grip_distance=0.1)  # fmt: skip
        assert play.life() == [LYING] * 12


def test_at_home_too_an_object_must_be_known():
    robots = [(0.5, 0.49, ["detect A"]), (0.5, 0.51, IDLE)]
    play = Play(robots, [(0.505, 0.5, "A")], ["A"], needs_detection=True)
    assert play.life() == [LYING] * 2 + [DELIVERED] * 10  # activated in 0, seen in 1, known in 2
    assert Play([(0.5, 0.49, IDLE), (0.5, 0.51, IDLE)], [(0.505, 0.5, "A")], ["A"],
                needs_detection=True).life() == [LYING] * 12  # fmt: skip


# --- at home ------------------------------------------------------------------------------------


def test_at_home_robots_see_as_far_as_home_sight():
    """Whatever the ranges of sensors: an object in place, then a robot that holds one."""
    robots = [(0.45, 0.5, IDLE), (0.57, 0.5, IDLE)]
    how = {"object_range": 0.2, "robot_range": 0.2, "grip_distance": 0.05, "iterations": 3}
    for sight, comes in ((0.115, 0), (0.125, 1)):
        play = Play(robots, [(0.44, 0.5, "A")], ["A"], **how, home_sight=sight)
        assert play.of("situation", 0) == [3, 2, 2]
        assert play.of("situation", 1) == [0] + [comes] * 2
        play = Play([(0.1, 0.1, IDLE), robots[1]], [(0.45, 0.5, "A")], ["A"], **how,
                    home_sight=sight)  # fmt: skip
        assert play.of("situation", 1) == [3 * comes] * 3


def test_a_robot_finds_what_it_dropped_only_after_it_left():
    stays = [(0.403, 0.5, IDLE), (0.1, 0.1, IDLE)]
    thing = [(0.405, 0.5, "A")]
    play = Play(stays, thing, ["A"], iterations=14)
    assert play.life() == [WAITING] * 5 + [DROPPED] * 9
    leaves = [(0.403, 0.5, ["detect C"] * 6 + [WEST, EAST]), (0.1, 0.1, IDLE)]
    play = Play(leaves, thing, ["A"], iterations=14)
    assert play.of("dropped", 0)[4:8] == [NONE, 0, NONE, NONE]
    assert play.life() == [WAITING] * 5 + [DROPPED] * 3 + [WAITING] * 5 + [DROPPED]
    # Meanwhile it takes other objects, if it is alone with them.
    play = Play(stays, [*thing, (0.41, 0.51, "B")], ["AB"], iterations=14)
    assert play.life(0) == [WAITING] * 5 + [DROPPED] * 7 + [WAITING] * 2
    assert play.life(1) == [LYING] * 6 + [WAITING] * 5 + [DROPPED] * 3
    assert play.of("dropped", 0)[11:] == [1] * 3  # it remembers one, and goes back to the other


def test_a_helper_goes_to_the_closest_robot_not_to_the_closest_object():
    """Robot 2 enters between two that wait; the closer one's object is the farther one."""
    robots = [(0.43, 0.516, IDLE), (0.43, 0.48, IDLE), (0.398, 0.5, [EAST, "detect C"])]
    objects = [(0.445, 0.508, "B"), (0.416, 0.485, "B")]
    play = Play(robots, objects, ["BB"], iterations=5)
    assert play.of("held", 0) == [0] * 5
    assert play.of("held", 1) == [1] * 5
    x, y = play.of("x", 2), play.of("y", 2)
    assert (x[0], y[0]) == pytest.approx((0.4035, 0.5))
    gap = math.hypot(0.445 - x[0], 0.508 - y[0])
    step = (0.445 - x[0]) / gap * 0.01, (0.508 - y[0]) / gap * 0.01
    assert (x[1] - x[0], y[1] - y[0]) == pytest.approx(step, abs=1e-6)
    assert play.of("held", 2)[-1] == 0
    # One that holds nothing, or is farther than 0.05, or is outside, is not helped.
    alone = [(0.47, 0.55, IDLE), (0.43, 0.48, IDLE), robots[2]]
    play = Play(alone, [(0.48, 0.555, "B"), (0.416, 0.485, "B")], ["BB"], iterations=5)
    assert play.of("held", 2)[-1] == 1
    outside = [(0.398, 0.5, ["grip A"]), (0.1, 0.1, IDLE), (0.41, 0.5, IDLE)]
    play = Play(outside, [(0.395, 0.5, "A")], ["A"], iterations=5)
    assert play.of("situation", 2) == [0] * 5


def test_a_step_to_an_object_does_not_go_beyond_it():
    robots = [(0.5, 0.5, IDLE), (0.1, 0.1, IDLE)]
    play = Play(robots, [(0.5, 0.505, "A")], ["A"], grip_distance=0.004, iterations=3)
    assert play.of("y", 0) == pytest.approx([0.505] * 3)
    assert play.life() == [LYING, WAITING, WAITING]


def test_a_free_object_is_taken_only_if_no_robot_needs_help():
    """Situation 1 precedes situation 3, however close the free object is."""
    robots = [(0.43, 0.516, IDLE), (0.1, 0.1, IDLE), (0.398, 0.5, [EAST, "detect C"])]
    objects = [(0.445, 0.508, "A"), (0.404, 0.496, "A")]
    play = Play(robots, objects, ["AAA"], iterations=8)
    assert play.of("situation", 2)[:5] == [0, 1, 1, 1, 1]
    assert play.life(0)[-1] == DELIVERED
    assert play.part(0) == 0


def test_a_robot_does_not_help_with_an_object_that_it_dropped_but_with_others():
    """Robot 2 grips what robot 0 dropped; robot 1 comes home with a B, a little farther off."""
    robots = [
        (0.4485, 0.5, IDLE),
        (0.3955, 0.5, ["grip B", *IDLE * 5, EAST]),
        (0.4995, 0.5, [*IDLE * 5, WEST, "detect C"]),
    ]
    play = Play(robots, [(0.4485, 0.505, "B"), (0.39, 0.5, "B")], ["BB"], grip_distance=0.05)
    assert play.of("held", 0) == [0] * 5 + [NONE] * 2 + [1] * 5
    assert play.of("held", 1) == [1] * 11 + [NONE]
    assert play.of("held", 2) == [NONE] * 6 + [0] * 5 + [NONE]
    assert play.of("situation", 0)[5:9] == [2, 0, 1, 2]


# --- energy -------------------------------------------------------------------------------------


def test_a_carrier_that_runs_out_of_energy():
    """0.02 for a grip and each move: 0.05 are enough to begin the third. Another one takes over."""
    robots = [(0.2, 0.2, ["grip A", EAST]), (0.215, 0.205, ["grip A"])]
    play = Play(robots, [(0.205, 0.2, "A")], ["A"], energy=0.05, iterations=6)
    assert play.of("action", 0) == [4, 3, 3, NONE, NONE, NONE]
    assert play.of("held", 0) == [0, 0] + [NONE] * 4
    assert play.life() == [GRIPPED, CARRIED] + [DROPPED] * 4
    assert play.place(5) == pytest.approx((0.211, 0.2))
    assert play.of("energy", 0)[2:] == pytest.approx([-0.01] * 4)
    play = Play(robots, [(0.205, 0.2, "A")], ["A"], energy=0.09, iterations=6, move_cost=0.03)
    assert play.life() == [GRIPPED, CARRIED, DROPPED, GRIPPED, DROPPED, DROPPED]
    assert play.of("held", 1) == [NONE] * 3 + [0] + [NONE] * 2


def test_one_that_waits_at_home_and_runs_out_of_energy():
    """It lets go in the iteration in which robot 1 grips: one holder, so nothing is delivered."""
    robots = [(0.5, 0.5, IDLE), (0.508, 0.482, IDLE)]
    play = Play(robots, [(0.5, 0.515, "A")], ["A"], energy=0.15, grip_cost=0.05, iterations=6)
    assert play.of("held", 0) == [0, 0] + [NONE] * 4
    assert play.of("waited", 0) == [0, 1] + [0] * 4
    assert play.of("held", 1) == [NONE, NONE, 0] + [NONE] * 3
    assert play.life() == [WAITING] * 3 + [DROPPED] * 3
    assert play.fitness == [0, 0]
    assert play.of("action", 1) == [3, 3, 4, 4, NONE, NONE]
    # With a little more energy, it would have been the second holder.
    play = Play(robots, [(0.5, 0.515, "A")], ["A"], energy=0.2, grip_cost=0.05, iterations=6)
    assert play.life() == [WAITING] * 2 + [DELIVERED] * 4
    # A robot that runs out of energy in the grip itself has not gripped.
    play = Play(robots, [(0.5, 0.515, "A")], ["A"], energy=0.05, grip_cost=0.05, iterations=3)
    assert play.life() == [LYING] * 3
