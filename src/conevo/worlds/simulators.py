"""Which simulator plays a world: its own, or the rollout of worlds written in Warp."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from conevo.controllers.registry import refuse_misfit
from conevo.errors import EnvironmentFailure

if TYPE_CHECKING:
    from conevo.controllers.protocol import Controller
    from conevo.worlds.protocol import Simulator, World

__all__ = ["has_own_simulator", "simulator"]


def has_own_simulator(world: Any) -> bool:
    """Return whether a world, or its class, brings its own simulator."""
    return hasattr(world, "simulator")


def simulator(
    world: World, controller: Controller, n_threads: int | None = None, device: str = "cpu"
) -> Simulator:
    """Return what plays a world with such controllers, ready to play.

    Raises:
        UsageError: the world's functions cannot be compiled, its own simulator lacks something, or
            the controller does not fit the world.
        EnvironmentFailure: there is no such device, or no place for compiled kernels.
    """
    from conevo.kernels.engine import usable_threads

    if not has_own_simulator(world):
        from conevo.worlds.rollout import Rollout

        return Rollout(world, controller, n_threads, device).build()
    refuse_misfit(controller, world)
    if device != "cpu":
        raise EnvironmentFailure(
            f"device {device!r}: {world.name} has its own simulator, on the cpu"
        )
    from conevo.worlds.own_simulator import build_own

    return build_own(world, controller, n_threads or usable_threads())
