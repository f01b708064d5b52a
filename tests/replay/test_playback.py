"""Playbacks show the events of an epoch as they happened, in all worlds."""

import dataclasses
import json
import math
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from conevo import palette
from conevo.errors import UsageError
from conevo.kernels import khepera
from conevo.numbers import enumerated, number
from conevo.playback.check import checked
from conevo.playback.schema import Kind, Pool
from conevo.replay.playback import playback_of
from conevo.worlds.gacc import drawn as gacc
from conevo.worlds.gacc import drawn_building as building
from conevo.worlds.pursuit import drawn as pursuit
from conevo.worlds.rover import drawn as rover
from oracles.gacc_scene import octant
from replay.epochs import TASKS, epoch, renamed
from replay.eventful import played
from replay.staging import changed, values

GACC, LIGHT = TASKS[3], TASKS[4]


# --- all worlds -----------------------------------------------------------------------------------


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("is_heuristic", [False, True])
def test_a_playback_shows_the_record(task, is_heuristic):
    trajectory = epoch(task, is_heuristic=is_heuristic)
    about, playback = trajectory.about, playback_of(trajectory)
    t, r = about["iterations"], about["n_robots"]
    for name in ("x", "y", "action", "heading", "energy", "held"):
        shown = getattr(playback, name)
        if name in trajectory.channels:
            n = shown.codes.shape[1]
            assert np.array_equal(shown.values, values(trajectory, name)[:, :n]), name
        else:
            assert shown is None
    assert np.array_equal(playback.sensors.values, values(trajectory, "sensors"))
    for name in ("hidden", "outputs"):
        if all(about["heuristic"]):
            assert getattr(playback, name) is None
        else:
            assert np.array_equal(getattr(playback, name).values, values(trajectory, name))
    assert [kind.name for kind in playback.actions] == about["actions"]
    castes = [playback.castes[robot.caste].name for robot in playback.robots]
    assert castes == about["labels"]
    assert playback.castes[-1] == Kind("non-specialized", palette.FAINT)
    assert {kind.name for kind in playback.castes} == {*about["castes"], "non-specialized"}
    for name in ("specialization", "fitness", "heuristic"):
        assert [getattr(robot, name) for robot in playback.robots] == about[name]
    assert [robot.favourite for robot in playback.robots] == about["favourites"]
    assert [robot.share for robot in playback.robots] == about["favourite_shares"]
    assert [list(robot.neurons) for robot in playback.robots] == about["neurons"]
    assert (playback.iterations, len(playback.robots)) == (t, r)
    assert sorted(playback.events, key=lambda event: event.t) == list(playback.events)
    x0, y0, x1, y1 = playback.bounds
    assert (playback.x.values >= x0).all()
    assert (playback.x.values <= x1).all()
    assert (playback.y.values >= y0).all()
    assert (playback.y.values <= y1).all()


@pytest.mark.parametrize("task", TASKS)
def test_a_playback_becomes_json_and_every_sensor_has_a_name(task):
    playback, pool = playback_of(epoch(task)), Pool()
    text = json.dumps(pool.plain(playback), allow_nan=False)
    assert json.loads(text)["title"] == playback.title
    assert checked(playback) == playback
    groups = [range(g.first, g.first + g.count) for g in playback.sensor_groups]
    assert [k for group in groups for k in group] == list(range(playback.sensors.codes.shape[2]))
    assert all(len(set(g.names)) == g.count for g in playback.sensor_groups)


def test_a_team_of_heuristic_robots_has_no_activations():
    trajectory = epoch(TASKS[0])
    r = trajectory.about["n_robots"]
    playback = playback_of(renamed(trajectory, heuristic=["low"] * r, neurons=[[]] * r))
    assert playback.hidden is playback.outputs is None
    assert np.array_equal(playback.sensors.values, trajectory.channels["sensors"].values)
    assert dict(playback.facts)["heuristic robots"] == f"{r} low"
    assert "hidden neurons" not in dict(playback.facts)


