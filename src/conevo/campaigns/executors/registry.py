"""The executors by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from conevo.campaigns.devices import CPU, devices_here
from conevo.campaigns.executors.local import Processes, Serial
from conevo.campaigns.executors.protocol import Executor
from conevo.errors import UsageError, unknown_name
from conevo.kernels.threads import usable_cores

__all__ = ["EXECUTORS", "make_executor"]

EXECUTORS = (Processes.name, Serial.name, "ray")


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
        address: of an existing Ray cluster, or "auto"; by default Ray is started here.
        store: address of an object store ("s3://BUCKET/PATH") for Ray's nodes, if they do not see
            the campaign's directory.
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
    kinds: dict[str, Callable[[int], Executor]] = {k.name: k for k in (Serial, Processes)}
    return kinds[name](cores or usable_cores())
