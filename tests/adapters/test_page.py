"""The examples of docs/adapters.md, each in a process of its own, print the output on the page."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from extras import need

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "adapters.md"
NEEDS = {
    "PettingZoo": ("pettingzoo",),
    "Stable-Baselines3 and SuperSuit": ("pettingzoo", "stable_baselines3", "supersuit"),
    "Gymnasium": ("gymnasium",),
    "TorchRL": ("torchrl",),
    "BenchMARL": ("benchmarl",),
}


def run_page() -> Any:
    """Return the script that executes pages; it finds their examples."""
    spec = importlib.util.spec_from_file_location("run_page", ROOT / "docs" / "run_page.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["run_page"] = module  # where its dataclass looks
    spec.loader.exec_module(module)
    return module


SCRIPT = run_page()
EXAMPLES = [
    (match["about"].removeprefix("needs ").partition(";")[0], match["text"], match["output"])
    for match in SCRIPT.FENCE.finditer(PAGE.read_text(encoding="utf-8"))
    if "tests/adapters/test_page.py" in (match["about"] or "")
]


def test_every_example_is_run_here_or_with_the_other_pages() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert len(EXAMPLES) == text.count("```python") >= 5
    assert all(output for _, _, output in EXAMPLES)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_an_example_prints_the_output_on_the_page(number: int, tmp_path: Path) -> None:
    needs, text, output = EXAMPLES[number]
    need(*NEEDS[needs])
    done = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning:__main__", "-c", text],
        cwd=tmp_path, capture_output=True, text=True, check=False,
        env=os.environ | {"RL_LOGGING_LEVEL": "WARNING"},  # TorchRL's notes are on standard output
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert SCRIPT.shape(done.stdout) == SCRIPT.shape(output)
