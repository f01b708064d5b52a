"""Noise of sensors and actions, and failing robots: shared settings of worlds, off by default.

A world inherits the settings, has ``kept_inputs`` and ``kept_heuristic`` in its state and the
settings in its constants, and defines the effect of a failure; ``disturbed`` adds the phases. A
setting that is off adds no phase, and its array has a single element.
"""

from __future__ import annotations

from typing import Annotated, Any

from annotated_types import Ge, Le

from conevo.kernels.disturbances import confuse, keep_clean, of_types, read_wrongly, regain
from conevo.kernels.phases import Phase
from conevo.parameters import parameters

__all__ = ["Disturbances", "disturbed"]

Share = Annotated[float, Ge(0), Le(1)]


@parameters("world")
class Disturbances:
    """Noise and failures; they are not in the thesis."""

    sensor_noise: Share = 0.0
    """(reading) the largest error, in both directions, of each sensor value that a controller
    reads; values stay within the sensor's range."""
    action_noise: Share = 0.0
    """(probability) that a robot's outputs are replaced by random ones, in each iteration."""
    failure: Share = 0.0
    """(probability) that a robot fails for good: in each iteration, or only in that of
    ``failure_at``."""
    failure_at: Annotated[int, Ge(0), Le(1_000_000)] = 0
    """(iterations) the iteration from which all failing robots do nothing; 0 if they may fail in
    any."""

    def kept(self, n_robots: int, n_inputs: int) -> dict[str, int]:
        """Return the sizes of a team's arrays for the disturbances that are on."""
        is_kept = self.action_noise > 0 or self.failure > 0
        return {
            "kept_inputs": n_robots * n_inputs if self.sensor_noise > 0 else 1,
            "kept_robots": n_robots if is_kept else 1,
        }


def disturbed(
    functions: dict[str, Any],
    structs: tuple[Any, Any, Any],
    p: Disturbances,
    fail: Any,
    stand: Any = None,
) -> dict[str, Any]:
    """Return a world's phases together with those of the disturbances that are on.

    Args:
        functions: of the world.
        structs: of its state, its scenarios and its constants.
        p: its parameters.
        fail: function for a robot, after all have committed, which decides whether it fails.
        stand: function for a robot before it acts, if a failed one would still act.
    """

    def phase(function: Any) -> Phase:
        return Phase(of_types(function, *structs))

    found = dict(functions)
    if p.sensor_noise > 0:
        sense = _phases(functions["sense"])
        found["sense"] = (phase(keep_clean), *sense, phase(read_wrongly))
    may_stand = (Phase(stand),) if stand is not None and p.failure > 0 else ()
    if p.action_noise > 0 or may_stand:
        act = _phases(functions["act"])
        found["act"] = (phase(confuse), *may_stand, *act, phase(regain))
    if p.failure > 0:
        found["commit"] = (*_phases(functions["commit"]), Phase(fail))
    return found


def _phases(stage: Any) -> tuple[Phase, ...]:
    return stage if isinstance(stage, tuple) else (Phase(stage),)
