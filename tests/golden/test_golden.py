"""The same bits as before the seams moved, on the machine that wrote the digests."""

import importlib.util
import json
from pathlib import Path

import pytest

HERE = Path(__file__).parent


@pytest.mark.slow
def test_worlds_and_methods_give_the_outcomes_on_record() -> None:
    """Sines are the C library's: on a machine with another one, the worlds that use them differ."""
    spec = importlib.util.spec_from_file_location("outcomes", HERE / "outcomes.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    known = json.loads((HERE / "outcomes.json").read_text())
    assert module.outcomes() == known
