"""Noise and failures, for the state of any world: phases around those of a world.

They are added only on request (``worlds.disturbances.disturbed``). Sensor values that a world keeps
from one iteration to the next are kept without noise.
"""

from typing import Any

import warp as wp

from conevo.kernels.actions import NONE
from conevo.kernels.phases import written
from conevo.kernels.random import uniform

__all__ = ["confuse", "fails", "keep_clean", "of_types", "read_wrongly", "regain"]

# Counters of random numbers: no world has any between 2**20 - 512 and 2**20 - 256.
NOISE = wp.constant(2**20 - 512)  # plus the number of the input
OUTPUT = wp.constant(2**20 - 384)  # plus the number of the output
REPLACED = wp.constant(2**20 - 320)
FAILURE = wp.constant(2**20 - 319)


@wp.func
def keep_clean(team: Any, scene: Any, p: Any, i: int, t: int) -> None:
    """Restore robot ``i``'s inputs without noise, so that a world may keep them."""
    n = team.inputs.shape[1]
    if t > 0:
        for k in range(n):
            team.inputs[i, k] = team.kept_inputs[i * n + k]


@wp.func
def read_wrongly(team: Any, scene: Any, p: Any, i: int, t: int) -> None:
    """Add noise to robot ``i``'s inputs: uniform in [-size, size], within each sensor's range.

    Choice: the error of a sensor is drawn again in every iteration and is the same for every team.
    """
    n = team.inputs.shape[1]
    for k in range(n):
        value = team.inputs[i, k]
        team.kept_inputs[i * n + k] = value
        u = uniform(scene.seed[0], t, NOISE + k, i)
        least = wp.where(k < p.signed_inputs, -1.0, 0.0)
        team.inputs[i, k] = wp.clamp(value + p.sensor_noise * (2.0 * u - 1.0), least, 1.0)


@wp.func
def confuse(team: Any, scene: Any, p: Any, i: int, t: int) -> None:
    """Replace robot ``i``'s outputs by random ones now and then, whatever controls it.

    Choice: a random output is uniform in [-4, 4], a share of 0.02 to 0.98 where it is squashed.
    """
    team.kept_heuristic[i] = team.heuristic[i]
    if uniform(scene.seed[0], t, REPLACED, i) < p.action_noise:
        team.heuristic[i] = NONE
        for k in range(team.outputs.shape[1]):
            team.outputs[i, k] = 8.0 * uniform(scene.seed[0], t, OUTPUT + k, i) - 4.0


@wp.func
def regain(team: Any, scene: Any, p: Any, i: int, t: int) -> None:
    """Give robot ``i`` its usual control back."""
    team.heuristic[i] = team.kept_heuristic[i]


@wp.func
def fails(seed: wp.uint64, p: Any, i: int, t: int) -> bool:
    """Return whether robot ``i`` fails in iteration ``t``; from the next one on it does nothing."""
    if p.failure_at > 0 and t + 1 != p.failure_at:
        return False
    return uniform(seed, t, FAILURE, i) < p.failure


def of_types(function: Any, team: Any, scene: Any, p: Any) -> Any:
    """Return a function that fits any world, with the types of one world's structs."""
    name = function.key.rpartition(".")[2]
    lines = [
        f"def {name}(team: Team, scene: Scene, p: Params, i: int, t: int) -> None:",
        "    function(team, scene, p, i, t)",
    ]
    scope = {"function": function, "Team": team, "Scene": scene, "Params": p}
    return written(name, lines, scope, f"{name} of {team.key}")
