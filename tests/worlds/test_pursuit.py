"""The pursuit worlds in situations built by hand: capture, motion, sight, heuristics, flight."""

import math
from dataclasses import replace

import numpy as np
import pytest

from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from worlds.situations import (
    AHEAD,
    FAR,
    FORWARD,
    IDLE,
    LEFT,
    NAN,
    NONE,
    PI,
    REVERSE,
    RIGHT,
    STOP,
    T,
    around,
    hunt,
    placed,
    shaping,
    situation,
    split,
)

# --- capture ------------------------------------------------------------------------------------


@pytest.mark.parametrize("towards", [0, 60, 120, 180, 240, 300])
def test_a_prey_in_a_triangle_of_predators_is_captured(towards):
    """It drives at one of them, or between two, through a gap that is too narrow."""
    robots = around(50, 50, 5.6, [0, 120, -120])
    result, seen = situation(robots, [(50, 50, math.radians(towards), AHEAD)])
    assert split(result) == (hunt(T - 9, 9, 1, 0), [T - 9] * 3)
    assert seen["captured"][:, 0].tolist() == [0] * 9 + [1] * (T - 9)
    assert (seen["fitness"] == np.cumsum(seen["captured"])[:, None]).all()
    # With one predator less a gap is open.
    result, seen = situation([*robots[:2], (*FAR, IDLE)], [(50, 50, -PI / 3 - PI / 3, AHEAD)])
    assert not seen["collided"][:9].any()


def test_predators_that_press_a_prey_collide_in_every_iteration():
    robots = around(50, 50, 5.6, [0, 120, -120], AHEAD)
    result, seen = situation(robots, [(50, 50, 0, IDLE)])
    assert split(result) == (hunt(T - 9, 9, 1, 3 * T), [T - 9] * 3)
    assert seen["collided"].tolist() == [[1, 1, 1, 0]] * T
    # Heuristic predators do the same.
    pressing, _ = situation(
        [(*r[:3], IDLE) for r in robots], [(50, 50, 0, IDLE)], heuristic=[0, 0, 0]
    )
    assert pressing == result


CORNER = (2.8, 2.8, -3 * PI / 4, AHEAD)


@pytest.mark.parametrize(
    ("second", "captured"),
    [
        (FAR, False),  # one predator is not enough
        ((2.8 + 5.5 + 22.1, 2.8, 0.0), False),  # just out of light range
        ((2.8 + 5.5 + 21.9, 2.8, 0.0), True),  # just within it, facing away
    ],
)
def test_a_prey_in_a_corner_needs_two_predators(second, captured):
    result, seen = situation([(2.8, 12.0, 0.0, IDLE), (*second, IDLE)], [CORNER])
    assert seen["collided"][:, 2].all()  # the prey presses into the corner
    expected = hunt(T - 9, 9, 1, 0) if captured else hunt(0, T, 0, 0)
    assert split(result) == (expected, [expected["capture_time"]] * 2)


@pytest.mark.parametrize("near", [0, 1, 2, 3])
def test_a_prey_that_stops_by_itself_is_captured_with_two_near(near):
    places = [(50, 70), (50, 30), (30, 50)]
    robots = [(*places[k], 0, IDLE) if k < near else (5 + 10 * k, 95, 0, IDLE) for k in range(3)]
    result, _ = situation(robots, [(50, 50, 0, IDLE)])
    assert result["capture_time"] == (T - 9 if near >= 2 else 0)
    assert result["captures"] == (near >= 2)


@pytest.mark.parametrize(
    ("towards", "wall"), [(0, True), (PI, True), (-PI / 2, True), (PI / 2, False)]
)
def test_a_prey_between_a_wall_and_two_predators(towards, wall):
    """The wall is below; with one predator on either side it can only move up."""
    robots = [(55.6, 2.8, 0, IDLE), (44.4, 2.8, 0, IDLE)]
    result, seen = situation(robots, [(50, 2.8, towards, AHEAD)])
    assert split(result)[0] == (hunt(T - 9, 9, 1, 0) if wall else hunt(0, T, 0, 0))
    assert seen["collided"][0, 2] == wall


@pytest.mark.parametrize(("way", "captured"), [(0.019, True), (0.021, False), (-0.021, False)])
def test_a_slow_prey_is_immobilized_below_two_millimetres_in_ten_iterations(way, captured):
    robots = [(50, 70, 0, IDLE), (50, 30, 0, IDLE)]
    result, seen = situation(robots, [(50, 50, 0, (way / 0.96, way / 0.96))])
    assert seen["x"][-1, 2] - 50 == pytest.approx(T * way, rel=1e-3)
    assert result["capture_time"] == (T - 9 if captured else 0)


