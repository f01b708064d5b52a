"""Access to pages in a browser for tests: pixels, numbers, the state of the viewer."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from conevo.replay.page import replay_page
from conevo.replay.playback import playback_of
from conevo.replay.trajectory import Trajectory
from replay.eventful import numbers, played
from replay.synthetic import made_up

if TYPE_CHECKING:
    from playwright.sync_api import Page

Pixels = npt.NDArray[np.uint8]
PLACE = "([team, robot]) => conevo.place(team, robot)"


class Epoch:
    """A world's epoch: the contents of its file, its playback, its page."""

    def __init__(self, name: str, folder: Path, seed: int = 2) -> None:
        self.name = name
        path = folder / f"{name}-{seed}.npz"
        played(name, seed).save(path)
        self.about, self.channels = numbers(path)
        self.playback = playback_of(Trajectory.load(path))
        self.page = replay_page([self.playback])
        self.n = self.about["n_robots"]

    def at(self, channel, t, robot):
        return self.channels[channel][t, robot]


def open_page(tab: Page, text: str, path: Path) -> None:
    """Open a replay page from a file and wait until it is ready, or shows that it has failed."""
    path.write_text(text, encoding="utf-8")
    tab.goto(path.as_uri())
    tab.wait_for_selector("body[data-ready]")


def state(tab: Page) -> dict[str, Any]:
    """Return the state of the viewer after all changes have been drawn."""
    found: dict[str, Any] = tab.evaluate(
        "async () => { await new Promise(requestAnimationFrame); return conevo.state(); }"
    )
    return found


def until(tab: Page, condition: str, argument: Any = None) -> None:
    """Wait until a condition, in JavaScript, is true in the page."""
    tab.wait_for_function(condition, arg=argument, polling="raf")


def overflow(tab: Page) -> int:
    """Return by how many pixels the page is wider than the window, after its layout."""
    found: int = tab.evaluate(
        """async () => {
            for (let k = 0; k < 3; k++) await new Promise(requestAnimationFrame);
            return document.documentElement.scrollWidth - innerWidth;
        }"""
    )
    return found


def pixels(tab: Page, clip: dict[str, float] | None = None) -> Pixels:
    """Return a picture of the page, or of a part of it, as [height, width, 3]."""
    shot = tab.screenshot(clip=clip, animations="disabled", caret="hide")
    with Image.open(io.BytesIO(shot)) as image:
        return np.asarray(image.convert("RGB"))


def inside(tab: Page, selector: str) -> dict[str, float]:
    """Return the place of an element in the window: x, y, width, height in pixels."""
    box: dict[str, float] | None = tab.locator(selector).bounding_box()
    assert box is not None, f"{selector} is not visible"
    return box


def hexadecimal(pixel: npt.ArrayLike) -> str:
    """Return "#rrggbb"."""
    return "#" + bytes(np.asarray(pixel, dtype=np.uint8)).hex()


def where(tab, robot, team=0):
    place = tab.evaluate(PLACE, [team, robot])
    return place["x"], place["y"]


def seek(tab, t):
    tab.evaluate("t => conevo.seek(t)", t)
    assert state(tab)["t"] == t


def at_world(tab, x, y):
    """The drawn position of a place in the made-up world, derived from robots 0 and 3."""
    playback, t = made_up(), state(tab)["t"]
    places = np.array([where(tab, 0), where(tab, 3)])
    here = np.array([[c.values[t, r] for c in (playback.x, playback.y)] for r in (0, 3)])
    scale = (places[1] - places[0]) / (here[1] - here[0])
    assert scale[0] == pytest.approx(-scale[1], rel=1e-3)  # y points up, both axes alike
    return places[0] + scale * (np.array([x, y]) - here[0])


def patch(tab, x, y, half=3):
    """The colours around a place in the window."""
    size = 2 * half + 1
    clip = {"x": round(x) - half, "y": round(y) - half, "width": size, "height": size}
    return [hexadecimal(pixel) for pixel in pixels(tab, clip).reshape(-1, 3)]


def number_in(text):
    """A number as it is shown, and its largest possible distance from the exact value."""
    found = re.fullmatch(r"([-−]?[\d,]*\.?(\d*))\D*", text.strip())
    assert found, text
    decimals = len(found[2])
    return float(found[1].replace(",", "").replace("−", "-")), 0.5000001 * 10**-decimals


def shown(tab, team=0):
    """The contents of the selected robot's panel: fields, sensors, hidden, outputs."""
    return tab.evaluate(
        """team => {
            const panel = document.getElementById(`robot-${team}`);
            const of = (name) => Object.fromEntries(
                [...panel.querySelectorAll(`[data-${name}]`)]
                    .map((cell) => [cell.dataset[name], cell.textContent.trim()]));
            const [field, sensor, hidden, output] =
                ["field", "sensor", "hidden", "output"].map(of);
            return {field, sensor, hidden, output};
        }""",
        team,
    )


def apart(x, y):
    """Robots by the distance to their nearest neighbour, the largest first."""
    places = np.stack([x, y], axis=-1)
    distances = np.hypot(*np.moveaxis(places[:, None] - places, -1, 0))
    np.fill_diagonal(distances, np.inf)
    return np.argsort(-distances.min(axis=0))
