"""The example of ask and tell by hand works, and demonstrates its point."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_function.py"


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [("cone", -0.5, 0.0), ("ccga", -0.5, 0.0), ("homcne", -8.6, -8.4)],
)
def test_populations_divide_the_places_and_clones_cannot(
    name: str, least: float, most: float, capsys: pytest.CaptureFixture[str]
) -> None:
    """Four clones are best in the middle, at 4 x 1.5 x sqrt(2) = 8.485 from the places."""
    runpy.run_path(str(EXAMPLE))["main"](name)
    worth = [float(text) for text in re.findall(r"is worth (\S+)", capsys.readouterr().out)]
    assert len(worth) == 6
    assert least < worth[-1] <= most