def test_a_prey_in_a_tight_circle_is_not_immobilized_and_one_that_spins_is():
    robots = [(50, 70, 0, IDLE), (50, 30, 0, IDLE)]
    assert situation(robots, [(50, 50, 0, (0.2, 1.0))])[0]["capture_time"] == 0
    assert situation(robots, [(50, 50, 0, (-1.0, 1.0))])[0]["capture_time"] == T - 9


def test_the_window_counts_moves_and_refusals():
    """Three free moves, then an obstacle: less than a tenth once none is in the window."""
    robots = [(50, 70, 0, IDLE), (50, 30, 0, IDLE)]
    result, seen = situation(
        robots, [(50, 50, 0, AHEAD)], obstacles=[(50 + 3 * 0.96 + 5.6, 50)], n_obstacles=1
    )
    assert seen["collided"][:, 2].tolist() == [0] * 3 + [1] * (T - 3)
    assert 11 <= result["first_capture"] <= 12  # one of ten is a tenth, not less: rounding decides
    wide, _ = situation(
        robots,
        [(50, 50, 0, AHEAD)],
        obstacles=[(50 + 3 * 0.96 + 5.6, 50)],
        n_obstacles=1,
        capture_share=0.25,
    )
    assert wide["first_capture"] == 10  # two of ten


def test_a_prey_can_be_captured_again():
    """One predator is near, another passes by; a third does so later, and slowly."""
    robots = [(50, 70, 0, IDLE), (20, 42, 0, AHEAD), (3, 58, 0, (0.25, 0.25))]
    result, seen = situation(robots, [(50, 50, 0, IDLE)], iterations=170)
    gaps = np.hypot(seen["x"][:, :3] - 50, seen["y"][:, :3] - 50) - 5.5
    captured = (gaps <= 22).sum(axis=1) >= 2
    captured[:9] = False
    assert np.abs(np.diff(captured.astype(int))).tolist().count(1) == 3  # on, off, on
    assert (seen["captured"][:, 0] == captured).all()
    blocked = int(seen["collided"][:, :3].sum())
    assert blocked > 60  # the second predator ends at the wall
    expected = hunt(captured.sum(), captured.argmax(), 2, blocked)
    assert split(result) == (expected, [captured.sum()] * 3)


def test_two_prey_captured_at_once_count_once_in_time_and_twice_as_captures():
    robots = [(50, 70, 0, IDLE), (50, 30, 0, IDLE)]
    result, seen = situation(robots, [(42, 50, 0, IDLE), (58, 50, 0, IDLE)])
    assert split(result) == (hunt(T - 9, 9, 2, 0), [T - 9] * 2)
    assert seen["captured"].tolist() == [[0, 0]] * 9 + [[1, 1]] * (T - 9)
    result, seen = situation(robots, [(42, 50, 0, IDLE), (58, 50, 0, AHEAD)])
    assert split(result) == (hunt(T - 9, 9, 1, 0), [T - 9] * 2)


def test_the_number_of_predators_needed_and_the_range_are_parameters():
    robots, prey = [(50, 70, 0, IDLE), (50, 30, 0, IDLE)], [(50, 50, 0, IDLE)]
    far = [*robots, (10, 10, 0, IDLE)]
    assert situation(far, prey)[0]["capture_time"] == T - 9
    assert situation(far, prey, capture_predators=3)[0]["capture_time"] == 0
    assert situation(robots, prey, sensor_range_cm=14.4)[0]["capture_time"] == 0
    assert situation(robots, prey, sensor_range_cm=14.6)[0]["capture_time"] == T - 9
    assert situation(robots, prey, capture_window=20)[0]["first_capture"] == 19


# --- motion -------------------------------------------------------------------------------------


def test_a_prey_is_a_fifth_faster():
    _, seen = situation(
        [(10, 30, 0, AHEAD), (10, 20, 0, AHEAD)], [(10, 70, 0, AHEAD)], iterations=50
    )
    way = seen["x"][-1] - 10
    assert way[0] == pytest.approx(50 * 0.8, rel=1e-5)
    assert way[2] / way[0] == pytest.approx(1.2, rel=1e-5)


