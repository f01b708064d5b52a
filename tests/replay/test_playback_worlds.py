"""Playbacks of each world: detections, captures and deliveries, described and counted correctly."""

import math
from collections import Counter

import numpy as np
import pytest

from conevo.numbers import enumerated
from conevo.replay.playback import playback_of
from conevo.replay.recording import record_epoch
from conevo.replay.trajectory import Trajectory
from conevo.worlds.gacc.plans import plan
from conevo.worlds.rollout import Rollout
from conevo.worlds.rover import rocks
from replay.epochs import TASKS, epoch
from replay.eventful import played
from replay.staging import changed, events_of, values
from worlds.gathering import IDLE, gathering

GACC, LIGHT = TASKS[3], TASKS[4]


# --- rover ----------------------------------------------------------------------------------------


def test_rover_detections():
    trajectory = played("rover")
    playback, t = playback_of(trajectory), trajectory.about["iterations"]
    detected, kind = values(trajectory, "detected"), values(trajectory, "scene/rock_type")
    worth = np.array(rocks.VALUES)[kind]
    found = np.flatnonzero(detected < t)
    assert len(found) > 20
    assert len({int(detected[k]) for k in found}) == len(playback.events)
    letters = Counter()
    for event in playback.events:
        text, _, by = event.text.partition(" by ")
        for word in text.split(", "):
            n, _, letter = word.rpartition(" ")
            letters[letter] += int(n or 1)
        assert by == enumerated("rover", event.robots)
        assert len(event.robots) >= 2
        paid = values(trajectory, "value")[event.t].round()
        before = values(trajectory, "value")[event.t - 1].round() if event.t else 0 * paid
        assert event.robots == tuple(i for i in range(len(paid)) if paid[i] > before[i])
    assert letters == Counter(rocks.TYPES[kind[k]] for k in found)
    value, area = playback.measures
    assert value.name == "value recorded by the lander"
    assert area.name == "share of area covered"
    covered = trajectory.about["performance"]["area"]
    assert area.values.values[-1] == pytest.approx(covered, abs=1e-5)
    assert (np.diff(area.values.values) >= 0).all()
    for s in range(t):
        assert value.values.values[s] == worth[detected < s].sum()
    assert value.values.values[-1] == trajectory.about["performance"]["value"]
    assert value.values.values[-1] + worth[detected == t - 1].sum() == worth[found].sum()
    (things,) = playback.things
    assert things.gone.values.tolist() == [min(int(d), t) for d in detected]
    names = [f"red rock {one}, worth {n}" for one, n in zip("ABCD", (1, 2, 3, 4), strict=True)]
    assert [one.name for one in things.kinds] == names
    assert things.kind.values.tolist() == kind.tolist()


def test_rocks_of_one_type_are_one_kind():
    trajectory = epoch("rover/simple-1", 20)
    (things,) = playback_of(trajectory).things
    assert [kind.name for kind in things.kinds] == ["red rock E, worth 1"]
    assert set(things.kind.values.tolist()) == {0}


def test_words_for_detections():
    trajectory = epoch(TASKS[0])
    never = np.full(2000, 2**31 - 1)
    of = {letter: np.flatnonzero(values(trajectory, "scene/rock_type") == n)
          for n, letter in enumerate("ABCD")}  # fmt: skip
    never[[of["C"][0], *of["A"][:2]]] = 60
    never[of["B"][:8]] = 70
    never[of["D"][0]] = 199
    value = np.zeros((200, 20))
    value[60:, [3, 7]] += 5
    value[70:, 1] += 8.0
    value[70:, [2, 9]] += 16
    playback = playback_of(changed(trajectory, detected=never, value=value))
    assert events_of(playback) == [
        (60, "A, A, C by rovers 3 and 7", (3, 7)),
        (70, "8 B by rovers 1, 2 and 9", (1, 2, 9)),
        (199, "D", ()),
    ]
    recorded = playback.measures[0].values.values
    assert recorded[[60, 61, 70, 71, 199]].tolist() == [0, 5, 5, 21, 21]


