"""The drawing and the numbers of the replay page in a real browser, against the file."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from conevo import palette
from conevo.replay.page import replay_page
from replay.eventful import WORLDS
from replay.synthetic import DETECTED, HELD, PHASE, ROCKS_X, ROCKS_Y, R, T, made_up
from replay.viewing import (
    Epoch,
    apart,
    at_world,
    hexadecimal,
    inside,
    number_in,
    open_page,
    patch,
    pixels,
    seek,
    shown,
    state,
    until,
    where,
)

pytest_plugins = ["replay.browser"]
pytestmark = pytest.mark.browser


@pytest.fixture(scope="module", params=WORLDS)
def epoch(request, tmp_path_factory):
    return Epoch(request.param, tmp_path_factory.mktemp("epoch"))


@pytest.fixture
def team(tab, tmp_path):
    """The page of the made-up team, drawn."""
    open_page(tab, replay_page([made_up()]), tmp_path / "team.html")
    assert tab.get_attribute("body", "data-ready") == "yes"
    return tab


# --- robots ---------------------------------------------------------------------------------------


def test_a_click_on_a_robot_shows_its_numbers_of_the_file(tab, epoch, tmp_path):
    open_page(tab, epoch.page, tmp_path / "replay.html")
    channels = epoch.channels
    for t in (0, 101, 239):
        seek(tab, t)
        for robot in (int(r) for r in apart(channels["x"][t], channels["y"][t]) if r < epoch.n):
            if robot % 3 and t != 101:
                continue  # all of them once, some always
            tab.keyboard.press("Escape")
            tab.mouse.click(*where(tab, robot))
            selected = state(tab)["selected"]
            assert selected == {"team": 0, "robot": robot}
            check_panel(epoch, t, robot, shown(tab))
            if t != 101 and robot > 9:
                break


def check_panel(epoch, t, robot, panel):
    """Compare the panel of a robot with the trajectory's file."""
    about, field = epoch.about, panel["field"]
    action = int(epoch.at("action", t, robot))
    if action >= 0:
        assert about["actions"][action] in field["action"]
    assert about["labels"][robot] in field["caste"]
    if liked := about["favourites"][robot]:
        name, _, share = field["favourite"].rpartition(", ")
        assert name == liked
        number, tolerance = number_in(share)
        assert number == pytest.approx(100 * about["favourite_shares"][robot], abs=tolerance)
    else:
        assert field["favourite"] == "–"
    expected = {
        "x": epoch.at("x", t, robot),
        "y": epoch.at("y", t, robot),
        "specialization": about["specialization"][robot],
        "fitness": about["fitness"][robot],
    }
    for name in ("energy", "heading"):
        if name in epoch.channels:
            expected[name] = epoch.at(name, t, robot)
        else:
            assert name not in field or not re.search(r"\d", field[name])
    for name, value in expected.items():
        number, tolerance = number_in(field[name])
        if "°" in field[name]:
            value = math.degrees(value)
            number -= 360 * round((number - value) / 360)
        assert number == pytest.approx(value, abs=tolerance), (name, robot, t)
    if "held" in epoch.channels:
        held = int(epoch.at("held", t, robot))
        assert bool(re.search(r"\d|[ABC]", field["holding"])) == (held >= 0), field["holding"]
    check_network(epoch, t, robot, panel)


def check_network(epoch, t, robot, panel):
    """Compare activations of all sensors and of the neurons in used slots."""
    about, channels = epoch.about, epoch.channels
    has_network = not about["heuristic"][robot]
    filled = np.flatnonzero(channels["hidden"][:, robot].any(axis=0))
    slots = {
        "sensor": range(channels["sensors"].shape[2]),
        "hidden": filled if has_network else (),
        "output": range(channels["outputs"].shape[2]) if has_network else (),
    }
    assert len(panel["hidden"]) == (len(about["neurons"][robot]) if has_network else 0)
    for (name, wanted), channel in zip(
        slots.items(), ("sensors", "hidden", "outputs"), strict=True
    ):
        assert {str(k) for k in wanted} <= set(panel[name]), (name, robot)
        for k, text in panel[name].items():
            assert re.fullmatch(r"[-−]?\d+\.\d{3}", text), (name, text)
            number, tolerance = number_in(text)
            value = channels[channel][t, robot, int(k)]
            assert number == pytest.approx(value, abs=tolerance), (name, k, robot, t)


