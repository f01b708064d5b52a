"""Reports without ink: for tests of a report's words, numbers and files.

Drawing takes most of a report's time. Figures are made in Matplotlib's objects, but their files
are the same two empty ones. ``test_report.py`` and ``test_figures.py`` draw: each kind of figure in
both formats, the others as SVG.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, BinaryIO

import pytest

EMPTY = {
    "svg": b'<svg xmlns="http://www.w3.org/2000/svg" width="504pt" height="216pt"></svg>',
    "pdf": b"%PDF-1.4\n",
}


@pytest.fixture
def without_ink() -> Iterator[None]:
    """Save every figure as an empty one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.figure.Figure.savefig", save_empty)
        yield


@pytest.fixture(scope="module")
def module_without_ink() -> Iterator[None]:
    """Save every figure of a module's tests as an empty one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.figure.Figure.savefig", save_empty)
        yield


@pytest.fixture(scope="module")
def as_svg_only() -> Iterator[None]:
    """Save every figure of a module's tests as an SVG and an empty PDF."""
    from matplotlib.figure import Figure

    real = Figure.savefig

    def save(self: Figure, file: BinaryIO, **options: Any) -> None:
        (save_empty if options["format"] == "pdf" else real)(self, file, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", save)
        yield


def save_empty(self: object, file: BinaryIO, **options: Any) -> None:
    """Write the file of an empty figure, in place of ``Figure.savefig``."""
    file.write(EMPTY[options["format"]])
