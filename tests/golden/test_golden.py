"""Outcomes equal the recorded ones bit for bit; a new version of a world or method has new ones."""

import importlib.util
import json
from pathlib import Path

HERE = Path(__file__).parent


def test_worlds_and_methods_give_the_outcomes_on_record() -> None:
    """Kernels call no library mathematics; methods draw from numpy's generators."""
    spec = importlib.util.spec_from_file_location("outcomes", HERE / "outcomes.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    known = json.loads((HERE / "outcomes.json").read_text())
    assert module.outcomes() == known
