"""Open a page in a browser that has a window, not in one for the terminal."""

from __future__ import annotations

import os
import sys
import threading
import webbrowser
from pathlib import Path

import click

__all__ = ["open_page", "open_while_serving"]

TEXT = ("www-browser", "w3m", "lynx", "links", "links2", "elinks", "browsh")  # in the terminal


def open_page(address: str) -> None:
    """Open a page in the browser, or print its address if there is no browser.

    Without a display only a browser that ``BROWSER`` names is opened, since any other would be one
    for the terminal.
    """
    if not (_has_browser() and webbrowser.open(address)):
        click.echo(f"conevo: note: no browser found here; open {address} in one", err=True)


def open_while_serving(address: str) -> None:
    """Open a page without waiting, since a browser may not return before it has the page."""
    threading.Thread(target=open_page, args=(address,), daemon=True).start()


def _has_browser() -> bool:
    """Whether a browser with a window of its own would open."""
    named = os.environ.get("BROWSER", "")
    has_windows = sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if not (named or has_windows):
        return False
    try:
        found = webbrowser.get()
    except webbrowser.Error:
        return False
    command = getattr(found, "name", "")
    return Path(command or "browser").name not in TEXT
