"""What a result was made with: versions, kernels, machine."""

from __future__ import annotations

import platform
import sys
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

__all__ = ["now", "describe_machine", "version"]


def describe_machine() -> dict[str, Any]:
    """Return versions of everything that can change a result, and the machine's description."""
    return {
        "conevo": version("conevo"),
        "python": platform.python_version(),
        "numpy": version("numpy"),
        "warp": version("warp-lang"),
        "platform": platform.platform(),
        "cpu": _cpu(),
    }


def version(package: str) -> str:
    """Return the installed version of a package, "source" where it runs without being installed."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "source"


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
