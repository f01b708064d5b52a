"""Playbacks of damaged and hostile trajectories: complete or refused in one clear line."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from conevo.errors import UsageError
from conevo.playback import check
from conevo.playback.check import checked
from conevo.playback.quantized import Channel
from conevo.playback.schema import Event, Playback, Pool
from conevo.replay.playback import playback_of
from conevo.replay.trajectory import Trajectory
from replay.epochs import TASKS, epoch, renamed
from replay.staging import changed, opened, parts_of, values

GACC, LIGHT = TASKS[3], TASKS[4]


# --- damaged files --------------------------------------------------------------------------------


def refused(trajectory, match=None):
    with pytest.raises(UsageError, match=match) as error:
        opened(trajectory)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("task", "name"),
    [
        *((TASKS[0], name) for name in ("x", "y", "action", "energy", "detected", "value",
                                        "sensors", "hidden", "outputs", "scene_canal",
                                        "scene_rock_x", "scene_rock_type", "scene_lander")),
        *((TASKS[1], name) for name in ("heading", "captured", "collided", "scene_n_bodies",
                                        "scene_n_obstacles", "scene_obstacle_x")),
        *((TASKS[2], name) for name in ("heading", "collided", "fitness")),
        *((GACC, name) for name in ("held", "life", "part", "object_x", "waited", "situation",
                                    "demand", "scene_plan", "scene_left", "scene_object_type")),
    ],
)  # fmt: skip
def test_a_missing_or_misshapen_channel_is_named(task, name):
    trajectory = epoch(task)
    shown = name.replace("scene_", "scene/")
    refused(changed(trajectory, **{name: None}), f"damaged: {shown} is missing")
    more = np.zeros((7, 3, 5, 2))
    refused(changed(trajectory, **{name: more}), rf"damaged: {shown} is \[7, 3, 5, 2\], not \[")


def at(trajectory, name, index, value):
    """The array of a channel with another value somewhere."""
    array = values(trajectory, name.replace("scene_", "scene/")).copy()
    array[index] = value
    return {name: array}


@pytest.mark.parametrize(
    ("task", "name", "index", "value", "match"),
    [
        (TASKS[0], "action", (3, 4), 4, "action is"),
        (TASKS[0], "action", (3, 4), -2, "action is"),
        (TASKS[0], "scene_rock_type", 5, 5, "scene/rock_type is"),
        (TASKS[0], "scene_rock_type", 5, -1, "scene/rock_type is"),
        (TASKS[0], "detected", 5, -1, None),
        (TASKS[0], "scene_canal", (0, 0), 2, "scene/canal is"),
        (TASKS[1], "captured", (0, 0), 2, "captured is"),
        (TASKS[1], "collided", (0, 0), -1, "collided is"),
        (TASKS[1], "scene_n_bodies", (), 9, "9 bodies"),
        (TASKS[1], "scene_n_bodies", (), 3, "3 bodies"),
        (TASKS[1], "scene_n_obstacles", (), 7, "7 obstacles"),
        (GACC, "held", (0, 0), 20, "held is"),
        (GACC, "held", (0, 0), -2, "held is"),
        (GACC, "life", (0, 0), 7, "life is"),
        (GACC, "part", (0, 0), 20, "part is"),
        (GACC, "part", (slice(5, None), 0), 4, "part 5 of complex object 1 is out of turn"),
        (GACC, "part", (slice(5, None), slice(0, 2)), 0, "part 1 of complex object 1 is out"),
        (GACC, "scene_plan", (0, 0), 3, "scene/plan is"),
        (GACC, "scene_object_type", 0, 3, "scene/object_type is"),
    ],
)
def test_impossible_numbers_are_refused(task, name, index, value, match):
    trajectory = epoch(task)
    refused(changed(trajectory, **at(trajectory, name, index, value)), match)


@pytest.mark.parametrize(("low", "step"), [(1e308, 1.0), (0.0, 1e300), (math.nan, 0.0), (0, 2**60)])
def test_values_that_cannot_be_drawn_are_refused(low, step):
    for name in ("x", "sensors"):
        odd = replace(epoch(TASKS[0]).channels[name], low=low, step=step)
        refused(changed(epoch(TASKS[0]), **{name: odd}), f"{name}|not a finite number")


def test_a_hostile_name_stays_in_its_line():
    for name in ("two\nlines", "<script>", "x" * 10_000, "\x1b[2J", "rover\u2028v1"):
        with pytest.raises(UsageError) as error:
            opened(renamed(changed(epoch(TASKS[0]), x=None), world=name))
        text = str(error.value)
        assert text.isprintable()
        assert len(text) < 500


def test_parts_in_another_order_than_planned_are_refused():
    """The first complex object begins with a B (BAABAABAAB); object 19 is a C."""
    part = np.full((200, 20), -1)
    part[5:, 19] = 0
    wrong = changed(epoch(GACC), part=part)
    refused(wrong, "complex object 1 is not built as it was planned")


def test_parts_that_are_not_planned_are_refused():
    """The plan without an order has one A; here two are built in."""
    trajectory = epoch("gacc/complex-1")
    part = np.full((200, 10), -1)
    part[5:, 0], part[9:, 1] = 0, 1
    of_type = values(trajectory, "scene/object_type").copy()
    of_type[1] = 0
    wrong = changed(trajectory, part=part, scene_object_type=of_type)
    refused(wrong, "complex object 1 is not built as it was planned")


@pytest.mark.parametrize(
    ("task", "about", "match"),
    [
        (TASKS[0], {"params": {}}, "no parameter low_range"),
        (TASKS[0], {"actions": ["low"]}, "its actions are low"),
        (TASKS[0], {"world": "gacc-v2"}, "its actions are|is missing"),
        (TASKS[0], {"castes": [], "labels": ["hero"] * 20}, "hero"),
        (TASKS[0], {"labels": ["low"]}, None),
        (TASKS[0], {"neurons": [[0, 99]] * 20}, "neurons"),
        (TASKS[0], {"neurons": [[-1]] * 20}, "neurons"),
        (TASKS[0], {"iterations": 10}, "not \\[10"),
        (TASKS[0], {"n_robots": 3}, None),
        (TASKS[0], {"iterations": 0}, None),
        (TASKS[0], {"environment": "x" * 3000}, "cannot be shown"),
        (TASKS[0], {"environment": "\x07"}, "cannot be shown"),
        (TASKS[0], {"environment": "\ud800"}, "cannot be shown"),
        (TASKS[0], {"performance": None}, None),
        (TASKS[0], {"fitness": [float("nan")] * 20}, "not a finite number"),
        (TASKS[0], {"fitness": [10**400] * 20}, None),
        (GACC, {"environment": "complex-77"}, None),
        (GACC, {"environment": "simple"}, None),
        (GACC, {"environment": "complex-1"}, None),
        (LIGHT, {"performance": {"far": 1.0}}, "performance/far is missing"),
        (LIGHT, {"actions": ["rest"]}, "action is"),
        (LIGHT, {"actions": ["rest", "rest"]}, None),
    ],
)
def test_impossible_texts_are_refused(task, about, match):
    refused(renamed(epoch(task), **about), match)


@pytest.mark.parametrize("value", [None, "0.05", True, -0.1, math.nan, math.inf, []])
def test_impossible_parameters_are_refused(value):
    trajectory = epoch(TASKS[0])
    params = trajectory.about["params"] | {"hi_range": value}
    refused(renamed(trajectory, params=params), "hi_range|not a finite number")


ODD = st.sampled_from([-1, 0, 1, 2, 3, 7, 255, 65_535, 2**31 - 1, 2**32 - 1])
STRANGE = st.sampled_from([0.0, 1.0, -1.0, 0.5, 1e-9, 1e18, 1e308, -1e308, math.nan, math.inf])


@st.composite
def damage(draw, channel):
    """Return a damaged channel: reshaped, cut, turned, with other numbers, or removed."""
    codes = channel.codes
    how = draw(st.sampled_from(["none", "cut", "turn", "flat", "one", "all", "scale", "empty"]))
    if how == "none":
        return None
    if how == "cut" and codes.ndim:
        axis = draw(st.integers(0, codes.ndim - 1))
        return replace(channel, codes=np.delete(codes, 0, axis) if codes.shape[axis] else codes)
    if how == "turn":
        return replace(channel, codes=codes.T)
    if how == "flat":
        return replace(channel, codes=codes.ravel())
    if how == "empty":
        return replace(channel, codes=codes[:0] if codes.ndim else codes.reshape(1)[:0])
    if how == "scale":
        return replace(channel, low=draw(STRANGE), step=draw(STRANGE))
    codes = codes.astype(np.uint32)
    if how == "one" and codes.size:
        codes.flat[draw(st.integers(0, codes.size - 1))] = draw(ODD) % 2**32
    elif how == "all":
        codes = np.full_like(codes, draw(ODD) % 2**32)
    return replace(channel, codes=codes)


@pytest.mark.parametrize("task", TASKS)
@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_with_any_damage_a_playback_is_complete_or_refused(task, data):
    trajectory = epoch(task, 40)
    name = data.draw(st.sampled_from(sorted(trajectory.channels)))
    odd = data.draw(damage(trajectory.channels[name]))
    channels = {**trajectory.channels, name: odd}
    if odd is None:
        del channels[name]
    with np.errstate(all="ignore"):
        assert_complete_or_refused(replace(trajectory, channels=channels))


ABOUT = st.one_of(
    st.none(), st.booleans(), st.integers(-5, 10**30), st.floats(), st.text(max_size=5),
    st.lists(st.one_of(st.text(max_size=3), st.floats(), st.integers()), max_size=4),
    st.dictionaries(st.text(max_size=3), st.floats(), max_size=3),
)  # fmt: skip


@pytest.mark.parametrize("task", TASKS)
@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_with_any_description_a_playback_is_complete_or_refused(task, data):
    trajectory = epoch(task, 40)
    key = data.draw(st.sampled_from(sorted(trajectory.about)))
    if key == "params" and data.draw(st.booleans()):
        name = data.draw(st.sampled_from(sorted(trajectory.about["params"])))
        value = trajectory.about["params"] | {name: data.draw(ABOUT)}
    else:
        value = data.draw(ABOUT)
    assume(not (key == "world" and value == ""))
    assert_complete_or_refused(renamed(trajectory, **{key: value}))


def assert_complete_or_refused(trajectory):
    """Assert that all numbers are finite and indices in range, without the package's own checks."""
    refusal = ""
    try:
        playback = opened(trajectory)
    except UsageError as error:
        refusal = str(error)
    if refusal:
        assert "\n" not in refusal
        return
    t, r = playback.iterations, len(playback.robots)
    json.dumps(Pool().plain(playback), allow_nan=False).encode()
    for one in parts_of(playback):
        if isinstance(one, Channel):
            assert np.isfinite(one.values).all()
        elif isinstance(one, Event):
            assert 0 <= one.t < t
            assert one.kind < len(playback.event_kinds)
            assert set(one.robots) <= set(range(r))
    assert playback.x.codes.shape == playback.y.codes.shape == (t, len(playback.body))
    assert set(np.unique(playback.action.values)) <= set(range(-1, len(playback.actions)))
    assert {robot.caste for robot in playback.robots} <= set(range(len(playback.castes)))
    for things in playback.things:
        assert set(np.unique(things.kind.values)) <= set(range(len(things.kinds)))
        if things.gone is not None:
            assert set(np.unique(things.gone.values)) <= set(range(t + 1))
        if things.state is not None:
            assert set(np.unique(things.state.values)) <= set(range(len(things.states)))
    if playback.held is not None:
        k = playback.things[0].kind.codes.size
        assert set(np.unique(playback.held.values)) <= set(range(-1, k))


