"""A recording as a DataFrame, and its display in a notebook."""

from __future__ import annotations

import dataclasses
import html
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.playback.quantized import Channel
from conevo.replay.page import replay_page
from conevo.replay.playback import playback_of
from conevo.replay.recording import record
from conevo.replay.trajectory import Trajectory
from runs.tiny import evolve_tiny

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytest_plugins = ["replay.browser"]

TASKS = ("rover/complex-1", "pursuit/team-3", "gacc/complex-1")


@pytest.fixture(scope="module", params=TASKS)
def recording(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Trajectory:
    run = evolve_tiny(tmp_path_factory.mktemp("seen") / "run", "cone", request.param)
    return record(run, threads=1)


def test_a_frame_has_a_row_for_every_robot_in_every_iteration(recording: Trajectory) -> None:
    pytest.importorskip("pandas")
    frame, about = recording.frame(), recording.about
    n, robots = about["iterations"], about["n_robots"]
    assert frame["iteration"].tolist() == [t for t in range(n) for _ in range(robots)]
    assert frame["robot"].tolist() == [*range(robots)] * n
    assert frame["caste"].tolist() == about["labels"] * n
    values = {name: channel.values for name, channel in recording.channels.items()}
    for name, t, r in (("x", 3, 1), ("y", n - 1, robots - 1), ("fitness", 5, 0)):
        assert frame[name][t * robots + r] == values[name][t, r]
    t, r = 4, robots - 1
    row = frame.iloc[t * robots + r]
    assert row["action"] == about["actions"][values["action"][t, r]]
    for name, ends in (("sensors", about["inputs"]), ("outputs", about["outputs"])):
        assert [row[f"{name}.{end}"] for end in ends] == values[name][t, r].tolist()
    assert [row[f"hidden.{k}"] for k in range(4)] == values["hidden"][t, r].tolist()
    for name in about["performance"]:
        assert row[f"performance.{name}"] == values[f"performance/{name}"][t]


def test_an_iteration_without_an_action_has_a_missing_value(recording: Trajectory) -> None:
    pytest.importorskip("pandas")
    actions = np.zeros((recording.about["iterations"], recording.about["n_robots"]), np.int64)
    actions[0] = -1
    channels = recording.channels | {"action": Channel.of(actions)}
    frame = dataclasses.replace(recording, channels=channels).frame()
    assert frame["action"].isna().equals(frame["iteration"] == 0)


def test_further_arrays_are_those_of_robots_only(recording: Trajectory) -> None:
    pytest.importorskip("pandas")
    if "energy" in recording.channels:
        energy = recording.frame("energy")["energy"].to_numpy()
        assert np.array_equal(energy, recording.channels["energy"].values.ravel())
    scene = next(name for name in recording.channels if name.startswith("scene/"))
    with pytest.raises(UsageError, match="iterations, robots"):
        recording.frame(scene)
    with pytest.raises(UsageError, match=r"unknown array 'fitnes' .* did you mean 'fitness'"):
        recording.frame("fitnes")


def test_a_notebook_shows_the_replay_page_in_a_sandbox(recording: Trajectory) -> None:
    card = recording._repr_html_()
    (frame,) = re.findall(r"<iframe ([^>]*)></iframe>", card)
    page = re.findall(r'srcdoc="([^"]*)"', frame)[0]
    assert html.unescape(page) == replay_page([playback_of(recording)])
    assert re.findall(r'sandbox="([^"]*)"', frame) == ["allow-scripts"]
    assert "height: 720px" in frame


@pytest.mark.browser
def test_the_replay_works_in_its_sandbox(recording: Trajectory, tab: Page, tmp_path: Path) -> None:
    path = tmp_path / "notebook.html"
    path.write_text(f"<!doctype html><meta charset=utf-8>{recording._repr_html_()}")
    tab.goto(path.as_uri())
    page = tab.frame_locator("iframe")
    page.get_by_text("iteration 0 of 12").wait_for()
    page.get_by_role("slider").first.press("End")
    page.get_by_text("iteration 11 of 12").wait_for()


def test_a_page_that_is_too_large_is_named_instead(
    recording: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("conevo.replay.page.CARD_BYTES", 2**14)
    card = recording._repr_html_()
    assert "iframe" not in card
    assert "conevo replay FILE" in card


def test_a_hostile_name_is_text(recording: Trajectory) -> None:
    about = recording.about | {"method": '"><script>x</script>', "environment": "<img src=x>"}
    card = dataclasses.replace(recording, about=about)._repr_html_()
    outside = re.sub(r'srcdoc="[^"]*"', "", card)
    assert "<script" not in outside
    assert "<img" not in outside
