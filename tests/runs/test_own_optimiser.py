"""The example of another library's optimiser learns its world."""

import runpy
from pathlib import Path

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_optimiser.py"


def test_cma_es_brings_clones_to_the_light(capsys) -> None:
    """A team that stays where it is reaches 0.4 on average, one that walks there 1."""
    reached = runpy.run_path(str(EXAMPLE))["main"]()
    assert reached > 0.85
    assert capsys.readouterr().out.count("generation") >= 4
