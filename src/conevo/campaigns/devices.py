"""The devices on which a campaign's runs are simulated: which are meant, and which comes next.

Results are the same on all, so a run that was begun on one may be carried on with any other. Where
no device is named, runs begin on the CPU and go on where they were.
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
        UsageError: one that cannot be, one that is there twice, or CPU and CUDA together: the
            workers on the CPU would be the last to end.
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
    """Return the devices that are meant on this machine: for "auto" all its cards, or the CPU.

    Raises:
        EnvironmentFailure: one is not here.
    """
    if tuple(devices) == (AUTO,):
        return cards_here() or (CPU,)
    return tuple(map(device_here, devices))


def next_device(devices: Sequence[str], in_use: Iterable[str | None]) -> str | None:
    """Return the device with the fewest workers, the first of several; None if there are none."""
    workers = Counter(in_use)
    if not devices:
        return None
    return min(devices, key=lambda device: workers[device])


def main() -> None:
    """End with one line and exit code 3 unless this machine has the device that is named."""
    try:
        devices_here(parse_devices(sys.argv[1]))
    except ConevoError as error:
        sys.stderr.write(f"conevo: error: {platform.node()}: {error}\n")
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