def test_rover_surroundings():
    trajectory = epoch(TASKS[0])
    playback = playback_of(trajectory)
    canals, lander = playback.backdrop
    assert np.array_equal(canals.cells.values, values(trajectory, "scene/canal"))
    x, y = values(trajectory, "scene/lander")
    assert lander.numbers[:2] == (x, y)
    things = playback.things[0]
    row, column = ((v.values * 200).astype(int) for v in (things.y, things.x))
    assert canals.cells.values[row, column].all()  # row 0 at the bottom, rocks in canals
    ranges, near = playback.rings
    assert (ranges.radius, ranges.when) == ((0.07, 0.05, 0.03, 0.0), "action")
    assert (near.radius, near.when) == ((0.02,) * 4, "selected")
    assert [group.reach for group in playback.sensor_groups] == [0.02, 0.07]
    assert playback.output_names == ("low", "med", "hi", "move: dx", "move: dy")


# --- predators and prey ---------------------------------------------------------------------------


@pytest.mark.parametrize("task", ["pursuit", "pursuit/team-7", "prey/shaping-3"])
def test_bodies_in_the_arena(task):
    trajectory = played(task) if task == "pursuit" else epoch(task)
    playback = playback_of(trajectory)
    n, r = int(values(trajectory, "scene/n_bodies")), trajectory.about["n_robots"]
    team, other = ("prey", "predator") if "prey/" in task else ("predator", "prey")
    assert [playback.body_kinds[k].name for k in playback.body] == [team] * r + [other] * (n - r)
    assert playback.x.codes.shape[1] == n
    walls, *obstacles = playback.backdrop
    assert walls.numbers == playback.bounds == (0, 0, 100, 100)
    count = int(values(trajectory, "scene/n_obstacles"))
    x, y = values(trajectory, "scene/obstacle_x"), values(trajectory, "scene/obstacle_y")
    assert [one.numbers for one in obstacles] == [(x[k], y[k], 2.75) for k in range(count)]
    at = np.stack([playback.x.values, playback.y.values], axis=-1)
    for one in obstacles:
        assert np.hypot(*(at - one.numbers[:2]).T).min() > 2 * 2.75 - 0.01
    assert playback.seconds == 0.1
    kinds = ("infrared",) if team == "prey" else ("infrared", "light")
    assert tuple(group.name for group in playback.sensor_groups) == kinds
    assert playback.rings[0].radius == (2.75 + 22,) * 5


def test_captures():
    trajectory = played("pursuit", 9)
    playback = playback_of(trajectory)
    captured = values(trajectory, "captured")[:, 0]
    performance = trajectory.about["performance"]
    begins, ends = events_of(playback, "capture begins"), events_of(playback, "capture ends")
    assert len(begins) == performance["captures"] > 1
    assert begins[0][0] == performance["first_capture"]
    assert len(begins) - len(ends) == captured[-1]
    (measure,) = playback.measures
    assert measure.values.values[-1] == performance["capture_time"] == captured.sum()
    assert measure.values.values.tolist() == np.cumsum(captured).tolist()
    at = np.stack([values(trajectory, "x"), values(trajectory, "y")], axis=-1)
    for t, text, robots in begins:
        assert captured[t] == 1
        assert not (t and captured[t - 1])
        gaps = [math.dist(at[t, i], at[t, 5]) - 5.5 for i in range(5)]
        assert robots == tuple(i for i in range(5) if gaps[i] <= 22.01)
        assert len(robots) >= 2
        assert text == f"the prey is captured by {enumerated('predator', robots)}"
    (halo,) = playback.things
    assert halo.state.values[:, 0].tolist() == captured.tolist()
    assert np.array_equal(halo.x.values[:, 0], playback.x.values[:, 5])
    assert np.array_equal(halo.y.values[:, 0], playback.y.values[:, 5])


def test_words_for_captures_and_collisions():
    trajectory = epoch("pursuit/team-7")  # three predators, two prey
    x, y = (values(trajectory, name).copy() for name in "xy")
    captured, collided = np.zeros((200, 2), int), np.zeros((200, 5), int)
    x[:, :], y[:, :] = [10, 30, 60, 20, 80], 50  # predator 2 is 27.5 - 7.5 from prey 1
    captured[3:6, 0] = captured[9:, 1] = 1
    collided[0:4, 1] = collided[7, 1] = collided[8, 2] = collided[5:, 4] = 1
    playback = playback_of(changed(trajectory, x=x, y=y, captured=captured, collided=collided))
    assert events_of(playback) == [
        (0, "predator 1 collides", (1,)),
        (3, "prey 0 is captured by predators 0 and 1", (0, 1)),
        (6, "prey 0 is free again after 3 iterations (0.3 s)", ()),
        (7, "predator 1 collides", (1,)),
        (8, "predator 2 collides", (2,)),
        (9, "prey 1 is captured by predator 2", (2,)),
    ]
    assert playback.measures[0].values.values[[2, 5, 8, 199]].tolist() == [0, 3, 3, 194]


