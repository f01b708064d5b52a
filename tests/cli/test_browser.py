"""Which browser is opened: one with a window, or none."""

import os
import subprocess
import sys

import pytest

CODE = "from conevo.cli.browser import open_page; open_page('http://127.0.0.1/page')"


@pytest.fixture
def opening(tmp_path):
    """Return a function that opens a page where only these browsers are installed."""

    def run(*names, **variables):
        folder = tmp_path / "bin"
        folder.mkdir()
        for name in names:
            script = folder / name
            script.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/{name}.asked\n')
            script.chmod(0o755)
        known = {k: v for k, v in os.environ.items() if k not in ("BROWSER", "WAYLAND_DISPLAY")}
        known |= {"PATH": str(folder), "PYTHONPATH": os.pathsep.join(sys.path), "DISPLAY": ""}
        done = subprocess.run(
            [sys.executable, "-c", CODE],
            env=known | variables,
            capture_output=True,
            text=True,
            timeout=30,
        )
        assert (done.returncode, done.stdout) == (0, "")
        asked = {path.stem: path.read_text().split() for path in tmp_path.glob("*.asked")}
        return asked, done.stderr

    return run


@pytest.mark.parametrize(
    ("names", "variables"),
    [
        ([], {}),
        (["w3m", "lynx", "www-browser"], {}),
        (["w3m"], {"DISPLAY": ":0"}),
        (["links"], {"WAYLAND_DISPLAY": "wayland-0"}),
        (["w3m"], {"BROWSER": "w3m"}),
        (["w3m"], {"BROWSER": "w3m %s", "DISPLAY": ":0"}),
        (["firefox"], {}),  # which needs a display
    ],
)
def test_without_a_window_the_address_is_printed(opening, names, variables):
    asked, err = opening(*names, **variables)
    assert asked == {}
    assert err == "conevo: note: no browser found here; open http://127.0.0.1/page in one\n"


@pytest.mark.parametrize(
    ("names", "variables"),
    [
        (["helper"], {"BROWSER": "helper"}),  # as editors on remote machines set it
        (["helper", "w3m"], {"BROWSER": "helper", "DISPLAY": ":0"}),
    ],
)
def test_a_browser_that_is_named_is_opened(opening, names, variables):
    assert opening(*names, **variables) == ({"helper": ["http://127.0.0.1/page"]}, "")
