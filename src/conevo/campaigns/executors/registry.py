"""The executors by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from conevo.campaigns.devices import CPU, devices_here
from conevo.campaigns.executors.local import Processes, Serial
from conevo.campaigns.executors.protocol import Executor
from conevo.errors import UsageError, unknown_name
from conevo.kernels.threads import usable_cores

__all__ = ["EXECUTORS", "make_executor"]

LOCAL: dict[str, Callable[[int], Executor]] = {"processes": Processes, "serial": Serial}
EXECUTORS = (*LOCAL, "ray")


def make_executor(
    name: str,
    cores: int | None = None,
    address: str | None = None,
    store: str | None = None,
    devices: Sequence[str] = (CPU,),
) -> Executor:
    """Return an executor.

    Args:
        name: of ``EXECUTORS``.
        cores: that its jobs may use together; by default all usable ones, or all of a cluster.
        address, store: as for ``RayCluster``; other executors have none.
        devices: of its jobs.

    Raises:
        UsageError: an unknown executor, a missing package, an option that this executor does not
            have, or a device that it cannot choose.
        EnvironmentFailure: it does not have one of the devices.
    """
    if name not in EXECUTORS:
        raise unknown_name("executor", name, EXECUTORS)
    if name == "ray":
        from conevo.campaigns.executors.ray import RayCluster

        return RayCluster(cores, address, store or "", devices)
    for option, value in (("--address", address), ("--store", store)):
        if value is not None:
            raise UsageError(f"{option} {value}: only the executor ray has one, not {name}")
    devices_here(devices)
    return LOCAL[name](cores or usable_cores())