@pytest.mark.parametrize(("gap", "is_near"), [(21.9, True), (22.0, True), (22.1, False)])
def test_in_light_range_is_from_rim_to_rim(gap, is_near):
    trajectory = epoch("pursuit/team-7")
    x, y = (np.zeros((200, 5)) for _ in "xy")
    x[:, :] = [10, 70, 72, 10 + 5.5 + gap, 90]
    y[:, :] = 50
    y[:, 3] = 50
    captured = np.zeros((200, 2), int)
    captured[20, 0] = 1
    x[:, 1:3] = 10 + 5.5 + gap + 12
    y[:, 2] = 60
    playback = playback_of(changed(trajectory, x=x, y=y, captured=captured))
    (begin,) = events_of(playback, "capture begins")
    assert begin[2] == ((0, 1, 2) if is_near else (1, 2))


def test_a_capture_that_lasts_one_iteration():
    captured = np.zeros((200, 2), int)
    captured[0, 1] = 1
    playback = playback_of(changed(epoch("pursuit/team-7"), captured=captured))
    ends = [(1, "prey 1 is free again after 1 iteration (0.1 s)", ())]
    assert events_of(playback, "capture ends") == ends


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_the_path_and_the_end_of_prey(seed):
    trajectory = epoch("prey/shaping-6", 200, seed)
    playback, r = playback_of(trajectory), trajectory.about["n_robots"]
    (path,) = playback.measures
    performance = trajectory.about["performance"]
    assert path.values.values[-1] == pytest.approx(performance["path"], abs=0.05)
    assert len(playback.events) == round(performance["collided"] * r)
    for event in playback.events:
        (i,) = event.robots
        action = values(trajectory, "action")[:, i]
        assert (action[: event.t + 1] >= 0).all()
        assert (action[event.t + 1 :] == -1).all()
        assert event.text == f"prey {i} collides: its epoch ends"


# --- gathering ------------------------------------------------------------------------------------


class Scene:
    """A world with a single scenario, made by hand."""

    def __init__(self, world, scenarios):
        self._world, self._scenarios = world, scenarios

    def __getattr__(self, name):
        return getattr(self._world, name)

    def scenarios(self, keys):
        return self._scenarios


def staged(*args, **how):
    """The playback of a gathering epoch made by hand."""
    a_world, (genes, slots, scenarios, heuristic), _ = gathering(*args, **how)
    rollout = Rollout(Scene(a_world, scenarios), n_threads=1)
    about, channels = record_epoch(rollout, genes, slots, 7, heuristic)
    return playback_of(Trajectory(about, channels))


EAST = (0.0055, 0.0)


def test_carried_home_and_built_in():
    """Robot 0 grips an object outside and carries it home; robot 1 comes and helps."""
    playback = staged(
        [(0.385, 0.5, ["grip A", EAST]), (0.425, 0.5, IDLE)],
        [(0.39, 0.5, "A")],
        ["AB"],
        iterations=7,
    )
    assert events_of(playback) == [
        (0, "robot 0 grips A", (0,)),
        (3, "robot 0 is home with A and waits for help", (0,)),
        (5, "A is part 1 of complex object 1, by robots 0 and 1", (0, 1)),
    ]
    assert playback.measures[0].values.values.tolist() == [0] * 5 + [1] * 2
    (row,) = playback.plan
    assert row.parts == (0, 1, *[2] * 8)
    assert row.built == (5, *[7] * 9)
    assert row.is_ordered


AROUND = [(0.5 + 0.01 * math.cos(a), 0.5 + 0.01 * math.sin(a), IDLE) for a in range(6)]


