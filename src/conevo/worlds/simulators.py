"""The simulator of a world: its own, or the rollout of worlds written in Warp."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from conevo.controllers.registry import refuse_misfit
from conevo.errors import EnvironmentFailure
from conevo.kernels.devices import AUTO, CPU, device_here, refuse_unknown_device

if TYPE_CHECKING:
    from conevo.controllers.protocol import Controller
    from conevo.worlds.protocol import Simulator, World

__all__ = ["device_for", "has_own_simulator", "simulator"]


def has_own_simulator(world: Any) -> bool:
    """Return whether a world, or its class, brings its own simulator."""
    return hasattr(world, "simulator")


def device_for(world: World, name: str) -> str:
    """Return the device that a name means for a world; for "auto" one that can play it.

    Raises:
        UsageError: it is not the name of a device.
        EnvironmentFailure: the machine has no such device, or the world has its own simulator.
    """
    if not has_own_simulator(world):
        return device_here(name)
    refuse_unknown_device(name)
    if name not in (AUTO, CPU):
        raise EnvironmentFailure(f"device {name!r}: {world.name} has its own simulator, on the cpu")
    return CPU


def simulator(
    world: World, controller: Controller, n_threads: int | None = None, device: str = CPU
) -> Simulator:
    """Return the simulator of a world with such controllers, ready to play.

    A device is first checked: it must agree with the CPU bit for bit.

    Raises:
        UsageError: the world's functions cannot be compiled, its own simulator lacks something, or
            the controller does not fit the world.
        EnvironmentFailure: the machine has no such device, the device gives other results than the
            CPU, or compiled kernels cannot be kept.
    """
    from conevo.kernels.threads import threads_of

    device = device_for(world, device)
    if not has_own_simulator(world):
        from conevo.worlds.agreement import refuse_other_bits
        from conevo.worlds.rollout import Rollout

        made = Rollout(world, controller, n_threads, device).build()
        if device != CPU:
            refuse_other_bits(made, device)
        return made
    refuse_misfit(controller, world)
    from conevo.worlds.own_simulator import build_own

    return build_own(world, controller, threads_of(n_threads))
