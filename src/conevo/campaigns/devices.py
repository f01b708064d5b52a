"""The devices on which a campaign's runs are simulated: which are meant, and which comes next."""

from __future__ import annotations

import platform
import sys
from collections import Counter
from collections.abc import Iterable, Sequence

from conevo.errors import ConevoError, UsageError, shown
from conevo.kernels.devices import CPU, DEVICE

__all__ = ["CPU", "check_here", "main", "next_device", "parse_devices"]


def parse_devices(text: str) -> tuple[str, ...]:
    """Return the devices that "cuda:0,cuda:1" names.

    Raises:
        UsageError: one that cannot be, one that is there twice, or CPU and CUDA together: a run
            that is begun on one kind is carried on there.
    """
    devices = tuple(part.strip() for part in text.split(","))
    for device in devices:
        if not DEVICE.fullmatch(device):
            raise UsageError(
                f"--device {shown(text)}: {shown(device)} is not a device; allowed: cpu, cuda, "
                f"cuda:0, or several as cuda:0,cuda:1"
            )
    if len(set(devices)) < len(devices):
        raise UsageError(f"--device {shown(text)}: a device is listed twice")
    if len(devices) > 1 and not all(":" in device for device in devices):
        raise UsageError(f"--device {shown(text)}: several devices are written cuda:0,cuda:1")
    return devices


def check_here(devices: Sequence[str]) -> None:
    """Refuse devices that this machine does not have, before any run is begun.

    Raises:
        EnvironmentFailure: one is not here.
    """
    if any(device != CPU for device in devices):
        from conevo.worlds.rollout import check_device

        for device in devices:
            check_device(device)


def next_device(devices: Sequence[str], in_use: Iterable[str]) -> str:
    """Return the device with the fewest workers, the first of several."""
    workers = Counter(in_use)
    return min(devices, key=lambda device: workers[device])


def main() -> None:
    """End with one line and exit code 3 unless this machine has the device that is named."""
    try:
        check_here(parse_devices(sys.argv[1]))
    except ConevoError as error:
        sys.stderr.write(f"conevo: error: {platform.node()}: {error}\n")
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
