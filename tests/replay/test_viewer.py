"""The replay page in a real browser: it loads, plays, jumps, and responds to keys."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from conevo.replay.page import replay_page
from conevo.replay.playback import playback_of
from conevo.replay.trajectory import Trajectory
from replay.eventful import WORLDS, played
from replay.synthetic import DETECTED, T, made_up
from replay.viewing import Epoch, inside, open_page, overflow, pixels, seek, state, until, where

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


# --- loading --------------------------------------------------------------------------------------


def test_the_page_of_an_epoch_loads_and_shows_it(tab, epoch, tmp_path):
    """Without errors and requests, which the fixture ``tab`` checks in every test."""
    open_page(tab, epoch.page, tmp_path / "replay.html")
    assert tab.get_attribute("body", "data-ready") == "yes"
    tab.evaluate("conevo.ready")
    first = state(tab)
    assert (first["t"], first["playing"], first["speed"], first["colourBy"]) == (
        0,
        False,
        60,
        "action",
    )
    assert (first["selected"], first["teams"]) == (None, 1)
    assert tab.title().startswith(epoch.playback.title)
    text = tab.inner_text("body")
    assert epoch.playback.title in text
    assert epoch.playback.subtitle in text
    assert not tab.get_by_role("alert").is_visible()
    for kind in epoch.playback.actions:
        assert kind.name in tab.inner_text("#legend")
    for world in (0, 100, 239):
        seek(tab, world)
        picture = pixels(tab, inside(tab, "#world-0"))
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 50
    tab.screenshot(path=tmp_path / f"{epoch.name}.png")


def test_a_page_in_a_string_loads_too(tab):
    tab.set_content(replay_page([made_up()]))
    tab.wait_for_selector("body[data-ready=yes]")
    assert state(tab)["t"] == 0


def test_the_same_epoch_gives_the_same_page(epoch):
    again = Trajectory(played(epoch.name).about, played(epoch.name).channels)
    assert replay_page([playback_of(again)]) == epoch.page


# --- time -----------------------------------------------------------------------------------------


def test_play_advances_and_pause_stops(team):
    team.click("#play")
    until(team, "() => conevo.state().t > 5")
    assert state(team)["playing"]
    team.click("#play")
    stopped = state(team)
    assert not stopped["playing"]
    assert team.input_value("#scrub") == str(stopped["t"])
    frames = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    team.evaluate(frames)
    assert state(team)["t"] == stopped["t"]
    team.evaluate("conevo.play()")
    until(team, "t => conevo.state().t > t", stopped["t"] + 3)
    team.evaluate("conevo.pause()")
    assert not state(team)["playing"]


def test_it_stops_at_the_end_and_play_starts_again(team):
    seek(team, T - 10)
    team.click("#play")
    until(team, "() => !conevo.state().playing")
    assert state(team)["t"] == T - 1
    team.click("#play")
    until(team, "() => conevo.state().playing && conevo.state().t > 0")
    assert state(team)["t"] < T - 1


def test_speed_is_in_iterations_per_second(team):
    speeds = team.eval_on_selector_all("#speed option", "all => all.map((one) => one.value)")
    assert [int(speed) for speed in speeds] == [5, 15, 30, 60, 120, 240, 480, 960]
    paced = """n => new Promise((done) => {
        conevo.seek(0);
        conevo.play();
        let first = null;
        const look = (now) => {
            const {t, playing} = conevo.state();
            first ??= t > 0 ? [t, now] : null;
            if (playing && t < n) return requestAnimationFrame(look);
            conevo.pause();
            done(1000 * (t - first[0]) / (now - first[1]));
        };
        requestAnimationFrame(look);
    })"""
    for speed, n in ((30, 15), (120, 50), (480, 180)):
        team.select_option("#speed", str(speed))
        assert state(team)["speed"] == speed
        # A busy machine draws too slowly, and time is lost: one of several tries must be right.
        tries = (team.evaluate(paced, n) for _ in range(4))
        assert any(rate == pytest.approx(speed, rel=0.2) for rate in tries), speed


def test_scrubbing_shows_that_iteration(team):
    first = team.inner_text("#time")
    assert (team.get_attribute("#scrub", "min"), team.get_attribute("#scrub", "max")) == (
        "0",
        str(T - 1),
    )
    box = inside(team, "#scrub")
    team.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert state(team)["t"] == pytest.approx(T / 2, abs=3)
    assert team.inner_text("#time") != first
    for t in (17, 163):
        team.fill("#scrub", str(t))
        assert state(team)["t"] == t
        assert f"{t} of {T}" in team.inner_text("#time")


def test_iterations_count_from_0(team):
    """As everywhere: in events, in the trajectory's rows, in films."""
    for t in (0, 1, T - 1):
        seek(team, t)
        assert f"{t} of {T}" in team.inner_text("#time")