def test_a_click_away_from_all_robots_deselects(team):
    team.mouse.click(*where(team, 1))
    assert state(team)["selected"] == {"team": 0, "robot": 1}
    team.mouse.click(*at_world(team, 6.0, 5.5))
    assert state(team)["selected"] is None


def test_robots_have_the_colour_of_their_action_or_caste(tab, epoch, tmp_path):
    open_page(tab, epoch.page, tmp_path / "replay.html")
    about, playback = epoch.about, epoch.playback
    colours = {kind.name: kind.colour for kind in (*playback.actions, *playback.castes)}
    for t in (30, 200):
        seek(tab, t)
        x, y = (epoch.channels[name][t] for name in ("x", "y"))
        lonely = [int(r) for r in apart(x, y) if r < epoch.n][:6]
        for by in ("action", "caste"):
            tab.select_option("#colour", by)
            assert state(tab)["colourBy"] == by
            for robot in lonely:
                if by == "caste":
                    colour = colours[about["labels"][robot]]
                else:
                    action = int(epoch.at("action", t, robot))
                    colour = colours[about["actions"][action]] if action >= 0 else palette.FAINT
                assert tab.evaluate("r => conevo.colour(0, r)", robot) == colour
                seen = patch(tab, *where(tab, robot))
                known = [one for one in seen if one in colours.values()]
                assert known.count(colour) >= 4, (robot, t, by, seen)
                assert known.count(colour) > 0.8 * len(known), (robot, t, by)


def test_zooming_keeps_robots_under_the_mouse(team):
    """Keys zoom around the selected robot, the wheel around the mouse; dragging moves the view."""
    seek(team, 75)
    whole = [where(team, robot) for robot in range(R)]
    team.evaluate("conevo.select(0, 2)")
    for _ in range(3):
        team.keyboard.press("z")
    state(team)
    box, near = inside(team, "#world-0"), where(team, 2)
    assert np.hypot(*np.subtract(where(team, 1), near)) > 3 * np.hypot(*np.subtract(*whole[1:3]))
    assert box["x"] < near[0] < box["x"] + box["width"]
    assert box["y"] < near[1] < box["y"] + box["height"]
    team.keyboard.press("Escape")
    team.mouse.click(*near)
    assert state(team)["selected"] == {"team": 0, "robot": 2}
    team.keyboard.press("Escape")
    team.mouse.move(near[0] + 60, near[1] + 40)
    team.mouse.down()
    team.mouse.move(near[0] + 30, near[1] + 20, steps=5)
    team.mouse.up()
    assert state(team)["selected"] is None
    assert np.subtract(where(team, 2), near) == pytest.approx([-30, -20], abs=8)
    team.keyboard.press("0")
    state(team)
    assert np.array([where(team, robot) for robot in range(R)]) == pytest.approx(np.array(whole))
    team.mouse.move(*whole[3])
    team.mouse.wheel(0, -400)
    until(team, "() => conevo.state().look.zoom > 1.5")
    state(team)
    assert where(team, 3) == pytest.approx(whole[3], abs=1)
    seen = patch(team, *where(team, 3))
    assert seen.count(team.evaluate("conevo.colour(0, 3)")) >= 4


