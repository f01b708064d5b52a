"""The drawing that your own world declares: objects, areas, events, colours, names."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.playback.drawn import Area, Drawn, Objects, Signal
from conevo.replay.playback import playback_of
from conevo.replay.trajectory import Trajectory
from replay.epochs import epoch, renamed
from replay.staging import events_of, opened, values

BALL = f"{Path(__file__).resolve().parents[2] / 'examples' / 'ball.py'}:near-1"
SUBCLASS = """
from dataclasses import dataclass
from typing import ClassVar

from conevo.playback.drawn import Area, Drawn
from conevo.worlds.registry import WorldEntry
from conevo.worlds.rover.world import RoverParams, RoverWorld


@dataclass(frozen=True)
class MyWorld(RoverWorld):
    name: ClassVar[str] = "mine-v1"
    drawn: ClassVar[Drawn] = Drawn(areas=(Area("camp", "lander[0]", "lander[1]", "med_range"),))


ENTRY = WorldEntry("mine-v1", "Mine", "", "", ("complex-5",), "RoverParams", "MyWorld")
"""


def with_drawn(drawn, **about):
    plain = drawn.plain if isinstance(drawn, Drawn) else drawn
    return renamed(epoch(BALL, 80), drawn=plain, **about)


def test_the_ball_and_its_goal_are_drawn():
    found = epoch(BALL, 80)
    playback = playback_of(found)
    (ball,) = playback.things
    recorded = values(found, "ball")
    assert ball.name == "ball"
    assert np.allclose(ball.x.values, recorded[:, :1], atol=1e-4)
    assert np.allclose(ball.y.values, recorded[:, 1:], atol=1e-4)
    (goal,) = playback.backdrop
    assert (goal.shape, goal.label) == ("disc", "goal")
    assert goal.numbers == pytest.approx((*values(found, "scene/places")[-1], 0.03))
    assert [kind.colour for kind in playback.actions] == ["#9a9aa5", "#d55e00"]
    assert playback.output_names == ("rest", "push", "dx", "dy")
    (sensors,) = playback.sensor_groups
    assert sensors.names == ("ball x", "ball y", "goal x", "goal y")
    action = values(found, "action")
    pushes = np.argwhere((action[1:] == 1) & (action[:-1] == 0)).tolist()
    assert events_of(playback) == [(t + 1, f"robot {i}: begins to push", (i,)) for t, i in pushes]
    assert len(pushes) > 0


def test_it_needs_no_code_of_the_world(tmp_path):
    path = tmp_path / "epoch.npz"
    epoch(BALL, 80).save(path)
    (ball,), (goal,) = (
        getattr(playback_of(Trajectory.load(path)), k) for k in ("things", "backdrop")
    )
    assert (ball.name, goal.label) == ("ball", "goal")
    assert Trajectory.load(path).about == epoch(BALL, 80).about


def test_objects_have_kinds_states_and_an_end():
    found = epoch("rover/complex-5", 80)
    rocks = Objects(
        "rocks", "rock_x", "rock_y", size=0.002, shape="square",
        kind="rock_type", kinds=("A", "B", "C", "D"), gone="detected",
    )  # fmt: skip
    robots = Objects("marks", "x[0:2]", "y[0:2]", state="action[0:2]", states=("a", "b", "c", "d"))
    other = renamed(found, world="mine-v1", drawn=Drawn(objects=(rocks, robots), unit="m").plain)
    drawn, own = playback_of(other), playback_of(found)
    (mine, marks), (theirs,) = drawn.things, own.things
    assert np.array_equal(mine.kind.values, theirs.kind.values)
    assert np.array_equal(mine.gone.values, theirs.gone.values)
    assert np.array_equal(mine.x.values, theirs.x.values)
    assert drawn.unit == "m"
    assert np.array_equal(marks.state.values, values(found, "action")[:, :2])
    assert [group.name for group in drawn.sensor_groups] == ["rovers", "red rocks"]


def test_a_subclass_is_drawn_like_the_world_it_inherits(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(SUBCLASS)
    mine, rover = epoch(f"{path}:complex-5", 80), epoch("rover/complex-5", 80)
    assert mine.about["like"] == "rover-v2"
    assert "like" not in rover.about
    assert "drawn" not in rover.about
    drawn, plain = playback_of(mine), playback_of(rover)
    assert drawn.title == "mine/complex-5"
    assert [one.label for one in drawn.backdrop] == ["canals", "lander", "camp"]
    assert drawn.backdrop[-1].numbers[2] == mine.about["params"]["med_range"]
    assert drawn.things[0].kinds == plain.things[0].kinds
    assert drawn.rings == plain.rings
    odd = renamed(mine, actions=["a", "b", "c", "d"], castes=["a", "b", "c", "d"])
    odd = renamed(odd, labels=["a"] * mine.about["n_robots"])
    assert [kind.name for kind in playback_of(odd).actions] == ["a", "b", "c", "d"]
    assert [one.label for one in playback_of(odd).backdrop] == ["camp"]


@pytest.mark.parametrize(
    ("drawn", "words"),
    [
        (Drawn(objects=(Objects("ball", "bal[0]", "ball[1]"),)), "did you mean 'ball'?"),
        (Drawn(objects=(Objects("ball", "ball[2]", "ball[1]"),)), "'ball[2]' picks from"),
        (Drawn(objects=(Objects("ball", "ball", "ball[1]"),)), "x is [80, 2], y [80, 1]"),
        (Drawn(objects=(Objects("ball", "ball(1)", "ball[1]"),)), "is not a place"),
        (Drawn(areas=(Area("goal", "places", 0.5, 0.1),)), "goal is not drawn: x is [6, 2]"),
        (Drawn(areas=(Area("goal", 0.5, 0.5),)), "a radius, or a width and a height"),
        (Drawn(signals=(Signal("push", "places"),)), "not recorded in every iteration"),
        (
            Drawn(objects=(Objects("ball", "ball[0]", "ball[1]", kind="n_robots"),)),
            "1 names",
        ),
        (
            Drawn(objects=(Objects("a", "x", "y", state="action", states=("a",)),)),
            "0 to 1, for 1 names",
        ),
        ({"object": []}, "drawn: object is not a known key"),
        ({"unit": 3}, "drawn: unit = 3: must be a valid string"),
    ],
)
def test_a_wrong_drawing_is_one_line(drawn, words):
    with pytest.raises(UsageError) as error:
        playback_of(with_drawn(drawn))
    assert words in str(error.value)
    assert str(error.value).startswith("world ball-v1: ")
    assert "\n" not in str(error.value)


def test_damaged_descriptions_are_refused():
    for odd in ({"objects": [{"name": "a", "x": "x", "y": "y", "size": -1}]},
                {"objects": [{"name": "a\n", "x": "x", "y": "y"}]},
                {"bounds": [1, 1, 0, 0]}, {"colours": {"rest": "red"}},
                {"areas": [{"name": "a", "x": 0, "y": 0, "radius": 1e999}]}):  # fmt: skip
        with pytest.raises(UsageError) as error:
            opened(with_drawn(odd))
        assert "\n" not in str(error.value)


def test_a_trajectory_of_an_older_release_has_plain_names():
    found = epoch(BALL, 80)
    old = {k: v for k, v in found.about.items() if k not in ("drawn", "inputs", "outputs")}
    playback = playback_of(dataclasses.replace(found, about=old))
    assert playback.things == playback.backdrop == ()
    assert playback.output_names == ("output 0", "output 1", "output 2", "output 3")
    assert playback.sensor_groups[0].names == ("0", "1", "2", "3")
