"""Fixtures that several folders of tests share."""

import os
import re
import shutil
import sys
import tempfile
from contextlib import contextmanager
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace

import pytest

CHILDREN = Path(__file__).parent / "children"
HEADERS = "CONEVO_TEST_HEADERS"
if is_first := not os.environ.get(HEADERS):  # not a worker of xdist, nor pytest within a test
    os.environ[HEADERS] = tempfile.mkdtemp(prefix="conevo-headers-")
    paths = (str(CHILDREN), os.environ.get("PYTHONPATH"))
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    sys.path.insert(0, str(CHILDREN))  # some tests pass it on
    spec = spec_from_file_location("conevo_test_headers", CHILDREN / "sitecustomize.py")
    spec.loader.exec_module(module_from_spec(spec))  # for this process, too

if os.environ.get("CONEVO_TEST_WARP_MODE"):  # "debug": array accesses out of bounds are errors
    import warp

    warp.config.mode = os.environ["CONEVO_TEST_WARP_MODE"]


def pytest_configure():
    """Leave writing to the system: no test turns the machine off, and a run syncs 50 files.

    Processes that tests start, and kill, do sync.
    """
    os.fsync = os.fstat  # refuses a handle that is not open, as the real one does


def pytest_unconfigure():
    """Remove the headers that the processes of the tests have shared."""
    if is_first:
        shutil.rmtree(os.environ.pop(HEADERS), ignore_errors=True)


def pytest_collection_modifyitems(config, items):
    """Leave out slow tests, those that take minutes, and in parallel those that need their cores.

    Unless ``-m`` names their mark. CI sets ``CONEVO_TEST_SLOW``, so that slow tests run.
    """
    asked = set(re.findall(r"\w+", config.option.markexpr))
    never = {"exhaustive"} | ({"timing"} if hasattr(config, "workerinput") else set())
    gone = []
    for item in items:
        marks = {mark.name for mark in item.iter_markers()}
        is_slow = "slow" in marks and not (marks & asked or os.environ.get("CONEVO_TEST_SLOW"))
        if is_slow or marks & (never - asked):
            gone.append(item)
    if gone:
        config.hook.pytest_deselected(items=gone)
        items[:] = [item for item in items if item not in set(gone)]


@pytest.fixture
def two_cards(monkeypatch):
    """Simulate two CUDA devices on this machine; the CPU does their work."""
    from conevo.worlds import rollout

    known = [SimpleNamespace(alias=f"cuda:{k}") for k in range(2)]
    monkeypatch.setattr("warp.get_cuda_devices", lambda: known)
    real = rollout.Rollout

    def on_the_cpu(world, controller=None, n_threads=None, device="cpu"):
        assert device in ("cpu", "cuda", "cuda:0", "cuda:1")
        return real(world, controller, n_threads)

    monkeypatch.setattr(rollout, "Rollout", on_the_cpu)


@pytest.fixture
def cpu_blocks():
    """Return a context in which Warp runs a block's lanes on the CPU (its experimental fibers).

    Only tests do so. Their kernels are not optimised, which compiles in a third of the time.
    """
    import warp as wp
    from warp._src.context import user_modules

    @contextmanager
    def switched_on():
        before = wp.config.enable_cpu_blocks, wp.config.optimization_level
        known = {name for name, module in user_modules.items() if module.hashers}
        wp.config.enable_cpu_blocks, wp.config.optimization_level = True, 0
        try:
            yield
        finally:
            wp.config.enable_cpu_blocks, wp.config.optimization_level = before
            for name in user_modules.keys() - known:  # else later tests get these options, too
                user_modules[name].mark_modified()

    return switched_on