def test_robots_that_do_nothing_are_faint(team):
    seek(team, 110)
    assert team.evaluate("conevo.colour(0, 3)") == palette.FAINT
    assert patch(team, *where(team, 3)).count(palette.FAINT) >= 4
    seek(team, 120)
    assert team.evaluate("conevo.colour(0, 3)") == made_up().actions[(120 // PHASE + 3) % 4].colour


def test_a_trail_follows_its_robot(team):
    seek(team, T - 1)
    if not state(team)["trails"]:
        team.check("#trails")
    playback = made_up()
    behind = at_world(team, playback.x.values[T - 30, 2], playback.y.values[T - 30, 2])
    with_trail = patch(team, *behind)
    team.uncheck("#trails")
    assert not state(team)["trails"]
    assert patch(team, *behind) != with_trail


def test_all_numbers_of_all_robots_are_shown(tab, tmp_path):
    """Every value of a made-up team at a few iterations, small and large ones."""
    playback = made_up()
    large = tuple(replace(one, fitness=98765.4321 * 10**k) for k, one in enumerate(playback.robots))
    playback = replace(playback, robots=large)
    open_page(tab, replay_page([playback]), tmp_path / "large.html")
    for t in (0, 77, T - 1):
        seek(tab, t)
        for robot in range(R):
            tab.evaluate("r => conevo.select(0, r)", robot)
            panel = shown(tab)
            number, tolerance = number_in(panel["field"]["fitness"])
            assert number == pytest.approx(playback.robots[robot].fitness, abs=tolerance)
            for name, channel in (
                ("sensor", playback.sensors),
                ("hidden", playback.hidden),
                ("output", playback.outputs),
            ):
                values = channel.values[t, robot]
                slots = playback.robots[robot].neurons if name == "hidden" else range(len(values))
                assert set(panel[name]) == {str(k) for k in slots}
                for k in slots:
                    value = values[k]
                    number, tolerance = number_in(panel[name][str(k)])
                    assert number == pytest.approx(value, abs=tolerance), (name, k, robot, t)


# --- things and events ----------------------------------------------------------------------------


def test_a_detected_rock_fades(team):
    playback = made_up()
    high = playback.things[1].kinds[1].colour
    low = playback.things[1].kinds[0].colour

    def rocks(t):
        seek(team, t)
        return [patch(team, *at_world(team, *at)) for at in zip(ROCKS_X, ROCKS_Y, strict=True)]

    fading, forever, later = rocks(DETECTED[0] - 1)
    assert fading.count(low) >= 4
    assert forever.count(high) >= 4
    assert later.count(high) >= 4
    fading, forever, later = rocks(DETECTED[0] + 10)
    halfway = fading[len(fading) // 2]
    assert halfway != low
    assert forever.count(high) >= 4
    assert later.count(high) >= 4
    fading, forever, later = rocks(T - 1)
    ground, mark = made_up().backdrop[0].fill, fading[len(fading) // 2]
    assert mark not in (low, ground, halfway)  # a faint mark stays
    assert distance(mark, ground) < distance(halfway, ground) < distance(low, ground)
    assert forever.count(high) >= 4
    assert later.count(high) < 4


def distance(one, other):
    """The distance of two colours."""
    a, b = (np.array([int(c[k : k + 2], 16) for k in (1, 3, 5)]) for c in (one, other))
    return int(np.abs(a - b).sum())


def test_a_carried_object_moves_with_its_robot(team):
    colour = made_up().things[0].kinds[1].colour
    playback = made_up()
    for t in (0, HELD[0], HELD[30], T - 1):
        seek(team, t)
        at = [float(c.values[t, 1]) for c in (playback.things[0].x, playback.things[0].y)]
        assert patch(team, *at_world(team, *at)).count(colour) >= 4, t
    seek(team, HELD[30])
    left = [float(c.values[0, 1]) for c in (playback.things[0].x, playback.things[0].y)]
    assert colour not in patch(team, *at_world(team, *left))
    team.evaluate("conevo.select(0, 0)")
    assert re.search(r"\d|B", shown(team)["field"]["holding"])
    seek(team, HELD[-1] + 1)
    assert not re.search(r"\d|B", shown(team)["field"]["holding"])


def test_events_jump(tab, epoch, tmp_path):
    open_page(tab, epoch.page, tmp_path / "replay.html")
    events = epoch.playback.events
    assert len(events) >= 2
    listed = tab.eval_on_selector_all(
        "#events-0 [data-event]", "all => all.map((one) => [+one.dataset.event, +one.dataset.t])"
    )
    assert sorted(listed) == [[k, event.t] for k, event in enumerate(events)]
    cut = "all => all.filter((one) => one.scrollWidth > one.clientWidth && one.clientWidth).length"
    tab.set_viewport_size({"width": 1280, "height": 800})
    assert tab.eval_on_selector_all("#events-0 span, .lanes em", cut) == 0
    for k in (0, len(events) // 2, len(events) - 1):
        button = tab.locator(f"#events-0 [data-event='{k}']")
        assert events[k].text in button.text_content()
        button.click()
        assert state(tab)["t"] == events[k].t


def test_events_can_be_filtered(team):
    """One of two kinds of events, detections and deliveries, can be hidden."""
    seen = "#events-0 [data-event]:visible"
    assert team.locator(seen).count() == 3
    team.get_by_label("detection", exact=False).first.uncheck()
    assert team.locator(seen).count() == 1
    assert "delivered" in team.locator(seen).inner_text()
    seek(team, 0)
    team.keyboard.press(".")
    assert state(team)["t"] == 150  # keys jump to listed events


# --- the timeline ---------------------------------------------------------------------------------


def test_the_timeline_shows_actions_and_jumps_to_them(tab, epoch, tmp_path):
    open_page(tab, epoch.page, tmp_path / "replay.html")
    action = epoch.channels["action"][:, : epoch.n].astype(int)
    check_timeline(tab, epoch.playback, action, 0)


def check_timeline(tab, playback, action, team):
    """In a robot's row, each iteration has the colour of its action; a click jumps to it."""
    length, n = action.shape
    seek(tab, length - 1)
    tab.keyboard.press("Escape")
    tab.locator(f"#timeline-{team}").scroll_into_view_if_needed()
    box = inside(tab, f"#timeline-{team}")
    picture = pixels(tab)
    cells = [(robot, t) for robot in range(n) for t in range(2, length - 2, 7)]
    places = np.array(cells_at(tab, team, cells))
    is_wide = box["width"] >= 3 * length  # otherwise a pixel may show several iterations
    for (robot, t), (x, y) in zip(cells, places, strict=True):
        if is_wide or len(set(action[t - 1 : t + 2, robot])) == 1:
            kind = action[t, robot]
            colour = playback.actions[kind].colour if kind >= 0 else palette.FAINT
            assert hexadecimal(picture[int(y), int(x)]) == colour, (robot, t)
    robots, times = np.array(cells).T
    assert np.polyfit(times, places[:, 0], 1)[0] == pytest.approx(box["width"] / length, rel=0.02)
    assert np.polyfit(robots, places[:, 1], 1)[0] == pytest.approx(box["height"] / n, rel=0.02)
    for robot, t in cells[:: len(cells) // 12]:
        tab.mouse.click(*cells_at(tab, team, [(robot, t)])[0])
        found = state(tab)
        assert found["t"] == pytest.approx(t, abs=0.51 * length / box["width"])
        assert found["selected"] == {"team": team, "robot": robot}


def cells_at(tab, team, cells):
    """Places of iterations in robots' rows of the timeline: x, y in the window."""
    return tab.evaluate(
        """([team, cells]) => cells.map(([robot, t]) => {
            const {x, y} = conevo.row(team, robot, t);
            return [x, y];
        })""",
        [team, cells],
    )


# --- two teams ------------------------------------------------------------------------------------


def test_two_teams_side_by_side(tab, tmp_path):
    """In the same scenario; both follow the same time, and each shows the data of its own file."""
    teams = [Epoch("rover", tmp_path, seed) for seed in (2, 3)]
    open_page(tab, replay_page([team.playback for team in teams]), tmp_path / "both.html")
    assert state(tab)["teams"] == 2
    left, right = (inside(tab, f"#world-{k}") for k in range(2))
    assert left["x"] + left["width"] <= right["x"]
    assert left["width"] == pytest.approx(right["width"], abs=2)
    assert left["y"] == pytest.approx(right["y"], abs=2)
    for t in (60, 180):
        seek(tab, t)
        for k, team in enumerate(teams):
            for robot in apart(team.channels["x"][t], team.channels["y"][t])[:3].tolist():
                tab.keyboard.press("Escape")
                tab.mouse.click(*where(tab, robot, k))
                assert state(tab)["selected"] == {"team": k, "robot": robot}
                check_panel(team, t, robot, shown(tab, k))
                action = int(team.at("action", t, robot))
                assert team.playback.actions[action].colour in patch(tab, *where(tab, robot, k))
    for k, team in enumerate(teams):
        check_timeline(tab, team.playback, team.channels["action"].astype(int), k)
        seek(tab, 0)
        tab.locator(f"#events-{k} [data-event]").first.click()
        assert state(tab)["t"] == team.playback.events[0].t
    tab.screenshot(path=tmp_path / "both.png")
