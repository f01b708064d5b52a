"""How devices are named, known without loading Warp."""

import re

from conevo.errors import UsageError, shown

__all__ = ["CPU", "DEVICE", "refuse_unknown_device"]

CPU = "cpu"
DEVICE = re.compile(r"cpu|cuda(:[0-9]{1,3})?")


def refuse_unknown_device(name: str) -> None:
    """Raise UsageError for a name that no device has on any machine."""
    if not DEVICE.fullmatch(name):
        raise UsageError(f"{shown(name)} is not a device; allowed: cpu, cuda, cuda:N")
