"""The devices that simulate a campaign's runs: their names, and the next one to use.

Results are the same on all, so a run that began on one may continue on any other. If no device is
named, runs start on the CPU, and continue on their previous device.
"""

from __future__ import annotations

import platform
import sys
from collections import Counter
from collections.abc import Iterable, Sequence

from conevo.errors import ConevoError, UsageError, shown
from conevo.kernels.devices import AUTO, CPU, DEVICE, cards_here, device_here

__all__ = ["AUTO", "CPU", "devices_here", "main", "next_device", "parse_devices"]


def parse_devices(text: str) -> tuple[str, ...]:
    """Return the devices that "cuda:0,cuda:1" names.

    Raises:
        UsageError: an impossible name, a device that is listed twice, or CPU and CUDA together:
            the workers on the CPU would be the last to end.
    """
    devices = tuple(part.strip() for part in text.split(","))
    for device in devices:
        if not DEVICE.fullmatch(device):
            raise UsageError(
                f"--device {shown(text)}: {shown(device)} is not a device; allowed: auto, cpu, "
                f"cuda, cuda:0, or several as cuda:0,cuda:1"
            )
    if len(set(devices)) < len(devices):
        raise UsageError(f"--device {shown(text)}: a device is listed twice")
    if len(devices) > 1 and not all(":" in device for device in devices):
        raise UsageError(f"--device {shown(text)}: several devices are written cuda:0,cuda:1")
    return devices


def devices_here(devices: Sequence[str]) -> tuple[str, ...]:
    """Return the devices of this machine that are meant: for "auto" all its cards, or the CPU.

    Raises:
        EnvironmentFailure: it does not have one of them.
    """
    if tuple(devices) == (AUTO,):
        return cards_here() or (CPU,)
    return tuple(map(device_here, devices))


def next_device(devices: Sequence[str], in_use: Iterable[str | None]) -> str | None:
    """Return the device with the fewest workers, ties go to the first; None without devices."""
    workers = Counter(in_use)
    if not devices:
        return None
    return min(devices, key=lambda device: workers[device])


def main() -> None:
    """Exit with one line and code 3 unless this machine has the named device."""
    try:
        devices_here(parse_devices(sys.argv[1]))
    except ConevoError as error:
        sys.stderr.write(f"conevo: error: {platform.node()}: {error}\n")
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