def test_keys(team):
    press = team.keyboard.press
    for keys, t in (
        (["ArrowRight"], 1),
        (["ArrowRight", "ArrowRight", "ArrowLeft"], 2),
        (["Shift+ArrowRight"], 12),
        (["Shift+ArrowLeft", "Shift+ArrowLeft"], 0),
        (["ArrowLeft"], 0),
        (["End"], T - 1),
        (["ArrowRight"], T - 1),
        (["Home"], 0),
        (["."], DETECTED[0]),
        (["."], DETECTED[2]),
        ([".", "."], 150),
        ([","], DETECTED[2]),
        (["ArrowLeft", ","], DETECTED[0]),
        (["ArrowLeft", ","], DETECTED[0] - 1),
        (["."], DETECTED[0]),
    ):
        for key in keys:
            press(key)
        assert state(team)["t"] == t, keys
    for key, field, value in (
        ("+", "speed", 120),
        ("-", "speed", 60),
        ("-", "speed", 30),
        ("c", "colourBy", "caste"),
        ("c", "colourBy", "action"),
        ("ArrowDown", "selected", {"team": 0, "robot": 0}),
        ("ArrowDown", "selected", {"team": 0, "robot": 1}),
        ("ArrowUp", "selected", {"team": 0, "robot": 0}),
        ("Escape", "selected", None),
        ("Space", "playing", True),
        ("Space", "playing", False),
    ):
        press(key)
        assert state(team)[field] == value, key
    for key, field in (("t", "trails"), ("r", "ranges")):
        before = state(team)[field]
        assert team.is_checked(f"#{field}") == before
        press(key)
        assert state(team)[field] == team.is_checked(f"#{field}") == (not before)
    assert team.input_value("#speed") == "30"


def test_keys_of_a_focused_control_count_once(team):
    seek(team, 50)
    team.focus("#scrub")
    team.keyboard.press("ArrowRight")
    assert state(team)["t"] == 51
    team.focus("#play")
    team.keyboard.press("Space")
    assert state(team)["playing"]
    team.keyboard.press("Space")
    assert not state(team)["playing"]
    before = team.is_checked("#trails")
    team.focus("#trails")
    team.keyboard.press("Space")
    assert team.is_checked("#trails") is not before
    assert not state(team)["playing"]


def test_help_opens_and_closes(team):
    def helps():
        return team.evaluate(
            "() => [...document.querySelectorAll('dialog, [role=dialog], #help')]"
            ".some((one) => one.checkVisibility())"
        )

    assert not helps()
    team.keyboard.press("?")
    assert helps()
    team.keyboard.press("Escape")
    assert not helps()


# --- by keyboard and by ear -----------------------------------------------------------------------


def test_controls_can_be_reached_and_have_names(team):
    reached = {}
    for _ in range(60):
        team.keyboard.press("Tab")
        number, name, *seen = team.evaluate(
            """() => {
                const one = document.activeElement;
                const {outlineStyle, boxShadow} = getComputedStyle(one);
                return [[...document.querySelectorAll("*")].indexOf(one), one.id || one.localName,
                        one.matches(":focus-visible"),
                        outlineStyle !== "none" || boxShadow !== "none"];
            }"""
        )
        if number in reached or name == "body":
            break
        reached[number] = (name, seen)
    names = {name for name, _ in reached.values()}
    assert {"play", "scrub", "speed", "colour", "trails", "ranges"} <= names
    assert len(reached) >= 11  # and both filters and three events
    assert {name for name, seen in reached.values() if seen != [True, True]} == set()
    heard = team.context.new_cdp_session(team).send("Accessibility.getFullAXTree")["nodes"]
    roles = {"button", "slider", "combobox", "checkbox", "radio", "canvas", "Canvas", "image"}
    named = [
        (node["role"]["value"], node["name"]["value"].strip())
        for node in heard
        if not node["ignored"] and node["role"]["value"] in roles
    ]
    assert len(named) > 8
    assert [role for role, name in named if not name] == []


def test_a_narrow_window_needs_no_scrolling_sideways(team):
    team.set_viewport_size({"width": 700, "height": 900})
    assert overflow(team) <= 0
    seek(team, 100)
    team.mouse.click(*where(team, 2))
    assert state(team)["selected"] == {"team": 0, "robot": 2}


def test_pictures_are_sharp_on_fine_screens(chromium, tmp_path):
    """Twice the number of pixels is drawn if a pixel of the window has two of the screen."""
    context = chromium.new_context(device_scale_factor=2)
    page = context.new_page()
    open_page(page, replay_page([made_up()]), tmp_path / "fine.html")
    wide, width = page.evaluate(
        "() => { const c = document.querySelector('#world-0'); return [c.width, c.clientWidth]; }"
    )
    page.screenshot(path=tmp_path / "fine.png")
    with Image.open(tmp_path / "fine.png") as image:
        assert image.width == 2 * page.viewport_size["width"]
    context.close()
    assert wide == pytest.approx(2 * width, abs=2)
