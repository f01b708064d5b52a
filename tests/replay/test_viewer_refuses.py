"""Hostile names and damaged data in a real browser: text stays text, nonsense gets one line."""

from __future__ import annotations

import base64
import json
import re
import zlib
from dataclasses import fields, replace
from typing import Any

import pytest

from conevo.playback.channel import Channel
from conevo.playback.schema import Event, Playback
from conevo.replay.page import replay_page
from replay.synthetic import T, crowd, made_up, renamed
from replay.viewing import inside, open_page, overflow, state, until

pytest_plugins = ["replay.browser"]
pytestmark = pytest.mark.browser

HOSTILE = {
    "script": "<script>window.pwned = 1; alert(1)</script>",
    "image": "<img src=x onerror='window.pwned = 1'>",
    "quotes": "\"'`><svg/onload=window.pwned=1>${window.pwned=1}{{1}}",
    "end of script": "</script></title></style><script>window.pwned = 1</script><!--",
    "comment": "--><iframe srcdoc='<script>parent.pwned=1</script>'></iframe><!-- conevo:data -->",
    "separators": "a\u2028window.pwned = 1\u2029b\ud7ff\u202eevil\u202c &lt;b&gt; &#x3c;",
    "long": "Wwwwwwwwwwwwwwwwwwww" * 100,
    "right to left": "\u202eסוכן روبوت مجهول\u200f",
    "prototype": "__proto__",
    "empty": "",
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_hostile_names_stay_text(tab, tmp_path, text):
    """In every place of a playback that holds text; nothing is run, nothing added, all is shown."""
    elements = "() => [...document.querySelectorAll('*')].map((e) => e.localName).sort().join()"
    counts = []
    for name in ("robot", text):
        playback = renamed(made_up(), name)
        open_page(tab, replay_page([playback]), tmp_path / "hostile.html")
        assert tab.get_attribute("body", "data-ready") == "yes"
        for robot in (0, 1):
            tab.evaluate("robot => conevo.select(0, robot)", robot)
        for t in (0, 60, T - 1):
            tab.evaluate("t => conevo.seek(t)", t)
        tab.keyboard.press("c")
        assert state(tab)["colourBy"] == "caste"
        counts.append(tab.evaluate(elements))
    assert tab.evaluate("window.pwned") is None
    if text.strip():  # what has no name may be left out
        assert counts[0] == counts[1]
    assert text in tab.evaluate("document.body.textContent")
    assert re.sub(r"\s+", " ", text).strip()[:50] in re.sub(r"\s+", " ", tab.title())
    box = inside(tab, "#world-0")
    assert box["width"] > 200
    assert box["height"] > 100
    assert overflow(tab) <= 0


def taken_apart(page: str) -> tuple[str, Any, bytes, str]:
    """Return a page's text before its data, what is said, the numbers, the text after them."""
    found = re.fullmatch(
        r'(.*<script type="application/json" id="about">)(.*?)</script>\n'
        r'<script type="application/octet-stream" id="data">(.*?)(</script>.*)',
        page,
        re.DOTALL,
    )
    assert found
    return found[1], json.loads(found[2]), zlib.decompress(base64.b64decode(found[3])), found[4]


def put_together(page: str, about: Any, data: bytes | str) -> str:
    """Return a page with other data; text as it is, bytes packed."""
    before, _, _, after = taken_apart(page)
    said = about if isinstance(about, str) else json.dumps(about)
    text = data if isinstance(data, str) else base64.b64encode(zlib.compress(data)).decode()
    return (
        f'{before}{said}</script>\n<script type="application/octet-stream" id="data">{text}{after}'
    )


def put(value: Any, *path: Any) -> Any:
    """Return a function that changes one thing of what a page says."""

    def change(about):
        *way, last = path
        for step in way:
            about = about[step]
        about[last] = value

    return change


def drop(*path: Any) -> Any:
    """Return a function that leaves out one thing."""

    def change(about):
        *way, last = path
        for step in way:
            about = about[step]
        del about[last]

    return change


ONE = ("teams", 0)
DAMAGE = {
    "another format": put(2, "format"),
    "no format": drop("format"),
    "no teams": put([], "teams"),
    "three teams": lambda about: about.update(teams=about["teams"] * 3),
    "a team is nothing": put(None, "teams", 0),
    "teams are a number": put(7, "teams"),
    "epochs not alike": lambda about: about["teams"].append(about["teams"][0] | {"iterations": 5}),
    "beyond the data": put(10**7, *ONE, "x", "at"),
    "before the data": put(-4, *ONE, "x", "at"),
    "between two numbers": put(1, *ONE, "x", "at"),
    "half a byte": put(0.5, *ONE, "x", "at"),
    "three bytes": put(3, *ONE, "x", "bytes"),
    "no bytes": put(0, *ONE, "x", "bytes"),
    "other axes": put([T * 5], *ONE, "x", "shape"),
    "too many robots": put([T, 6], *ONE, "x", "shape"),
    "negative lengths": put([-T, -5], *ONE, "x", "shape"),
    "absurd lengths": put([2**40, 2**40], *ONE, "x", "shape"),
    "length in words": put("all", *ONE, "x", "shape"),
    "low is no number": put("0", *ONE, "x", "low"),
    "low is missing": put(None, *ONE, "x", "low"),
    "low overflows": put(1e308, *ONE, "x", "low"),
    "step overflows": put(1e308, *ONE, "x", "step"),
    "a channel is a number": put(3, *ONE, "x"),
    "action out of range": put(100, *ONE, "action", "low"),
    "action between": put(0.5, *ONE, "action", "low"),
    "held out of range": put(100, *ONE, "held", "low"),
    "thing out of range": put(9, *ONE, "things", 0, "kind", "low"),
    "state out of range": put(9, *ONE, "things", 0, "state", "low"),
    "gone of others": put([2], *ONE, "things", 1, "gone", "shape"),
    "size of a thing": put(-1e9, *ONE, "things", 0, "size"),
    "no iterations": put(0, *ONE, "iterations"),
    "negative iterations": put(-5, *ONE, "iterations"),
    "half an iteration": put(2.5, *ONE, "iterations"),
    "absurd iterations": put(10**12, *ONE, "iterations"),
    "iterations in words": put("many", *ONE, "iterations"),
    "caste out of range": put(7, *ONE, "robots", 0, "caste"),
    "negative caste": put(-1, *ONE, "robots", 0, "caste"),
    "no robots": put([], *ONE, "robots"),
    "body out of range": put([0, 0, 0, 0, 9], *ONE, "body"),
    "absurd radius": put(-1, *ONE, "body_kinds", 0, "radius"),
    "event too late": put(T, *ONE, "events", 0, "t"),
    "event of no kind": put(5, *ONE, "events", 0, "kind"),
    "event of nobody": put([99], *ONE, "events", 0, "robots"),
    "part of no kind": put([0, 9], *ONE, "plan", 0, "parts"),
    "bounds upside down": put([10, 7, -2, 1], *ONE, "bounds"),
    "bounds too few": put([0, 1], *ONE, "bounds"),
    "bounds without extent": put([0, 0, 0, 0], *ONE, "bounds"),
    "a colour that is none": put("red;}body{display:none", *ONE, "actions", 0, "colour"),
    "a colour with an address": put("url(https://example.com/x)", *ONE, "backdrop", 0, "fill"),
    "a name that is none": put({"toString": 1}, *ONE, "actions", 0, "name"),
    "too few rings": put([0.1], *ONE, "rings", 0, "radius"),
    "sensors of nobody": put(4, *ONE, "sensor_groups", 0, "first"),
    "sensors without end": put(10**9, *ONE, "sensor_groups", 0, "count"),
    "gauge of other times": put([3], *ONE, "gauges", 0, "values", "shape"),
    "disc without radius": put([1, 2], *ONE, "backdrop", 1, "numbers"),
    "raster without cells": put(None, *ONE, "backdrop", 2, "cells"),
}
OPTIONAL = {field.name for field in fields(Playback) if field.default is None}
DAMAGE |= {
    f"without {field.name}": drop(*ONE, field.name)
    for field in fields(Playback)
    if field.name not in OPTIONAL
}


LISTS = {field.name for field in fields(Playback) if field.default == ()} | {"facts"}


def refused(tab, page: str) -> str:
    """Show a page that must refuse its data; return what is wrong with how it does, "" if nothing.

    One clear line, and nothing on the console (the fixture ``tab`` looks there).
    """
    tab.set_content(page)
    tab.wait_for_selector("body[data-ready]")
    if tab.get_attribute("body", "data-ready") != "error":
        return "not refused"
    alert = tab.get_by_role("alert")
    if alert.count() != 1 or not alert.is_visible():
        return "no alert"
    said = alert.inner_text().strip()
    if not 10 < len(said) < 300 or "\n" in said:
        return f"said {said!r}"
    return ""


def test_damaged_descriptions_get_one_line(tab, complaints):
    page = replay_page([made_up()])
    found = {}
    for name, change in DAMAGE.items():
        _, about, data, _ = taken_apart(page)
        change(about)
        wrong = refused(tab, put_together(page, about, data))
        wrong += " ".join(complaints)
        complaints.clear()
        if wrong:
            found[name] = wrong
    assert found == {}


def test_descriptions_that_are_no_json_get_one_line(tab):
    page = replay_page([made_up()])
    _, about, data, _ = taken_apart(page)
    good = json.dumps(about)
    nan = json.dumps(about | {"teams": [about["teams"][0] | {"seconds": float("nan")}]})
    for text in ("", "null", "[]", "7", good[: len(good) // 2], good + "}", nan, "[" * 100_000):
        wrong = refused(tab, put_together(page, text, data))
        assert wrong == "", text[:40]


def test_damaged_numbers_get_one_line(tab):
    page = replay_page([made_up()])
    _, about, data, _ = taken_apart(page)
    packed = zlib.compress(data)
    flipped = bytearray(packed)
    flipped[len(packed) // 2] ^= 0xFF

    def text(some: bytes) -> str:
        return base64.b64encode(some).decode()

    for name, numbers in {
        "none": "",
        "cut": text(packed)[: len(packed) // 2],
        "cut at four": text(packed)[:400],
        "no base64": "%%%" + text(packed)[3:],
        "not packed": text(data),
        "packed in another way": text(zlib.compress(data, wbits=31)),
        "flipped": text(bytes(flipped)),
        "one byte too few": data[:-4],
        "other data": b"\0" * 64,
    }.items():
        wrong = refused(tab, put_together(page, about, numbers))
        assert wrong == "", name


def test_a_page_without_data_gets_one_line(tab):
    before, _, _, after = taken_apart(replay_page([made_up()]))
    before = before.rpartition("<script")[0]
    assert refused(tab, before + after.removeprefix("</script>")) == ""


def test_what_may_be_missing_may_be_missing(tab, tmp_path):
    """The least playback that there is: robots, where they are, what they do."""
    bare = replace(
        made_up(),
        **dict.fromkeys(OPTIONAL),
        **dict.fromkeys(LISTS, ()),
    )
    open_page(tab, replay_page([bare]), tmp_path / "bare.html")
    assert tab.get_attribute("body", "data-ready") == "yes"
    place = tab.evaluate("conevo.place(0, 2)")
    tab.mouse.click(place["x"], place["y"])
    assert state(tab)["selected"] == {"team": 0, "robot": 2}
    for key in ("End", ".", ",", "c", "r", "t", "ArrowDown"):
        tab.keyboard.press(key)
    assert state(tab)["t"] == T - 1


def test_extremes_are_shown(tab, tmp_path):
    """One iteration, one robot, all places alike, huge and tiny numbers, very many events."""
    still = made_up()
    one = replace(
        still,
        iterations=1,
        robots=still.robots[:1],
        body=(0,),
        **{
            name: Channel.of(getattr(still, name).values[:1, :1])
            for name in ("x", "y", "action", "heading", "energy", "hidden", "outputs")
        },
        held=None,
        sensors=None,
        sensor_groups=(),
        things=(),
        events=(),
        plan=(),
        gauges=(),
        measures=(),
    )
    huge = replace(still, energy=Channel.of(still.energy.values * 1e12), seconds=1e-9)
    many = replace(
        crowd(robots=64, rocks=5000, iterations=400),
        events=tuple(Event(k % 400, k % 2, f"event {k}", (k % 64,)) for k in range(3000)),
    )
    for playback in (one, huge, many):
        open_page(tab, replay_page([playback]), tmp_path / "extreme.html")
        assert tab.get_attribute("body", "data-ready") == "yes", tab.inner_text("body")
        tab.evaluate("conevo.select(0, 0)")
        tab.keyboard.press("End")
        assert state(tab)["t"] == playback.iterations - 1
        tab.evaluate("conevo.play()")
        until(tab, "() => conevo.state().t >= 0")
        tab.evaluate("conevo.pause()")
