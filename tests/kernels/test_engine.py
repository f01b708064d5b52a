"""The compiled kernels match the sources: never stale, never compiled twice, also for CUDA."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import warp as wp

import conevo
from conevo.controllers.registry import controller
from conevo.errors import EnvironmentFailure
from conevo.kernels import engine
from conevo.worlds.episode import episode_kernel, loading_kernel
from conevo.worlds.registry import WORLDS, world
from conevo.worlds.rollout import Rollout
from conevo.worlds.simulators import has_own_simulator

PACKAGE = Path(conevo.__file__).parent
CHILDREN = Path(__file__).parents[1] / "children"
PLAY = """
import json, sys
import numpy as np
import warp as wp
wp.config.optimization_level = 0  # compiles in half the time
from conevo.worlds.registry import WORLDS, world
from conevo.worlds.rollout import Rollout

task = world("rover/complex-5", n_robots=6, iterations=30)
pool = np.random.default_rng(1).uniform(-1, 1, (60, 31)).astype(np.float32)
teams = np.full((1, 6, 20), -1, np.int32)
teams[:, :, :10] = np.arange(60).reshape(1, 6, 10)
rollout = Rollout(task, n_threads=1)
found = {"hash": rollout.fingerprint}
if "--only-hash" not in sys.argv:
    seen = rollout.record(pool, teams[0], task.scenarios([1]))
    found["seen"] = {name: float(np.float64(values).sum()) for name, values in seen.items()}
print(json.dumps(found))
"""
# A constant, a function called by a function, the body of a phase, an imported constant.
ENERGY = ("worlds/rover/dynamics.py", "team.energy[i] = p.energy\n", "team.energy[i] = 0.5\n")
EDITS = (
    ("worlds/rover/state.py", "ROCK_CELLS = wp.constant(40)", "ROCK_CELLS = wp.constant(20)"),
    ("kernels/random.py", "* 5.9604644775390625e-08", "* 4.0e-08"),
    ENERGY,
    ("kernels/geometry.py", "COVER_CELLS = wp.constant(100)", "COVER_CELLS = wp.constant(50)"),
)


def play(source: Path, cache: Path, *arguments: str) -> dict:
    """Run the package at ``source`` in its own process, with compiled kernels in ``cache``."""
    paths = os.pathsep.join((str(source), str(CHILDREN)))  # the headers of all children are shared
    environment = os.environ | {"PYTHONPATH": paths, "WARP_CACHE_PATH": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", PLAY, *arguments],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stderr == ""  # Warp prints nothing, with or without a GPU
    return json.loads(done.stdout)


def compiled(cache: Path) -> dict[str, int]:
    return {str(p.relative_to(cache)): p.stat().st_mtime_ns for p in cache.rglob("*.o")}


def edit(source: Path, file: str, old: str, new: str) -> None:
    path = source / "conevo" / file
    text = path.read_text()
    assert text.count(old) == 1, (file, old)
    path.write_text(text.replace(old, new))


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """Return a copy of the package, its cache, what it played, and then with all edits."""
    folder = tmp_path_factory.mktemp("edited")
    source, cache = folder / "source", folder / "cache"
    shutil.copytree(PACKAGE, source / "conevo", ignore=shutil.ignore_patterns("__pycache__"))
    first = play(source, cache)
    known = compiled(cache)
    for file, old, new in EDITS:
        edit(source, file, old, new)
    changed = play(source, cache)
    new = compiled(cache).keys() - known.keys()
    yield source, cache, first, changed, new
    shutil.rmtree(folder)


def test_edits_that_matter_change_what_is_computed(played):
    """Edits of the rules above are noticed: rovers start with less energy."""
    _, cache, first, changed, new = played
    assert first["seen"]["energy"] > 900 * 6 * 30
    assert changed["seen"]["energy"] < 0.5 * 6 * 30
    assert changed["hash"] != first["hash"]
    assert len(new) == 1  # the kernel of loading is the same
    assert len(compiled(cache)) == 3


@pytest.mark.slow
def test_edited_kernels_are_never_stale_and_unchanged_ones_never_compiled_again(played, tmp_path):
    source, cache, first, changed, _ = played
    known = compiled(cache)
    assert play(source, tmp_path / "fresh") == changed  # the results of a machine without a cache
    hashes = {first["hash"], changed["hash"]}
    for file, old, new in EDITS:
        edit(source, file, new, old)
    for file, old, new in EDITS:  # each of them alone is noticed
        edit(source, file, old, new)
        hashes.add(play(source, cache, "--only-hash")["hash"])
        edit(source, file, new, old)
    assert len(hashes) == 2 + len(EDITS)
    assert play(source, cache) == first  # undone: the first compilation is used again
    assert compiled(cache) == known


PLAYED = {name: one for name, one in WORLDS.items() if not has_own_simulator(one.world_class)}


def first_environment(entry):
    return world(f"{entry.name}/{entry.environments[0]}", iterations=200)


@pytest.mark.parametrize("entry", PLAYED.values(), ids=PLAYED)
def test_the_cuda_form_compiles_for_sm_90_without_a_device(entry, tmp_path):
    engine.start()
    task = first_environment(entry)
    mind = controller(world=task).mind(len(task.inputs), len(task.outputs))
    episode = episode_kernel(task.simulation(), mind)
    loading = loading_kernel(mind)
    for kernel, size in ((episode, 20_000), (loading, 5_000)):
        files = wp.compile_aot_module(kernel.module, arch=90, module_dir=tmp_path)
        assert [f.suffixes[-2:] for f in files] == [[".sm90", ".cubin"]]
        assert files[0].read_bytes()[:4] == b"\x7fELF"
        assert files[0].stat().st_size > size


@pytest.mark.skipif(wp.is_cuda_available(), reason="there is a CUDA device here")
def test_a_missing_cuda_device_is_one_clear_line():
    with pytest.raises(EnvironmentFailure, match="no CUDA device on this machine"):
        Rollout(world("rover/complex-1"), device="cuda")


def test_kernel_hash_is_the_same_for_all_environments_and_sizes_of_a_world():
    one = Rollout(world("rover/complex-1")).fingerprint
    small = world("rover/simple-10", n_robots=3)
    assert Rollout(small, controller(world=small, n_hidden=4)).fingerprint == one
    two = Rollout(world("pursuit/team-1")).fingerprint
    assert Rollout(world("pursuit/team-10", prey="random", arena_cm=1000.0)).fingerprint == two
    assert one != two
    assert len(one) == 16
    assert int(one, 16) > 0