def test_words():
    of_a_run = {"method": "mesp", "label": "here", "seed": 4, "generation": 12, "epoch": 2}
    playback = playback_of(renamed(epoch(TASKS[0]), **of_a_run))
    assert playback.title == "rover/complex-5"
    assert playback.subtitle == "Multi-Agent ESP, seed 4, fittest team of generation 12, epoch 2"
    facts = dict(playback.facts)
    performance = epoch(TASKS[0]).about["performance"]
    assert facts["value"] == f"{performance['value']:.0f} points"
    assert facts["area"] == f"{performance['area']:.4g} share of the square"
    hunt = epoch(next(task for task in TASKS if task.startswith("pursuit")))
    collisions = hunt.about["performance"]["collisions"]
    assert dict(playback_of(hunt).facts)["collisions"] == (
        f"{number(collisions)} refused moves (smaller is better)"
    )
    new = ("units", "favourites", "favourite_shares")  # conevo 0.1.0 had none
    about = {k: v for k, v in epoch(TASKS[0]).about.items() if k not in new}
    old = playback_of(dataclasses.replace(epoch(TASKS[0]), about=about))
    assert dict(old.facts)["value"] == f"{performance['value']:.0f}"
    assert "favourite settings" not in dict(old.facts)
    assert {(robot.favourite, robot.share) for robot in old.robots} == {("", 0.0)}
    assert (facts["run"], facts["method"], facts["seed"]) == ("here", "Multi-Agent ESP", "4")
    assert facts["hidden neurons"] == "10 to 11"  # one has an empty slot among its neurons
    mean = np.mean(epoch(TASKS[0]).about["fitness"])
    assert facts["team fitness (mean)"] == number(mean)
    caste, n = Counter(epoch(TASKS[0]).about["labels"]).most_common(1)[0]
    assert facts["castes"].startswith(f"{n} {caste}")
    liked = Counter(name for name in epoch(TASKS[0]).about["favourites"] if name)
    share = sum(epoch(TASKS[0]).about["favourite_shares"]) / liked.total()
    assert facts["favourite settings"].endswith(f"; mean share {number(share)}")
    assert all(f"{n} {name}" in facts["favourite settings"] for name, n in liked.items())
    assert playback_of(epoch(TASKS[0])).subtitle == "a team of no run"
    unknown = playback_of(renamed(epoch(TASKS[0]), **(of_a_run | {"method": "mine"})))
    assert unknown.subtitle.startswith("mine, seed 4, ")
    assert enumerated("robot", [3]) == "robot 3"
    assert enumerated("robot", [3, 7]) == "robots 3 and 7"
    assert enumerated("robot", [3, 7, 8]) == "robots 3, 7 and 8"


# --- colours --------------------------------------------------------------------------------------

# Machado, Oliveira and Fernandes 2009: colours as seen by people who lack one kind of cones.
VISION = {
    "all cones": np.eye(3),
    "no long": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                [-0.003882, -0.048116, 1.051998]],
    "no middle": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                  [-0.011820, 0.042940, 0.968881]],
    "no short": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                 [0.004733, 0.691367, 0.303900]],
}  # fmt: skip
XYZ = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
WHITE = [0.95047, 1.0, 1.08883]


def lab(colours, vision):
    """Coordinates in CIE L*a*b* [n, 3]."""
    rgb = np.array([[int(c[k : k + 2], 16) for k in (1, 3, 5)] for c in colours]) / 255
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ np.array(VISION[vision]).T, 0, 1)
    f = seen @ np.array(XYZ).T / WHITE
    f = np.where(f > 0.008856, np.cbrt(f), 7.787 * f + 16 / 116)
    return np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], -1)


def closest(colours, vision):
    """The distance of the two colours that are the most alike."""
    at = lab(colours, vision)
    apart = np.linalg.norm(at[:, None] - at, axis=-1)
    return apart[np.triu_indices(len(colours), 1)].min()


