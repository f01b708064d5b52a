"""Exported teams: size of the files, time of a team-step, and where fast arithmetic parts.

    python benchmarks/export.py [--tasks TASK ...] [--method NAME] [--repeats N]

evolves a small team per task (preset smoke), records an epoch of it, and lets every exported file
play along that epoch: it gets the recorded observations and its own context. The outputs are
compared with the recorded ones. It needs onnxruntime, torch and gcc, and leaves out the formats
whose packages are missing. It takes about two minutes.
"""

from __future__ import annotations

import argparse
import ctypes
import importlib.util
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import conevo
from conevo.errors import EnvironmentFailure
from conevo.export.files import export
from conevo.export.team import EvolvedTeam, evolved_team
from conevo.rng import fold
from machine import alternate, machine, spread, table

Step = Callable[[Any, Any], Any]
TASKS = ("rover/complex-1", "pursuit/team-3", "gacc/complex-1")
FORMATS = (
    (".py", False), (".h", False), (".onnx", False), (".onnx", True), (".pt2", False),
    (".pt2", True),
)  # fmt: skip
PARTED = 1e-3  # a difference of an output


def recorded(run: conevo.Run, team: EvolvedTeam) -> tuple[Any, Any]:
    """Return observations [T, R, S] and outputs [T, R, O] of an epoch of the run's champion."""
    world, champion = conevo.world(run.outline.task), run.champion  # its whole epoch
    assert champion is not None
    genes, rows = champion.as_trial()
    scenarios = world.scenarios([fold(run.config.run.seed, "test", 0)])
    seen = conevo.Rollout(world, run.config.controller).record(genes, rows[0], scenarios)
    return seen["inputs"], seen["outputs"]


def of_python(path: Path) -> Step:
    """Return the step of a Python file."""
    spec = importlib.util.spec_from_file_location("exported_team", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.step


def of_onnx(path: Path) -> Step:
    """Return the step of an ONNX graph, on one thread."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    return lambda seen, context: session.run(None, {"observations": seen, "context": context})


def of_torch(path: Path) -> Step:
    """Return the step of a PyTorch program, on one thread."""
    import torch

    torch.set_num_threads(1)
    program = torch.export.load(path).module()
    tensor = torch.from_numpy

    def step(seen: Any, context: Any) -> Any:
        with torch.no_grad():
            return [one.numpy() for one in program(tensor(seen), tensor(context))]

    return step


def of_c(path: Path, outputs: Any) -> Step:
    """Return the step of a C header, compiled with gcc; its context stays in the library."""
    source = path.with_suffix(".c")
    source.write_text(
        f'#include "{path.name}"\nstatic team_state state;\n'
        "void step(const float *seen, float *outputs) { team_step(&state, seen, outputs); }\n"
    )
    library = path.with_suffix(".so")
    flags = ["-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, "-o", library, source], check=True)
    call = ctypes.CDLL(str(library)).step

    def step(seen: Any, context: Any) -> Any:
        found = np.empty_like(outputs)
        call(ctypes.c_void_p(seen.ctypes.data), ctypes.c_void_p(found.ctypes.data))
        return found, context

    return step


def step_of(path: Path, outputs: Any) -> Step:
    """Return the step of any file."""
    ending = path.suffix
    if ending == ".h":
        return of_c(path, outputs)
    return {".py": of_python, ".onnx": of_onnx, ".pt2": of_torch}[ending](path)


def played(step: Step, team: EvolvedTeam, observations: Any) -> tuple[Any, float]:
    """Return the outputs along an epoch, and the seconds of an iteration."""
    context, found = team.first_context, []
    began = time.perf_counter()
    for seen in observations:
        outputs, context = step(seen, context)
        found.append(outputs)
    return np.stack(found), (time.perf_counter() - began) / len(observations)


def agreement(found: Any, outputs: Any) -> list[str]:
    """Return differences as text.

    The first one, the iteration from which one exceeds ``PARTED``, the largest, and the share of
    robots and iterations in which the same output is the highest.
    """
    off = np.abs(found - outputs).max(axis=(1, 2))
    if found.tobytes() == outputs.tobytes():
        return ["same bits", "", "", ""]
    apart = np.flatnonzero(off > PARTED)
    when = f"{apart[0]} of {len(off)}" if len(apart) else f"not in {len(off)}"
    same = (found.argmax(axis=2) == outputs.argmax(axis=2)).mean()
    return [f"{off[0]:.1e}", when, f"{off.max():.2g}", f"{100 * same:.2f} %"]


def measure(task: str, method: str, repeats: int, folder: Path) -> list[list[str]]:
    """Return the rows of a task."""
    run = conevo.evolve(task, method, "smoke", seed=1, out=folder / "run")
    team = evolved_team(run)
    observations, outputs = recorded(run, team)
    steps, rows = {}, {}
    for ending, fast in FORMATS:
        name = f"`{ending}`{' fast' if fast else ''}"
        try:
            if ending == ".h" and shutil.which("gcc") is None:
                raise EnvironmentFailure(".h needs gcc")
            place = folder / ("fast" if fast else "exact")
            path = export(team, place / f"team{ending}", fast=fast)
            steps[name] = step_of(path, outputs[0])
        except (EnvironmentFailure, ImportError) as error:
            print(f"{task}: left out: {error}")
            continue
        found, _ = played(steps[name], team, observations)
        rows[name] = [f"{path.stat().st_size / 1000:.1f}", *agreement(found, outputs)]

    def timed(step: Step) -> Callable[[], float]:
        return lambda: played(step, team, observations)[1]

    times = alternate({name: timed(step) for name, step in steps.items()}, repeats)
    sizes = f"{task}, {len(outputs[0])} robots"
    return [
        [sizes, name, row[0], " (".join(spread(times[name], 1e-6)) + ")", *row[1:]]
        for name, row in rows.items()
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--tasks", nargs="+", default=TASKS)
    parser.add_argument("--method", default="cone")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    rows = []
    for task in options.tasks:
        with tempfile.TemporaryDirectory() as folder:
            rows += measure(task, options.method, options.repeats, Path(folder))
    print(machine("conevo", "numpy", "onnxruntime", "torch"))
    head = ["team", "file", "kB", "us per team-step", "first difference", "parts at iteration",
            "largest", "same highest output"]  # fmt: skip
    print(table(head, rows))


if __name__ == "__main__":
    main()
