"""Hostile names and odd numbers in a real browser: text stays text, and all is shown."""

from __future__ import annotations

import re
from dataclasses import fields, replace

import pytest

from conevo.playback.quantized import Channel
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
    """Every text of a playback is shown as it is; none of them runs or adds elements."""
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
    if text.strip():  # an element without a name may be missing
        assert counts[0] == counts[1]
    assert text in tab.evaluate("document.body.textContent")
    assert re.sub(r"\s+", " ", text).strip()[:50] in re.sub(r"\s+", " ", tab.title())
    box = inside(tab, "#world-0")
    assert box["width"] > 200
    assert box["height"] > 100
    assert overflow(tab) <= 0


def test_a_long_value_does_not_break_the_name_in_front_of_it(tab, tmp_path):
    facts = (("run", "jaxmarl-MPE_simple_world_comm_v3-" * 4), ("seed", "1"))
    open_page(tab, replay_page([replace(made_up(), facts=facts)]), tmp_path / "long.html")
    lines = """() => {
        const name = document.createRange();
        const names = [...document.querySelectorAll("dt")];
        name.selectNodeContents(names.find((one) => one.textContent === "run"));
        return name.getClientRects().length;
    }"""
    assert tab.evaluate(lines) == 1


OPTIONAL = {field.name for field in fields(Playback) if field.default is None}
LISTS = {field.name for field in fields(Playback) if field.default == ()} | {"facts"}


@pytest.mark.parametrize(
    "cut",
    [
        lambda page: re.sub(r'(id="data">.{400}).*?(?=</script>)', r"\1", page),
        lambda page: re.sub(r'(id="about">.{400}).*?(?=</script>)', r"\1", page),
        lambda page: re.sub(r'<script type="application/[^>]*>.*?</script>', "", page),
    ],
    ids=["numbers", "words", "both"],
)
def test_a_page_that_lost_its_data_gets_one_line(tab, cut):
    """Without errors on the console, which the fixture ``tab`` checks."""
    page = replay_page([made_up()])
    assert cut(page) != page
    tab.set_content(cut(page))
    tab.wait_for_selector("body[data-ready=error]")
    message = tab.get_by_role("alert").inner_text()
    assert message == "This replay cannot be shown: its data are missing or damaged."


def test_optional_parts_may_be_missing(tab, tmp_path):
    """The smallest possible playback: robots, their places and actions."""
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
