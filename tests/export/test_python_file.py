"""The exported Python file runs where only Python and numpy can be imported."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import conevo
from conevo.controllers.registry import controller
from conevo.export.files import export
from conevo.export.networks import KINDS
from export.replayed import recorded

LIGHT = Path(__file__).resolve().parents[2] / "examples" / "light.py"
# Executed by a bare Python in a folder with team.py and epoch.npz.
SCRIPT = """
import importlib, json, sys

standard = [p for p in sys.path if p.startswith((sys.base_prefix, sys.base_exec_prefix))]
assert not any(p.endswith(("site-packages", "dist-packages")) for p in standard), standard
sys.path[:] = [*standard, "packages", "."]

def is_here(name):
    try:
        importlib.import_module(name)
    except ImportError:
        return False
    return True

found = {"importable": [name for name in sys.argv[1:] if is_here(name)]}
import team
import numpy as np

epoch = np.load("epoch.npz")
one = team.Team()
for again in range(2):
    outputs = np.stack([one(seen) for seen in epoch["observations"]])
    found[f"equal {again}"] = outputs.tobytes() == epoch["outputs"].tobytes()
    one.reset()
context, outputs = np.zeros_like(one.context), []
for seen in epoch["observations"]:
    after, context = team.step(seen, context)
    outputs.append(after)
found["equal by step"] = np.stack(outputs).tobytes() == epoch["outputs"].tobytes()
tops = {name.partition(".")[0] for name in sys.modules}
found["loaded"] = sorted(tops - set(sys.stdlib_module_names) - {"__main__"})
print(json.dumps(found))
"""


@pytest.mark.parametrize("name", KINDS)
def test_it_runs_with_numpy_alone_bit_for_bit(name, tmp_path):
    world = conevo.world(f"{LIGHT}:dark-1", iterations=100)
    team, observations, outputs = recorded(world, controller(name, world=world))
    export(team, tmp_path / "team.py")
    np.savez(tmp_path / "epoch.npz", observations=observations, outputs=outputs)
    site = Path(np.__file__).parents[1]
    (tmp_path / "packages").mkdir()
    for package in ("numpy", "numpy.libs"):  # its shared libraries, where it brings them
        if (site / package).exists():
            (tmp_path / "packages" / package).symlink_to(site / package)
    others = ["conevo", "warp", "scipy", "pydantic", "click", "onnx", "torch", "pandas"]
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", SCRIPT, *others],
        cwd=tmp_path, capture_output=True, text=True, env={"PATH": os.environ["PATH"]},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    import json

    assert json.loads(done.stdout) == {
        "importable": [],
        "equal 0": True,
        "equal 1": True,
        "equal by step": True,
        "loaded": ["numpy", "team"],
    }


def test_wrong_shapes_are_refused(tmp_path):
    world = conevo.world(f"{LIGHT}:dark-1", iterations=2)
    team, observations, _ = recorded(world, controller(world=world))
    path = export(team, tmp_path / "team.py")
    spec = importlib.util.spec_from_file_location("exported_team", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    context = team.first_context
    for seen, kept in ((observations[0, :1], context), (observations[0], context[:, 1:])):
        with pytest.raises(ValueError, match="shapes"):
            module.step(seen, kept)
        with pytest.raises(conevo.UsageError, match=r"have the shape .*, not \(3, \d+\)"):
            team.step(seen, kept)