@pytest.mark.parametrize("vision", VISION)
def test_colours_are_distinct_for_everybody(vision):
    """A difference of 2.3 is just noticeable; much more than 11 is impossible with ten colours."""
    rovers = [*rover.ACTIONS.values(), palette.FAINT]
    assert closest(rovers, vision) > 22
    assert closest([*pursuit.ACTIONS.values(), palette.FAINT], vision) > 22
    assert closest([*gacc.ACTIONS.values(), palette.FAINT], vision) > 11
    assert closest([*gacc.CASTES.values(), palette.MOVE, palette.FAINT], vision) > 11
    stones = [*rover.ROCKS[:4], rover.CANAL]
    assert closest(stones, vision) > 17
    for stone in stones[:4]:
        assert min(closest([stone, robot], vision) for robot in rovers) > 17
    rims = [state.colour for state in gacc.LIFE if state.colour]
    assert closest([*dict.fromkeys(rims), *gacc.OBJECTS.values()], vision) > 11
    assert closest([look.line for look in palette.METHODS.values()], vision) > 15
    assert closest([look.area for look in palette.METHODS.values()], vision) > 9
    for kinds in (pursuit.EVENT_KINDS, building.EVENT_KINDS):
        assert closest([kind.colour for kind in kinds], vision) > 11


def test_lightness_shows_the_kind_of_action_and_hue_the_type():
    colours = list(gacc.CASTES.values())
    verbs = (colours[:3], colours[3:6], colours[6:])  # to detect, gather, construct
    lightness = [[lab([c], "all cones")[0, 0] for c in verb] for verb in verbs]
    for light, middle, dark in zip(*lightness, strict=True):
        assert light > middle + 10 > dark + 20
    worth = [lab([c], "all cones")[0, 0] for c in rover.ROCKS[:4]]
    assert all(a > b + 15 for a, b in pairwise(worth))


# --- directions -----------------------------------------------------------------------------------


def bearing(group, k):
    return group.angles[k] % (2 * math.pi)


def test_octants_agree_with_the_world():
    for group in (
        playback_of(epoch(TASKS[0])).sensor_groups + playback_of(epoch(GACC)).sensor_groups[:3]
    ):
        assert not group.turns
        for k in range(8):
            for off in (-0.99, 0.0, 0.99):
                a = bearing(group, k) + off * group.half
                assert octant(math.cos(a), math.sin(a)) == k
        compass = dict(zip(group.names, group.angles, strict=True))
        assert compass["ENE"] == pytest.approx(math.radians(22.5))
        assert compass["NNW"] == pytest.approx(math.radians(112.5))
        assert compass["SSE"] == pytest.approx(math.radians(292.5))


@pytest.mark.parametrize(("task", "group"), [(TASKS[0], 0), (GACC, 1)])
def test_a_sensed_robot_is_in_the_wedge(task, group):
    playback = playback_of(played(task.partition("/")[0]))
    g = playback.sensor_groups[group]
    at = np.stack([playback.x.values, playback.y.values], axis=-1)
    sensed = playback.sensors.values[1:, :, g.first : g.first + 8]
    seen = np.argwhere(sensed > 1e-3)
    assert len(seen) > 20
    for t, i, k in seen[:200].tolist():
        way = np.delete(at[t], i, axis=0) - at[t, i]  # places in the previous iteration
        off = np.angle(np.exp(1j * (np.arctan2(way[:, 1], way[:, 0]) - g.angles[k])))
        inside = (np.hypot(*way.T) < g.reach + 1e-3) & (np.abs(off) < g.half + 1e-2)
        assert inside.any()


def test_khepera_sensors_are_those_of_the_kernels():
    assert float(khepera.RADIUS) == pursuit.RADIUS
    infrared, light = playback_of(epoch("pursuit/team-7")).sensor_groups
    for k in range(8):
        m, side = (k, 1) if k < 4 else (7 - k, -1)  # sensors on the right mirror those on the left
        way = khepera.LOOK_X[m], side * khepera.LOOK_Y[m]
        assert (math.cos(light.angles[k]), math.sin(light.angles[k])) == pytest.approx(way)
    assert infrared.angles == light.angles
    assert infrared.turns
    assert light.turns
    assert light.reach == pursuit.RADIUS + 22.0
    assert light.half == math.radians(30)
    assert light.names[:4] == ("10° left", "45° left", "90° left", "180° left")
    assert light.names[4:] == ("180° right", "90° right", "45° right", "10° right")


