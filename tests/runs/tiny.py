"""Worlds so small that a whole run takes a tenth of a second, and the results of a run."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import numpy as np

import conevo
from conevo.cli.main import main
from conevo.controllers.registry import CONTROLLERS
from conevo.runs.settings import controller_of
from conevo.worlds.registry import resolve as resolve_world

FORKS = multiprocessing.get_context("forkserver")  # loads Warp once for all processes
FORKS.set_forkserver_preload(["conevo.cli.main", "conevo.runs.start", "conevo.worlds.rollout"])
TASK = "rover/complex-1"
TASKS = [f"{entry.short_name}/{entry.environments[-1]}" for entry in conevo.WORLDS.values()]
PAIRS = [
    (method, TASKS[0 if method == "neat" else k % len(TASKS)])
    for k, method in enumerate(conevo.METHODS)
]
"""Each method with one task, each task with several methods; NEAT's kernel is the longest."""
TINY: dict[str, Any] = {
    "run.generations": 5,
    "run.epochs": 2,
    "run.fittest_epochs": 2,
    "run.n_finalists": 2,
    "run.n_validations": 3,
    "run.n_tests": 3,
    "world.n_robots": 3,
    "world.iterations": 12,
    "controller.n_hidden": 2,
    "controller.max_hidden": 4,
    "method.genotypes": 4,
}
# Windows of one generation, so that thresholds and controller sizes change within five.
RESTLESS = {"stagnation_v": 1, "stagnation_w": 1, "stagnation_y": 1, "gst": 1.0, "sst": 1.0}
RESTLESS |= {"new_node": 0.5, "new_connection": 0.5}


def tiny_settings(method: str, task: str = TASK, **changes: Any) -> dict[str, Any]:
    """Return the settings of a tiny run that uses every feature of a method."""
    known = conevo.METHODS[method].config_class.__dataclass_fields__
    restless = {f"method.{key}": value for key, value in RESTLESS.items() if key in known}
    world = resolve_world(task)[0].params_class.__dataclass_fields__
    tiny = {k: v for k, v in TINY.items() if k[:6] != "world." or k[6:] in world}
    mind = CONTROLLERS[controller_of(conevo.METHODS[method])].settings_class
    no = {f"controller.{k}" for k in ("n_hidden", "max_hidden")} - {
        f"controller.{k}" for k in mind.__dataclass_fields__
    }
    tiny = {k: v for k, v in tiny.items() if k not in no}
    small = conevo.world(task, **{k[6:]: v for k, v in tiny.items() if k[:6] == "world."})
    tiny["method.genotypes"] = max(tiny["method.genotypes"], small.n_robots)  # HetCNE's minimum
    if "genotypes" not in known:
        del tiny["method.genotypes"]
        tiny |= {"method.pairs": 4, "method.rounds": 2}
    return tiny | restless | {key.replace("__", "."): value for key, value in changes.items()}


def evolve_tiny(path: Path, method: str = "cone", task: str = TASK, **changes: Any) -> conevo.Run:
    """Make a finished tiny run; arguments such as run__epochs=3 change its settings."""
    settings = tiny_settings(method, task, **changes)
    return conevo.evolve(task, method, "smoke", out=path, overrides=settings, threads=1)


def command(path: Path, method: str, task: str = TASK, **changes: Any) -> list[str]:
    """Return the command line that makes the same run as ``evolve_tiny``."""
    settings = tiny_settings(method, task, **changes)
    sets = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    return ["run", task, "--method", method, "--preset", "smoke", "--out", str(path), *sets]


def spawn(*arguments: str) -> subprocess.Popen[str]:
    """Start conevo in its own process, one that Ctrl-C reaches."""
    return subprocess.Popen(
        [sys.executable, "-m", "conevo", *arguments, "--threads", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def wait_for(condition: Callable[[], bool], seconds: float = 60) -> None:
    """Wait until something has happened."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.002)


def kill_twice(path: Path, arguments: list[str]) -> list[int]:
    """Make a run of 25 generations or more, killed in two of the first ten; return these two."""
    kills = sorted(random.choices(range(10), k=2))
    for generation in kills:
        process = FORKS.Process(target=main, args=([*arguments, "--quiet", "--threads", "1"],))
        process.start()
        wait_for(lambda: is_past(path, process, generation))  # noqa: B023 (called at once)
        time.sleep(random.uniform(0, 0.02))
        process.kill()
        process.join()
        assert process.exitcode == -signal.SIGKILL
        assert conevo.Run(path).status == "interrupted"
        arguments = ["resume", str(path)]
    return kills


def killed_at(pattern: str, *arguments: str) -> None:
    """Carry out a command in a process that is killed when it has written a certain file."""
    words = [*arguments, "--threads", "1", "--quiet"]
    process = FORKS.Process(target=_killed, args=(pattern, words))
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL, process.exitcode


def _killed(pattern: str, arguments: list[str]) -> None:
    sync = os.fsync

    def fsync(handle: int) -> None:
        if re.search(pattern, os.readlink(f"/proc/self/fd/{handle}")):
            os.kill(os.getpid(), signal.SIGKILL)
        sync(handle)

    os.fsync = fsync
    main(arguments)


def is_past(path: Path, process: subprocess.Popen[str] | BaseProcess, generation: int) -> bool:
    """Whether a process has ended, or runs and has finished a number of generations."""
    lock, log = path / "lock", path / "generations.jsonl"
    is_running = lock.exists() and lock.read_text() == f"process {process.pid}"
    ended = process.poll() if isinstance(process, subprocess.Popen) else process.exitcode
    return ended is not None or (is_running and log.read_bytes().count(b"\n") >= generation)


def content(path: Path) -> dict[str, Any]:
    """Return all results of a run, without times: arrays as bytes."""
    found: dict[str, Any] = {"config": (path / "config.toml").read_text()}
    lines = (path / "generations.jsonl").read_text().splitlines()
    found["generations"] = [json.loads(line) | {"seconds": 0} for line in lines]
    found["test"] = json.loads((path / "test.json").read_text())
    for file in [
        path / "champion.npz",
        path / "finalists.npz",
        *sorted((path / "teams").iterdir()),
    ]:
        found[file.name] = arrays(file)
    (checkpoint,) = path.glob("checkpoint-?.npz")
    found["checkpoint"] = arrays(checkpoint)
    return found


def arrays(path: Path) -> dict[str, tuple[str, tuple[int, ...], bytes]]:
    """Return the arrays of an npz file as dtype, shape and bytes."""
    with np.load(path) as archive:
        each = {name: archive[name] for name in archive}  # reads it each time
    return {name: (one.dtype.str, one.shape, one.tobytes()) for name, one in each.items()}
