"""Team-steps per second on a CUDA device, and the other facts that decide whether it pays.

In four minutes it measures the kernels' resources on a multiprocessor; the kernel alone and the
whole of ``evaluate`` for every number of lanes and batch; whether results are those of the CPU; a
generation of the thesis' size. Without a device the kernels are compiled for sm_90, and all else
runs on the CPU in sizes that take seconds, which tests the script but not the speed.
"""

from __future__ import annotations

import argparse
import multiprocessing
import statistics
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from conevo.kernels.devices import CPU, device_here
from conevo.kernels.threads import usable_cores
from conevo.rng import fold
from conevo.worlds.agreement import difference
from conevo.worlds.registry import world as build_world
from conevo.worlds.rollout import Rollout
from cubin import compiled
from generation import HEAD, Timed, measure
from machine import machine, table
from simulator import SEED, WORLDS, label, random_teams

LANES = (32, 64, 96, 128, 256)
REPEATS = 3
PARTS = ("kernels", "speed", "bits", "generation")


@dataclass(frozen=True)
class Sizes:
    """Sizes of the measurements.

    Attributes:
        batches: numbers of teams that are evaluated at once.
        iterations: of an epoch, where speed is measured.
        equal_teams: teams that play whole epochs on both devices.
        equal_iterations: of these epochs.
        preset: of the generation.
        settings: of its run.
    """

    batches: tuple[int, ...]
    iterations: int
    equal_teams: int
    equal_iterations: int
    preset: str
    settings: dict[str, Any]


ON_CUDA = Sizes((4096, 16384), 250, 64, 1000, "thesis", {"run.n_validations": 1})
ON_CPU = Sizes((8, 16), 20, 4, 30, "smoke", {"world.iterations": 20, "run.n_validations": 1})


def about(device: str) -> str:
    """Return the device's name, its size and its driver."""
    if device == CPU:
        return "no CUDA device: all that is not compiled for one runs on the CPU, in small sizes"
    card = wp.get_device(device)
    asked = ["nvidia-smi", "--query-gpu=driver_version", "--format=csv,noheader"]
    try:
        driver = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.split()[0]
    except (OSError, subprocess.CalledProcessError, IndexError):
        driver = "unknown"
    memory = card.total_memory / 2**30
    return (
        f"{card.name} ({device}), sm_{card.arch}, {card.sm_count} multiprocessors, "
        f"{memory:.0f} GiB, driver {driver}"
    )


def kernels(paths: Sequence[str], lanes: Sequence[int], device: str) -> str:
    """Return a table of the kernels' resources, which also compiles them for later parts."""
    arch = 90 if device == CPU else wp.get_device(device).arch
    work = [(path, n, arch) for path in paths for n in lanes]
    with multiprocessing.get_context("spawn").Pool(min(len(work), usable_cores())) as pool:
        rows = pool.starmap(_compiled, work, chunksize=1)
    head = ["world", "lanes", "registers", "instructions", "shared, bytes", "stack, bytes"]
    return f"Kernels compiled for sm_{arch}\n\n{table(head, rows)}"


def _compiled(path: str, lanes: int, arch: int) -> list[object]:
    """Return a row of that table, in a separate process, since a compiler uses one core."""
    one = compiled(Rollout(build_world(path)).cuda_form(lanes), lanes, arch)
    return [path, lanes, one.registers, one.instructions, one.shared, one.stack]