# --- the check itself -----------------------------------------------------------------------------


WRONG = {
    "bounds the wrong way round": lambda s: {"bounds": (1.0, 0.0, 0.0, 1.0)},
    "bounds without extent": lambda s: {"bounds": (0.0, 0.0, 0.0, 0.0)},
    "endless bounds": lambda s: {"bounds": (0.0, 0.0, math.inf, 1.0)},
    "sensors beyond the last": lambda s: {
        "sensor_groups": (replace(s.sensor_groups[3], first=25),)
    },
    "sensors of nobody": lambda s: {"sensors": None},
    "a floor without cells": lambda s: {
        "backdrop": (replace(s.backdrop[0], cells=Channel.of(np.zeros((0, 4), int))),)
    },
}


@pytest.mark.parametrize("what", WRONG)
def test_a_playback_that_does_not_fit_together_is_refused(what):
    playback = playback_of(epoch(GACC))
    with pytest.raises(ValueError, match=r"bounds|sensors|cells"):
        checked(replace(playback, **WRONG[what](playback)))


def test_of_too_many_events_the_rarest_stay(monkeypatch):
    monkeypatch.setattr(check, "MOST_EVENTS", 10)
    playback = replace(playback_of(epoch(GACC)), events=())
    often = [Event(t, 0, f"often {t}") for t in range(20)]
    rarely = [Event(t, 4, f"rarely {t}") for t in range(0, 18, 3)]
    few = checked(replace(playback, events=(*often, *rarely)))
    assert [event.text for event in few.events] == [
        *("often 0", "rarely 0", "often 1", "often 2", "often 3", "rarely 3"),
        *("rarely 6", "rarely 9", "rarely 12", "rarely 15"),
    ]
    assert few.facts[-1] == ("events", "10 of 26 shown, the rarest kinds first")
    enough = checked(replace(playback, events=tuple(often[9::-1])))
    assert enough.events == tuple(often[:10])
    assert enough.facts == playback.facts


def test_a_playback_is_the_same_from_a_file(tmp_path):
    for task in TASKS:
        trajectory = epoch(task)
        path = tmp_path / "epoch.npz"
        path.unlink(missing_ok=True)
        trajectory.save(path)
        kept, shown = playback_of(Trajectory.load(path)), playback_of(trajectory)
        assert isinstance(kept, Playback)
        assert sorted(kept.facts) == sorted(shown.facts)
        one, other = Pool(), Pool()
        plain, wanted = one.plain(replace(kept, facts=())), other.plain(replace(shown, facts=()))
        assert plain == wanted
        assert one.data == other.data
