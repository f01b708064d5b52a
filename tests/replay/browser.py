"""Pages in a real browser: Debian's chromium, driven by playwright.

A module of tests sets ``pytest_plugins = ["replay.browser"]``. Without playwright or chromium its
tests are skipped; if CONEVO_TEST_BROWSER=required is set, they fail instead. A test also fails if
its pages log an error or warning, throw an exception, open a dialog, or send a request to another
machine.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext, Dialog, Page

__all__ = ["FLAGS", "chromium", "complaints", "tab"]

FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
VIEWPORT = {"width": 1280, "height": 800}
PATIENCE = 10_000  # ms; a page that takes longer never finishes
LOCAL = {"127.0.0.1", "localhost"}


@pytest.fixture(scope="module")  # playwright's event loop would disturb other modules
def chromium() -> Iterator[Browser]:
    """Chromium, started once for a module, with its own user data directory."""
    path = shutil.which("chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        _unavailable("playwright is not installed")
    if path is None:
        _unavailable("there is no chromium on the path")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS, headless=True)
        yield browser
        browser.close()


def _unavailable(why: str) -> None:
    if os.environ.get("CONEVO_TEST_BROWSER") == "required":
        pytest.fail(f"CONEVO_TEST_BROWSER=required, but {why}", pytrace=False)
    pytest.skip(f"{why}, so nothing is tested in a browser")


@pytest.fixture
def complaints() -> list[str]:
    """The errors of this test's pages so far; a test may clear those that it caused."""
    return []


@pytest.fixture
def tab(chromium: Browser, complaints: list[str]) -> Iterator[Page]:
    """An empty page in a fresh profile; pages that it opens are watched as well."""
    context = chromium.new_context(viewport=VIEWPORT, device_scale_factor=1)
    context.set_default_timeout(PATIENCE)
    _watch(context, complaints)
    yield context.new_page()
    context.close()
    assert complaints == []


def _watch(context: BrowserContext, complaints: list[str]) -> None:
    def dismiss(dialog: Dialog) -> None:
        complaints.append(f"dialog: {dialog.message}")
        dialog.dismiss()

    def check(url: str) -> None:
        scheme, host = urlsplit(url)[:2]
        if scheme not in {"about", "blob", "data", "file"} and host.split(":")[0] not in LOCAL:
            complaints.append(f"asked the network for {url}")

    context.on(
        "console",
        lambda message: (
            complaints.append(f"console {message.type}: {message.text}")
            if message.type in {"error", "warning", "assert"}
            else None
        ),
    )
    context.on("weberror", lambda thrown: complaints.append(f"thrown: {thrown.error}"))
    context.on("request", lambda request: check(request.url))
    context.on("dialog", dismiss)