def speed(path: str, lanes: Sequence[int], sizes: Sizes, device: str) -> str:
    """Return a table of a world's team-steps per second."""
    world = build_world(path, iterations=sizes.iterations)
    scenarios = world.scenarios([fold(SEED, "epoch", 0, 0)])
    genes, teams = random_teams(Rollout(world), max(sizes.batches))
    suggested = world.simulation().lanes
    rows = []
    for n in lanes if device != CPU else (1,):
        rollout = Rollout(world, device=device, lanes=n)
        cells: list[object] = [f"{n}{' (its own)' if n == suggested else ''}"]
        for batch in sizes.batches:
            some = teams[:batch]
            pool = genes[: some.max() + 1]
            play = partial(rollout.evaluate, pool, some, scenarios)
            play()
            steps = batch * sizes.iterations / 1e6
            alone, whole = zip(*(_seconds(play) for _ in range(REPEATS)), strict=True)
            cells += [f"{steps / statistics.median(one):.2f}" for one in (alone, whole)]
        rows.append(cells)
    head = ["lanes"]
    for batch in sizes.batches:
        head += [f"{batch:,}: kernel", "evaluate"]
    return f"{label(world)}: million team-steps/s\n\n{table(head, rows)}"


def _seconds(play: Any) -> tuple[float, float]:
    """Return the seconds of the kernel that plays, and those of the whole call."""
    with Timed(Rollout, "_launch") as launched:
        began = time.perf_counter()
        play()
        return launched.seconds, time.perf_counter() - began


def bits(path: str, sizes: Sizes, device: str) -> list[object]:
    """Return whether a whole evaluation and a record are those of the CPU."""
    world = build_world(path, iterations=sizes.equal_iterations)
    here, there = Rollout(world), Rollout(world, device=device)
    genes, teams = random_teams(here, sizes.equal_teams)
    modes = np.full(teams.shape[:2], -1, np.int32)
    modes[::2, ::2] = np.arange(modes[::2, ::2].size).reshape(modes[::2, ::2].shape)
    modes[::2, ::2] %= len(world.heuristics)
    scenarios = world.scenarios([fold(SEED, "bits", k) for k in range(2)])
    of_cpu, of_device = (one.evaluate(genes, teams, scenarios, modes) for one in (here, there))
    one = world.scenarios([fold(SEED, "bits", 0)])
    seen, again = (each.record(genes, teams[0], one, modes[0]) for each in (here, there))
    other = [name for name in seen if seen[name].tobytes() != again[name].tobytes()]
    return [
        path,
        difference(of_cpu, of_device) or "same bits",
        f"{', '.join(other)} differ" if other else "same bits",
    ]


def generation(sizes: Sizes, device: str) -> str:
    """Return a table of a generation of the rover world, and of one of two iterations."""
    settings = sizes.settings | {"run.generations": 2}
    brief = settings | {"world.iterations": 2}
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, these in (("as it is", settings), ("2 iterations", brief)):
            out = Path(folder) / name
            row = measure(
                WORLDS[0], "cone", sizes.preset, out, generations=1, device=device, settings=these
            )
            rows.append([name, *row[1:]])
    return (
        f"{WORLDS[0]}, preset {sizes.preset}, cone: a generation\n\n"
        f"{table(['epochs', *HEAD[1:]], rows)}"
    )


def main() -> None:
    """Print each table as soon as it is made."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="auto")
    parser.add_argument("--world", nargs="+", default=WORLDS)
    parser.add_argument("--lanes", nargs="+", type=int, default=LANES)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    options = parser.parse_args()
    began = time.perf_counter()
    device = device_here(options.device)
    sizes = ON_CPU if device == CPU else ON_CUDA
    say = partial(print, flush=True)
    say(f"{machine('conevo', 'numpy', 'warp-lang')}\n{about(device)}")
    if "kernels" in options.parts:
        say(f"\n{kernels(options.world, options.lanes, device)}")
    if "speed" in options.parts:
        for path in options.world:
            say(f"\n{speed(path, options.lanes, sizes, device)}")
    if "bits" in options.parts:
        rows = [bits(path, sizes, device) for path in options.world]
        head = ["world", f"{sizes.equal_teams} teams, whole epochs", "recorded epoch"]
        say(f"\n{device} and cpu\n\n{table(head, rows)}")
    if "generation" in options.parts:
        say(f"\n{generation(sizes, device)}")
    say(f"\n{machine()} · {time.perf_counter() - began:.0f} s in all")


if __name__ == "__main__":
    main()