def test_waiting_without_help():
    playback = staged(AROUND[:3], [(0.5, 0.5, "C")], ["C"], iterations=8)
    assert events_of(playback) == [
        (0, "robots 0, 1 and 2 grip C in the home area", (0, 1, 2)),
        *((5, f"robot {i} lets go of C after waiting for 5 iterations", (i,)) for i in range(3)),
    ]
    assert set(playback.things[0].state.values.ravel()) == {0, 4, 6}


def test_help_comes_one_after_the_other():
    """Robot 1 is three iterations away; robot 0 gives up before any other robot comes."""
    robots = [(0.5, 0.5, IDLE), (0.508, 0.47, IDLE)]
    playback = staged(robots, [(0.5, 0.515, "B")], ["B"], iterations=14)
    assert events_of(playback) == [
        (0, "robot 0 grips B in the home area", (0,)),
        (3, "robot 1 helps robot 0 with B", (1,)),
        (5, "robot 0 lets go of B after waiting for 5 iterations", (0,)),
        (8, "robot 1 lets go of B after waiting for 5 iterations", (1,)),
    ]
    assert [one.name for one in playback.event_kinds][:4] == [
        "grip",
        "let go",
        "wait for help",
        "help",
    ]


def test_an_object_that_is_not_needed_is_let_go():
    robots = [(0.5, 0.5, IDLE), (0.508, 0.47, IDLE)]
    playback = staged(robots, [(0.5, 0.515, "A")], ["BA"], iterations=5)
    assert events_of(playback) == [
        (0, "robot 0 grips A in the home area", (0,)),
        (3, "robot 0 lets go of A, which is not needed now", (0,)),
    ]


def test_a_grip_outside_with_another_setting_lets_go_without_a_reason():
    robots = [(0.2, 0.2, ["grip B", EAST, "grip C"]), (0.8, 0.2, IDLE)]
    playback = staged(robots, [(0.205, 0.2, "B")], ["B"], iterations=4)
    assert events_of(playback) == [(0, "robot 0 grips B", (0,)), (2, "robot 0 lets go of B", (0,))]
    assert (playback.held.values[:, 0] >= 0).tolist() == [True, True, False, False]


def test_objects_built_in_at_once_have_their_own_builders():
    """Both pairs grip an A in the first iteration; all four robots are rewarded."""
    robots = [(0.45, 0.49, IDLE), (0.55, 0.49, IDLE), (0.45, 0.51, IDLE), (0.55, 0.51, IDLE)]
    playback = staged(robots, [(0.45, 0.5, "A"), (0.55, 0.5, "A")], ["AA"], iterations=3)
    assert events_of(playback) == [
        (0, "A is part 1 of complex object 1, by robots 0 and 2", (0, 2)),
        (0, "A is part 2 of complex object 1, by robots 1 and 3", (1, 3)),
    ]


def test_objects_of_two_types_built_in_at_once():
    robots = [(0.45, 0.49, IDLE), (0.45, 0.51, IDLE)]
    robots += [(0.55, 0.49, IDLE), (0.55, 0.51, IDLE), (0.56, 0.5, IDLE)]
    playback = staged(robots, [(0.45, 0.5, "A"), (0.55, 0.5, "B")], ["AB"], iterations=3)
    assert events_of(playback) == [
        (0, "A is part 1 of complex object 1, by robots 0 and 1", (0, 1)),
        (0, "B is part 2 of complex object 1, by robots 2, 3 and 4", (2, 3, 4)),
    ]


def test_the_last_part_completes():
    robots = [(0.499, 0.5, IDLE), (0.501, 0.5, IDLE)]
    objects = [(0.5, 0.5015 + 0.0015 * k, "A") for k in range(10)]
    playback = staged(robots, objects, ["A" * 10], iterations=12)
    assert playback.plan[0].built == tuple(range(10))
    assert events_of(playback, "completion") == [(9, "complex object 1 is complete", (0, 1))]
    demand = playback.gauges[0]
    assert (demand.name, demand.most) == ("demand A", 1.0)
    assert demand.values.values[1] == pytest.approx(1 / 8, abs=1e-4)


