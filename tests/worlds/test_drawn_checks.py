"""``conevo check`` checks the drawing that a world declares before an epoch is replayed."""

from pathlib import Path

import numpy as np
import pytest

from conevo.controllers.registry import controller
from conevo.playback.drawn import Area, Drawn, Objects, Signal
from conevo.worlds.checks import findings, random_teams
from conevo.worlds.drawn_checks import drawn_in_words, of_drawing
from conevo.worlds.registry import world
from conevo.worlds.simulators import simulator

EXAMPLES = Path(__file__).parents[2] / "examples"
BALL = Objects("ball", "ball[0]", "ball[1]")


@pytest.fixture(scope="module")
def played():
    a_world = world(f"{EXAMPLES / 'ball.py'}:near-1", iterations=20)
    return simulator(a_world, controller(world=a_world), n_threads=1)


def faults(played):
    """Return the faults found in an epoch of the world."""
    genes, (team,) = random_teams(played.world, 1)
    return list(of_drawing(played, genes, team, np.full(len(team), -1, np.int32), 1))


@pytest.mark.parametrize(
    ("drawn", "words"),
    [
        ("ball", "drawn must be a Drawn, not 'ball'"),
        (Drawn(objects=(Objects("ball", "bal[0]", "ball[1]"),)), "did you mean 'ball'?"),
        (Drawn(objects=(Objects("ball", "ball[2]", "ball[1]"),)),
         "ball is not drawn: 'ball[2]' picks from an array [2]"),
        (Drawn(objects=(Objects("ball", "ball[0]", "ball[1]", size=-1),)),
         "drawn: objects[0].size = -1: must be greater than 0"),
        (Drawn(objects=(Objects("ball", "ball[0]", "ball[1]", shape="dot"),)),
         "drawn: objects[0].shape = 'dot': must be 'disc' or 'square'"),
        (Drawn(objects=(Objects("ball", "ball[0]", "ball[1]", size="big"),)),
         "drawn: objects[0].size = 'big'"),
        (Drawn(objects=(Objects("ball", "ball[0]", "ball[1]", size=np.float32(1)),)),
         "drawn must be of plain texts and numbers: "),
        (Drawn(objects=BALL), "drawn: objects = "),
        (Drawn(areas=(Area("goal", 0.5, 0.5),)), "a radius, or a width and a height, above 0"),
        (Drawn(areas=(Area("goal", 0.5, float("nan"), 0.1),)), "drawn must be of plain texts and"),
        (Drawn(signals=(Signal("push", "places"),)), "not recorded in every iteration"),
        (Drawn(bounds=(1, 1, 0, 0)), "bounds (1.0, 1.0, 0.0, 0.0)"),
        (Drawn(colours={"rest": "red"}), "'red' is not a colour, as in '#d55e00'"),
        (Drawn(colours={"rset": "#d55e00"}), "'rset' in drawn.colours; did you mean 'rest'?"),
    ],
)  # fmt: skip
def test_each_mistake_is_one_line(played, monkeypatch, drawn, words):
    monkeypatch.setattr(type(played.world), "drawn", drawn)
    (found,) = faults(played)
    assert words in found
    assert "\n" not in found
    assert not found.startswith(("world", "the trajectory"))


def test_drawn_objects_are_named(played):
    assert faults(played) == []
    assert drawn_in_words(played.world) == "robots, ball, goal, begins to push"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("places[-1, 0]", "place[-1, 0]", "light is not drawn: unknown array or value 'place'"),
        ('recorded=("x", "y", ', "recorded=(", "does not record x, y of every robot"),
        ('dark-1",)', 'dark-1",), studied="somewhere"', "its study 'somewhere' is not there"),
    ],
)
def test_check_shows_it(old, new, words, tmp_path):
    text = (EXAMPLES / "light.py").read_text()
    assert text.count(old) == 1
    (tmp_path / "bad.py").write_text(text.replace(old, new))
    found = [one for one in findings(f"{tmp_path / 'bad.py'}:dark-1") if one.status == "problem"]
    assert [words in one.text for one in found] == [True]


def test_a_world_without_a_drawing_need_not_record_places(tmp_path):
    text = (EXAMPLES / "light.py").read_text()
    (line,) = (line for line in text.splitlines(keepends=True) if "drawn: ClassVar" in line)
    text = text.replace(line, "").replace('recorded=("x", "y", ', "recorded=(")
    (tmp_path / "plain.py").write_text(text)
    topics = {one.topic: one for one in findings(f"{tmp_path / 'plain.py'}:dark-1")}
    assert topics["drawn"].status == "note"
    assert "does not record x, y of every robot" in topics["drawn"].text
    assert "problem" not in {one.status for one in topics.values()}
