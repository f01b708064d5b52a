"""A world on a device: its functions, and how its scenarios and its state get there and back."""

from typing import Any

import numpy as np
import numpy.typing as npt
import warp as wp

from conevo.errors import UsageError
from conevo.kernels import engine
from conevo.kernels.arrays import first_parts
from conevo.kernels.devices import device_here
from conevo.kernels.threads import threads_of
from conevo.worlds.contract import refuse_faults, scenario_faults, shapes_of
from conevo.worlds.protocol import Scenarios, World

__all__ = ["WorldOnDevice"]


class WorldOnDevice:
    """A world written in Warp, on the CPU or on a CUDA device.

    ``Rollout`` plays epochs of it with the robots' controllers; ``Stepper`` plays it step by step.

    Args:
        world: the world and environment.
        n_threads: CPU threads; all usable ones by default. Results do not depend on it.
        device: "cpu", a CUDA device as Warp names it, or "auto": a CUDA device if the machine has
            one.
        lanes: of a block; by default those that the world suggests on a CUDA device, and one on the
            CPU (more are for tests of the CUDA form, and need Warp's CPU blocks).

    Raises:
        UsageError: the world does not meet the engine's requirements, or the device's name is
            unknown.
        EnvironmentFailure: the device does not exist.
    """

    def __init__(
        self,
        world: World,
        n_threads: int | None = None,
        device: str = "cpu",
        lanes: int | None = None,
    ) -> None:
        engine.start()
        if not hasattr(world, "simulation"):
            raise UsageError(
                f"world {world.name} is not written in Warp: its own simulator(...) plays it"
            )
        self.world = world
        self.device = device_here(device)
        self.n_threads = threads_of(n_threads)
        with engine.building:
            self._simulation = world.simulation()
            refuse_faults(world, self._simulation)
        self.lanes = lanes or (1 if self.device == "cpu" else self._simulation.lanes)
        self._shapes = shapes_of(world, self._simulation)
        self._one_scenario: Scenarios | None = None  # of this world: an example for others

    def is_shared(self, name: str) -> bool:
        """Return whether all scenarios have a field of theirs in common."""
        field = self._simulation.scene.vars.get(name)
        return field is not None and field.type.ndim > 1

    def _refuse_faulty(self, scenarios: Scenarios) -> None:
        """Raise UsageError for scenarios that are not those of the world's scene."""
        n = len(getattr(scenarios, "seed", ()))
        if isinstance(getattr(scenarios, "seed", None), np.ndarray) and not n:
            raise UsageError(f"world {self.world.name}: there must be at least one scenario")
        if self._one_scenario is None:
            self._one_scenario = self.world.scenarios([0])
        for fault in scenario_faults(self._simulation.scene, scenarios, n, self._one_scenario):
            raise UsageError(f"world {self.world.name}: scenarios: {fault}")

    def _scene(self, scenarios: Scenarios) -> Any:
        scene = self._simulation.scene()
        for name in self._simulation.scene.vars:
            values = getattr(scenarios, name)
            setattr(scene, name, self._array(values if self.is_shared(name) else values.ravel()))
        return scene

    def _array(self, values: npt.NDArray[Any]) -> Any:
        dtype = wp.dtype_from_numpy(values.dtype)
        values = np.ascontiguousarray(values)  # views are made from pointers, without strides
        with engine.memory_named(self.device):
            return wp.array(values, dtype=dtype, device=self.device, copy=self.device != "cpu")

    def _read(self, state: Any, name: str, n: int) -> npt.NDArray[Any]:
        """Return a copy of an array of the first ``n`` worlds' state, [n, its dimensions]."""
        return first_parts(getattr(state, name), n, self._shapes[name])
