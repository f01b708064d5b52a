"""The machine of a measurement, and its statistics; standard library only, for any environment."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import TypeVar

__all__ = ["alternate", "machine", "spread", "table"]

Name = TypeVar("Name")


def machine(*packages: str) -> str:
    """Return one line: time, processor, cores, load, versions of Python and of ``packages``."""
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        cpu = names[0].split(":", 1)[1].strip() if names else cpu
    versions = [f"Python {platform.python_version()}"]
    versions += [f"{name} {_version(name)}" for name in packages]
    when = time.strftime("%Y-%m-%d %H:%M %z")
    load = os.getloadavg()[0]
    return f"{when} · {cpu} · {os.cpu_count()} cores · load {load:.1f} · {', '.join(versions)}"


def alternate(work: Mapping[Name, Callable[[], float]], repeats: int) -> dict[Name, list[float]]:
    """Return ``repeats`` results of each piece of work, taken in turns.

    Turns distribute a slow minute of the machine over all of them.
    """
    results: dict[Name, list[float]] = {name: [] for name in work}
    for _ in range(repeats):
        for name, measure in work.items():
            results[name].append(measure())
    return results


def spread(values: Sequence[float], unit: float = 1e3, digits: int = 0) -> tuple[str, str]:
    """Return the median and "lowest - highest", divided by ``unit``."""
    low, middle, high = (f(values) / unit for f in (min, statistics.median, max))
    return f"{middle:.{digits}f}", f"{low:.{digits}f} - {high:.{digits}f}"


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "(not installed, from source)"
