"""The provenance of a run: versions, code, kernels, machine, and the world's header.

``provenance.json`` of a run contains, besides its origin::

    conevo, python, numpy, warp, platform, cpu, device, code, kernel_hash     when it was started
    world       its header: enough to show the run without loading the world
    sessions    one for each start or resume: started, from_generation, threads, and the same
                versions, machine, device and code as above
    finished, stopped_by    of a finished run

``code`` is the digest of the code that decides results (``runs.code``).
"""

from __future__ import annotations

import functools
import logging
import platform
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from conevo.errors import shown
from conevo.kernels.devices import CPU, is_here
from conevo.runs.code import code_digest, version

if TYPE_CHECKING:
    from conevo.evolution.protocol import Method
    from conevo.worlds.measures import Measure
    from conevo.worlds.protocol import World

__all__ = ["declared", "describe", "describe_machine", "describe_world", "device_of", "now"]

log = logging.getLogger("conevo")


def describe_machine(device: str) -> dict[str, Any]:
    """Return versions of everything that can change a result, and the machine's description."""
    return {
        "conevo": version("conevo"),
        "code": code_digest(),
        "python": platform.python_version(),
        "numpy": version("numpy"),
        "warp": version("warp-lang"),
        "platform": platform.platform(),
        "cpu": _cpu(),
        "device": device,
    }


def describe(world: World, method: Method) -> dict[str, Any]:
    """Return the headers of a run's world and method, which are read without loading them."""
    about = {"name": method.name, "title": method.title}
    return {"world": describe_world(world), "method": about}


def declared(provenance: Mapping[str, Any]) -> dict[str, Measure]:
    """Return the measures of a run's world by name; conevo 0.1.0 recorded none."""
    from conevo.worlds.measures import Measure

    found = (provenance.get("world") or {}).get("measures", ())
    return {one["name"]: Measure(**one) for one in found}


def describe_world(world: World) -> dict[str, Any]:
    """Return a world's header: its names, its measures, the main one first, and its size.

    ``optimum`` is the largest possible value of the main measure, None if it is unknown.
    """
    from conevo.worlds.measures import measures_of

    return {
        "name": world.name,
        "environment": world.environment,
        "measures": [measure.record() for measure in measures_of(world)],
        "castes": list(world.castes),
        "n_robots": world.n_robots,
        "iterations": world.params.iterations,
        "optimum": getattr(world, "optimum", None),
    }


def device_of(provenance: Mapping[str, Any], wanted: str | None) -> str:
    """Return the name of the device for a run.

    Results are the same on all devices. The default is the device of the last session, or the CPU
    if this machine has no such device; a warning is then logged once.
    """
    if wanted is not None:
        return wanted
    last = str([provenance, *provenance["sessions"]][-1].get("device", provenance["device"]))
    if is_here(last):
        return last
    _warn_of_missing(last)
    return CPU


@functools.cache
def _warn_of_missing(device: str) -> None:
    log.warning(
        "this machine has no %s, on which the run was last played: it is played on the cpu, with "
        "the same results",
        shown(device),
    )


def now() -> str:
    """Return the present time in UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _cpu() -> str:
    """Return the processor's name."""
    path = Path("/proc/cpuinfo")
    if sys.platform == "linux" and path.is_file():
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
