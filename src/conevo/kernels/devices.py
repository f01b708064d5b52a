"""Devices: their names, and which of them this machine has.

Names are checked without loading Warp; only the list of devices needs it.
"""

import re

from conevo.errors import EnvironmentFailure, UsageError, shown

__all__ = [
    "AUTO",
    "CPU",
    "DEVICE",
    "cards_here",
    "device_here",
    "is_here",
    "refuse_unknown_device",
]

AUTO, CPU = "auto", "cpu"
DEVICE = re.compile(r"auto|cpu|cuda(:[0-9]{1,3})?")


def refuse_unknown_device(name: str) -> None:
    """Raise UsageError for a name that no device has on any machine."""
    if not DEVICE.fullmatch(name):
        raise UsageError(f"{shown(name)} is not a device; allowed: auto, cpu, cuda, cuda:N")


def cards_here() -> tuple[str, ...]:
    """Return the names of this machine's CUDA devices, in Warp's order."""
    import warp as wp

    from conevo.kernels import engine

    engine.start()
    return tuple(device.alias for device in wp.get_cuda_devices())


def is_here(name: str) -> bool:
    """Return whether this machine has a device."""
    if name in (AUTO, CPU):
        return True
    return name in (cards := cards_here()) or (name == "cuda" and bool(cards))


def device_here(name: str) -> str:
    """Return the device that a name means on this machine: for "auto" its first GPU, or the CPU.

    Raises:
        UsageError: it is not the name of a device.
        EnvironmentFailure: this machine does not have the device.
    """
    refuse_unknown_device(name)
    if name == AUTO:
        return next(iter(cards_here()), CPU)
    if not is_here(name):
        allowed = [CPU, *cards_here()]
        why = "no CUDA device on this machine; " if len(allowed) == 1 else ""
        raise EnvironmentFailure(f"device {name!r}: {why}allowed here: {', '.join(allowed)}")
    return name