def test_a_robot_drives_on_a_circle():
    """Wheels 1/2 and 1 on an axle of 5.3: a circle of radius 5.3/2 x 1.5/0.5 to the left."""
    _, seen = situation([(50, 50, 0, (0.5, 1.0)), (*FAR, IDLE)], [(10, 10, 0, IDLE)])
    assert np.allclose(np.hypot(seen["x"][:, 0] - 50, seen["y"][:, 0] - 57.95), 7.95, atol=1e-3)
    turned = np.arange(1, T + 1) * 0.4 / 5.3
    assert np.allclose(seen["x"][:, 0], 50 + 7.95 * np.sin(turned), atol=1e-3)
    assert np.allclose(np.cos(seen["heading"][:, 0] - turned), 1, atol=1e-6)
    assert (seen["action"][:, 0] == FORWARD).all()


def test_wheels_name_the_primitive():
    pairs = {(0.05, -0.05): STOP, (0.5, 0.5): FORWARD, (-0.2, 0.5): LEFT, (0.5, -0.2): RIGHT,
             (-0.5, -0.3): REVERSE, (0.0, 0.4): FORWARD}  # fmt: skip
    for k, (wheels, action) in enumerate(pairs.items()):
        _, seen = situation([(50, 50, k, wheels), (*FAR, IDLE)], [(10, 10, 0, IDLE)], iterations=3)
        if wheels == (0.0, 0.4):  # at the boundary: |w| is not above |f| up to rounding
            assert set(seen["action"][:, 0].tolist()) <= {FORWARD, LEFT}
        else:
            assert (seen["action"][:, 0] == action).all()
        assert np.allclose([seen["left"][0, 0], seen["right"][0, 0]], wheels, atol=1e-5)


@pytest.mark.parametrize("towards", [0.0, PI / 2, -PI, -PI / 2])
def test_a_wall_refuses_the_whole_move(towards):
    """Driving in a curve into a wall 2 cm ahead: the last free pose is kept, heading included."""
    x, y = 50 + 45.25 * math.cos(towards), 50 + 45.25 * math.sin(towards)
    _, seen = situation([(x, y, towards, (0.9, 1.0)), (50, 50, 0, IDLE)], [(50, 30, 0, IDLE)])
    pose = np.stack([seen["x"][:, 0], seen["y"][:, 0], seen["heading"][:, 0]], axis=1)
    assert seen["collided"][:, 0].tolist() == [0, 0] + [1] * (T - 2)
    assert (pose[2:] == pose[1]).all()
    assert 0 <= 2 - np.hypot(*(pose[1, :2] - [x, y])) < 0.8
    assert not seen["collided"][:, 1:].any()


@pytest.mark.parametrize("kind", ["obstacle", "robot", "prey"])
def test_bodies_and_obstacles_refuse_the_whole_move(kind):
    block = (50 + 5.5 + 1.0, 50)
    robots = [(50, 50, 0, (0.9, 1.0)), ((*block, 0) if kind == "robot" else FAR) + (IDLE,)]
    prey = [((*block, 0) if kind == "prey" else (10.0, 10.0, 0.0)) + (IDLE,)]
    obstacles = [block] if kind == "obstacle" else []
    result, seen = situation(robots, prey, obstacles=obstacles, n_obstacles=len(obstacles))
    pose = np.stack([seen["x"][:, 0], seen["y"][:, 0], seen["heading"][:, 0]], axis=1)
    assert seen["collided"][:, 0].tolist() == [0] + [1] * (T - 1)
    assert (pose == pose[0]).all()
    assert not seen["collided"][:, 1:].any()
    assert result["collisions"] == T - 1


def test_a_robots_last_place_is_taken_even_if_it_leaves():
    _, seen = situation([(50, 50, 0, AHEAD), (55.6, 50, 0, AHEAD)], [(10, 10, 0, IDLE)])
    assert seen["collided"][:4, :2].tolist() == [[1, 0], [0, 0], [0, 0], [0, 0]]
    # Turning on the spot never obstructs other robots.
    _, seen = situation([(50, 50, 0, (-1, 1)), (55.51, 50, 0, (1, -1))], [(10, 10, 0, IDLE)])
    assert not seen["collided"].any()


