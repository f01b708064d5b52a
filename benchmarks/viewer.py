"""Frames per second of the replay page, and its time until usable, in headless chromium.

Needs playwright (``pip install playwright``) and chromium on the path. The crowd is made up: 30
robots among 2,000 rocks for 2,500 iterations, half of the rocks detected. It is played at 480
iterations per second in a window of 1280 x 800. Chromium draws at most 60 frames per second, so
"full redraw" shows how much time is left. The rover epoch is real, of random networks or of the
champion of a run. "usable" is from the start of navigation to ``body[data-ready=yes]``.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from conevo.replay.page import replay_page
from conevo.replay.playback import playback_of
from conevo.replay.recording import record
from conevo.replay.trajectory import Trajectory
from conevo.runs.run import Run
from machine import machine, spread, table

ROOT = Path(__file__).resolve().parent.parent
WINDOW = {"width": 1280, "height": 800}
SPEED = 480  # iterations per second: the whole epoch takes five seconds
SHOWS = {"as it opens": (), "trails, ranges, a robot selected": ("#trails", "#ranges")}
WHEN_READY = """
new MutationObserver(() => {
    if (document.body?.dataset.ready) window.readyAt ??= performance.now();
}).observe(document, {subtree: true, attributes: true, attributeFilter: ["data-ready"]});
"""


def play(browser: Any, page: Path, boxes: Sequence[str], seconds: float) -> tuple[float, float]:
    """Play for some seconds; return frames per second and milliseconds of a full redraw."""
    context = browser.new_context(viewport=WINDOW)
    tab = context.new_page()
    tab.goto(page.as_uri())
    tab.wait_for_selector("body[data-ready=yes]")
    tab.select_option("#speed", str(SPEED))
    for box in ("#trails", "#ranges") if boxes else ():
        tab.set_checked(box, box in boxes)
    if boxes:
        tab.evaluate("conevo.select(0, 0)")
    measured = tab.evaluate(
        """async (seconds) => {
            conevo.play();
            await new Promise(requestAnimationFrame);
            conevo.frames();
            await new Promise((done) => setTimeout(done, 1000 * seconds));
            const {count, seconds: spent} = conevo.frames();
            conevo.pause();
            return [count / spent, conevo.drawMilliseconds(100)];
        }""",
        seconds,
    )
    context.close()
    return measured[0], measured[1]


def open_until_usable(browser: Any, page: Path) -> float:
    """Open a page in a fresh profile; return the milliseconds until it is usable."""
    context = browser.new_context(viewport=WINDOW)
    tab = context.new_page()
    tab.add_init_script(WHEN_READY)
    tab.goto(page.as_uri())
    tab.wait_for_selector("body[data-ready=yes]")
    milliseconds: float = tab.evaluate("readyAt")
    context.close()
    return milliseconds


def main() -> None:
    """Measure both pages and print markdown tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", type=Path, help="of a rover task: its champion's epoch is opened")
    parser.add_argument("--seconds", type=float, default=5.0, help="to play")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()

    sys.path.insert(0, str(ROOT / "tests"))
    from playwright.sync_api import sync_playwright

    from replay.browser import FLAGS
    from replay.epochs import epoch
    from replay.synthetic import crowd

    trajectory = record(Run(options.run)) if options.run else epoch("rover/complex-5", 2500)
    assert isinstance(trajectory, Trajectory)
    print(machine("conevo", "playwright"), "\n")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        pages = {"crowd": replay_page([crowd()]), "rover": replay_page([playback_of(trajectory)])}
        paths = {name: Path(folder) / f"{name}.html" for name in pages}
        for name, page in pages.items():
            paths[name].write_text(page, encoding="utf-8")
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        print(f"Chromium {browser.version}, headless, {WINDOW['width']} x {WINDOW['height']}\n")
        rows = []
        for what, boxes in SHOWS.items():
            played = [
                play(browser, paths["crowd"], boxes, options.seconds)
                for _ in range(options.repeats)
            ]
            rates, draws = zip(*played, strict=True)
            rows.append([what, *spread(rates, 1, 1), *spread(draws, 1, 2)])
        head = ["30 robots, 2,000 rocks", "frames/s", "range", "full redraw, ms", "range"]
        print(table(head, rows), "\n")
        usable = [open_until_usable(browser, paths["rover"]) for _ in range(options.repeats)]
        browser.close()
        about = trajectory.about
        what = f"{about['task']}, {about['n_robots']} robots, {about['iterations']} iterations"
        sizes = [
            f"{len(data) / 1e6:.2f}" for data in (trajectory.to_bytes(), pages["rover"].encode())
        ]
        row = [what, *sizes, f"{statistics.median(usable):.0f}", spread(usable, 1)[1]]
        print(table(["epoch", "file, MB", "page, MB", "usable after ms", "range"], [row]))
    print("\n" + machine())


if __name__ == "__main__":
    main()
