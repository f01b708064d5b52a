"""Opening a page in the reader's browser, if there is one that does not take the terminal."""

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
    """Open a page in the browser, or print that there is none and what to open.

    Without a display only a browser that ``BROWSER`` names is opened, since whatever else is found
    would be one for the terminal.
    """
    if not (_has_browser() and webbrowser.open(address)):
        click.echo(f"conevo: note: no browser found here; open {address} in one", err=True)


def open_while_serving(address: str) -> None:
    """Do the same without waiting: a browser may not return before it has the page."""
    threading.Thread(target=open_page, args=(address,), daemon=True).start()


def _has_browser() -> bool:
    """Whether a browser would open that has a window of its own."""
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