def test_the_prey_shines_into_the_wedge():
    playback = playback_of(played("pursuit"))
    r, light = len(playback.robots), playback.sensor_groups[1]
    at = np.stack([playback.x.values, playback.y.values], axis=-1)
    readings = playback.sensors.values[1:, :, light.first : light.first + 8]
    seen = np.argwhere(readings.max(axis=2) > 0.2)
    assert len(seen) > 20
    for t, i in seen.tolist():
        way = at[t, r] - at[t, i]
        k = readings[t, i].argmax()
        looks = playback.heading.values[t, i] + light.angles[k]
        off = np.angle(np.exp(1j * (np.arctan2(way[1], way[0]) - looks)))
        wide = math.asin(min(2 * pursuit.RADIUS / np.hypot(*way), 1.0))
        assert abs(off) < light.half + wide + 0.05
        assert np.hypot(*way) < light.reach + pursuit.RADIUS + 0.1


# --- other worlds ---------------------------------------------------------------------------------


def test_a_world_outside_the_package():
    playback = playback_of(epoch(LIGHT))
    assert playback.title == "light/dark-1"
    assert playback.bounds == (0, 0, 1, 1)
    assert [kind.colour for kind in playback.actions] == [palette.BLUE, palette.ORANGE]
    assert playback.castes[:2] == playback.actions
    assert playback.things == playback.events == playback.rings == ()
    (light,) = playback.backdrop
    assert light.label == "light"
    x, y = values(epoch(LIGHT), "scene/places")[-1]
    assert light.numbers == pytest.approx((x, y, 0.02))
    assert playback.output_names == ("rest", "move", "dx", "dy")
    (measure,) = playback.measures
    assert measure.name == "nearness"
    ended = epoch(LIGHT).about["performance"]["nearness"]
    assert measure.values.values[-1] == pytest.approx(ended, abs=1e-4)


@pytest.mark.parametrize("missing", [("x",), ("y", "action"), ("x", "y", "action")])
def test_a_world_that_cannot_be_drawn(missing):
    with pytest.raises(UsageError) as error:
        playback_of(changed(epoch(LIGHT), **dict.fromkeys(missing)))
    text = str(error.value)
    assert text.startswith("world light-v1 cannot be drawn")
    assert f"does not record {', '.join(missing)} of every robot" in text
    assert "Simulation.recorded" in text


def test_a_world_of_any_size_with_its_own_castes():
    trajectory = epoch(LIGHT)
    x = np.linspace(-3, 17, 600).reshape(200, 3)
    other = changed(trajectory, x=x, heading=x, energy=x)
    castes = ["rest", "non-specialized", "walker"]
    playback = playback_of(
        renamed(other, castes=castes, labels=["walker", "rest", "non-specialized"])
    )
    y = values(trajectory, "y")
    assert playback.bounds == pytest.approx((-4, y.min() - 1, 18, y.max() + 1))
    assert np.allclose(playback.heading.values, x, atol=1e-3)
    assert np.allclose(playback.energy.values, x, atol=1e-3)
    assert [one.name for one in playback.castes] == ["rest", "walker", "non-specialized"]
    assert [robot.caste for robot in playback.robots] == [1, 0, 2]
    assert playback.castes[0].colour == playback.actions[0].colour
    assert len({one.colour for one in (*playback.castes, *playback.actions)}) == 4
    half = changed(trajectory, x=np.linspace(-1, 0.5, 600).reshape(200, 3))
    assert playback_of(half).bounds[0] < -1
    standing = changed(trajectory, x=np.full((200, 3), 5.0), y=np.full((200, 3), 5.0))
    assert playback_of(standing).bounds == (4.5, 4.5, 5.5, 5.5)