def test_two_bodies_that_want_one_place_are_both_refused():
    """Head-on with 1 cm between the rims: either alone could drive 0.8, together neither."""
    front, back = (50, 50, 0), (56.5, 50, PI)
    _, seen = situation([(*front, AHEAD), (*back, AHEAD)], [(10, 10, 0, IDLE)])
    assert seen["collided"].tolist() == [[1, 1, 0]] * T
    assert (seen["x"][:, 0] == 50).all()
    assert (seen["x"][:, 1] == np.float32(56.5)).all()
    for wheels, moved in (((AHEAD, IDLE), (0.8, 0)), ((IDLE, AHEAD), (0, -0.8))):
        robots = [(*front, wheels[0]), (*back, wheels[1])]
        _, seen = situation(robots, [(10, 10, 0, IDLE)], iterations=2)
        assert np.allclose(seen["x"][0, :2] - [50, 56.5], moved, atol=1e-5)
    # A predator and a prey: both are refused, the predator's refusal is the team's collision.
    result, seen = situation([(*front, AHEAD), (*FAR, IDLE)], [(*back, AHEAD)])
    assert seen["collided"].tolist() == [[1, 0, 1]] * T
    assert result["collisions"] == T


def test_three_in_a_row_and_one_that_is_refused_anyway():
    # 0 and 1 collide ahead, 1 and 2 too, 0 and 2 do not: none of them moves.
    robots = [(43.6, 50, 0, AHEAD), (50, 55.0, -PI / 2, AHEAD), (56.4, 50, PI, AHEAD)]
    _, seen = situation(robots, [(10, 10, 0, IDLE)], iterations=9)
    first = int(seen["collided"][:, :3].any(axis=1).argmax())
    assert seen["collided"][first, :3].all()
    # A body that is refused by an obstacle reserves no place: the other one drives on.
    robots = [(50, 50, 0, AHEAD), (56.5, 50, PI, AHEAD)]
    _, seen = situation(
        robots, [(10, 10, 0, IDLE)], obstacles=[(55.7, 55.49)], n_obstacles=1, iterations=2
    )
    assert seen["collided"][0].tolist() == [0, 1, 0]
    assert seen["x"][0, 0] == pytest.approx(50.8)


# --- seeing -------------------------------------------------------------------------------------


def test_infrared_senses_everything_and_light_only_prey_even_behind_others():
    robots = [(50, 50, 0, IDLE), (60, 50, 0, IDLE), (50, 65, 0, IDLE)]
    _, seen = situation(robots, [(70, 50, 0, IDLE)], iterations=2)
    infrared, light = seen["inputs"][0, 0, :8], seen["inputs"][0, 0, 8:16]
    sx, sy = 2.75 * math.cos(math.radians(13)), 2.75 * math.sin(math.radians(13))
    assert infrared[[0, 7]] == pytest.approx([1 - (math.hypot(10 - sx, sy) - 2.75) / 22] * 2)
    assert light[[0, 7]] == pytest.approx([1 - (math.hypot(20 - sx, sy) - 2.75) / 22] * 2)
    assert infrared[2] > 0.4
    assert not light[2:6].any()
    assert not infrared[3:6].any()


def test_a_held_sensor_moves_the_robot_and_the_others_stay_free():
    """A robot that is controlled by its first sensor alone, in an empty arena."""
    a_world = world("pursuit/team-1", iterations=5, prey="heuristic")
    rollout = Rollout(a_world)
    genes = np.zeros((1, rollout.genome.n_genes), np.float32)
    genes[0, 0], genes[0, -2:] = 0.5, 0.1
    slots = np.full((2, rollout.genome.max_parts), -1, np.int32)
    slots[:, 0] = 0
    scenarios = placed(a_world, [(50, 50, 0), (50, 20, 0), (10, 90, 0)], ())
    clamp = np.full((2, 16), NAN, np.float32)
    clamp[0, 0], clamp[1, 3] = 0.6, 0.3
    free = rollout.record(genes, slots, scenarios)
    held = rollout.record(genes, slots, replace(scenarios, clamp=clamp))

    def command(sensor):
        return math.tanh(0.5 / (1 + math.exp(-5 * sensor)))

    assert free["left"][0, :2] == pytest.approx([command(0.0)] * 2, abs=1e-5)
    assert held["left"][0, :2] == pytest.approx([command(0.6), command(0.0)], abs=1e-5)
    assert (held["inputs"][:, 0, 0] == np.float32(0.6)).all()
    assert (held["inputs"][:, 1, 3] == np.float32(0.3)).all()
    others = np.ones((2, 16), bool)
    others[0, 0] = others[1, 3] = False
    assert np.array_equal(free["inputs"][0][others], held["inputs"][0][others])


# --- the heuristic predator ---------------------------------------------------------------------