def test_without_an_order_parts_are_shown_as_delivered():
    robots = [(0.5, 0.49, IDLE), (0.5, 0.51, IDLE)]
    two = [(0.505, 0.5, "A"), (0.515, 0.5, "A")]
    playback = staged(robots, two, ["CABAB"], ordered="d", iterations=4)
    (row,) = playback.plan
    assert not row.is_ordered
    assert row.parts == (0, 0, 1, 1, *[2] * 6)  # the rest in the order of types
    assert row.built == (0, 1, *[4] * 8)


@pytest.mark.parametrize("seed", range(2, 6))
def test_gathering_adds_up(seed):
    trajectory = played("gacc", seed, 400)
    playback = playback_of(trajectory)
    performance = trajectory.about["performance"]
    t = trajectory.about["iterations"]
    (measure,) = playback.measures
    assert measure.values.values[-1] == performance["delivered"]
    built = [when for row in playback.plan for when in row.built if when < t]
    assert len(built) == performance["delivered"]
    assert sorted(built) == [when for when, _, _ in events_of(playback, "delivery")]
    assert len(events_of(playback, "completion")) == performance["completed"]
    kinds = [kind for row in playback.plan for kind in row.parts]
    assert sorted(kinds) == sorted(plan("complex-5").parts.ravel())
    paid = Counter(i for _, _, robots in events_of(playback, "delivery") for i in robots)
    fitness = trajectory.about["fitness"]
    assert [paid[i] for i in range(len(fitness))] == fitness
    things = playback.things[0]
    assert np.array_equal(things.state.values, values(trajectory, "life"))
    assert np.array_equal(things.x.values, values(trajectory, "object_x"))
    assert things.kind.values.tolist() == values(trajectory, "scene/object_type").tolist()
    assert values(trajectory, "demand").max() <= 1.0
    assert [gauge.most for gauge in playback.gauges] == [1.0] * 3


def test_every_grip_and_release_is_an_event():
    trajectory = played("gacc", 3, 400)
    playback, held = playback_of(trajectory), values(trajectory, "held")
    before = np.vstack([np.full_like(held[:1], -1), held[:-1]])
    grips = {(t, i) for t, i in np.argwhere((held >= 0) & (held != before)).tolist()}
    shown_grips = {
        (t, i)
        for kind in ("grip", "help")
        for t, _, robots in events_of(playback, kind)
        for i in robots
    }
    assert shown_grips == grips
    gone = {(t, i) for t, i in np.argwhere((before >= 0) & (held != before)).tolist()}
    built = {(t, i) for t, _, robots in events_of(playback, "delivery") for i in robots}
    assert {
        (t, i) for t, _, robots in events_of(playback, "let go") for i in robots
    } == gone - built


def test_gathering_surroundings():
    trajectory = epoch(GACC)
    playback = playback_of(trajectory)
    home, zone, *obstacles = playback.backdrop
    assert home.numbers == pytest.approx((0.15, 0.15, 0.85, 0.85))
    assert zone.numbers == pytest.approx((0.47, 0.47, 0.53, 0.53))
    sides = [values(trajectory, f"scene/{name}") for name in ("left", "bottom", "right", "top")]
    assert [one.numbers for one in obstacles] == [
        tuple(side[k] for side in sides) for k in range(10)
    ]
    see, grip, near = playback.rings
    assert see.radius == (0.05,) * 3 + (0.0,) * 4
    assert grip.radius == (0.0,) * 4 + (0.05,) * 3
    assert near.radius == (0.05,) * 7
    assert [group.reach for group in playback.sensor_groups] == [0.05, 0.05, 0.12, 0.0]
    assert playback.sensor_groups[3].names == ("A", "B", "C")
    assert playback.sensor_groups[3].angles == ()
    assert len(playback.output_names) == 8
    assert playback.output_names[5] == "grip A"


def test_home_is_sensed_in_its_direction():
    playback = playback_of(epoch(GACC))
    group = playback.sensor_groups[2]
    at = np.stack([playback.x.values, playback.y.values], axis=-1)[:-1]
    k = playback.sensors.values[1:, :, group.first : group.first + 8].argmax(axis=2)
    way = 0.5 - at
    off = np.arctan2(way[..., 1], way[..., 0]) - np.array(group.angles)[k]
    assert (np.abs(np.angle(np.exp(1j * off))) <= group.half + 1e-3).all()
