"""The examples of docs/export.md that need further packages; tests/test_docs.py runs the others."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from conevo.export.files import export
from conevo.export.team import evolved_team
from conevo.rng import stream
from export.needed import compiler, package
from runs.tiny import evolve_tiny

PAGE = Path(__file__).resolve().parents[2] / "docs" / "export.md"
EXAMPLE = re.compile(
    r"<!-- not run: needs (\w+); tests/export/test_page.py executes it -->\n```\w+\n(.*?)```",
    re.DOTALL,
)
FILE = re.compile(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", re.DOTALL)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run whose team has the page's numbers of rovers and neurons."""
    sizes = {"world__n_robots": 20, "controller__n_hidden": 10, "controller__max_hidden": 20}
    return evolve_tiny(tmp_path_factory.mktemp("page") / "run", "homcne", **sizes)


def example(needs):
    (text,) = (text for name, text in EXAMPLE.findall(PAGE.read_text()) if name == needs)
    return text


def printed(folder, *command, **options):
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_example_that_is_not_run_there_is_run_here():
    assert [name for name, _ in EXAMPLE.findall(PAGE.read_text())] == [
        "onnxruntime",
        "PyTorch",
        "gcc",
    ]
    assert PAGE.read_text().count("<!-- not run:") == 3


def test_onnx(run, tmp_path):
    package("onnx")
    package("onnxruntime")
    export(evolved_team(run), tmp_path / "team.onnx")
    shown = printed(tmp_path, sys.executable, "-c", example("onnxruntime"))
    assert shown == "['low', 'med', 'hi', 'move: dx', 'move: dy'] exact (20, 5)\n"


def test_pytorch(run, tmp_path):
    package("torch")
    export(evolved_team(run), tmp_path / "team.pt2")
    shown = printed(tmp_path, sys.executable, "-c", example("PyTorch"))
    assert shown.startswith('torch.Size([20, 5]) {"format": "conevo-team-1"')


def test_c(run, tmp_path):
    """The program prints what ``step`` returns: nine digits identify a float32."""
    compiler()
    ((name, text),) = FILE.findall(PAGE.read_text())
    (tmp_path / name).write_text(text)
    team = evolved_team(run, robot=0)
    export(team, tmp_path / "robot.h")
    printed(tmp_path, "bash", "-ec", example("gcc"))
    observations = stream(1, "seen").random((5, 1, 16), np.float32)
    lines = "\n".join(" ".join(f"{one:.9g}" for one in seen[0]) for seen in observations)
    shown = printed(tmp_path, tmp_path / "main", input=lines)
    found = np.array([line.split() for line in shown.splitlines()], np.float32)
    context = team.first_context
    for seen, outputs in zip(observations, found, strict=True):
        expected, context = team.step(seen, context)
        assert outputs.tobytes() == expected.tobytes()