def test_heuristic_predators_go_to_the_last_known_place_of_the_prey():
    """The prey leaves while its pursuer still turns; the pursuer drives to its last known place."""
    _, seen = situation(
        [(20, 50, PI, IDLE), (95, 5, 0, IDLE)],
        [(42, 50, PI / 4, AHEAD)],
        heuristic=[0, -1],
        iterations=90,
    )
    x, y, heading = (seen[name][:, 0] for name in ("x", "y", "heading"))
    lost = int((np.hypot(x - seen["x"][:, 2], y - seen["y"][:, 2]) > 27.5).argmax())
    assert 0 < lost < 15
    place = seen["x"][lost - 1, 2], seen["y"][lost - 1, 2]
    assert seen["left"][:8, 0] == pytest.approx(-seen["right"][:8, 0])  # on the spot
    on_the_way = slice(15, 35)
    bearing = np.arctan2(place[1] - y[on_the_way], place[0] - x[on_the_way])
    assert np.abs(bearing - heading[on_the_way]).max() < 0.01
    gap = np.hypot(x - place[0], y - place[1])
    assert gap.min() < 5.5
    assert gap[-1] > 11  # it is not there: forgotten


def test_heuristic_predators_catch_an_idle_prey_and_walk_without_one():
    robots = [(35, 50, 2.0, IDLE), (65, 50, 2.0, IDLE), (50, 70, 2.0, IDLE)]
    result, seen = situation(robots, [(50, 50, 0, IDLE)], heuristic=0, iterations=100)
    assert result["capture_time"] == 91
    assert (np.hypot(seen["x"][-1, :3] - 50, seen["y"][-1, :3] - 50) < 6.4).all()
    _, seen = situation([(50, 80, 0, IDLE)] * 1 + [(80, 50, 1, IDLE)], [(10, 10, 0, IDLE)],
                        heuristic=0, iterations=400)  # fmt: skip
    way = np.hypot(np.diff(seen["x"][:, :2], axis=0), np.diff(seen["y"][:, :2], axis=0))
    assert (way.sum(axis=0) > 150).all()
    assert len(set(np.round(seen["heading"][:, 0], 2))) > 15  # it turns occasionally


# --- the prey world -----------------------------------------------------------------------------


def test_fitness_of_a_flight_is_its_length_and_straightness():
    result, _ = shaping([(20, 50, 0, AHEAD)])
    assert result["path"] == pytest.approx(T * 0.96, rel=1e-5)
    assert result["collided"] == 0
    result, _ = shaping([(50, 50, 0, (0.5, 1.0))])
    assert result["path"] == pytest.approx(T * 0.72 * (1 - math.sqrt(0.25)), rel=1e-4)
    result, _ = shaping([(50, 50, 0, (-0.5, -0.5))])  # backward counts like forward
    assert result["path"] == pytest.approx(T * 0.48, rel=1e-4)
    assert shaping([(50, 50, 0, (-1, 1))])[0]["path"] == 0


@pytest.mark.parametrize("what", ["wall", "obstacle", "predator"])
def test_a_collision_ends_a_flight_with_zero_and_leaves_the_body(what):
    x = 90 if what == "wall" else 50
    result, seen = shaping(
        [(x, 50, 0, AHEAD), (20, 20, 0, AHEAD)],
        predators=[(62, 50, PI, IDLE)] if what == "predator" else [],
        obstacles=[(62, 50)] if what == "obstacle" else [],
    )
    at = int(seen["collided"][:, 0].argmax())
    assert seen["collided"][at, 0] == 1
    assert seen["fitness"][at - 1, 0] == pytest.approx(at * 0.96, rel=1e-5)
    assert not seen["fitness"][at:, 0].any()
    assert seen["action"][:, 0].tolist() == [FORWARD] * (at + 1) + [NONE] * (T - at - 1)
    assert not seen["left"][at + 1 :, 0].any()
    assert not seen["right"][at + 1 :, 0].any()
    assert len({*seen["x"][at:, 0].tolist()}) == 1
    assert result["fitness"] == pytest.approx([0, T * 0.96], rel=1e-5)
    assert result["path"] == pytest.approx(T * 0.96 / 2, rel=1e-5)
    assert result["collided"] == 0.5


def test_a_predator_that_runs_into_a_prey_is_not_a_collision_of_the_prey():
    result, seen = shaping([(50, 50, 0, (0.02, 0.02))], predators=[(50, 60, 0, IDLE)])
    assert seen["collided"][-10:, 1].all()
    assert not seen["collided"][:, 0].any()
    assert result["collided"] == 0
    assert result["path"] > 0
